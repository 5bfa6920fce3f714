"""The likelihood of counts seen at some times, with bounds, and its gradient by all parameters.

The bounds are proven where counts are exact or rounded and the state is known often enough (`amplified`). How it is
found depends on the states: few are gone over for all runs side by side; looks that begin alike, together; else each
part of a run alone, over all states or over the likely ones.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import expm1, inf
from typing import Any

import numpy as np

from kinetics.markov.panels.base import Likelihood, Observed, Scored
from kinetics.markov.panels.bridges import KnownSteps, Narrowing
from kinetics.markov.panels.data import PanelData, PanelRun
from kinetics.markov.panels.fans import Cut, Fan, FanPass, FanStep
from kinetics.markov.panels.few_states import FewPass, FewStates
from kinetics.markov.panels.moving_windows import StepFinder
from kinetics.markov.panels.panel_step import PanelStep
from kinetics.markov.panels.run_pass import RunPass
from kinetics.markov.panels.slopes import Slopes
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.search import MAX_STATES
from kinetics.markov.transient.transitions import Transitions
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
        models = {name: {"model": each.name, **each.told} for name, each in self.data.observations.items()}
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
        structure, nothing = self._structure(network, data), self._slopes(network, point or {}, ())
        if structure.few is not None:
            together = FewPass(structure.few, network, data, nothing)
            if together.fits():
                return together.filtered
        cut = self._cut
        found: list[list[tuple[Ints, Floats]]] = []
        for parts in cut.of_runs:
            found.append([])
            for fan, place in parts:
                run = cut.fans[fan].runs[place]
                if run.times.size == 1:
                    found[-1].append((run.initial, run.chances))
                else:
                    found[-1] += self._pass(structure.steps, (fan, place), run, network, data, nothing).filtered
        return found

    def _passes(
        self, network: Network, data: PanelData, slopes: Slopes
    ) -> Iterator[tuple[RunPass | FewPass | FanPass, int]]:
        """One pass over all runs where states are few; else one for each fan, or part of a run, and how many parts are
        like it."""
        structure = self._structure(network, data)
        if structure.few is not None:
            together = FewPass(structure.few, network, data, slopes)
            if together.fits():
                yield together, 1
                return
        for place, fan in enumerate(self._cut.fans):
            at = structure.fan_step(place, fan, network, data)
            if at is not None:
                yield FanPass(at, structure.chain(at, network), network, data, slopes), 1
                continue
            for member, (run, copies) in enumerate(zip(fan.runs, fan.copies, strict=True)):
                yield self._pass(structure.steps, (place, member), run, network, data, slopes), copies

    def _pass(
        self,
        known: dict[tuple[int, int], list[PanelStep]],
        place: tuple[int, int],
        run: PanelRun,
        network: Network,
        data: PanelData,
        slopes: Slopes,
    ) -> RunPass:
        """One pass over a part: with proven bounds, or for a gradient over the bridges, which are found first."""
        steps, narrows = known.get(place), bool(slopes.size)
        if steps is not None and (narrows or not any(step.is_projected for step in steps)):
            passed = RunPass(KnownSteps(steps, network), network, data, run, keeps=narrows)
            if not narrows or passed.score(slopes) < MOST_MISSED or passed.least < UNLIKELY:
                return passed
        bridges = Narrowing(StepFinder(network, data, run, self.max_states), network, data, run, narrows)
        passed = RunPass(bridges, network, data, run)
        if bridges.is_whole:
            known[place] = bridges.steps
        if narrows:
            passed = RunPass(KnownSteps(bridges.steps, network), network, data, run, keeps=True)
            passed.score(slopes)
        return passed

    @cached_property
    def _cut(self) -> Cut:
        """The parts of the runs, whatever the rates."""
        return Cut.of(self.model.network, self.data)

    def _structure(self, network: Network, data: PanelData) -> _Structure:
        """What does not depend on the rates but for which of them are 0; of rate laws, on no change of a parameter.

        Nor on how columns are observed, but for which of their parameters are as large as can be: what is detected with
        certainty leaves no other counts.
        """
        happens = (network.known_rates > 0).astype(float).tolist()
        certain = [float(each.parameter == each.most) for each in data.observations.values()]
        key = (*happens, *certain, *(network.parameters.values() if network.laws else ()))
        if key not in self._known:
            self._known.clear()
            self._known[key] = _Structure(network, data)
        return self._known[key]


class _Structure:
    """All states, where they are few; else what was found of each part of the runs, by its place."""

    def __init__(self, network: Network, data: PanelData) -> None:
        check_homogeneous(network)
        self.few = FewStates.of(network, data)
        self.steps: dict[tuple[int, int], list[PanelStep]] = {}
        self._fans: dict[int, FanStep | None] = {}
        self._over: dict[bytes, PanelStep] = {}
        self._chain: tuple[Network | None, dict[int, Transitions]] = (None, {})

    def fan_step(self, place: int, fan: Fan, network: Network, data: PanelData) -> FanStep | None:
        """The step of a fan; None if its parts are gone over one by one."""
        if place not in self._fans:
            self._fans[place] = FanStep.of(network, data, fan, self._over)
        return self._fans[place]

    def chain(self, at: FanStep, network: Network) -> Transitions:
        """The transitions of a fan at the rates of a network, found once for all fans over the same states."""
        if self._chain[0] is not network:
            self._chain = (network, {})
        chains, over = self._chain[1], id(at.step.rows)
        if over not in chains:
            chains[over] = at.step.chain(network)
        return chains[over]


def log_likelihood(model: Model | Network, data: PanelData) -> Answer:
    """The logarithm of the probability of panel data, with bounds; see `PanelLikelihood`.

    >>> from kinetics import Network
    >>> from kinetics.markov.panels import PanelData, PanelRun, log_likelihood
    >>> decay = Network.from_text("A -> B, 1")
    >>> log_likelihood(decay, PanelData({"A": {"A": 1}}, [PanelRun([1, 0], [2.0], [[1]])])).value
    -2.0
    """
    return PanelLikelihood(Model.of(model), data).value()
