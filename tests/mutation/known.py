"""Mutants that once lived: `python -m tests.mutation.known` runs on each the one test that has to see it.

Prints a line a mutant and keeps what came of all in `results/mutation/known.json`; the exit code is 1 where one lives,
or where its test fails without it.
"""

from __future__ import annotations

import json
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

from tests.mutation.judging import ROOT, changed, copy_of, run_tests

STORED = ROOT / "results/mutation/known.json"


@dataclass(frozen=True)
class Known:
    """One text of a module in the place of another, and the test that has to fail."""

    name: str
    module: str
    before: str
    after: str
    test: str


def known() -> list[Known]:
    """All of them, in the order of the file."""
    told = tomllib.loads(Path(__file__).with_name("known.toml").read_text(encoding="utf-8"))
    return [Known(name, **one) for name, one in told.items()]


def is_seen(mutant: Known, tree: Path) -> bool:
    """Whether its test passes in a copy of the project as it is, and fails with the mutant."""
    path = tree / mutant.module
    sound = path.read_text(encoding="utf-8")
    if sound.count(mutant.before) != 1:
        raise ValueError(f"{mutant.module} has {mutant.before!r} {sound.count(mutant.before)} times; expected it once")
    if not run_tests(tree, (mutant.test,)).passed:
        return False
    with changed(path, sound.replace(mutant.before, mutant.after)):
        return not run_tests(tree, (mutant.test,)).passed


def main() -> int:
    """Judge all of them."""
    fates = {}
    with copy_of() as tree:
        for mutant in known():
            fates[mutant.name] = "killed" if is_seen(mutant, tree) else "lives"
            print(f"{fates[mutant.name]:8} {mutant.name}", flush=True)
    STORED.parent.mkdir(parents=True, exist_ok=True)
    STORED.write_text(json.dumps(fates, indent=1) + "\n", encoding="utf-8")
    return int("lives" in fates.values())


if __name__ == "__main__":
    sys.exit(main())
