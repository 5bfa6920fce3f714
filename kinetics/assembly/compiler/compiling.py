"""The compilation of small targets: weakest senses, most joins, fewest letters, each verified."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, islice, product
from math import prod
from typing import NamedTuple

from kinetics.assembly.compiler import reasons
from kinetics.assembly.compiler.choices import Choices, asked_joins
from kinetics.assembly.compiler.orientation import turnings
from kinetics.assembly.compiler.plan import MOST, Channel, Plan, planned
from kinetics.assembly.compiler.proof import proven
from kinetics.assembly.compiler.result import Compiled, InfeasibleError, Notify, UndecidedError, sensing
from kinetics.assembly.compiler.search import MOST_LETTERS, Problem, Solution, solutions
from kinetics.assembly.compiler.target import Target
from kinetics.assembly.rules.conditions import Senses

MAX_LETTERS = 8
TIME_LIMIT = 120.0  # s
# Steps of one search, a second or so for 100,000. Counted, not timed: the same target gives the same book anywhere.
DIRECT_STEPS = 400_000
DEFERRED_STEPS = 100_000
HURRY = 10  # so many times fewer steps where one search of many is made
# Choices of joins that are tried one after another where the compiler chooses: the largest, paths, then all if few.
MOST_LARGEST, MOST_PATHS, FEW_CHOICES = 4, 20, 4096

# What is tried in this order where the target does not say what its cubes sense.
LADDER = tuple(
    Senses(faces=faces, roll=roll, across=across, touched=touched)
    for faces in ("two", "six")
    for touched, across, roll in sorted(product((False, True), repeat=3), key=lambda senses: (sum(senses), senses))
)


def compile_book(
    target: Target,
    *,
    joins: Sequence[str] | None = None,
    breaks: bool | None = None,
    max_letters: int | None = None,
    time_limit: float = TIME_LIMIT,
    seed: int = 0,
    progress: Notify | None = None,
) -> Compiled:
    """A rule book that builds the target and nothing else, with as few letters as its joins allow.

    joins : those to allow, no others, by sizes (`1+2`) or names (`2.a+1->3.b`); None: what the target asks for, or else
        as many as cubes with these senses can tell from mistakes
    breaks : whether bonds break; what is left must grow again. None: what the target says
    max_letters : most letters; None: what the target says, or 8
    time_limit : s of wall time
    seed : of what is drawn by chance; only growth from a seed does
    progress : called with what is being tried
    Where the target names no senses, the weakest that are enough are taken. Targets of more than eight cubes, and
    those with a seed, are grown from a seed (see `seeded`).
    InfeasibleError: there is no such book, and why. UndecidedError: none was found in time, nor a proof.
    """
    asked = _Asked.of(target, joins, breaks, max_letters, time_limit, progress)
    if target.seed is not None or len(target) > MOST:
        from kinetics.assembly.compiler.seeded import compile_seeded

        if asked.joins is not None:
            raise ValueError(f"joins: {target.name!r} is grown from a seed, cube by cube; leave joins out")
        held = replace(target, breaks=asked.breaks)
        return compile_seeded(held, max_letters=max_letters, time_limit=time_limit, seed=seed, progress=progress)
    failures: dict[str, _Failure] = {}
    for senses in [target.senses] if target.senses is not None else LADDER:
        outcome = asked.attempt(senses)
        if isinstance(outcome, Compiled):
            return outcome
        failures[sensing(senses)] = outcome
        if asked.is_late:
            break
    if all(failure.is_proof for failure in failures.values()):
        first = next(iter(failures.values()))
        last = asked.remedy() if target.senses is not None else f"nor is there one with {'; '.join(list(failures)[1:])}"
        raise InfeasibleError(f"{first.text}\n{last}")
    raise UndecidedError(_undecided(target, failures, time_limit))


def all_books(
    target: Target,
    *,
    joins: Sequence[str] | None = None,
    breaks: bool | None = None,
    max_letters: int | None = None,
    time_limit: float = TIME_LIMIT,
    progress: Notify | None = None,
) -> Iterator[Compiled]:
    """One book for each choice among the joins with which everything leads to the target, fewest joins first.

    Choices for which no book is found are left out; it ends after time_limit. The senses are the target's, or the
    weakest that are enough for any choice. Other arguments as of `compile_book`.
    """
    asked = _Asked.of(target, joins, breaks, max_letters, time_limit, progress)
    for senses in [target.senses] if target.senses is not None else LADDER:
        found = False
        try:
            plan = planned(target, senses, asked.tick)
            among = frozenset(plan.joins if asked.joins is None else asked_joins(plan, asked.joins))
            for choice in Choices(plan, asked.breaks, asked.tick).every():
                if not choice <= among:
                    continue
                made = asked.book(plan, choice, HURRY)
                if isinstance(made, Compiled):
                    found = True
                    yield made
        except TimeoutError:
            return
        if found:
            return


def _undecided(target: Target, failures: Mapping[str, _Failure], time_limit: float) -> str:
    """What was ruled out, and what was not decided."""
    open_ = [senses for senses, failure in failures.items() if not failure.is_proof]
    out = [senses for senses, failure in failures.items() if failure.is_proof]
    ruled = f"; infeasible with {'; with '.join(out)}" if out else ""
    return (
        f"target {target.name!r} with {'; with '.join(open_)}: not decided within {time_limit:g} s and the steps "
        f"allowed for a search{ruled}. Allow more time, ask for fewer joins, or name stronger senses"
    )


class _Failure(NamedTuple):
    """Why no book came of it; is_proof: there is none."""

    text: str
    is_proof: bool


@dataclass
class _Asked:
    """What is asked for, and how much time and how many steps are left."""

    target: Target
    joins: tuple[str, ...] | None
    breaks: bool
    max_letters: int
    time_limit: float
    progress: Notify
    start: float = field(default_factory=time.monotonic)
    steps: int = 0
    hurry: int = 1

    @classmethod
    def of(
        cls,
        target: Target,
        joins: Sequence[str] | None,
        breaks: bool | None,
        max_letters: int | None,
        time_limit: float,
        progress: Notify | None,
    ) -> _Asked:
        if not time_limit > 0:
            raise ValueError(f"time_limit = {time_limit} s; it must be more than 0")
        if max_letters is None:
            max_letters = target.max_letters or MAX_LETTERS
        if not 2 <= max_letters <= MOST_LETTERS:
            raise ValueError(f"max_letters = {max_letters}; it must be 2 to {MOST_LETTERS}")
        if joins is not None and not joins:
            raise ValueError("joins: an empty list allows none; leave it out to allow all")
        return cls(
            target,
            target.joins if joins is None else tuple(joins),
            target.breaks if breaks is None else breaks,
            max_letters,
            time_limit,
            progress or (lambda _: None),
        )

    @property
    def is_late(self) -> bool:
        """Whether time is up."""
        return time.monotonic() - self.start > self.time_limit

    def tick(self) -> None:
        """TimeoutError when time is up."""
        if self.is_late:
            raise TimeoutError

    def attempt(self, senses: Senses) -> Compiled | _Failure:
        """A book for cubes with these senses, turned as suits where the target leaves it open."""
        try:
            if self.target.tops is not None or senses.faces != "two":
                return self.turned(self.target, senses)
            failures = []
            for tops in turnings(self.target.positions):
                made = self.turned(replace(self.target, tops=tops), senses)
                if isinstance(made, Compiled):
                    return made
                failures.append(made)
        except TimeoutError:
            return _Failure(
                f"{self.target.name!r} with {sensing(senses)}: not decided within {self.time_limit:g} s", False
            )
        is_proof = all(failure.is_proof for failure in failures)
        also = "\nwith all cubes turned alike, it is no better" if is_proof else ""
        return _Failure(failures[0].text + also, is_proof)

    def turned(self, target: Target, senses: Senses) -> Compiled | _Failure:
        """The same for a target whose cubes are turned."""
        head = f"target {target.name!r} is infeasible with this sensing ({sensing(senses)})"
        plan = planned(target, senses, self.tick)
        choices = Choices(plan, self.breaks, self.tick)
        if self.joins is not None:
            return self.exactly(choices, asked_joins(plan, self.joins), head)
        failures = []
        for number, joins in enumerate(_worth_trying(choices)):
            made = self.book(plan, joins, 1 if number == 0 else HURRY)
            if isinstance(made, Compiled):
                return made
            failures.append(made)
        if failures:
            is_proof = _tries_all(choices) and all(failure.is_proof for failure in failures)
            what = head if is_proof else f"target {target.name!r} with {sensing(senses)}: not decided,"
            return _Failure(f"{what} because {failures[0].text}", is_proof)
        clashes = reasons.in_words(plan, choices.obstacles(plan.joins))
        if not choices.is_complete:
            return _Failure(f"target {target.name!r} with {sensing(senses)}: not decided, because of\n{clashes}", False)
        return _Failure(f"{head}, whatever joins are chosen, because\n{clashes}", True)

    def exactly(self, choices: Choices, joins: tuple[Channel, ...], head: str) -> Compiled | _Failure:
        """A book with these joins."""
        plan = choices.plan
        if choices.sensible(joins) != frozenset(joins):
            raise InfeasibleError(
                f"target {self.target.name!r} is infeasible with these joins ({reasons.choice(plan, joins)}), whatever "
                "cubes sense: not all of them can happen, or they make what never becomes the target"
            )
        clashes = choices.obstacles(joins)
        if clashes:
            return _Failure(f"{head} and these joins because\n{reasons.in_words(plan, clashes[-1:])}", True)
        made = self.book(plan, joins)
        if isinstance(made, Compiled):
            return made
        return made._replace(text=f"{head} because {made.text}") if made.is_proof else made

    def book(self, plan: Plan, joins: Iterable[Channel], hurry: int = 1) -> Compiled | _Failure:
        """A book with the fewest letters for these joins; in a hurry, with so many times fewer steps."""
        start = time.monotonic()
        problem = Problem.of(plan, joins, self.breaks)
        exhausted = True
        for n_letters in range(2, self.max_letters + 1):
            for deferred in (False, True):
                self.progress(f"{sensing(plan.senses)}: {len(problem.joins)} joins, {n_letters} letters")
                found, complete = self.search(problem, n_letters, deferred, hurry)
                if found is not None:
                    book, verified = proven(problem, found)
                    names = tuple(map(plan.name, problem.joins))
                    return Compiled(book, exhausted, names, time.monotonic() - start, verified)
            exhausted &= complete
        listed = reasons.choice(plan, problem.joins)
        if exhausted:
            return _Failure(f"the joins {listed} take more than {self.max_letters} letters: all were tried", True)
        return _Failure(f"the joins {listed}: not decided within the steps allowed for the search", False)

    def search(self, problem: Problem, n_letters: int, deferred: bool, hurry: int) -> tuple[Solution | None, bool]:
        """A solution, and whether all were tried."""
        self.steps = (DEFERRED_STEPS if deferred else DIRECT_STEPS) // max(hurry, self.hurry)

        def tick() -> None:
            self.steps -= 1
            if self.steps % 256 == 0:
                self.tick()
            if self.steps == 0:
                raise _OutOfStepsError

        try:
            return next(solutions(problem, n_letters, deferred, tick), None), True
        except _OutOfStepsError:
            return None, False

    def remedy(self) -> str:
        """Which stronger senses are enough, in words; "" where none were found in time."""
        own = self.target.senses
        if own is None:
            return ""
        self.hurry = HURRY
        for senses in LADDER:
            if senses != own and _is_stronger(senses, own):
                made = self.attempt(senses)
                if isinstance(made, Compiled):
                    return f"{sensing(senses)} are enough: a book of {made.letters} letters does it"
        return "no stronger sensing was found to be enough in time"


def _tries_all(choices: Choices) -> bool:
    return choices.is_small and prod(len(group.options) for group in choices.groups) <= FEW_CHOICES


def _worth_trying(choices: Choices) -> Iterator[frozenset[Channel]]:
    """Choices of joins, each once."""
    rest = choices.every() if _tries_all(choices) else ()
    seen: set[frozenset[Channel]] = set()
    for joins in chain(islice(choices.largest(), MOST_LARGEST), islice(choices.paths(), MOST_PATHS), rest):
        if joins not in seen:
            seen.add(joins)
            yield joins


class _OutOfStepsError(Exception):
    """The search has used up its steps."""


def _is_stronger(senses: Senses, than: Senses) -> bool:
    """Whether cubes sense all that they did."""
    faces = ("one", "two", "six")
    return faces.index(senses.faces) >= faces.index(than.faces) and all(
        getattr(senses, name) or not getattr(than, name) for name in ("roll", "across", "touched")
    )
