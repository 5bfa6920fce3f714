"""The mutation score of each room: `python -m tests.mutation` draws mutants of its modules and runs its tests on each.

A mutant is killed where a test fails, or where the tests take ten times as long as without it. Prints a line a room
and each mutant that lives; the exit code is 1 where a room's score is below the floor. Mutants listed in `rooms.toml`
as accepted are told, and count as neither. Cost: the room's tests once a mutant, compiling kernels anew.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import Queue

from tests.mutation.sites import Mutant, mutants

ROOT = Path(__file__).parents[2]
COPIED = ("kinetics", "mechsim", "calibration", "tests", "wellmixed.py", "pyproject.toml")
LINKED = ("results", "docs", "notebooks", "README.md", "ARCHITECTURE.md")
FLOOR = 0.9
PATIENCE, LEAST_PATIENCE = 10, 120.0  # times what the tests take; s


@dataclass(frozen=True)
class Room:
    """Modules whose mutants are to be killed by these tests, and those accepted: "place | change" -> reason."""

    name: str
    modules: tuple[str, ...]
    tests: tuple[str, ...]
    accepted: dict[str, str]


@dataclass(frozen=True)
class Verdict:
    """What became of a mutant: "killed", "lives" or "accepted"."""

    module: str
    line: int
    place: str
    change: str
    fate: str


def rooms() -> dict[str, Room]:
    told = tomllib.loads(Path(__file__).with_name("rooms.toml").read_text(encoding="utf-8"))
    return {
        name: Room(name, tuple(one["modules"]), tuple(one["tests"]), one.get("accepted", {}))
        for name, one in told.items()
    }


def drawn(room: Room, most: int, seed: int, root: Path = ROOT) -> list[tuple[str, Mutant]]:
    """At most so many mutants of a room, drawn without replacement from all of them; the same for the same sources."""
    every = [(module, mutant) for module in room.modules for mutant in mutants((root / module).read_text("utf-8"))]
    return random.Random(f"{seed} {room.name}").sample(every, min(most, len(every)))


def score(verdicts: list[Verdict]) -> float:
    """Share killed of those that were neither accepted; 1 where there is none."""
    counted = [verdict for verdict in verdicts if verdict.fate != "accepted"]
    return sum(verdict.fate == "killed" for verdict in counted) / len(counted) if counted else 1.0


@contextmanager
def trees(n: int, root: Path = ROOT) -> Iterator[Queue[Path]]:
    """n copies of the project, of which one at a time is taken and put back."""
    with tempfile.TemporaryDirectory(prefix="mutation") as folder:
        free: Queue[Path] = Queue()
        for i in range(n):
            tree = Path(folder) / str(i)
            tree.mkdir()
            for name in COPIED:
                if (root / name).is_dir():
                    shutil.copytree(root / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
                elif (root / name).exists():
                    shutil.copy(root / name, tree / name)
            for name in LINKED:
                (tree / name).symlink_to(root / name)
            free.put(tree)
        yield free


def passes(tree: Path, tests: tuple[str, ...], limit: float) -> bool:
    """Whether all of these tests pass within a time, s."""
    command = [sys.executable, "-B", "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider", *tests]
    environment = os.environ | {"PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    try:
        done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, timeout=limit, check=False)
    except subprocess.TimeoutExpired:
        return False
    if done.returncode not in (0, 1, 2):
        raise RuntimeError(f"pytest ended with {done.returncode}: {done.stderr.decode()[-2000:]}")
    return done.returncode == 0


def judge(room: Room, module: str, mutant: Mutant, free: Queue[Path], limit: float) -> Verdict:
    """Run the room's tests on a mutant in a tree that is free."""
    tree = free.get()
    try:
        path = tree / module
        sound = path.read_text(encoding="utf-8")
        path.write_text(mutant.source, encoding="utf-8")
        lives = passes(tree, room.tests, limit)
        path.write_text(sound, encoding="utf-8")
    finally:
        free.put(tree)
    fate = ("accepted" if f"{mutant.place} | {mutant.change}" in room.accepted else "lives") if lives else "killed"
    return Verdict(module, mutant.line, mutant.place, mutant.change, fate)


def judged(room: Room, most: int, seed: int, workers: int, root: Path = ROOT) -> list[Verdict]:
    """Verdicts of the mutants drawn, told as they come. Raises RuntimeError where a test fails without any mutant."""
    chosen = drawn(room, most, seed, root)
    with trees(workers, root) as free, ThreadPoolExecutor(workers) as pool:
        tree, began = free.get(), time.monotonic()
        if not passes(tree, room.tests, 3600.0):
            raise RuntimeError(f"{room.name}: a test of {', '.join(room.tests)} fails without any mutant")
        free.put(tree)
        limit = max(LEAST_PATIENCE, PATIENCE * (time.monotonic() - began))
        found = []
        for verdict in pool.map(lambda one: judge(room, *one, free, limit), chosen):
            found.append(verdict)
            print(f"  {verdict.fate:8} {verdict.module}:{verdict.line}  {verdict.place} | {verdict.change}", flush=True)
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("rooms", nargs="*", choices=[*rooms(), []], help="which ones; all without any")
    parser.add_argument("--most", type=int, default=60, help="mutants drawn a room (60)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--json", metavar="FILE", help="write every verdict there")
    options = parser.parse_args()
    told, low = {}, False
    for room in rooms().values():
        if options.rooms and room.name not in options.rooms:
            continue
        print(f"{room.name}: {options.most} mutants at most")
        verdicts = judged(room, options.most, options.seed, options.workers)
        share = score(verdicts)
        low |= share < FLOOR
        fates = [verdict.fate for verdict in verdicts]
        told[room.name] = {"seed": options.seed, "score": share, "verdicts": [asdict(verdict) for verdict in verdicts]}
        print(
            f"{room.name}: {fates.count('killed')} of {len(fates)} killed, {fates.count('lives')} live, "
            f"{fates.count('accepted')} accepted: {100 * share:.0f} %"
        )
        if options.json:
            Path(options.json).write_text(json.dumps(told, indent=1), encoding="utf-8")
    return int(low)


if __name__ == "__main__":
    sys.exit(main())
