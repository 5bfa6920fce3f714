"""The filter over one run, look by look.

With a the probabilities of the states after one look, the next look has the probability a E D 1: E is the transition
matrix of the time between them, by uniformisation, and D has the probability of what is seen in each state on its
diagonal. a E D, scaled to sum to 1, are the probabilities after it: the forward filter of a hidden Markov chain (Baum
et al. 1970, doi:10.1214/aoms/1177697196). All numbers are positive, so that relative errors add up.

The derivative of a E D b, with b what all later looks have as their probability from each state, is that of one mean
at a time, whose adjoint gives it by all rates at once: see `markov.derivatives`.
"""

from __future__ import annotations

from math import log

import numpy as np

from kinetics.markov.derivatives import adjoint_at
from kinetics.markov.panels.bridges import StepSource, missed
from kinetics.markov.panels.carrying import Carried
from kinetics.markov.panels.data import PanelData, PanelRun
from kinetics.markov.panels.panel_step import amplified, too_unlikely
from kinetics.markov.panels.slopes import Slopes
from kinetics.markov.passage.backward import LOST
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.network import Network
from kinetics.support.arrays import Floats


class RunPass:
    """The filter over one run, forwards; it keeps what a gradient needs, or not."""

    def __init__(
        self, steps: StepSource, network: Network, data: PanelData, run: PanelRun, keeps: bool = False
    ) -> None:
        self._network, self._data, self._run = network, data, run
        self._carried: list[Carried] = []
        self.log_likelihood, self.least = 0.0, 1.0
        self._rounded = 0.0
        self.is_certified = all(each.is_certified for each in data.observations.values())
        self.gradient = np.zeros(0)
        self.filtered = [(run.initial, run.chances)]  # states possible before each look, and their chances
        tiny, chances, is_known = [], [], []
        now, part = run.chances, 1.0
        while (found := steps.next(now)) is not None:
            step, chain, there = found.step, found.chain, found.there
            after = step.forwards(network, there[step.ends]) * step.chances(network, data, run)
            probability = float(after.sum())
            if not probability > 0.0:
                raise too_unlikely(run, step.look)
            if keeps:
                self._carried.append(found)
            now = after / probability
            self.log_likelihood += log(probability)
            part *= probability
            if step.look >= 0:
                self.least, part = min(self.least, part), 1.0
                self.filtered.append((step.seen_states, now))
            rounded = ROUNDOFF * (after.size + chain.roundings + len(data.columns) + 8.0)
            self._rounded += found.relative + rounded
            most = 1.0 if step.jumps is None else max(1.0, float(step.jump_rates(network).sum()))
            tiny.append(found.left + LOST * (1 + there.size))
            chances.append(probability / most)
            is_known.append(step.look >= 0 and len(step.seen_states) == 1)
            self.is_certified &= chain.is_certified
            self.is_certified &= step.jumps is None or not step.is_projected  # beyond, an event might be of any rate
        self.filtered.pop()  # after the last look there is none
        share = float(amplified(np.array(tiny), np.array(chances), np.array(is_known)))
        self.is_certified &= share < np.inf
        self._left = share if share < np.inf else 0.0

    @property
    def error(self) -> float:
        """Bound on the error of the log-likelihood, or of what a bridge misses an estimate."""
        return self._rounded + self._left

    def score(self, slopes: Slopes) -> float:
        """Find the derivatives (P,) of the log-likelihood by the logarithms of the parameters, as `gradient`.

        Over bridges, return an estimate of the share of the likelihood that they miss.
        """
        found, lost = np.zeros(slopes.size), 0.0
        later = np.ones(len(self._carried[-1].step.seen_states)) if self._carried else np.ones(1)
        for carried in reversed(self._carried):
            step = carried.step
            seen = step.chances(self._network, self._data, self._run) * later
            values = step.backwards(self._network, seen)
            scale = float(values.max())
            values /= scale
            mean, back, by_entry = adjoint_at(carried.chain, carried.start, values, step.length)
            found += slopes.of_rates(step.states, step.rows, step.channels) @ by_entry / mean
            if step.is_projected:
                lost += missed(carried, by_entry, mean)
            before = carried.there[step.ends]
            if step.jumps is not None:
                there = before[step.jumps.before] * step.jump_rates(self._network)
                there *= seen[step.jumps.after] / scale
                rows = step.ends[step.jumps.before]
                found += slopes.of_rates(step.states, rows, step.jumps.channels) @ there / mean
            if step.look >= 0:
                for p, column in slopes.columns.items():
                    found[p] += float(self._observed(carried, column) @ later) / (scale * mean)
            later = back[step.begins] / mean
        self.gradient = found
        if any(carried.step.is_projected for carried in self._carried):
            self._left, self.is_certified = lost, False
        return lost

    def _observed(self, carried: Carried, column: int) -> Floats:
        """How the probability (F,) of all states after a look changes with the parameter of a column, times that of
        being there."""
        step = carried.step
        there = step.forwards(self._network, carried.there[step.ends])
        observation = list(self._data.observations.values())[column]
        seen = float(self._run.seen[step.look, column])
        if np.isnan(seen) or observation.parameter is None:
            return np.zeros(there.size)
        counted = step.seen_states @ self._data.weights(self._network).T
        others = np.ones(there.size)
        for c, each in enumerate(self._data.observations.values()):
            if c != column and not np.isnan(self._run.seen[step.look, c]):
                others *= each.weights(counted[:, c], float(self._run.seen[step.look, c]))
        return there * others * observation.slopes(counted[:, column], seen) * observation.parameter
