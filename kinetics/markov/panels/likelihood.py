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

import numpy as np

from kinetics.markov.derivatives import ChannelEntries, gradient_at
from kinetics.markov.panels.base import Likelihood, Observed, Scored
from kinetics.markov.panels.data import PanelData, PanelRun
from kinetics.markov.panels.few_states import FewPass, FewStates
from kinetics.markov.panels.panel_step import PanelStep, amplified, carried, chances_of
from kinetics.markov.panels.slopes import Slopes
from kinetics.markov.passage.backward import LEFT_OUT, LOST, expected_from_all
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.search import MAX_STATES
from kinetics.markov.transient.transitions import totals
from kinetics.network import Model, Network
from kinetics.network.network import check_homogeneous
from kinetics.support.answer import Answer, kind_of
from kinetics.support.arrays import Floats, Ints

METHOD = "forward filter by uniformisation"
FORGOTTEN = 1e-60  # of the Poisson probability, before a look after which the state is known
LARGEST = 700.0  # error of a logarithm beyond which nothing is known
MOST_LOST = 1e-8  # of the probability of a look, before the likely states are found anew


@dataclass(frozen=True, eq=False)
class PanelLikelihood(Likelihood):
    """The log-likelihood of panel data, at any values of the parameters of a model.

    model : its network; counts at time 0 come with the data
    data : runs, columns and how they were observed
    max_states : the most states between two looks; more are refused

    Which states matter is found once; each value takes one pass over them.

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
        for passed, copies in self._passes(network, data, len(names)):
            total += copies * passed.log_likelihood
            error += copies * passed.error
            certified &= passed.is_certified
            if names:
                gradient += copies * passed.gradient(slopes)
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

    def data_at(self, point: Mapping[str, float]) -> PanelData:
        """The data, with observations at these values."""
        seen = {name: value for name, value in point.items() if name in self.observed}
        return self.data.with_observed(**seen) if seen else self.data

    def filtered(self, point: Mapping[str, float] | None = None) -> list[list[tuple[Ints, Floats]]]:
        """Of each run, before each of its looks: the states (n, S) possible just after the last one, and their
        probabilities (n,) given all that was seen until then."""
        network, data = self.network_at(point or {}), self.data_at(point or {})
        structure = self._structure(network)
        if structure.few is not None:
            together = FewPass(structure.few, network, data)
            if together.fits(0):
                return together.filtered
        return [_Pass(structure.steps_of(data, r, run), network, data, run).filtered for r, run in enumerate(data.runs)]

    def _passes(self, network: Network, data: PanelData, parameters: int) -> Iterator[tuple[_Pass | FewPass, int]]:
        """One pass over all runs where states are few, else one for all runs that are alike, and how many these are."""
        structure = self._structure(network)
        if structure.few is not None:
            together = FewPass(structure.few, network, data)
            if together.fits(parameters):
                yield together, 1
                return
        for r, copies in self._alike.items():
            run = data.runs[r]
            passed = _Pass(structure.steps_of(data, r, run), network, data, run)
            if passed.lost > MOST_LOST:  # the states were likely at other rates
                passed = _Pass(structure.renewed(network).steps_of(data, r, run), network, data, run)
            yield passed, copies

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
            self._known[key] = _Structure(network, self.data, self.max_states)
        return self._known[key]


class _Structure:
    """The states between looks, found when first asked for."""

    def __init__(self, network: Network, data: PanelData, max_states: int) -> None:
        check_homogeneous(network)
        self._network, self._data, self._max_states = network, data, max_states
        self._steps: dict[int, list[PanelStep]] = {}

    @cached_property
    def few(self) -> FewStates | None:
        """All states, where they are few."""
        return FewStates.of(self._network, self._data)

    def renewed(self, network: Network) -> _Structure:
        """The same, with likely states found anew at the rates of this network."""
        self._network = network
        self._steps.clear()
        return self

    def steps_of(self, data: PanelData, r: int, run: PanelRun) -> list[PanelStep]:
        """The steps of a run, one a look."""
        if r not in self._steps:
            states, found = run.initial[None, :], []
            for look in range(run.times.size):
                found.append(PanelStep.of(self._network, data, run, look, states, self._max_states))
                states = found[-1].seen_states
            self._steps[r] = found
        return self._steps[r]


class _Pass:
    """The filter over one run, forwards."""

    def __init__(self, steps: Sequence[PanelStep], network: Network, data: PanelData, run: PanelRun) -> None:
        self._steps, self._network, self._data, self._run = steps, network, data, run
        self._weights = data.weights(network)
        self._lengths = np.diff(run.times, prepend=run.start)
        self._filtered = [np.ones(1)]
        self._chains = [step.chain(network) for step in steps]
        self._before: list[Floats] = []
        self.log_likelihood, self.error, self.lost = 0.0, 0.0, 0.0
        self.is_certified = all(chain.is_certified for chain in self._chains) and all(
            each.is_certified for each in data.observations.values()
        )
        tiny, chances = [], []
        for step, chain, length in zip(steps, self._chains, self._lengths, strict=True):
            left_out = FORGOTTEN if len(step.ends) == 1 else LEFT_OUT
            there, relative = carried(chain, step.start(self._filtered[-1]), float(length), left_out)
            before = there[step.ends]
            after = self._forwards(step, before) * self._chances(step, len(self._before))
            probability = float(after.sum())
            if not probability > 0.0:
                raise ValueError(
                    f"{run.named(len(self._before))}: this has a probability below 1e-300 at these rates; begin with "
                    f"other values"
                )
            self._before.append(before)
            self._filtered.append(after / probability)
            self.log_likelihood += log(probability)
            rounded = ROUNDOFF * (after.size + chain.roundings + len(self._weights) + 8.0)
            self.error += relative + rounded
            self.lost = max(self.lost, float(there[-2]) / probability)
            most = 1.0 if step.jumps is None else max(1.0, float(step.jump_rates(network).sum()))
            tiny.append(float(there[-2]) + left_out + LOST * (1 + there.size))
            chances.append(probability / most)
            self.is_certified &= step.jumps is None or not step.is_projected  # beyond, an event might be of any rate
        share = amplified(np.array(tiny), np.array(chances), np.array([len(step.seen_states) == 1 for step in steps]))
        self.is_certified &= share < np.inf
        self.error += share if share < np.inf else 0.0

    def _chances(self, step: PanelStep, look: int) -> Floats:
        """Of what was seen, in the states after a look, as it is observed now."""
        return chances_of(self._data, self._run, look, step.seen_states @ self._weights.T)

    def _forwards(self, step: PanelStep, before: Floats) -> Floats:
        """Probabilities of the states after a look, from those just before the event that comes with it."""
        if step.jumps is None:
            return before
        flow = before[step.jumps.before] * step.jump_rates(self._network)
        return totals(step.jumps.after, flow, len(step.seen_states))

    def _backwards(self, step: PanelStep, after: Floats) -> Floats:
        """Values of the states just before the event of a look, from those after it."""
        if step.jumps is None:
            return after
        flow = after[step.jumps.after] * step.jump_rates(self._network)
        return totals(step.jumps.before, flow, len(step.ends))

    @property
    def filtered(self) -> list[tuple[Ints, Floats]]:
        """States possible just before each step, and their probabilities."""
        states = [self._run.initial[None, :], *(step.seen_states for step in self._steps[:-1])]
        return list(zip(states, self._filtered, strict=False))

    def gradient(self, slopes: Slopes) -> Floats:
        """Derivatives (P,) of the log-likelihood by the logarithms of the parameters."""
        found = np.zeros(slopes.size)
        later = np.ones(len(self._steps[-1].seen_states)) if self._steps else np.ones(1)
        for look in reversed(range(len(self._steps))):
            step, chain, start = self._steps[look], self._chains[look], self._filtered[look]
            chances = self._chances(step, look)
            seen = chances * later
            values = np.zeros(len(step.states) + 2)
            values[step.ends] = self._backwards(step, seen)
            scale = float(values.max())
            values /= scale
            length = float(self._lengths[look])
            if length > 0.0 and chain.rates.any():
                entries = ChannelEntries(chain._replace(channels=np.arange(chain.rates.size)), chain.rates.size)
                (mean,) = gradient_at(entries, step.start(start), values[None, :], length)
                probability = mean.answer.value
                found += slopes.of_rates(step.states, step.rows, step.channels) @ mean.value / probability
                if step.begins.size == 1:
                    before = step.start(np.array([probability]))
                else:
                    before, _ = expected_from_all(chain, values, length)
            else:
                before = values
                probability = float(step.start(start) @ values)
            if step.jumps is not None:
                there = self._before[look][step.jumps.before] * step.jump_rates(self._network)
                there *= seen[step.jumps.after] / scale
                rows = step.ends[step.jumps.before]
                found += slopes.of_rates(step.states, rows, step.jumps.channels) @ there / probability
            for p, column in slopes.columns.items():
                found[p] += float(self.observed(step, look, column) @ later) / (scale * probability)
            later = before[step.begins] / probability
        return found

    def observed(self, step: PanelStep, look: int, column: int) -> Floats:
        """How the probability (F,) of all states after a look changes with the parameter of a column, times that of
        being there."""
        there = self._forwards(step, self._before[look])
        observation = list(self._data.observations.values())[column]
        seen = float(self._run.seen[look, column])
        if np.isnan(seen) or observation.parameter is None:
            return np.zeros(there.size)
        counted = step.seen_states @ self._weights.T
        others = np.ones(there.size)
        for c, each in enumerate(self._data.observations.values()):
            if c != column and not np.isnan(self._run.seen[look, c]):
                others *= each.weights(counted[:, c], float(self._run.seen[look, c]))
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
