"""How often the tests of residuals reject: a model that is right, and wrong ones, at data like those observed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from calibration.estimating.residuals import LEVEL, quantile_residuals
from kinetics.markov.panels import EventData, EventLikelihood, JointLikelihood, Likelihood, PanelLikelihood
from kinetics.network import Network
from kinetics.runs import RESTART
from kinetics.sampling import Auto, sample_path, simulate
from kinetics.support.arrays import Floats, Ints, whole_number
from kinetics.support.cli.progress import stage
from kinetics.support.intervals import binomial_limits

REPEATS = 40  # simulated sets of data for each figure
SPREAD = 0.5  # standard deviation of the logarithm of a factor on all rates of a run
BETWEEN, WITHIN = "rates differ between runs (by a factor of e^0.5)", "rates fall to a third within a run"


@dataclass(frozen=True)
class PowerOfResiduals:
    """How often tests of residuals at 5 % reject, over simulated sets of data like those observed.

    alternative : what was simulated; "" for the model itself, whose share is the size
    share, low, high : of sets that were rejected, with its 95 % interval
    repeats : sets
    """

    alternative: str
    share: float
    low: float
    high: float
    repeats: int

    def __str__(self) -> str:
        what = f"power where {self.alternative}" if self.alternative else "size"
        return f"{what} {100 * self.share:.0f} % [{100 * self.low:.0f}, {100 * self.high:.0f}]"


def power_of_residuals(
    likelihood: Likelihood, point: Mapping[str, float] | None = None, *, repeats: int = REPEATS, seed: int = 0
) -> list[PowerOfResiduals]:
    """Size and power of the tests of residuals for data with the runs and looks of those observed.

    The alternatives are rates that all are larger or smaller in some runs, where there are five runs or more, and rates
    that fall in each run from 1.5 to .5 times. Nothing is fitted to what is simulated.

    Cost: two or three times `repeats` passes of residuals. An empty list for data that are not simulated: rate laws,
    events with known times between looks, and groups.

    >>> from calibration.estimating.residual_power import power_of_residuals
    >>> from kinetics import Model, Network
    >>> from kinetics.markov.panels import PanelData, PanelLikelihood, PanelRun
    >>> decay = Model.of(Network.from_text("A -> B, 1"))
    >>> runs = [PanelRun([1000, 0], [0.5, 1.0], [[600], [370]]) for _ in range(6)]
    >>> found = power_of_residuals(PanelLikelihood(decay, PanelData({"A": {"A": 1}}, runs)), repeats=20, seed=1)
    >>> [each.share > 0.5 for each in found]  # of the size, and of two powers
    [False, True, True]
    """
    whole_number("repeats", repeats, 1)
    network = likelihood.network_at(point or {})
    has_looks = isinstance(likelihood, PanelLikelihood) and not likelihood.data.events
    has_events = isinstance(likelihood, EventLikelihood) and all(
        not (path.channels == RESTART).any() for path in likelihood.data.paths
    )
    if isinstance(likelihood, JointLikelihood) or not (has_looks or has_events) or network.laws:
        return []
    runs = 0
    if isinstance(likelihood, PanelLikelihood):
        runs = len(likelihood.data.runs)
    elif isinstance(likelihood, EventLikelihood):
        runs = len(likelihood.data.paths)
    kinds = ["", *([BETWEEN] if runs >= 5 else []), WITHIN]
    rng = np.random.default_rng(whole_number("seed", seed, 0))
    found = []
    for place, kind in enumerate(kinds):
        rejected = 0
        for repeat in range(repeats):
            stage(f"power of the tests of residuals, set {repeat + 1}", (place + repeat / repeats) / len(kinds))
            made = _like(likelihood, network, point or {}, kind, rng)
            rejected += quantile_residuals(made, point, seed=int(rng.integers(2**63))).p < LEVEL
        low, high = (float(each) for each in binomial_limits(rejected, repeats))
        found.append(PowerOfResiduals(kind, rejected / repeats, low, high, repeats))
    return found


def _like(
    likelihood: Likelihood, network: Network, point: Mapping[str, float], kind: str, rng: np.random.Generator
) -> Likelihood:
    """The likelihood of simulated data in place of those observed."""
    if isinstance(likelihood, EventLikelihood):
        paths = []
        for path in likelihood.data.paths:
            factor, open_rates = _factor(kind, rng), network.known_rates * path.open_channels
            steps = [(path.end, factor)] if kind != WITHIN else _falling(path.end)
            state, since, times, channels = path.initial, 0.0, [np.empty(0)], [np.empty(0, dtype=np.int64)]
            for end, scale in steps:
                part = sample_path(network.with_rates(open_rates * scale), state, end - since, int(rng.integers(2**63)))
                times.append(part.times + since)
                channels.append(part.channels)
                state, since = part.states[-1], end
            paths.append(
                replace(
                    path, network=network, times=np.concatenate(times), channels=np.concatenate(channels), partners=None
                )
            )
        return EventLikelihood(likelihood.model, EventData(paths))
    if not isinstance(likelihood, PanelLikelihood):
        raise TypeError(f"data of {type(likelihood).__name__} are not simulated")
    data, weights = likelihood.data_at(point), likelihood.data.weights(network)
    runs = []
    for run in data.runs:
        factor = _factor(kind, rng)
        start = run.initial[rng.choice(len(run.initial), p=run.chances)]
        states = _states(network, start, run.times - run.start, kind, factor, rng)
        counted, seen = states @ weights.T, run.seen.copy()
        for c, observation in enumerate(data.observations.values()):
            drawn = [
                float(observation.drawn(counted[k : k + 1, c].astype(float), seen[k, c], rng)[0])
                for k in range(len(seen))
            ]
            seen[:, c] = np.where(np.isnan(seen[:, c]), np.nan, drawn)
        runs.append(replace(run, seen=seen))
    return PanelLikelihood(likelihood.model, replace(data, runs=runs))


def _factor(kind: str, rng: np.random.Generator) -> float:
    """On all rates of a run."""
    return float(np.exp(SPREAD * rng.standard_normal())) if kind == BETWEEN else 1.0


def _falling(end: float, pieces: int = 10) -> list[tuple[float, float]]:
    """Ends of pieces of a run, and the factor on all rates in each."""
    return [(end * (k + 1) / pieces, 1.5 - (k + 0.5) / pieces) for k in range(pieces)]


def _states(network: Network, initial: Ints, times: Floats, kind: str, factor: float, rng: np.random.Generator) -> Ints:
    """Counts (n, S) at times (n,), tu, of one run."""
    state, since, found = initial, 0.0, []
    for time in times.tolist():
        scale = 1.5 - 0.5 * (since + time) / float(times[-1]) if kind == WITHIN else factor
        if time > since:
            scaled, seed = network.with_rates(network.known_rates * scale), int(rng.integers(2**63))
            state = simulate(scaled, Auto(), state, [time - since], 1, seed, 1).counts[0, 0]
        found.append(state)
        since = time
    return np.array(found)
