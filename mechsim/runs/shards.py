"""Shards: shares of the runs of a command, for job arrays that work in one folder or in several.

Runs are named by their inputs, so the folders of all shards are merged by copying their run files into one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mechsim.runs.record import RunSpec
from mechsim.runs.store import RunStore


@dataclass(frozen=True)
class Shard:
    """The k-th of n shares, counted from 1: every n-th run, from the k-th on, so that kinds of runs are spread evenly.

    A run keeps its shard when more runs are appended to the command.
    """

    index: int
    count: int

    def __post_init__(self) -> None:
        if not 1 <= self.index <= self.count:
            raise ValueError(f"shard {self.index}/{self.count}; expected K/N with K from 1 to N, as in 3/8")

    @classmethod
    def parse(cls, text: str) -> Shard:
        """`3/8`"""
        index, slash, count = text.partition("/")
        if not (slash and index.isdecimal() and count.isdecimal()):
            raise ValueError(f"shard {text!r}; expected K/N with K from 1 to N, as in 3/8")
        return cls(int(index), int(count))

    def of(self, specs: Sequence[RunSpec]) -> list[RunSpec]:
        """Its runs; none where there are fewer runs than shards."""
        return list(specs[self.index - 1 :: self.count])

    def __str__(self) -> str:
        return f"{self.index}/{self.count}"


def missing(specs: Sequence[RunSpec], folder: str | Path) -> list[RunSpec]:
    """Runs that are not in the folder, or damaged there. No folder is made."""
    if not (Path(folder) / "format").is_file():
        return list(specs)
    store = RunStore(folder)
    return [spec for spec in specs if store.read(spec) is None]
