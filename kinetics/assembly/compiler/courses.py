"""Candidate courses of growth: where the seed is, how the cubes are oriented, and which of them share rules."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping

from kinetics.assembly.compiler.budget import OutOfStepsError
from kinetics.assembly.compiler.growth import symmetries
from kinetics.assembly.compiler.orientation import AXES
from kinetics.assembly.compiler.result import InfeasibleError, UndecidedError, sensing
from kinetics.assembly.compiler.spanning import distances
from kinetics.assembly.compiler.stages import Course, NoCourseError, Planner, about, orbits_of
from kinetics.assembly.compiler.target import Target
from kinetics.assembly.deriving.mirror import mirrored
from kinetics.assembly.faces import Position
from kinetics.assembly.rules.conditions import DIRECTIONS, BookTarget, Direction, Senses

TRIALS = 500  # of orbits in one search for an order of growth
SEEDS = 4  # places tried for the seed where the target names none


def planned_course(target: Target, senses: Senses, tick: Callable[[], None]) -> tuple[Course, Position]:
    """An order of growth, and where the seed is.

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
            course = search.plan(tick)
        except NoCourseError as error:
            clashes.append(str(error))
            all_tried &= error.is_proof
        except OutOfStepsError:
            within = " within the steps allowed"
            break
        else:
            tops = tuple([AXES[course.axes[minus(place, root)]] for place in target.positions])
            orbits = {place: orbit for stage in course.stages for place, orbit in stage.items()}
            letters = tuple([str(orbits.get(minus(place, root))) for place in target.positions])
            if _is_its_mirror_image(target.positions, tops, letters):
                return course, root
            clashes.append("cubes that come in this order cannot tell left from right, and finish in either way")
            all_tried = False  # there may be other orders
    if all_tried and target.seed is not None and not within:
        raise InfeasibleError(
            f"target {target.name!r} is infeasible {head} from this seed, by growth in which a cube comes when all its "
            f"earlier neighbours are there and none is squeezed in, because {clashes[0]}"
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
