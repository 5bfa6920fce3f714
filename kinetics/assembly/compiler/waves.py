"""Waves of internal rules: a signal that a stage is complete travels to the seed, and permission for the next returns.

To begin with, a cube's letter tells all it can know: its orbit, the stage, and whether all that hangs on it is
complete. What of this is needed is found by merging letters (see `merging`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from kinetics.assembly.compiler.courses import Course
from kinetics.assembly.compiler.growth import Facts, Letters, Stage, around, beside, explore_stage
from kinetics.assembly.compiler.spanning import distances
from kinetics.assembly.faces import Position

ORIGIN, SEED = (0, 0, 0), -1  # where the seed is; its orbit
State = tuple[int, int, bool]  # orbit, stage, all that hangs on it is there


class _Waves:
    """How letters follow each other; every letter stands for a state.

    expected, distance : for each stage, once it is complete, the orbits around each orbit, and how far that is from the
        seed
    """

    def __init__(self, course: Course):
        self.codes: dict[State, int] = {}
        self.states: list[State] = []
        self.expected: list[dict[int, Counter[int]]] = []
        self.distance: list[dict[int, int]] = []
        whole = {ORIGIN: SEED}
        for coming in course.stages:
            whole |= coming
            near = {orbit: Counter(whole[p] for p in beside(place) if p in whole) for place, orbit in whole.items()}
            self.expected.append(near)
            self.distance.append({whole[place]: far for place, far in distances(list(whole), ORIGIN).items()})

    def code(self, orbit: int, stage: int, is_complete: bool) -> int:
        """The letter of a state."""
        state = (orbit, stage, is_complete)
        if state not in self.codes:
            self.codes[state] = len(self.states)
            self.states.append(state)
        return self.codes[state]

    def follow(self, place: Position, letters: Letters) -> int:
        """A cube's letter in the next round: news goes to the seed once all that hangs on the cube is complete; leave
        comes back.
        """
        orbit, stage, is_complete = self.states[letters[place]]
        distance = self.distance[stage]
        near = [self.states[letter] for letter in around(place, letters)]
        inner = [state for state in near if distance[state[0]] < distance[orbit]]
        if is_complete:
            has_leave = all(state[1] > stage for state in inner)
            return self.code(orbit, stage + 1, False) if has_leave else letters[place]
        outer = [state for state in near if distance[state[0]] > distance[orbit]]
        is_waiting = (
            stage == len(self.expected) - 1
            or Counter(state[0] for state in near) != self.expected[stage][orbit]
            or not all(state[1:] == (stage, True) for state in outer)
        )
        if is_waiting:
            return letters[place]
        return self.code(orbit, stage, True) if inner else self.code(orbit, stage + 1, False)


def facts_of(course: Course, tick: Callable[[], None] = lambda: None) -> tuple[Facts, int, Letters]:
    """All that is read during a planned growth, with as many letters as it takes; the seed's; those at the end.

    TooManyError: a stage has more than MOST_STATES states.
    """
    waves, facts = _Waves(course), Facts()
    seed = waves.code(SEED, 0, False)
    letters = {ORIGIN: seed}
    for number, coming in enumerate(course.stages):
        entering = {place: waves.code(orbit, number, False) for place, orbit in coming.items()}
        stage = Stage(course.senses, course.axes, letters, entering, course.required)
        is_last = number == len(course.stages) - 1
        letters = explore_stage(stage, course.turns, is_last, facts, waves.follow, tick=tick)
    return facts, seed, letters
