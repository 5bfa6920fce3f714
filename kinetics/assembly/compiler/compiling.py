"""The compilation of targets: the weakest senses that do, then the fewest letters, rules, and the largest yield."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice, product

from kinetics.assembly.compiler import reasons, seeded
from kinetics.assembly.compiler.budget import Budget, OutOfStepsError
from kinetics.assembly.compiler.clashes import clashes, obstacles
from kinetics.assembly.compiler.clauses import Clauses
from kinetics.assembly.compiler.dockings import Dockings
from kinetics.assembly.compiler.fewest import SET_STEPS, Best, NoBookError, fewest
from kinetics.assembly.compiler.joins import JoinSearch, asked_joins, sensible
from kinetics.assembly.compiler.orientation import turnings
from kinetics.assembly.compiler.parts import MOST
from kinetics.assembly.compiler.plan import Plan, planned
from kinetics.assembly.compiler.result import (
    Certificate,
    Compiled,
    InfeasibleError,
    Notify,
    Ruled,
    UndecidedError,
    sensing,
)
from kinetics.assembly.compiler.search import MOST_LETTERS
from kinetics.assembly.compiler.target import MAX_TARGET, Target
from kinetics.assembly.rules.conditions import Senses

MAX_LETTERS = 8
TIME_LIMIT = 600.0  # s
MOST_PARTS = 64  # of a target whose cubes are turned; the work grows with their square
# Steps for one kind of senses, and for one of those that are tried to say what would be enough.
RUNG_STEPS, REMEDY_STEPS = 30_000, 10_000
MOST_SETS = 1 << 12  # of joins of which a book each is made

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
    effort: float = 1.0,
    seed: int = 0,
    progress: Notify | None = None,
    clock: Callable[[], float] = time.monotonic,
    started: float | None = None,
) -> Compiled:
    """A rule book that builds the target and nothing else: of the weakest senses, then of the fewest letters, then of
    the fewest rules that were found, then of the largest yield.

    joins : those to allow, no others, by sizes (`1+2`) or names (`2.a+1->3.b`); None: what the target asks for, or else
        any
    breaks : whether bonds break; what is left must grow again. None: what the target says
    max_letters : most letters; None: what the target says, or 8; from a seed, any number
    time_limit : s of wall time for all of it; what is found does not depend on it unless it ends the work
    effort : by what the steps of every search are multiplied; less is quicker, and leaves more undecided
    seed : of what is drawn by chance; only growth from a seed does
    progress : called with what is being tried
    clock : in s; started : on it, when the time began to count; None: now
    `Compiled.searched` says what was tried, and within which kind of books. Targets of more than eight cubes, and those
    with a seed, are grown from a seed (see `seeded`).
    InfeasibleError: there is no such book, and why. UndecidedError: none was found in the steps allowed, or in time.
    """
    budget = Budget(time_limit, clock, effort, started)
    asked = _Asked.of(target, joins, breaks, max_letters, time_limit, progress, budget, seed)
    ruled: list[Ruled] = []
    rungs = asked.ladder if target.senses is None else (target.senses,)
    try:
        for senses in rungs:
            outcome = asked.rung(senses, seeded.RUNG_STEPS if is_seeded(target) else RUNG_STEPS)
            if isinstance(outcome, Compiled):
                return asked.explained(outcome, ruled)
            ruled.append(outcome)
        if all(each.is_proof for each in ruled):
            raise InfeasibleError(asked.why_not(ruled))
    except TimeoutError:
        raise UndecidedError(asked.too_late(ruled, rungs[len(ruled) :])) from None
    raise UndecidedError(asked.why_not(ruled))


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
    asked = _Asked.of(target, joins, breaks, max_letters, time_limit, progress, Budget(time_limit))
    for senses in [target.senses] if target.senses is not None else LADDER:
        found = False
        try:
            plan = asked.plan(target, senses)
            among = frozenset(plan.joins if asked.joins is None else asked_joins(plan, asked.joins))
            search = JoinSearch(plan, among, asked.breaks, Clauses(1, asked.budget))
            sets = sorted(islice(search.every(), MOST_SETS), key=lambda joins: (len(joins), sorted(joins)))
            for choice in sets:
                try:
                    best = fewest(plan, asked.breaks, choice, asked.max_letters, asked.budget, asked.report, SET_STEPS)
                except NoBookError:
                    continue
                found = True
                yield asked.compiled(best, plan, choice)
        except TimeoutError:
            return
        if found:
            return


@dataclass(frozen=True)
class _Asked:
    """What is asked for, and how much it may take."""

    target: Target
    joins: tuple[str, ...] | None
    breaks: bool
    max_letters: int
    time_limit: float
    report: Notify
    budget: Budget
    seed: int
    known: dict[tuple[object, str], Dockings] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        target: Target,
        joins: Sequence[str] | None,
        breaks: bool | None,
        max_letters: int | None,
        time_limit: float,
        progress: Notify | None,
        budget: Budget,
        seed: int = 0,
    ) -> _Asked:
        for name, value in (("time_limit", time_limit), ("effort", budget.effort)):
            if not value > 0:
                raise ValueError(f"{name} = {value}; it must be more than 0")
        if joins is not None and not joins:
            raise ValueError("joins: an empty list allows none; leave it out to allow all")
        joins, breaks = target.joins if joins is None else joins, target.breaks if breaks is None else breaks
        most = MOST_LETTERS
        if is_seeded(target):
            most = MAX_TARGET
            if breaks:
                raise ValueError(
                    f"target {target.name!r}: the bonds of a book that grows from a seed hold, since news that a stage "
                    "is complete is not taken back; set breaks = false"
                )
            if joins is not None:
                raise ValueError(f"joins: {target.name!r} is grown from a seed, cube by cube; leave out joins")
        if max_letters is None:
            max_letters = target.max_letters or (most if is_seeded(target) else MAX_LETTERS)
        if not 2 <= max_letters <= most:
            raise ValueError(f"max_letters = {max_letters}; it must be 2 to {most}")
        return cls(
            target,
            None if joins is None else tuple(joins),
            breaks,
            max_letters,
            time_limit,
            progress or (lambda _: None),
            budget,
            seed,
        )

    @property
    def ladder(self) -> tuple[Senses, ...]:
        """The senses that are tried, the weakest first."""
        return seeded.LADDER if is_seeded(self.target) else LADDER

    @cached_property
    def turnings(self) -> list[Target]:
        """The target with its cubes turned in the ways that are tried: such as have few different parts, if any."""
        turned = [replace(self.target, tops=tops) for tops in turnings(self.target.positions)]
        few = [t for t in turned if len(self.dockings(t, "two").parts.parts) <= MOST_PARTS]
        return few or turned[-1:]

    def dockings(self, target: Target, faces: str) -> Dockings:
        """How its parts meet, found once for all senses."""
        key = target.tops, faces
        if key not in self.known:
            self.known[key] = Dockings(target, faces, self.budget.check)
        return self.known[key]

    def plan(self, target: Target, senses: Senses) -> Plan:
        """The plan of a target for cubes that sense that much."""
        return planned(self.dockings(target, senses.faces), senses)

    def rung(self, senses: Senses, steps: int) -> Compiled | Ruled:
        """A book for cubes with these senses, turned as suits where the target leaves it open."""
        ruled: list[Ruled] = []
        turned = [self.target]
        if self.target.tops is None and senses.faces == "two" and not is_seeded(self.target):
            turned = self.turnings
        with self.budget.at_most(steps):
            for number, target in enumerate(turned, 1):
                self.report(f"{sensing(senses)}, turn {number} of {len(turned)}")
                try:
                    outcome = (self.grown if is_seeded(target) else self.turned)(target, senses)
                except OutOfStepsError:
                    text = f"target {target.name!r} with {sensing(senses)}: not decided in the steps allowed"
                    outcome = Ruled(senses, text, False, (), ())
                if isinstance(outcome, Compiled):
                    return outcome
                ruled.append(outcome)
        is_proof = all(each.is_proof for each in ruled)
        also = "\nwith all cubes turned alike, it is no better" if is_proof and len(ruled) > 1 else ""
        situations = tuple(each for one in ruled for each in one.situations)
        return replace(ruled[0], text=ruled[0].text + also, is_proof=is_proof, situations=situations)

    def grown(self, target: Target, senses: Senses) -> Compiled | Ruled:
        """A book that grows from a seed."""
        try:
            return seeded.grown_book(target, senses, self.max_letters, self.seed, self.budget, self.report)
        except (InfeasibleError, UndecidedError) as error:
            return Ruled(senses, str(error), isinstance(error, InfeasibleError), (), ())

    def turned(self, target: Target, senses: Senses) -> Compiled | Ruled:
        """The same for a target whose cubes are turned."""
        head = f"target {target.name!r} is infeasible with this sensing ({sensing(senses)})"
        open_ = f"target {target.name!r} with {sensing(senses)}: not decided"
        plan = self.plan(target, senses)
        joins, clashing = None, []
        if self.joins is not None:
            joins = asked_joins(plan, self.joins)
            if sensible(plan, joins, self.breaks) != frozenset(joins):
                raise InfeasibleError(
                    f"target {self.target.name!r} is infeasible with these joins ({reasons.choice(plan, joins)}), "
                    "whatever cubes sense: not all of them can happen, or they make what never becomes the target"
                )
            clashing, which = obstacles(plan, self.breaks, joins)[-1:], " and these joins"
        elif not JoinSearch(plan, plan.joins, self.breaks, Clauses(1, self.budget)).holds():
            clashing, which = obstacles(plan, self.breaks, plan.joins), ", whatever joins are chosen,"
        if clashing:
            because = f"{head}{which} because\n{reasons.in_words(plan, clashing)}"
            every = clashes(plan, plan.joins if joins is None else joins)
            return Ruled(senses, because, True, (reasons.situations(plan, every),), ())
        try:
            best = fewest(plan, self.breaks, joins, self.max_letters, self.budget, self.report)
        except NoBookError as error:
            text = f"{head} because {error}" if error.is_proof else f"{open_}: {error}"
            return Ruled(senses, text, error.is_proof, (reasons.situations(plan, ()),), error.exhausted)
        return self.compiled(best, plan, joins)

    def compiled(self, best: Best, plan: Plan, joins: object) -> Compiled:
        """The result, with what was searched."""
        n = len(best.book.letters)
        kind = (
            "kind of books: both cubes need a rule to bond and read before either writes; all structures of one shape "
            "have the same letters, and so have places that symmetry exchanges; a join happens in all its ways or not "
            "at all; cubes turned as in the book's target"
        )
        sets = "these joins" if joins is not None else "any joins"
        few = [
            f"{_letters(each.letters)}, {sets}: none does, all were tried ({each.steps} steps)"
            for each in best.exhausted
        ]
        few += [f"{_letters(number)}, {sets}: not decided in the steps allowed" for number in best.undecided]
        rules = (
            f"{_letters(n)}: of {best.compared} books the one with the fewest rules, then the largest yield: the first "
            f"found with any joins, and with each of {best.sets} sets of joins; not all books were compared"
            if joins is None
            else f"{_letters(n)}, these joins: the first book found"
        )
        certificate = Certificate(
            plan.target.name,
            best.book.fingerprint,
            n,
            best.is_fewest,
            joins is None,
            best.joins,
            best.exhausted,
            (),
        )
        return Compiled(best.book, best.is_fewest, best.joins, (kind, *few, rules), best.verified, certificate)

    def explained(self, made: Compiled, ruled: list[Ruled]) -> Compiled:
        """The result with what is known of weaker senses."""
        said = [f"{sensing(each.senses)}: {'infeasible' if each.is_proof else 'not decided'}" for each in ruled]
        turned = ", cubes turned in the ways tried" if self.target.tops is None else ""
        weaker = (f"weaker senses{turned}: {'; '.join(said)}",) if said else ()
        proofs = tuple(each for each in ruled if each.is_proof)
        certificate = made.certificate and replace(made.certificate, weaker=proofs)
        return replace(made, searched=(*weaker, *made.searched), certificate=certificate)

    def why_not(self, ruled: list[Ruled]) -> str:
        """Why there is no book, or none was found; and what would be enough."""
        proofs = [sensing(each.senses) for each in ruled if each.is_proof]
        if len(proofs) == len(ruled):
            others = f"nor is there one with {'; '.join(proofs[1:])}"
            return f"{ruled[0].text}\n{self.remedy() if self.target.senses is not None else others}"
        open_ = "\n".join(each.text for each in ruled if not each.is_proof)
        out = f"\ninfeasible with {'; '.join(proofs)}" if proofs else ""
        return f"{open_}{out}\n{self.remedy()}"

    def too_late(self, ruled: list[Ruled], following: Sequence[Senses]) -> str:
        """What was decided before time was up, and what comes next."""
        said = [f"{sensing(each.senses)} {'infeasible' if each.is_proof else 'not decided'}" for each in ruled]
        rest = f"; next: {'; '.join(map(sensing, following[1:]))}" if following[1:] else ""
        return (
            f"target {self.target.name!r}: not decided within {self.time_limit:g} s\nso far: "
            f"{'; '.join(said) or 'nothing'}\nat work: {sensing(following[0])}{rest}. Allow more time, or name senses"
        )

    def remedy(self) -> str:
        """What would be enough, in words: stronger senses, or bonds that hold."""
        own = self.target.senses
        for senses in self.ladder:
            if own is not None and senses != own and _is_stronger(senses, own):
                made = self._quick(senses)
                if isinstance(made, Compiled):
                    return f"{sensing(senses)} are enough: a book of {made.letters} letters does it"
        if self.breaks and self.joins is None:
            for senses in self.ladder if own is None else (own,):
                made = replace(self, breaks=False)._quick(senses)
                if isinstance(made, Compiled):
                    return (
                        f"if bonds hold (breaks = false), {sensing(senses)} are enough: a book of {made.letters} "
                        "letters does it"
                    )
        tried = "no stronger sensing was" if own is not None else "nothing was"
        return f"{tried} found to be enough in the steps and the time allowed"

    def _quick(self, senses: Senses) -> Compiled | Ruled | None:
        """An attempt with fewer steps; None where it is out of question, or time is up."""
        try:
            return self.rung(senses, REMEDY_STEPS)
        except (InfeasibleError, TimeoutError):
            return None


def is_seeded(target: Target) -> bool:
    """Whether a target is grown from a seed."""
    return target.seed is not None or len(target) > MOST


def _letters(number: int) -> str:
    return f"{number} letter{'' if number == 1 else 's'}"


def _is_stronger(senses: Senses, than: Senses) -> bool:
    """Whether cubes sense all that they did."""
    faces = ("one", "two", "six")
    return faces.index(senses.faces) >= faces.index(than.faces) and all(
        getattr(senses, name) or not getattr(than, name) for name in ("roll", "across", "touched")
    )
