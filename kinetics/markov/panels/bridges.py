"""Steps over the states that matter to both ends: reached from the earlier looks, and leading to the later ones.

Between two looks the states that matter are those of a bridge: with p the probability to be in a state coming from the
looks before, and h that of the looks after it from there, those that hold nearly all of the sum of p h. They are far
fewer than those that hold nearly all of the sum of p. What leaves them is no small probability, though, only one that
hardly leads to what was seen; how much of it would come back is an estimate: as much as from the last state before it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from kinetics.markov.panels.carrying import SHORT, Carried, carry
from kinetics.markov.panels.data import PanelData, PanelRun
from kinetics.markov.panels.panel_step import PanelStep
from kinetics.markov.passage.backward import uniformised
from kinetics.markov.passage.until import Mask
from kinetics.markov.transient.projection import largest
from kinetics.network import Network
from kinetics.support.arrays import Floats

CUT = 1e-10  # of the probability of what was seen, for the states that are dropped from each step
PARTS = 4  # of a step, between which p h is looked at too
AROUND = 3  # events by which the states kept are extended: between two ends of a step the probability moves on


class StepSource(Protocol):
    """Steps that come one after the other."""

    def next(self, now: Floats) -> Carried | None:
        """The next step from the probabilities now (M,); None after the last."""


class KnownSteps:
    """Steps that were found before, at the rates of a network."""

    def __init__(self, steps: Sequence[PanelStep], network: Network) -> None:
        self._steps, self._network = iter(steps), network

    def next(self, now: Floats) -> Carried | None:
        """The next step from the probabilities now (M,); None after the last."""
        step = next(self._steps, None)
        return None if step is None else carry(step, self._network, now)


class Narrowing:
    """Steps of a run as they are found; where they are over likely states, `steps` are over those of the bridges.

    Each time that the state is known, the part before it is narrowed, and its likely states are forgotten.

    narrows : whether bridges are asked for; if not, steps over likely states are left out, and not `is_whole`
    """

    def __init__(self, found: StepSource, network: Network, data: PanelData, run: PanelRun, narrows: bool) -> None:
        self._found, self._network, self._data, self._run = found, network, data, run
        self._narrows, self.is_whole = narrows, True
        self._part: list[Carried] = []
        self.steps: list[PanelStep] = []

    def next(self, now: Floats) -> Carried | None:
        """The next step from the probabilities now (M,); None after the last."""
        carried = self._found.next(now)
        if carried is not None and carried.step.is_projected and not self._narrows:
            self.is_whole = False
        elif carried is not None:
            self._part.append(carried)
        if self._part and (carried is None or (carried.step.look >= 0 and len(carried.step.seen_states) == 1)):
            self.steps += narrowed(self._part, self._network, self._data, self._run)
            self._part = []
        return carried


def narrowed(part: Sequence[Carried], network: Network, data: PanelData, run: PanelRun) -> list[PanelStep]:
    """Steps over the states that matter to both ends of a part of a run; as they are, where all states are there."""
    if not any(each.step.is_projected for each in part):
        return [each.step for each in part]
    kept: list[Mask] = []
    later = np.ones(len(part[-1].step.seen_states))
    for each in reversed(part):
        step = each.step
        values = step.backwards(network, step.chances(network, data, run) * later)
        values /= values.max()
        held, back = _along(each, values)
        probability = float(each.start @ back)
        kept.append(_around(step, largest(held[:-2] / probability, CUT)))
        later = back[step.begins] / probability
    kept.reverse()
    steps = [each.step for each in part]
    begins = [states[step.begins] for step, states in zip(steps, kept, strict=True)]
    begins[0][:] = True
    lasts = [*begins[1:], np.ones(len(steps[-1].seen_states), dtype=bool)]
    return [
        _narrowed(step, states, first, last)
        for step, states, first, last in zip(steps, kept, begins, lasts, strict=True)
    ]


def _along(carried: Carried, values: Floats) -> tuple[Floats, Floats]:
    """Sums (N + 2,) of p h at both ends of a step and between them, and the values h at its beginning.

    A step from one state to one other leads through many: their p h is 0 at both ends.
    """
    chain, times = carried.chain, [carried.step.length * part / PARTS for part in range(1, PARTS + 1)]
    there, _ = uniformised(chain, carried.start, times, is_backwards=False, left_out=SHORT)
    later, _ = uniformised(chain, values, times, is_backwards=True, left_out=SHORT)
    held = np.vstack([carried.start, there]) * np.vstack([later[::-1], values])
    return held.sum(axis=0), later[-1]


def _narrowed(step: PanelStep, kept: Mask, begins: Mask, lasts: Mask) -> PanelStep:
    """A step over the states kept (N,), from some of its begins (M,) to some of the states after it (F,)."""
    step = step.with_begins(begins).with_ends(lasts)
    kept = kept.copy()
    kept[step.begins] = kept[step.ends] = True
    return step.within(kept, len(kept))


def _around(step: PanelStep, kept: Mask) -> Mask:
    """The states kept (N,), and those around them within some events."""
    found = np.append(kept, [False, False])
    for _ in range(AROUND):
        found[np.append(step.columns[found[step.rows]], step.rows[found[step.columns]])] = True
        found[-2:] = False
    return found[:-2]


def missed(carried: Carried, by_entry: Floats, mean: float) -> float:
    """Estimate of the share of what was seen that a step over a bridge misses.

    by_entry : (K,) derivatives of the mean by the logarithm of each rate

    What leaves the states is taken to lead there with the probability of the state that it left: the derivative by the
    rate of leaving, but for its sign.
    """
    goes = carried.chain.columns == len(carried.step.states)
    return -float(by_entry[goes].sum()) / mean
