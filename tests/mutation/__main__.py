"""The mutation score of each room: `python -m tests.mutation` draws mutants of its modules and runs its tests on each.

A mutant is killed where a test fails, or where the tests take four times the processor time. Prints a line a mutant
and a line a room; the exit code is 1 where a room's score is below the floor. Mutants listed in `rooms.toml` as
accepted are told, and count as neither.

Verdicts are kept in `results/mutation`, a file a room, as they come. The next run of the same code goes on from there:
it judges those that are missing, and those that lived, anew. Cost: the room's tests once a mutant, up to the first
that fails; kernels are compiled anew.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import random
import sys
import tomllib
from dataclasses import asdict, dataclass
from pathlib import Path

from tests.helpers.meaning import meaning
from tests.mutation.judging import LEAST_PATIENCE, PATIENCE, ROOT, changed, copy_of, run_tests
from tests.mutation.sites import Mutant, mutants

STORED = ROOT / "results/mutation"
FLOOR = 0.9
MOST, SEED = 40, 1


@dataclass(frozen=True)
class Room:
    """Modules whose mutants are to be killed by these tests, without the slow ones.

    accepted : mutants that may live: "text of the line | change" -> reason
    plain : kernels run as plain Python, which spares compiling them for every mutant
    """

    name: str
    modules: tuple[str, ...]
    tests: tuple[str, ...]
    accepted: dict[str, str]
    slow: tuple[str, ...] = ()
    plain: bool = False

    @property
    def arguments(self) -> tuple[str, ...]:
        """The tests, as pytest is told."""
        return self.tests + tuple(f"--deselect={name}" for name in self.slow)


@dataclass(frozen=True)
class Verdict:
    """What became of a mutant: "killed", "lives" or "accepted"."""

    module: str
    line: int
    place: str
    change: str
    fate: str


@dataclass(frozen=True)
class Score:
    """The verdicts of a room.

    code : of its modules, see `code_of`; possible : mutants that there are; seed : by which these were drawn
    """

    code: str
    possible: int
    seed: int
    verdicts: tuple[Verdict, ...]

    def of(self, fate: str) -> int:
        """How many of a fate."""
        return sum(verdict.fate == fate for verdict in self.verdicts)

    @property
    def share(self) -> float:
        """Killed of those that were not accepted; 1 where there is none."""
        counted = len(self.verdicts) - self.of("accepted")
        return self.of("killed") / counted if counted else 1.0


def rooms() -> dict[str, Room]:
    """Rooms by name."""
    told = tomllib.loads(Path(__file__).with_name("rooms.toml").read_text(encoding="utf-8"))
    return {
        name: Room(
            name,
            tuple(one["modules"]),
            tuple(one["tests"]),
            one.get("accepted", {}),
            tuple(one.get("slow", ())),
            one.get("plain", False),
        )
        for name, one in told.items()
    }


def drawn(room: Room, most: int, seed: int, root: Path = ROOT) -> list[tuple[str, Mutant]]:
    """At most so many mutants of a room, drawn without replacement; fewer are the first of more of the same sources."""
    every = all_of(room, root)
    random.Random(f"{seed} {room.name}").shuffle(every)
    return every[:most]


def all_of(room: Room, root: Path = ROOT) -> list[tuple[str, Mutant]]:
    """Every mutant of a room, with its module."""
    return [(module, mutant) for module in room.modules for mutant in mutants((root / module).read_text("utf-8"))]


def code_of(room: Room, root: Path = ROOT) -> str:
    """SHA-256 of what the room's modules do: comments and docstrings may change, nothing else."""
    seen = hashlib.sha256()
    for module in room.modules:
        seen.update(f"{module}\n{meaning((root / module).read_text('utf-8'))}\n".encode())
    return seen.hexdigest()


def stored(name: str, folder: Path = STORED) -> Score | None:
    """What was kept of a room, if anything."""
    path = folder / f"{name}.json"
    if not path.exists():
        return None
    told = json.loads(path.read_text("utf-8"))
    return Score(**told | {"verdicts": tuple(Verdict(**one) for one in told["verdicts"])})


def judged(room: Room, most: int, seed: int, folder: Path = STORED, root: Path = ROOT) -> Score:
    """Verdicts of the mutants drawn, told and kept as they come. RuntimeError: a test fails without any mutant."""
    chosen, code, possible = drawn(room, most, seed, root), code_of(room, root), len(all_of(room, root))
    before = stored(room.name, folder)
    known = before.verdicts if before and (before.code, before.seed) == (code, seed) else ()
    found: list[Verdict] = []
    with copy_of(root) as tree:
        sound = run_tests(tree, room.arguments, plain=room.plain)
        if not sound.passed:
            raise RuntimeError(f"{room.name}: a test of {', '.join(room.tests)} fails without any mutant: {sound.said}")
        limit = max(LEAST_PATIENCE, PATIENCE * sound.seconds)
        print(f"{room.name}: its tests take {sound.seconds:.1f} s of processor time; {len(chosen)} mutants", flush=True)
        for i, (module, mutant) in enumerate(chosen):
            if i < len(known) and known[i].fate == "killed":
                found.append(known[i])
                continue
            with changed(tree / module, mutant.source):
                outcome = run_tests(tree, room.arguments, limit, room.plain)
            spared = "accepted" if f"{mutant.place} | {mutant.change}" in room.accepted else "lives"
            fate = spared if outcome.passed else "killed"
            found.append(Verdict(module, mutant.line, mutant.place, mutant.change, fate))
            print(f"  {fate:8} {module}:{mutant.line}  {mutant.place} | {mutant.change}", flush=True)
            _keep(room.name, Score(code, possible, seed, (*found, *known[i + 1 :])), folder)
    return Score(code, possible, seed, tuple(found))


def _keep(name: str, score: Score, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.json").write_text(json.dumps(asdict(score), indent=1) + "\n", encoding="utf-8")


def main() -> int:
    """Judge the rooms that are named; all without any."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("rooms", nargs="*", help=f"Judge these rooms alone: {', '.join(rooms())}.")
    parser.add_argument("--most", type=int, default=MOST, help=f"Draw at most so many mutants a room ({MOST}).")
    parser.add_argument("--seed", type=int, default=SEED, help="Draw them by this seed.")
    options = parser.parse_args()
    if unknown := set(options.rooms) - set(rooms()):
        parser.error(f"there is no room {', '.join(sorted(unknown))}; expected some of {', '.join(rooms())}")
    low = False
    for room in rooms().values():
        if options.rooms and room.name not in options.rooms:
            continue
        score = judged(room, options.most, options.seed)
        low |= score.share < FLOOR
        print(
            f"{room.name}: {score.of('killed')} of {len(score.verdicts)} killed, {score.of('lives')} live, "
            f"{score.of('accepted')} accepted: {100 * score.share:.0f} %"
        )
    return int(low)


if __name__ == "__main__":
    sys.exit(main())
