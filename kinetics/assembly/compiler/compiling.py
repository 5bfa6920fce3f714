"""The compilation of targets: the weakest senses that do, then the fewest letters, the largest yield, few rules."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice, product

from kinetics.assembly.compiler import reasons, seeded
from kinetics.assembly.compiler.budget import Budget, OutOfStepsError
from kinetics.assembly.compiler.choice import SET_STEPS
from kinetics.assembly.compiler.clauses import Clauses
from kinetics.assembly.compiler.dockings import Dockings
from kinetics.assembly.compiler.fewest import MAX_LETTERS, fewest
from kinetics.assembly.compiler.joins import JoinSearch, asked_joins, sensible
from kinetics.assembly.compiler.orientation import MOST, turnings
from kinetics.assembly.compiler.plan import Plan, planned
from kinetics.assembly.compiler.result import Compiled, InfeasibleError, Notify, Ruled, UndecidedError, sensing
from kinetics.assembly.compiler.search import MOST_LETTERS
from kinetics.assembly.compiler.target import Target
from kinetics.assembly.rules.conditions import Senses

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
    the largest yield that was found (see `yields`), then of the fewest rules.

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
    asked = _Asked.of(target, joins, breaks, max_letters, budget, progress, seed)
    ruled: list[Ruled] = []
    rungs = asked.ladder if target.senses is None else (target.senses,)
    try:
        for senses in rungs:
            outcome = asked.rung(senses, seeded.RUNG_STEPS if target.is_seeded else RUNG_STEPS)
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
    weakest that are enough for any choice. Other arguments as of `compile_book`. ValueError: a target that is grown
    from a seed, which leaves nothing to choose.
    """
    asked = _Asked.of(target, joins, breaks, max_letters, Budget(time_limit), progress)
    if target.is_seeded:
        raise ValueError(
            f"target {target.name!r}, of {len(target)} cubes, is grown from a seed, so that there is no choice of "
            f"joins; `compile_book`, or `wellmixed rules compile`, makes it; for a choice, take {MOST} cubes at most"
        )
    for senses in [target.senses] if target.senses is not None else LADDER:
        found = False
        try:
            plan = asked.plan(asked.target, senses)
            among = frozenset(plan.joins if asked.target.joins is None else asked_joins(plan, asked.target.joins))
            search = JoinSearch(plan, among, Clauses(1, asked.budget))
            sets = sorted(islice(search.every(), MOST_SETS), key=lambda joins: (len(joins), sorted(joins)))
            for choice in sets:
                made = fewest(plan, choice, asked.budget, asked.report, SET_STEPS)
                if isinstance(made, Compiled):
                    found = True
                    yield made
        except TimeoutError:
            return
        if found:
            return


