"""Waves of internal rules: word that a stage is complete travels to the seed, and leave for the next travels back.

To begin with, a cube's letter tells all it can know: its orbit, the stage, and whether all that hangs on it is
complete. What of this is needed is found by merging letters (see `merging`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

from kinetics.assembly.compiler.growth import Facts, Letters, Stage, around, beside, explore_stage
from kinetics.assembly.compiler.spanning import distances
from kinetics.assembly.compiler.stages import Course
from kinetics.assembly.faces import Position

ORIGIN = (0, 0, 0)
State = tuple[int, int, bool]  # orbit, stage, all that hangs on it is there


@dataclass(frozen=True)
class _Round:
    """What cubes know of a stage: the orbits around each orbit, and its distance from the seed, once it is complete."""

    expected: dict[int, Counter[int]]
    distance: dict[int, int]


class _Waves:
    """How letters follow each other; every letter stands for a state."""

    def __init__(self, rounds: list[_Round]):
        self.rounds = rounds
        self.codes: dict[State, int] = {}
        self.states: list[State] = []

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
        distance = self.rounds[stage].distance
        near = [self.states[letter] for letter in around(place, letters)]
        inner = [state for state in near if distance[state[0]] < distance[orbit]]
        if is_complete:
            has_leave = all(state[1] > stage for state in inner)
            return self.code(orbit, stage + 1, False) if has_leave else letters[place]
        outer = [state for state in near if distance[state[0]] > distance[orbit]]
        is_waiting = (
            stage == len(self.rounds) - 1
            or Counter(state[0] for state in near) != self.rounds[stage].expected[orbit]
            or not all(state[1:] == (stage, True) for state in outer)
        )
        if is_waiting:
            return letters[place]
        return self.code(orbit, stage, True) if inner else self.code(orbit, stage + 1, False)


def facts_of(course: Course, tick: Callable[[], None] = lambda: None) -> tuple[Facts, int, Letters]:
    """All that is read during a planned growth, with as many letters as it takes; the seed's; those at the end.

    TooManyError: a stage has more than MOST_STATES states.
    """
    orbits = {place: orbit for stage in course.stages for place, orbit in stage.items()}
    seed = max(orbits.values(), default=-1) + 1
    rounds, whole = [], {ORIGIN: seed}
    for coming in course.stages:
        whole = {**whole, **coming}
        rounds.append(_round(whole))
    waves = _Waves(rounds)
    letters = {ORIGIN: waves.code(seed, 0, False)}
    facts = Facts()
    for number, coming in enumerate(course.stages):
        entering = {place: waves.code(orbit, number, False) for place, orbit in coming.items()}
        stage = Stage(course.senses, course.axes, letters, entering, course.required)
        found, letters = explore_stage(stage, course.turns, number == len(rounds) - 1, waves.follow, tick=tick)
        facts.add(found)
    return facts, waves.code(seed, 0, False), letters


def _round(whole: dict[Position, int]) -> _Round:
    """What is known when these places are filled."""
    distance = distances(list(whole), ORIGIN)
    expected = {orbit: Counter(whole[p] for p in beside(place) if p in whole) for place, orbit in whole.items()}
    return _Round(expected, {whole[place]: steps for place, steps in distance.items()})
