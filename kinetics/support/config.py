"""TOML files that a person edits: found by name or path, read within limits, written whole."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from kinetics.support.limits import BREAKS, check_names, check_visible, text_in
from kinetics.support.output import write_whole

# tomllib takes quadratic time and memory on long dotted keys: 64 KB of them take 15 s and 4 GB.
MAX_BYTES = 64 * 1024
MAX_LINE = 4 * 1024


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
        if not path.exists():
            raise ValueError(f"{kind} file {text} does not exist; give the path of a TOML file")
        return path
    shipped = sorted(p.stem for p in folder.glob("*.toml"))
    if text not in shipped:
        raise ValueError(f"unknown {kind} {text!r}; shipped are {', '.join(shipped)}; or give the path of a .toml file")
    return folder / f"{text}.toml"


def read_toml(path: Path) -> dict[str, Any]:
    """Parse a TOML file of at most 64 KB whose lines have at most 4 KB."""
    text = text_in(path, MAX_BYTES)
    for number, line in enumerate(text.splitlines(), 1):
        if len(line) > MAX_LINE:
            raise ValueError(f"{path}, line {number}: {len(line)} characters; a line may have at most {MAX_LINE}")
    try:
        found = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise ValueError(f"{path} is not valid TOML: {error}") from None
    _check_visible(path, found)
    return found


def _check_visible(path: Path, found: Any) -> None:
    """A ValueError for keys and texts with characters that cannot be seen; texts may have several lines."""
    waiting = [found]
    while waiting:  # tables may be thousands deep
        part = waiting.pop()
        if isinstance(part, str):
            check_visible(f"{path} has a text", BREAKS.sub(" ", part))
        elif isinstance(part, dict):
            check_names(path, part)
            waiting += part.values()
        elif isinstance(part, list):
            waiting += part


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
