"""What the accuracy diagram measures: mean speed, encounter rate, hits on bonds, and breaks where they are enough.

To add a quantity, write it into `QUANTITIES` with a `Meter` that watches a trial's tank. Trials, table, JSON, figure
and presets read that tuple.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mechsim.accuracy.changes import RelativeChange
from mechsim.effects.faces import FINEST, FacesWithinReach
from mechsim.effects.latches import Encounter
from mechsim.inspection.speeds import mean_speed
from mechsim.runs.load_log import LoadLog
from mechsim.scene import Scene

if TYPE_CHECKING:
    from mechsim.effects.hits import Hit
    from mechsim.runs.record import RunSpec
    from mechsim.world.world import World

TAIL = 0.5  # of the threshold: the load above which hits are logged


class Meter:
    """A quantity being measured in one tank."""

    seen: float = 0

    def after_step(self) -> None:
        """Look at the step just made."""

    def total(self) -> float:
        """All that it has seen so far: a count, or a sum over steps."""
        return self.seen


@dataclass(frozen=True)
class Quantity:
    """One thing that is measured at every setting and compared.

    name : of its columns, and of its array in a trial's record; title : in words, for tables and plots
    unit : of its mean
    needs : the effect without which a scene has none of it
    attach : measures it in a world, given the whole scene with the effects that the tank leaves out
    carriers : how many of what its mean is given for one of are in a tank
    of_structures : it is measured in a tank of structures that neither join nor break; else in one of single cubes
    is_count : counted, and compared as a rate; else averaged over the steps
    is_in_runs : runs of the scene do the same work, so that it counts as cost
    least : events that it needs on either side before it is compared
    is_wide : its interval is far wider than the others': against a tolerance counts only what it shows to be wrong
    """

    name: str
    title: str
    unit: str
    needs: str | None
    attach: Callable[[Scene, World], Meter]
    carriers: Callable[[RunSpec], float]
    of_structures: bool = False
    is_count: bool = True
    is_in_runs: bool = False
    least: int = 1
    is_wide: bool = False

    def is_of(self, scene: Scene) -> bool:
        """Can it be measured for this scene?"""
        return self.needs is None or scene.effect(self.needs) is not None

    def against(self, change: RelativeChange) -> float:
        """The error that counts where a preset asks for a tolerance."""
        return change.shown if self.is_wide else change.limit


class SumOfSpeeds(Meter):
    """Mean speed of the bodies, step by step."""

    def __init__(self, world: World):
        self.world = world

    def after_step(self) -> None:
        """Add the mean over the bodies."""
        self.seen += mean_speed(self.world.bodies, self.world.bodies.live)


class MeetingsSeen(Meter):
    """Meetings of faces within the reach of the scene's bonding."""

    def __init__(self, scene: Scene, world: World):
        self.look = counter(scene, world)

    def after_step(self) -> None:
        """Count those that began in this step."""
        self.seen = self.look()


class HitsLogged(Meter):
    """Collisions that load a bond above a share of the threshold at which it breaks."""

    def __init__(self, scene: Scene, world: World, share: float):
        breaking = scene.effect("breaking")
        assert breaking is not None  # noqa: S101 - `is_of` was asked
        self.world, self.above, self.log = world, share * breaking.threshold, LoadLog()
        world.hit_listeners.append(self.note)

    def note(self, hit: Hit) -> None:
        """Take a hit of this step."""
        self.log.add(self.world.step_count, self.world.time, hit)

    def total(self) -> float:
        """A collision counts once, by its largest load."""
        return float(sum(row.hit.load > self.above for row in self.log.rows))


def pairs(spec: RunSpec) -> float:
    """Pairs of cubes in a tank."""
    return spec.n_cubes * (spec.n_cubes - 1) / 2


def breakable(spec: RunSpec) -> float:
    """Structures in a tank that could break."""
    return sum(bool(structure.bonds) for structure in spec.start)


SPEED = Quantity(
    *("speed", "mean speed", "length/tu (mean over the phase of the hold)", None),
    attach=lambda _, world: SumOfSpeeds(world),
    carriers=lambda _: 1.0,
    is_count=False,
)
MEETINGS = Quantity(
    *("meetings", "encounter rate", "meetings a pair of cubes and tu", "bonding"),
    attach=MeetingsSeen,
    carriers=pairs,
    is_in_runs=True,
)
# Breaks are rare. Hits above half the threshold are some 90 times as many (line4), so that they can be measured, and
# stand for them: that an error in this part of the tail is one of the breaks is assumed, not shown.
LOADS = Quantity(
    *("loads", "rate of hits above half the threshold", "hits a structure and tu", "breaking"),
    attach=lambda scene, world: HitsLogged(scene, world, TAIL),
    carriers=breakable,
    of_structures=True,
    least=20,
    is_wide=True,
)
BREAKS = Quantity(
    *("breaks", "rate of hits that would break", "breaks a structure and tu", "breaking"),
    attach=lambda scene, world: HitsLogged(scene, world, 1.0),
    carriers=breakable,
    of_structures=True,
    least=100,
    is_wide=True,
)
QUANTITIES = (SPEED, MEETINGS, LOADS, BREAKS)
BY_NAME = {quantity.name: quantity for quantity in QUANTITIES}


def counter(scene: Scene, world: World, in_passing: bool = True, finest: float = FINEST) -> Callable[[], int]:
    """A count of the meetings so far, to be asked after every step; ValueError where the scene has no bonding.

    in_passing, finest : meetings that begin and end between two calls count, too; see `FacesWithinReach`

    A meeting is what the latch `encounter` takes for one: two faces come within the bonding's reach after they were out
    of it for the refractory time. Any two faces count, whatever the rules: a free cube moves alike whichever way it is
    turned, so the rate of those that may bond is a fixed share of it, and more meetings mean less scatter.
    """
    bonding = scene.effect("bonding")
    if bonding is None:
        raise ValueError(f"scene {scene.name} lists no bonding, so there is no distance at which faces meet: add it")
    latch = bonding.latch if isinstance(bonding.latch, Encounter) else Encounter(probability=1.0)
    meetings = latch.attach(world, world.stream("bonding"))
    sideways = bonding.sideways * world.bodies.edge
    faces = FacesWithinReach(world, bonding.capture_distance, bonding.capture_angle, sideways, in_passing, finest)

    def count() -> int:
        for i, face, j, other in faces.within_reach().tolist():
            meetings((i, face, j, other))
        return meetings.begun

    return count
