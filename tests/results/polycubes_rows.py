"""A row of the table of shapes: one shape compiled, with the yield of its book, in a process of its own."""

from __future__ import annotations

import hashlib
import json
import resource
import signal
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from multiprocessing.connection import Connection
from typing import Any

from kinetics import Model
from kinetics.assembly import RuleBook, Senses, derive
from kinetics.assembly.compiler import InfeasibleError, Target, UndecidedError, compile_book
from kinetics.assembly.compiler.compiling import LADDER
from kinetics.assembly.compiler.result import Compiled, sensing
from kinetics.assembly.rules.writing import written
from kinetics.predicting.ranking.yield_and_first_time import yield_and_first_time
from kinetics.rates import ClassRates
from tests.helpers.meaning import meaning
from tests.results.polycubes_shapes import Shape, polycubes
from tests.results.studies import ROOT

EFFORTS = {2: 1.0, 3: 1.0, 4: 1.0, 5: 1.0, 6: 0.1, 7: 0.05, 8: 0.03}  # by cubes: what of the compiler's usual steps
CPU_LIMIT = 20.0  # s of a compilation, which then says how far it came; the process is ended after thrice that
# What yields are taken by: free cubes at first, time in tu, and rates in 1/tu of a pair of faces and of a bond.
CUBES, DURATION, JOIN, BREAK = 60, 2000.0, 7e-5, 3e-5
MAX_STATES, RUNS = 20_000, 1000  # solved exactly up to so many states, else so many runs
CLOCK_EVERY = 32  # readings: the clock of CPU time is slow


@dataclass(frozen=True)
class Row:
    """What came of one shape.

    number : its place within `polycubes(cubes)`, from 0
    outcome : `book`, `infeasible`, `undecided`, `ended` for a process that was ended, or `single` for one cube
    reason : why there is no book; empty where there is one
    is_fewest : whether fewer letters are proven not to do, among the kind of books that the compiler searches
    senses : what cubes sense; undecided_senses : weaker senses that were not decided, so that they may do as well
    undecided_letters : smaller numbers of letters that were not decided
    joins, breaks : channels of the derived network
    yield_, low, high : targets at the end over those possible, and its 95 % interval, or the bound of its error
    method, size : `exact` and states, or `ssa` and runs
    compile_cpu, yield_cpu : CPU time, s
    book : as TOML
    code : a fingerprint of the files that made it
    seed : of the sample that the shape is of; None where all of that size are in the table
    """

    cubes: int
    number: int
    places: Shape
    outcome: str
    reason: str = ""
    letters: int | None = None
    is_fewest: bool | None = None
    senses: str = ""
    undecided_senses: tuple[str, ...] = ()
    undecided_letters: tuple[int, ...] = ()
    rules: int | None = None
    joins: int | None = None
    breaks: int | None = None
    yield_: float | None = None
    low: float | None = None
    high: float | None = None
    method: str = ""
    size: int | None = None
    compile_cpu: float = 0.0
    yield_cpu: float = 0.0
    book: str = ""
    code: str = ""
    seed: int | None = None

    @property
    def key(self) -> tuple[int, int]:
        """Cubes and number."""
        return self.cubes, self.number

    @property
    def cpu(self) -> float:
        """CPU time in all, s."""
        return self.compile_cpu + self.yield_cpu

    def line(self) -> str:
        """As one line of JSON."""
        return json.dumps(asdict(self), ensure_ascii=False)

    @classmethod
    def read(cls, line: str) -> Row:
        """From its line."""
        content: dict[str, Any] = json.loads(line)
        content["places"] = tuple(map(tuple, content["places"]))
        for name in ("undecided_senses", "undecided_letters"):
            content[name] = tuple(content[name])
        return cls(**content)


def _files() -> bytes:
    """What the code does that a book depends on."""
    files = sorted(path for room in ("assembly", "kernels") for path in (ROOT / "kinetics" / room).rglob("*.py"))
    return "\n".join(meaning(path.read_text("utf-8")) for path in files if "drawing" not in path.parts).encode()


