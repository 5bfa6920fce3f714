"""What a disk may hold after a power failure, rebuilt from the trace of a layer.

A file's bytes are safe once it was synced, a name once its folder was. Of what was not, a file system may keep
anything; three cases stand for all: names without the bytes, names with half of the bytes, and neither.

Source: Pillai et al., All file systems are not created equal, OSDI 2014, section 3.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

NAMES_ALONE, TORN, NEITHER = "names alone", "half of the bytes", "neither names nor bytes"


@dataclass(eq=False)
class _File:
    now: bytes = b""
    synced: bytes = b""


@dataclass(eq=False)
class _Folder:
    entries: dict[str, _File | _Folder] = field(default_factory=dict)
    synced: dict[str, _File | _Folder] = field(default_factory=dict)


Tree = dict[str, bytes | None]  # paths below the root; None: a folder


class Disk:
    """A folder whose changes are told one after the other; it is there and empty, for good, at the start."""

    def __init__(self, root: Path) -> None:
        self.path, self.root = root.resolve(), _Folder()

    def apply(self, event: list[str]) -> None:
        """One note of the trace; those of calls and of runs that were kept change nothing."""
        kind, path = event[0], event[1]
        if kind in ("call", "kept"):
            return
        if kind == "sync":
            found = self._find(path)
            if isinstance(found, _Folder):
                found.synced = dict(found.entries)
            elif found is not None:
                found.synced = found.now
            return
        if kind == "content":
            found = self._find(path)
            assert isinstance(found, _File)
            found.now = bytes.fromhex(event[2])
            return
        folder, name = self._above(path)
        if kind == "create":
            folder.entries[name] = _File()
        elif kind == "mkdir":
            folder.entries[name] = _Folder()
        elif kind in ("unlink", "rmdir"):
            del folder.entries[name]
        elif kind == "rename":
            there, new = self._above(event[2])
            there.entries[new] = folder.entries.pop(name)

    def states(self) -> dict[str, Tree]:
        """What may be there after a power failure now, by case."""
        return {case: dict(_walk(self.root, case, "")) for case in (NAMES_ALONE, TORN, NEITHER)}

    def _find(self, path: str) -> _File | _Folder | None:
        if Path(path) == self.path:
            return self.root
        folder, name = self._above(path)
        return folder.entries.get(name)

    def _above(self, path: str) -> tuple[_Folder, str]:
        folder, parts = self.root, Path(path).relative_to(self.path).parts
        for part in parts[:-1]:
            inner = folder.entries[part]
            assert isinstance(inner, _Folder)
            folder = inner
        return folder, parts[-1]


def put(tree: Tree, root: Path) -> None:
    """Make these files and folders below `root`."""
    for name, content in tree.items():
        if content is None:
            (root / name).mkdir(parents=True)
        else:
            (root / name).write_bytes(content)


def _walk(folder: _Folder, case: str, above: str) -> Iterator[tuple[str, bytes | None]]:
    for name, what in (folder.synced if case == NEITHER else folder.entries).items():
        if isinstance(what, _Folder):
            yield above + name, None
            yield from _walk(what, case, f"{above}{name}/")
        else:
            torn = what.now[: len(what.now) // 2] if what.now != what.synced else what.now
            yield above + name, torn if case == TORN else what.synced
