"""TOML files that a person edits, read within limits and validated, with messages that say what to do."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from kinetics.support.output import write_whole

# tomllib takes quadratic time and memory on long dotted keys: 64 KB of them take 15 s and 4 GB.
MAX_BYTES = 64 * 1024
MAX_LINE = 4 * 1024
MAX_ERRORS = 10  # reported at once

Model = TypeVar("Model")

# Deferred: a model that no file of a command holds costs nothing.
STRICT = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=False, defer_build=True)


class Settings(BaseModel):
    """A frozen group of settings: unknown keys, NaN and infinities are refused."""

    model_config = STRICT


def is_path(name_or_path: str | Path) -> bool:
    """Whether this is the path of the user's own file (it ends in .toml or holds a separator), not a shipped name."""
    path = Path(name_or_path)
    return path.suffix == ".toml" or len(path.parts) > 1


def find(name_or_path: str | Path, folder: Path, kind: str) -> Path:
    """Path of a shipped file by its name, or of the user's own file.

    name_or_path : `line4`, or a path, see `is_path`
    folder : where the shipped files of this kind live
    """
    text = str(name_or_path)
    path = Path(text)
    if is_path(path):
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


def write_toml(data: dict[str, Any], target: Path) -> None:
    """Write TOML: whole or not at all, so that an older file stays until the new one is safely there."""
    import tomli_w

    try:
        content = tomli_w.dumps(data).encode()
    except TypeError as error:
        raise ValueError(f"the evidence of {target} does not fit into TOML: {error}") from None
    if len(content) > MAX_BYTES:
        raise ValueError(
            f"{target} would have {len(content)} bytes; at most {MAX_BYTES} can be read back; shorten the evidence"
        )
    write_whole(target, content)


def validated(kind: type[Model], data: Any, source: str | Path) -> Model:
    """`data` as a `kind`, or one ValueError that names every wrong key, what came and what is allowed.

    Strict: a number is written as a number, neither as text nor as true or false.
    """
    adapter = TypeAdapter(kind)
    try:
        adapter.validate_python(_with_tuples(data), strict=True)
        return adapter.validate_python(data)  # lists in free tables stay lists
    except ValidationError as error:
        texts = [_explain(item, kind) for item in error.errors()]
    except RecursionError:
        texts = ["tables within tables, too deep"]
    more = f"; and {len(texts) - MAX_ERRORS} more" if len(texts) > MAX_ERRORS else ""
    raise ValueError(f"{source}: {'; '.join(texts[:MAX_ERRORS])}{more}")


def _with_tuples(data: Any) -> Any:
    """The same with tuples for lists, which are all that TOML has and strict validation does not take for them."""
    if isinstance(data, dict):
        return {key: _with_tuples(value) for key, value in data.items()}
    return tuple(_with_tuples(value) for value in data) if isinstance(data, list | tuple) else data


def _explain(item: Any, kind: Any) -> str:
    """One pydantic error in plain words: where, what came, what is allowed."""
    place = ".".join(str(part) for part in item["loc"])
    context = item.get("ctx", {})
    if item["type"] == "extra_forbidden":
        key = str(item["loc"][-1])
        known = sorted({name for model in _models_at(kind, item["loc"][:-1]) for name in model.model_fields})
        close = difflib.get_close_matches(key, known, n=1)
        hint = f"did you mean {close[0]!r}? " if close else ""
        return f"unknown key {place!r}; {hint}allowed here: {', '.join(known)}"
    if item["type"] == "missing":
        return f"{place!r} is missing"
    if item["type"].startswith("union_tag"):  # a table whose kind is named by one of its keys
        name = str(context["discriminator"]).strip("'")
        if item["type"] == "union_tag_not_found":
            return f"'{place}.{name}' is missing"
        allowed = context["expected_tags"].replace("'", "")
        return f"{place}: unknown {name} {context['tag']!r}; allowed are {allowed}"
    if item["type"] == "value_error":  # raised by our own checks, which say it all
        return f"{place}: {context['error']}" if place else str(context["error"])
    message = re.sub("valid dictionary.*", "table", item["msg"].replace("valid tuple", "list"))
    asked = message.removeprefix("Input ").replace("Tuple should", "should").removesuffix(" after validation")
    return f"{place or 'the file'} = {repr(item['input'])[:80]}: {asked}"


def _models_at(kind: Any, place: Sequence[str | int]) -> list[type[BaseModel]]:
    """The models that may stand at `place` in a `kind`; a tag in the place chooses one of a union."""
    models = _models(kind)
    for part in place:
        fields = [model.model_fields[part] for model in models if part in model.model_fields]
        if fields:
            models = [inner for field in fields for inner in _models(field.annotation)]
        else:  # a tag; or a number in a list, or a key of a free table, which leave the models as they are
            tagged = [m for m in models if any(part in get_args(f.annotation) for f in m.model_fields.values())]
            models = tagged or models
    return models


def _models(annotation: Any) -> list[type[BaseModel]]:
    """All models that an annotation names."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for inner in get_args(annotation) for model in _models(inner)]
