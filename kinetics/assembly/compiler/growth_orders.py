"""Growth orders in stages: place of the seed, turns of the cubes, and a docking sequence without clashes.

Cubes that symmetry takes into each other come under the same rules: they make an orbit. A cube comes when it touches
all its neighbours of earlier orbits, and nothing else; none has to squeeze in. As every cube learns when the next stage
begins (see `waves`), a place may look like another one as long as their stages differ.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from kinetics.assembly.compiler.budget import OutOfStepsError
from kinetics.assembly.compiler.growth import (
    MOST_STATES,
    TURNS,
    Facts,
    Letters,
    Stage,
    TooManyError,
    Turn,
    beside,
    explore_stage,
    symmetries,
)
from kinetics.assembly.compiler.merging import tables_of
from kinetics.assembly.compiler.orientation import AXES
from kinetics.assembly.compiler.result import InfeasibleError, UndecidedError, sensing
from kinetics.assembly.compiler.spanning import distances
from kinetics.assembly.compiler.target import Target
from kinetics.assembly.deriving.mirror import mirrored
from kinetics.assembly.faces import Position
from kinetics.assembly.rules.conditions import DIRECTIONS, BookTarget, Direction, Senses

LONGEST = 600  # states of a stage; a longer one is cut in two, if it is of more than one orbit
TRIALS = 500  # of orbits in one search for an order of growth
SEEDS = 4  # places tried for the seed where the target names none


@dataclass(frozen=True)
class GrowthOrder:
    """A growth order in stages, with the seed at the origin.

    senses : of the cubes
    axes : of the tops of all cubes
    stages : place -> orbit, for each stage
    required : place -> the places that a cube has to touch when it comes
    turns : those that leave a lone seed as it is
    """

    senses: Senses
    axes: Mapping[Position, int]
    stages: tuple[Mapping[Position, int], ...]
    required: Mapping[Position, frozenset[Position]]
    turns: tuple[Turn, ...]


class NoGrowthOrderError(Exception):
    """There is no growth order: the clash as text; is_proof: all orders were tried."""

    def __init__(self, clash: str, is_proof: bool):
        super().__init__(clash)
        self.is_proof = is_proof


def about(axis: int) -> tuple[Turn, ...]:
    """The 16 turns that leave a lone cube with its top along an axis as it is."""
    return tuple(turn for turn in TURNS if turn.axis(axis) == axis)


# Groups of places under the same rules, and the turns that take the places of a group into each other.
Orbits = tuple[tuple[tuple[Position, ...], ...], frozenset[Turn]]


def orbits_of(places: Sequence[Position], group: Sequence[Turn]) -> list[Orbits]:
    """The orbits of the places under the group and, after it, under its subgroups; largest groups first."""
    subgroups = {frozenset(group)}
    for size in (0, 1, 2):
        subgroups |= {_generated(some) for some in combinations(group, size)}
    found: dict[tuple[tuple[Position, ...], ...], frozenset[Turn]] = {}
    for subgroup in sorted(subgroups, key=lambda g: (-len(g), sorted(map(repr, g)))):
        orbits = tuple(sorted({tuple(sorted({turn.of(place) for turn in subgroup})) for place in places}))
        found.setdefault(orbits, subgroup)
    return list(found.items())


def _generated(turns: Sequence[Turn]) -> frozenset[Turn]:
    """The group that some turns generate."""
    members = {Turn((0, 1, 2), (1, 1, 1))}
    fresh = set(members)
    while fresh:
        fresh = {turn.after(member) for turn in turns for member in fresh} - members
        members |= fresh
    return frozenset(members)


class Planner:
    """Depth-first search for an order of growth.

    senses : of the cubes
    orbits : they come one after the other
    axis : of the seed's top, at the origin; fixed : of all others, if given; else any that suits
    budget : most trials of an orbit
    """

    def __init__(
        self,
        senses: Senses,
        orbits: Orbits,
        axis: int,
        fixed: Mapping[Position, int] | None,
        budget: int,
    ):
        self.senses, self.fixed, self.budget = senses, fixed, budget
        self.orbits, self.group = orbits
        self.orbit_of = {place: number for number, orbit in enumerate(self.orbits) for place in orbit}
        self.axis, self.turns = axis, about(axis)
        self.order: list[tuple[int, bool]] = []  # orbit, and whether a stage begins with it
        self.failed: set[frozenset[tuple[Position, int]]] = set()
        self.clash = ""
        self.is_proof = True  # as long as nothing was left out

    def plan(self, tick: Callable[[], None] = lambda: None) -> GrowthOrder:
        """The stages.

        tick : called again and again; it may raise to end the search
        NoGrowthOrderError: there is no such order, or none within the budget.
        """
        self.tick = tick
        origin = (0, 0, 0)
        axes, required = {origin: self.axis}, {origin: frozenset[Position]()}
        if not self._extend(axes, required, {origin: self.orbit_of[origin]}, {}):
            raise NoGrowthOrderError(self.clash, self.is_proof and self.budget > 0)
        stages: list[dict[Position, int]] = []
        for orbit, is_first in self.order:
            if is_first or not stages:
                stages.append({})
            stages[-1].update(dict.fromkeys(self.orbits[orbit], orbit))
        return GrowthOrder(self.senses, axes, tuple(stages), required, self.turns)

    def _extend(
        self,
        axes: dict[Position, int],
        required: dict[Position, frozenset[Position]],
        standing: Letters,
        coming: Letters,
    ) -> bool:
        """Let all other orbits come; whether that works; axes and required are filled up."""
        if len(axes) == len(self.orbit_of):
            return True
        state = frozenset(axes.items())
        if state in self.failed:
            return False
        candidates = list(self._candidates(axes))
        for cut in (False, True) if coming else (True,):
            base, batch = ({**standing, **coming}, {}) if cut else (standing, coming)
            for orbit, tops, needs in candidates:
                if self.budget <= 0:
                    return False
                self.budget -= 1
                self.tick()
                axes.update(tops)
                required.update(needs)
                grown = {**batch, **dict.fromkeys(self.orbits[orbit], orbit)}
                if self._fits(Stage(self.senses, axes, base, grown, required), len(axes) == len(self.orbit_of)):
                    self.order.append((orbit, cut))
                    if self._extend(axes, required, base, grown):
                        return True
                    self.order.pop()
                for place in tops:
                    del axes[place], required[place]
        self.failed.add(state)
        return False

    def _candidates(
        self, axes: Mapping[Position, int]
    ) -> Iterator[tuple[int, dict[Position, int], dict[Position, frozenset[Position]]]]:
        """Orbits that may come next, with the axes of their cubes and what they touch; those near the seed first."""
        found = []
        for number, orbit in enumerate(self.orbits):
            if orbit[0] in axes:
                continue
            needs = {place: frozenset(p for p in beside(place) if p in axes) for place in orbit}
            if not needs[orbit[0]] or any(is_tight(place, touched) for place, touched in needs.items()):
                continue
            for tops in self._tops(orbit):
                step = abs(orbit[0][self.axis]), sum(map(abs, orbit[0]))
                found.append(((*step, [tops[p] for p in orbit], number), number, tops, needs))
        return iter([(number, tops, needs) for _, number, tops, needs in sorted(found, key=lambda f: f[0])])

    def _tops(self, orbit: tuple[Position, ...]) -> Iterator[dict[Position, int]]:
        """The axes that the cubes of an orbit may have."""
        if self.fixed is not None:
            yield {place: self.fixed[place] for place in orbit}
            return
        for axis in (2, 0, 1):
            tops = {(turn.of(orbit[0]), turn.axis(axis)) for turn in self.group}
            if len(tops) == len(orbit):  # else a turn leaves a place as it is, but not its axis
                yield dict(tops)

    def _fits(self, stage: Stage, is_last: bool) -> bool:
        """Whether no cube of the stage can be mistaken."""
        is_short = len(set(stage.coming.values())) == 1
        facts, most = Facts(), MOST_STATES if is_short else LONGEST
        try:
            explore_stage(stage, self.turns, is_last, facts, most=most, tick=self.tick)
        except TooManyError:
            self.is_proof &= not is_short
            return False
        if tables_of(facts) is not None:
            return True
        self.clash = clash_words(facts, stage)
        return False


def is_tight(place: Position, touched: frozenset[Position]) -> bool:
    """Whether a cube would dock between two opposite ones, which leave little room to enter."""
    six = beside(place)
    return any(a in touched and b in touched for a, b in zip(six[::2], six[1::2], strict=True))


def clash_words(facts: Facts, stage: Stage) -> str:
    """The clash as text: which cube reads the same as one that must not dock."""
    for event in facts.events:
        bad = sorted(event & facts.forbidden)
        if len(bad) == len(event):
            place = facts.examples[bad[0]]
            where = sorted(p for p in stage.coming if stage.coming[p] == facts.events[event])
            guest = bad[0][1]
            twist = f", axes {guest.roll}" if guest.roll else ""
            beside_it = f", touching {len(guest.touched)} cubes" if guest.touched else ""
            return (
                f"with {len(stage.standing)} cubes standing, a cube at {where[0]} cannot be told from one that must "
                f"not come, as at {place}: it docks with {guest.face} on {guest.partner_face}{twist}{beside_it}"
            )
    return f"with {len(stage.standing)} cubes standing, cubes that look alike would have to become different ones"


def planned_order(target: Target, senses: Senses, tick: Callable[[], None]) -> tuple[GrowthOrder, Position]:
    """A growth order, and the place of the seed.

    tick : called again and again; its OutOfStepsError ends the search
    InfeasibleError: there is none for cubes with these senses; UndecidedError: none was found.
    """
    head = f"with this sensing ({sensing(senses)})"
    if not _is_its_mirror_image(target.positions, target.tops):
        raise InfeasibleError(
            f"target {target.name!r} is infeasible {head} because it differs from its mirror image, and cubes with two "
            "face types cannot tell left from right; use six face types"
        )
    clashes: list[str] = []
    all_tried, within = True, ""
    for search, root in _searches(target, senses):
        try:
            order = search.plan(tick)
        except NoGrowthOrderError as error:
            clashes.append(str(error))
            all_tried &= error.is_proof
        except OutOfStepsError:
            within = " within the steps allowed"
            break
        else:
            tops = tuple([AXES[order.axes[minus(place, root)]] for place in target.positions])
            orbits = {place: orbit for stage in order.stages for place, orbit in stage.items()}
            letters = tuple([str(orbits.get(minus(place, root))) for place in target.positions])
            if _is_its_mirror_image(target.positions, tops, letters):
                return order, root
            clashes.append(
                "cubes that arrive in this order cannot distinguish left from right, and either form is completed"
            )
            all_tried = False  # there may be other orders
    if all_tried and target.seed is not None and not within:
        raise InfeasibleError(
            f"target {target.name!r} is infeasible {head} from this seed, by growth in which each cube docks after "
            f"all its earlier neighbours and none is squeezed in, because {clashes[0]}"
        )
    clash = f"; the first clash: {clashes[0]}" if clashes else ""
    raise UndecidedError(f"target {target.name!r}: not found{within} {head}{clash}")


def _is_its_mirror_image(
    places: tuple[Position, ...], tops: tuple[Direction, ...] | None, letters: tuple[str, ...] = ()
) -> bool:
    """Whether cubes at these places, with these tops and letters, can be turned into their mirror image."""
    scheme = "one" if tops is None else "two"
    placed = BookTarget(cubes=places, letters=letters or ("",) * len(places), tops=tops).structure()
    return mirrored(placed).canonical(scheme) == placed.canonical(scheme)


def _searches(target: Target, senses: Senses) -> Iterator[tuple[Planner, Position]]:
    """What is tried: seeds, the axes of the cubes, which of them come under the same rules."""
    for root in roots(target)[:SEEDS]:
        places = [minus(place, root) for place in target.positions]
        for axes in _axes(target, places):
            for axis in (2, 0, 1) if axes is None else (axes[0, 0, 0],):
                for orbits in orbits_of(places, symmetries(about(axis), dict.fromkeys(places, 0), axes)):
                    yield Planner(senses, orbits, axis, axes, TRIALS), root


def roots(target: Target) -> list[Position]:
    """Places for the seed, the best first."""
    if target.seed is not None:
        return [target.seed]
    places = target.positions
    reach = {place: max(distances(places, place).values()) for place in places}
    middle = [(min(c) + max(c)) / 2 for c in zip(*places, strict=True)]
    return sorted(places, key=lambda place: (reach[place], math.dist(place, middle), place))


def _axes(target: Target, places: list[Position]) -> Iterator[Mapping[Position, int] | None]:
    """Axes of the tops: as asked; or all alike, then as they come (None)."""
    if target.tops is not None:
        yield {place: DIRECTIONS.index(top) // 2 for place, top in zip(places, target.tops, strict=True)}
        return
    for axis in (2, 0, 1):
        yield dict.fromkeys(places, axis)
    yield None


def minus(place: Position, root: Position) -> Position:
    """A place as seen from another one."""
    return place[0] - root[0], place[1] - root[1], place[2] - root[2]
