"""The likelihood of counts seen at some times, with bounds, and its gradient by all parameters.

The bounds are proven where counts are exact or rounded and the state is known often enough (`amplified`).

With a the probabilities of the states after one look, the next look has the probability a E D 1: E is the transition
matrix of the time between them, by uniformisation, and D has the probability of what is seen in each state on its
diagonal. a E D, scaled to sum to 1, are the probabilities after it: the forward filter of a hidden Markov chain (Baum
et al. 1970, doi:10.1214/aoms/1177697196). All numbers are positive, so that relative errors add up.

The derivative of a E D b, with b what all later looks have as their probability from each state, is that of one mean
at a time, whose adjoint gives it by all rates at once: see `markov.derivatives`.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import expm1, inf, log
from typing import Any

import numpy as np

from kinetics.markov.derivatives import adjoint_at
from kinetics.markov.panels.base import Likelihood, Observed, Scored
from kinetics.markov.panels.bridges import KnownSteps, Narrowing, StepSource, missed
from kinetics.markov.panels.carrying import Carried
from kinetics.markov.panels.data import PanelData, PanelRun
from kinetics.markov.panels.few_states import FewPass, FewStates
from kinetics.markov.panels.moving_windows import StepFinder
from kinetics.markov.panels.panel_step import PanelStep, amplified
from kinetics.markov.panels.slopes import Slopes
from kinetics.markov.passage.backward import LOST
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.search import MAX_STATES
from kinetics.network import Model, Network
from kinetics.network.network import check_homogeneous
from kinetics.support.answer import Answer, kind_of
from kinetics.support.arrays import Floats, Ints

METHOD = "forward filter by uniformisation"
LARGEST = 700.0  # error of a logarithm beyond which nothing is known
MOST_MISSED = 1e-6  # of the likelihood, before its bridges are found anew
UNLIKELY = 1e-9  # probability of a look, below which likely states do not hold its bridge to many digits


@dataclass(frozen=True, eq=False)
class PanelLikelihood(Likelihood):
    """The log-likelihood of panel data, at any values of the parameters of a model.

    model : its network; counts at time 0 come with the data
    data : runs, columns and how they were observed
    max_states : the most states between two looks; more are refused

    Which states matter is found once; each value takes one pass over them. Of a network that can reach more states than
    are worth listing, a value alone has proven bounds, from all likely states, which are found anew each time. With
    derivatives it is an estimate: it takes only the states that matter to both looks, far fewer, and keeps them.

    ValueError: the rates depend on the time, or a look cannot be reached

    >>> from kinetics import Model, Network
    >>> from kinetics.markov.panels import PanelData, PanelLikelihood, PanelRun
    >>> decay = Model.of(Network.from_text("A -> B, k", k=0.5))
    >>> asked = PanelLikelihood(decay, PanelData({"A": {"A": 1}}, [PanelRun([10, 0], [1.0], [[4]])]))
    >>> found = asked.scored({"k": 0.5}, ["k"])  # binomial: 4 of 10 survive with probability exp(-k)
    >>> round(found.answer.value, 6), found.gradient.round(6).tolist()
    (-2.249405, [2.624482])
    """

    model: Model
    data: PanelData
    max_states: int = MAX_STATES
    _known: dict[tuple[float, ...], _Structure] = field(default_factory=dict, repr=False)

    def scored(self, point: Mapping[str, float] | None, names: Sequence[str]) -> Scored:
        """The log-likelihood and its derivatives by the logarithms of the parameters `names`."""
        began = time.process_time()
        network, data = self.network_at(point or {}), self.data_at(point or {})
        total, error, gradient, certified = 0.0, 0.0, np.zeros(len(names)), True
        slopes = self._slopes(network, point or {}, names, list(data.columns))
        for passed, copies in self._passes(network, data, slopes):
            total += copies * passed.log_likelihood
            error += copies * passed.error
            certified &= passed.is_certified
            gradient += copies * passed.gradient
        error = 1.01 * (expm1(error) if error < LARGEST else inf) + 4.0 * ROUNDOFF * (data.looks + 1) * (
            1.0 + abs(total)
        )
        why = f"{data.looks} looks at {len(data.runs)} runs"
        answer = Answer(
            total, total - error, total + error, kind_of(certified), METHOD, time.process_time() - began, why
        )
        return Scored(answer, gradient)

    @property
    def observed(self) -> Mapping[str, Observed]:
        """The parameters of observations, by column."""
        models = self.data.observations.items()
        return {name: Observed(each.parameter, each.most) for name, each in models if each.parameter is not None}

    @property
    def data_digest(self) -> str:
        """SHA-256 of what was seen."""
        return self.data.digest

    @property
    def size(self) -> dict[str, Any]:
        """Numbers of runs and looks, and the observation model of each column."""
        models = {name: {"model": each.name, **vars(each)} for name, each in self.data.observations.items()}
        return {"runs": len(self.data.runs), "looks": self.data.looks, "observed": models}

    @property
    def longest(self) -> float:
        """The time, tu, from the start of the longest run to its last look."""
        return max(float(run.times[-1] - run.start) for run in self.data.runs)

    def data_at(self, point: Mapping[str, float]) -> PanelData:
        """The data, with observations at these values."""
        seen = {name: value for name, value in point.items() if name in self.observed}
        return self.data.with_observed(**seen) if seen else self.data

    def filtered(self, point: Mapping[str, float] | None = None) -> list[list[tuple[Ints, Floats]]]:
        """Of each run, before each of its looks: the states (n, S) possible just after the last one, and their
        probabilities (n,) given all that was seen until then."""
        network, data = self.network_at(point or {}), self.data_at(point or {})
        structure, nothing = self._structure(network), self._slopes(network, point or {}, ())
        if structure.few is not None:
            together = FewPass(structure.few, network, data, nothing)
            if together.fits():
                return together.filtered
        return [self._pass(structure.steps, r, network, data, nothing).filtered for r in range(len(data.runs))]

    def _passes(self, network: Network, data: PanelData, slopes: Slopes) -> Iterator[tuple[_Pass | FewPass, int]]:
        """One pass over all runs where states are few, else one for all runs that are alike, and how many these are."""
        structure = self._structure(network)
        if structure.few is not None:
            together = FewPass(structure.few, network, data, slopes)
            if together.fits():
                yield together, 1
                return
        for r, copies in self._alike.items():
            yield self._pass(structure.steps, r, network, data, slopes), copies

    def _pass(
        self, known: dict[int, list[PanelStep]], r: int, network: Network, data: PanelData, slopes: Slopes
    ) -> _Pass:
        """One pass over a run: with proven bounds, or for a gradient over the bridges, which are found first."""
        run, steps, narrows = data.runs[r], known.get(r), bool(slopes.size)
        if steps is not None and (narrows or not any(step.is_projected for step in steps)):
            passed = _Pass(KnownSteps(steps, network), network, data, run, keeps=narrows)
            if not narrows or passed.score(slopes) < MOST_MISSED or passed.least < UNLIKELY:
                return passed
        bridges = Narrowing(StepFinder(network, data, run, self.max_states), network, data, run, narrows)
        passed = _Pass(bridges, network, data, run, keeps=False)
        if bridges.is_whole:
            known[r] = bridges.steps
        if narrows:
            passed = _Pass(KnownSteps(bridges.steps, network), network, data, run, keeps=True)
            passed.score(slopes)
        return passed

    @cached_property
    def _alike(self) -> dict[int, int]:
        """The first of all runs that are alike, such as snapshots, and their number."""
        first: dict[tuple[bytes | float, ...], int] = {}
        found: dict[int, int] = {}
        for r, run in enumerate(self.data.runs):
            arrays = (run.initial, run.times, run.seen, run.fired)
            place = first.setdefault((run.start, *(np.asarray(each).tobytes() for each in arrays)), r)
            found[place] = found.get(place, 0) + 1
        return found

    def _structure(self, network: Network) -> _Structure:
        """What does not depend on the rates but for which of them are 0; of rate laws, on no change of a parameter."""
        happens = (network.known_rates > 0).astype(float).tolist()
        key = (*happens, *(network.parameters.values() if network.laws else ()))
        if key not in self._known:
            self._known.clear()
            self._known[key] = _Structure(network, self.data)
        return self._known[key]


class _Structure:
    """All states, where they are few; else the steps of each run, by its place among all, once they were found."""

    def __init__(self, network: Network, data: PanelData) -> None:
        check_homogeneous(network)
        self.few = FewStates.of(network, data)
        self.steps: dict[int, list[PanelStep]] = {}


class _Pass:
    """The filter over one run, forwards; it keeps what a gradient needs, or not."""

    def __init__(self, steps: StepSource, network: Network, data: PanelData, run: PanelRun, keeps: bool) -> None:
        self._network, self._data, self._run = network, data, run
        self._carried: list[Carried] = []
        self.log_likelihood, self.least = 0.0, 1.0
        self._rounded = 0.0
        self.is_certified = all(each.is_certified for each in data.observations.values())
        self.gradient = np.zeros(0)
        self.filtered = [(run.initial[None, :], np.ones(1))]  # states possible before each look, and their chances
        tiny, chances, is_known = [], [], []
        now, part = np.ones(1), 1.0
        while (found := steps.next(now)) is not None:
            step, chain, there = found.step, found.chain, found.there
            after = step.forwards(network, there[step.ends]) * step.chances(network, data, run)
            probability = float(after.sum())
            if not probability > 0.0:
                raise ValueError(
                    f"{run.named(step.look)}: this has a probability below 1e-300 at these rates; begin with other "
                    f"values"
                )
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


def log_likelihood(model: Model | Network, data: PanelData) -> Answer:
    """The logarithm of the probability of panel data, with bounds; see `PanelLikelihood`.

    >>> from kinetics import Network
    >>> from kinetics.markov.panels import PanelData, PanelRun, log_likelihood
    >>> decay = Network.from_text("A -> B, 1")
    >>> log_likelihood(decay, PanelData({"A": {"A": 1}}, [PanelRun([1, 0], [2.0], [[1]])])).value
    -2.0
    """
    return PanelLikelihood(Model.of(model), data).value()
