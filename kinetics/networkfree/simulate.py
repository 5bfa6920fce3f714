"""Network-free stochastic simulation: statistically exact, however many structures a book can assemble.

The tank holds structures, those that look alike counted together. Faces are grouped by what they show and by the size
of their structure. A pair of groups that the book may let bond has one rate constant k, so that the rate of all joins
is at most the sum of k x pairs of faces. Events come at that rate; each draws a pair of faces and one of the four
twists, and nothing happens if both lie on one structure, cubes would overlap or the book refuses. Thinned so, each
join goes at k / 4 a pair of faces and twist, as in the derived network. Bonds outside loops break at their constants,
or at these times the weights of all other bodies and of the walls, where the break model weights bodies by size.

Rejection of such null events is what NFsim and DYNSTOC do for rules without space: Yang, Monine, Faeder & Hlavacek,
Phys. Rev. E 78, 031910 (2008); Sneddon, Faeder & Emonet, Nat. Methods 8, 177 (2011).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from math import isfinite, log1p

import numpy as np

from kinetics.assembly.rules.rule_book import RuleBook
from kinetics.assembly.structure import Structure
from kinetics.networkfree.growth import NOTHING, Growth, Growths
from kinetics.networkfree.tank import ALONE, Breakers, GrowingTank, Known, Rate, TankEvent
from kinetics.rates import ClassRates
from kinetics.support.arrays import rising_times, whole_number
from kinetics.support.cli.progress import forecast, stage
from kinetics.support.tables import rough

BLOCK = 4096  # random numbers drawn at once
PROGRESS_EVERY = 500  # draws
TRIED = 2000  # draws of the first run, from whose end the rest is forecast
DRAW_SECONDS = 4e-5  # of CPU time, on a common machine
BEGIN_SECONDS = 3e-4  # of a run, however few its draws
DRAWS_A_CUBE = 4.0  # null events among them, while all cubes join once
DRAWS_A_BREAK = 3.0  # and what rejoins
MOST_STILL = 1000  # draws in a row that do not move the clock: it has stalled


def grow(
    book: RuleBook,
    rates: ClassRates | Rate,
    initial: int | Mapping[Structure, int],
    end: float,
    runs: int = 1,
    seed: int = 0,
    progress: Callable[[int, float], None] | None = None,
    draws: int = 0,
    max_events: int | None = None,
) -> Growths:
    """Simulate assembly by the rules of a book, `runs` times, from time 0 until `end`, tu.

    rates : class rates, or a function of a rate class; constants in 1/tu, pairs of like structures counted as
        s (s - 1) / 2
    initial : the number of free cubes, to which the seed is added if the book needs one; or copies of structures
    progress : called with the number of runs finished and the time reached in the current one, tu
    draws : over how many draws of the class rates from their evidence the runs are spread, by turns; 0: over none, all
        runs are under the rates as they are
    max_events : most events of a run; if one would come to more, all runs end at its last one, and
        `Growths.truncated` says so. None: any number

    The same seed gives the same result; runs of different numbers are independent. After Ctrl-C, the runs that are
    finished are returned, if any. Cost: draws of faces and bonds, null events among them (`Growth.draws`). Source: Yang
    et al. (2008), doi:10.1103/PhysRevE.78.031910, and Sneddon et al. (2011), doi:10.1038/nmeth.1546, here in space.
    ValueError: an initial state that the book cannot begin from, or a class without a rate

    >>> from kinetics import ClassRates, grow
    >>> from kinetics.assembly import RuleBook
    >>> rates = ClassRates.uniform(join=1e-3)
    >>> grown = grow(RuleBook.load("line4"), rates, initial=8, end=1e5, runs=2, seed=1)
    >>> grown.largest([0.0, 1e5]).tolist()  # cubes, of each run
    [[1, 4], [1, 4]]
    """
    horizon = float(rising_times([end])[0])
    start = _checked(book, initial) if isinstance(initial, Mapping) else free_cubes(book, initial)
    known = [Known(book, *_rate_of(rates, book))]
    if draws:
        if not isinstance(rates, ClassRates):
            raise ValueError(f"draws = {draws} of rates that have no evidence; give ClassRates, or leave draws out")
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0, 1)))
        drawn = rates.draws(rng, min(whole_number("draws", draws, 1), whole_number("runs", runs, 1)))
        known = [known[0].under(*_rate_of(some, book)) for some in drawn]
    finished: list[Growth] = []
    most = np.inf if max_events is None else whole_number("max_events", max_events, 1)
    interrupted = False
    try:
        for run in range(whole_number("runs", runs, 1)):
            grown = _run(known[run % len(known)], start, horizon, seed, run, progress, runs, most)
            finished.append(grown)
            stage(f"{run + 1} of {runs} runs", (run + 1) / runs)
            if run == 0 and grown.draws < TRIED:
                _say(grown.draws, runs)
    except KeyboardInterrupt:
        if not finished:
            raise
        interrupted = True
    ends = tuple(grown.end if grown.end < horizon else np.inf for grown in finished)
    if min(ends) == np.inf:
        return Growths(tuple(finished), interrupted)
    return Growths(tuple(grown.until(min(ends)) for grown in finished), interrupted, ends)


def free_cubes(book: RuleBook, cubes: int) -> dict[Structure, int]:
    """A tank of free cubes, and the seed besides if the book needs one."""
    start = {book.monomer(): whole_number("cubes", cubes, 1)}
    seed = book.seed()
    return start if seed is None else start | {seed: 1}


def _rate_of(rates: ClassRates | Rate, book: RuleBook) -> tuple[Rate, Breakers]:
    """A function from class to rate constant, and the break model, checked for combinations and faces."""
    if not isinstance(rates, ClassRates):
        if not callable(rates):
            raise ValueError(f"rates = {rates!r}; expected ClassRates, or a function of a rate class")
        return rates, ALONE
    if rates.convention.combinations != "distinct":
        raise ValueError(
            f"these class rates count pairs as {rates.convention.combinations!r}; without a network they must be for "
            '"distinct" pairs, s (s - 1) / 2 of like structures'
        )
    if rates.faces not in (None, book.scheme):
        raise ValueError(
            f"these class rates are for faces = {rates.faces!r}; book {book.name!r} has {book.scheme!r}, whose face "
            "types mean something else"
        )
    breaks = rates.breaks
    _, wall, alone = breaks.by_size([1.0])
    return rates.rate, Breakers(lambda size: float(breaks.by_size([size]).bodies[0]), wall + alone)


def _checked(book: RuleBook, initial: Mapping[Structure, int]) -> dict[Structure, int]:
    """Copies of canonical structures."""
    start: dict[Structure, int] = {}
    for structure, copies in initial.items():
        unknown = set(structure.letters) - set(book.letters)
        if unknown:
            raise ValueError(
                f"initial holds {structure}; book {book.name!r} has no letter {min(unknown)!r}, but "
                f"{', '.join(book.letters)}"
            )
        canonical = book.settle(structure).canonical(book.scheme)
        start[canonical] = start.get(canonical, 0) + whole_number(f"copies of {structure}", copies, 0)
    held = {structure: copies for structure, copies in start.items() if copies}
    if not held:
        raise ValueError("initial holds no structure at all; give at least one cube")
    if book.seed_letter is not None and list(held) == [book.monomer().canonical(book.scheme)]:
        raise ValueError(f"initial holds free cubes alone; book {book.name!r} grows from a seed, so add book.seed()")
    return held


def _uniforms(seed: int, run: int) -> Iterator[float]:
    """The random numbers of a run, in [0, 1)."""
    generator = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(run,)))
    while True:
        yield from generator.random(BLOCK).tolist()


def _run(
    known: Known,
    initial: Mapping[Structure, int],
    end: float,
    seed: int,
    run: int,
    progress: Callable[[int, float], None] | None,
    runs: int,
    most: float,
) -> Growth:
    """One run, and what happened in it; it ends with so many events at most."""
    tank = GrowingTank(known, initial)
    numbers: dict[Structure, int] = {kind.structure: number for number, kind in enumerate(tank.counts)}
    counts = list(tank.counts.values())
    times: list[float] = []
    sides: list[list[int]] = []
    draws = 0
    with np.errstate(over="ignore", invalid="ignore"):  # overflowing rates are refused with a message
        for time, event in _draws(tank, _uniforms(whole_number("seed", seed, 0), run).__next__, end, run):
            draws += 1
            if draws % PROGRESS_EVERY == 0:
                if progress is not None:
                    progress(run, time)
                stage(f"{run} of {runs} runs; the next at {time:.4g} of {end:g} tu")
                if run == 0 and draws == TRIED:
                    _forecast(tank, draws, end - time, runs)
            if event is None:
                continue
            if len(times) == most:
                end = times[-1]
                break
            times.append(time)
            for kinds in event:
                indices = [numbers.setdefault(kind.structure, len(numbers)) for kind in kinds]
                sides.append(indices if len(indices) == 2 else [*indices, NOTHING])
    table = np.array(sides, dtype=np.int64).reshape(-1, 2, 2)
    structures = tuple(Structure.unchecked(s.positions, s.rotations, s.letters) for s in numbers)
    initial_counts = np.array(counts + [0] * (len(numbers) - len(counts)))
    return Growth(known.book, structures, initial_counts, np.array(times), table[:, 0], table[:, 1], end, draws)


def _forecast(tank: GrowingTank, draws: int, left: float, runs: int) -> None:
    """Say what all runs will take, from the rates in the first one, `left` tu before its end.

    Joins use up what joins, so that they are no more than the cubes, except for those that mend breaks.
    """
    drawn, break_rate = tank.rates()
    cubes = sum(len(kind.structure) * copies for kind, copies in tank.counts.items())
    more = min(drawn[-1] / 2 * left, DRAWS_A_CUBE * cubes) + DRAWS_A_BREAK * break_rate * left
    _say(draws + more, runs)


def _say(draws: float, runs: int) -> None:
    forecast(runs * (BEGIN_SECONDS + draws * DRAW_SECONDS), f"{rough(runs)} runs of some {rough(draws)} draws")


def _draws(
    tank: GrowingTank, draw: Callable[[], float], end: float, run: int
) -> Iterator[tuple[float, TankEvent | None]]:
    """When something is drawn, and the event that comes of it, if any; the tank is then as after the event."""
    time, still = 0.0, 0
    drawn, break_rate = tank.rates()
    while True:
        total = drawn[-1] / 2 + break_rate
        if total == 0:
            return
        if not isfinite(total):
            raise ValueError(f"run {run}: the rate of all events goes beyond 1e308; the rate constants are too large")
        wait = -log1p(-draw()) / total
        still = still + 1 if time + wait == time else 0
        if still >= MOST_STILL:
            raise ValueError(
                f"run {run}: events came so fast that the clock could not advance beyond {time:g}; the rate "
                f"constants are too large for this duration"
            )
        time += wait
        if time > end:
            return
        event = tank.part(draw, break_rate) if draw() * total < break_rate else tank.join(drawn, draw)
        if event is not None:
            tank.happens(event)
            drawn, break_rate = tank.rates()
        yield time, event