FILES = hashlib.sha256(_files()).hexdigest()  # as they are imported, whatever becomes of them during a long run


def code(cubes: int) -> str:
    """A fingerprint of the code and the settings that make the rows of so many cubes."""
    settings = repr((FILES, EFFORTS.get(cubes), CPU_LIMIT, CUBES, DURATION, JOIN, BREAK, MAX_STATES, RUNS))
    return hashlib.sha256(settings.encode()).hexdigest()[:12]


def made(cubes: int, number: int, seed: int | None = None) -> Row:
    """Compile one shape, and find the yield of its book."""
    shape = polycubes(cubes)[number]
    alone = Row(cubes, number, shape, "single", "a cube alone needs no rules", code=code(cubes), seed=seed)
    if cubes == 1:
        return alone
    target = Target(f"{cubes}-{number}", shape)
    began = time.process_time()
    try:
        result = compile_book(target, time_limit=CPU_LIMIT, effort=EFFORTS[cubes], clock=cpu_clock())
    except (InfeasibleError, UndecidedError) as error:
        outcome = "infeasible" if isinstance(error, InfeasibleError) else "undecided"
        return replace(alone, outcome=outcome, reason=str(error), compile_cpu=_since(began))
    cpu = _since(began)
    return replace(alone, outcome="book", reason="", compile_cpu=cpu, **_of_book(result), **yields(result.book))


def _since(began: float) -> float:
    """CPU time, s."""
    return round(time.process_time() - began, 2)


def _of_book(result: Compiled) -> dict[str, Any]:
    """Letters, rules and senses, and how far it is proven that fewer do not do."""
    assert result.certificate is not None
    proven = [each.senses for each in result.certificate.weaker]
    weaker = LADDER[: LADDER.index(Senses(**result.book.senses.as_dict()))]
    ruled = {each.letters for each in result.certificate.exhausted}
    return {
        "letters": result.letters,
        "is_fewest": result.minimal,
        "senses": result.capability,
        "undecided_senses": tuple(sensing(senses) for senses in weaker if senses not in proven),
        "undecided_letters": tuple(n for n in range(1, result.letters) if n not in ruled),
        "rules": len(result.book.all_rules),
        "book": written(result.book),
    }


def yields(book: RuleBook) -> dict[str, Any]:
    """Joins and breaks of the network, and the yield of the target after DURATION from CUBES free cubes."""
    began = time.process_time()
    derived = derive(book)
    network = ClassRates.uniform(JOIN, BREAK).apply(derived)
    assert book.target is not None
    monomer, target = (network.species[derived.species_of(each)] for each in (book.monomer(), book.target))
    model = Model.of(network, {monomer: CUBES})
    found = yield_and_first_time(model, target, CUBES // len(book.target), DURATION, RUNS, 0, MAX_STATES).yield_
    joins = sum(len(event.before) == 2 for event in derived.events)
    return {
        "joins": joins,
        "breaks": len(derived.events) - joins,
        "yield_": round(found.value, 4),
        "low": round(found.low, 4),
        "high": round(found.high, 4),
        "method": found.method,
        "size": int(found.why.split()[0]),
        "yield_cpu": _since(began),
    }


def cpu_clock() -> Callable[[], float]:
    """A clock of this process's CPU time in s, which looks only at every so many readings."""
    readings, now = 0, time.process_time()

    def clock() -> float:
        nonlocal readings, now
        readings += 1
        if readings % CLOCK_EVERY == 0:
            now = time.process_time()
        return now

    return clock


def work(to_parent: Connection, cubes: int, number: int, seed: int | None) -> None:
    """Make a row and send it; the system ends this process where it takes far more CPU time than allowed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which ends this process
    most = int(3 * CPU_LIMIT)
    resource.setrlimit(resource.RLIMIT_CPU, (most, most))
    to_parent.send(made(cubes, number, seed).line())
