"""Files that a person edits: TOML read with limits, validated with messages a person can act on."""

from __future__ import annotations

import difflib
import tomllib
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

# tomllib takes quadratic time and memory on long dotted keys: 64 KB of them take 15 s and 4 GB.
MAX_BYTES = 64 * 1024
MAX_LINE = 4 * 1024

Model = TypeVar("Model")

STRICT = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=False)


class Settings(BaseModel):
    """A frozen group of settings: unknown keys, NaN and infinities are refused."""

    model_config = STRICT


def find(name_or_path: str | Path, folder: Path, kind: str) -> Path:
    """Path of a shipped file by its name, or of the user's own file.

    name_or_path : `line4`, or a path (anything that ends in .toml or holds a separator)
    folder : where the shipped files of this kind live
    """
    text = str(name_or_path)
    path = Path(text)
    if path.suffix == ".toml" or len(path.parts) > 1:
        if not path.is_file():
            raise ValueError(f"{kind} file {text} does not exist; give the path of a TOML file")
        return path
    shipped = sorted(p.stem for p in folder.glob("*.toml"))
    if text not in shipped:
        raise ValueError(f"unknown {kind} {text!r}; shipped are {', '.join(shipped)}; or give the path of a .toml file")
    return folder / f"{text}.toml"


def read_toml(path: Path) -> dict[str, Any]:
    """Parse a TOML file of at most 64 KB whose lines have at most 4 KB."""
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise ValueError(f"{path} has {size} bytes; a configuration file may have at most {MAX_BYTES}")
    try:
        text = path.read_bytes().decode("utf-8")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path} is not UTF-8 text: {error}") from None
    for number, line in enumerate(text.splitlines(), 1):
        if len(line) > MAX_LINE:
            raise ValueError(f"{path}, line {number}: {len(line)} characters; a line may have at most {MAX_LINE}")
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise ValueError(f"{path} is not valid TOML: {error}") from None


def validated(kind: type[Model], data: Any, source: str | Path) -> Model:
    """`data` as a `kind`, or one ValueError that names every wrong key, what came and what is allowed."""
    try:
        return TypeAdapter(kind).validate_python(data)
    except ValidationError as error:
        raise ValueError(f"{source}: " + "; ".join(_explain(item, data) for item in error.errors())) from None


def _explain(item: Any, data: Any) -> str:
    """One pydantic error in plain words: where, what came, what was expected."""
    place = ".".join(str(part) for part in item["loc"]) or "the file"
    if item["type"] == "extra_forbidden":
        key = str(item["loc"][-1])
        return f"unknown key {place!r}{_suggest(key, item, data)}"
    if item["type"] == "missing":
        return f"{place!r} is missing"
    given = repr(item["input"])
    return f"{place} = {given[:80]}: {item['msg'][0].lower()}{item['msg'][1:]}"


def _suggest(key: str, item: Any, data: Any) -> str:
    """A near miss among the keys that stand beside the unknown one, if there is one."""
    parent = data
    for part in item["loc"][:-1]:
        if (isinstance(parent, dict) and part in parent) or (isinstance(parent, list) and isinstance(part, int)):
            parent = parent[part]
    known = [name for name in parent if name != key] if isinstance(parent, dict) else []
    close = difflib.get_close_matches(key, known, n=1)
    return f" (beside {close[0]!r}: written twice in two ways?)" if close else "; remove it or check its spelling"