@dataclass(frozen=True)
class _Asked:
    """What is asked for, and how much it may take."""

    target: Target
    budget: Budget
    report: Notify
    seed: int
    known: dict[tuple[object, str], Dockings] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        target: Target,
        joins: Sequence[str] | None,
        breaks: bool | None,
        max_letters: int | None,
        budget: Budget,
        progress: Notify | None,
        seed: int = 0,
    ) -> _Asked:
        for name, value in (("time_limit", budget.time_limit), ("effort", budget.effort)):
            if not value > 0:
                raise ValueError(f"{name} = {value}; it must be more than 0")
        target = replace(
            target,
            joins=target.joins if joins is None else tuple(joins),
            breaks=target.breaks if breaks is None else breaks,
            max_letters=target.max_letters if max_letters is None else max_letters,
        )
        if target.is_seeded and target.breaks:
            raise ValueError(
                f"target {target.name!r}: bonds of a book that grows from a seed cannot break, because the signal "
                f"that a stage is complete is never withdrawn; set breaks = false"
            )
        if target.is_seeded and target.joins is not None:
            raise ValueError(f"joins: {target.name!r} is grown from a seed, cube by cube; leave out joins")
        if not target.is_seeded and (target.max_letters or MAX_LETTERS) > MOST_LETTERS:
            raise ValueError(f"max_letters = {target.max_letters}; it must be 2 to {MOST_LETTERS}")
        return cls(target, budget, progress or (lambda _: None), seed)

    @property
    def ladder(self) -> tuple[Senses, ...]:
        """The senses that are tried, the weakest first."""
        return seeded.LADDER if self.target.is_seeded else LADDER

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
        return planned(self.dockings(target, senses.faces), senses, target.breaks)

    def rung(self, senses: Senses, steps: int) -> Compiled | Ruled:
        """A book for cubes with these senses, turned as suits where the target leaves it open."""
        ruled: list[Ruled] = []
        turned = [self.target]
        if self.target.tops is None and senses.faces == "two" and not self.target.is_seeded:
            turned = self.turnings
        with self.budget.at_most(steps):
            for number, target in enumerate(turned, 1):
                self.report(f"{sensing(senses)}, turn {number} of {len(turned)}")
                try:
                    outcome = (self.grown if target.is_seeded else self.turned)(target, senses)
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
            return seeded.grown_book(target, senses, self.seed, self.budget, self.report)
        except (InfeasibleError, UndecidedError) as error:
            return Ruled(senses, str(error), isinstance(error, InfeasibleError), (), ())

    def turned(self, target: Target, senses: Senses) -> Compiled | Ruled:
        """A book for a target with cubes turned as given."""
        plan = self.plan(target, senses)
        joins, clashing = None, []
        if target.joins is not None:
            joins = asked_joins(plan, target.joins)
            if sensible(plan, joins) != frozenset(joins):
                raise InfeasibleError(
                    f"target {target.name!r} is infeasible with these joins ({reasons.choice(plan, joins)}), "
                    "whatever cubes sense: not all of them can happen, or they make what never becomes the target"
                )
            clashing, which = reasons.obstacles(plan, joins)[-1:], " and these joins"
        elif not JoinSearch(plan, plan.joins, Clauses(1, self.budget)).holds():
            clashing, which = reasons.obstacles(plan, plan.joins), ", whatever joins are chosen,"
        if not clashing:
            return fewest(plan, joins, self.budget, self.report)
        because = (
            f"target {target.name!r} is infeasible with this sensing ({sensing(senses)}){which} because\n"
            f"{reasons.in_words(plan, clashing)}"
        )
        every = reasons.clashes(plan, plan.joins if joins is None else joins)
        return Ruled(senses, because, True, (reasons.situations(plan, every),), ())

    def explained(self, made: Compiled, ruled: list[Ruled]) -> Compiled:
        """The result, with findings about weaker senses."""
        turned = ", cubes turned in the ways tried" if self.target.tops is None else ""
        weaker = (f"weaker senses{turned}: {'; '.join(map(str, ruled))}",) if ruled else ()
        proofs = tuple(each for each in ruled if each.is_proof)
        certificate = made.certificate and replace(made.certificate, weaker=proofs)
        return replace(made, searched=(*weaker, *made.searched), certificate=certificate)

    def why_not(self, ruled: list[Ruled]) -> str:
        """Why there is no book, or none was found, and what would suffice."""
        proofs = [sensing(each.senses) for each in ruled if each.is_proof]
        if len(proofs) == len(ruled):
            others = f"nor is there one with {'; '.join(proofs[1:])}"
            return f"{ruled[0].text}\n{self.remedy() if self.target.senses is not None else others}"
        open_ = "\n".join(each.text for each in ruled if not each.is_proof)
        out = f"\ninfeasible with {'; '.join(proofs)}" if proofs else ""
        return f"{open_}{out}\n{self.remedy()}"

    def too_late(self, ruled: list[Ruled], following: Sequence[Senses]) -> str:
        """What was decided within the time limit, and what comes next."""
        rest = f"; next: {'; '.join(map(sensing, following[1:]))}" if following[1:] else ""
        so_far = "; ".join(map(str, ruled)) or "nothing"
        return (
            f"target {self.target.name!r}: not decided within {self.budget.time_limit:g} s\nso far: {so_far}\nat work: "
            f"{sensing(following[0])}{rest}. Allow more time, or name senses"
        )

    def remedy(self) -> str:
        """Text that says what would suffice: stronger senses, or unbreakable bonds."""
        own = self.target.senses
        for senses in self.ladder:
            if own is not None and senses != own and _is_stronger(senses, own):
                made = self._quick(senses)
                if isinstance(made, Compiled):
                    return f"{sensing(senses)} are enough: a book of {made.letters} letters does it"
        if self.target.breaks and self.target.joins is None:
            for senses in self.ladder if own is None else (own,):
                made = replace(self, target=replace(self.target, breaks=False))._quick(senses)
                if isinstance(made, Compiled):
                    return (
                        f"if bonds hold (breaks = false), {sensing(senses)} are enough: a book of {made.letters} "
                        "letters does it"
                    )
        tried = "no stronger sensing was" if own is not None else "nothing was"
        return f"{tried} found to be enough in the steps and the time allowed"

    def _quick(self, senses: Senses) -> Compiled | Ruled | None:
        """An attempt with fewer steps; None if it is out of question, or time is up."""
        try:
            return self.rung(senses, REMEDY_STEPS)
        except (InfeasibleError, TimeoutError):
            return None


def _is_stronger(senses: Senses, than: Senses) -> bool:
    """Whether cubes sense all that they did."""
    faces = ("one", "two", "six")
    return faces.index(senses.faces) >= faces.index(than.faces) and all(
        getattr(senses, name) or not getattr(than, name) for name in ("roll", "across", "touched")
    )
