"""Validation on held-out mechanics runs: their means, spreads and first times beside the predicted ones.

The measure is the posterior predictive distribution of the experiment itself: rates are drawn from their posterior, and
with each draw the same number of runs is simulated. What n runs show should look like one more such group of n. The
mean is predicted by the exact solution where the states allow, else by SSA runs.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from calibration.validating.first_times import FirstTimes, compare_first_times
from calibration.validating.scores import Counts, Score, central_band, group_scores, mean_misfit
from kinetics.network import Network
from kinetics.rates import Rates
from kinetics.runs import RESTART, JumpPath
from kinetics.sampling import Direct, simulate
from kinetics.solving import Transient
from kinetics.solving.states import TooManyStatesError
from kinetics.support.arrays import Floats, Ints, rising_times
from kinetics.support.intervals import student_interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# The 25th of 999 groups from either end bound a 95 % band: one more group falls below it with chance 25 / 1000.
GROUPS = 999
EXACT_STATES = 200_000  # with more reachable states than these the prediction is the mean of SSA runs


@dataclass(frozen=True)
class Cost:
    """CPU seconds: of the held-out mechanics runs, of `ssa_runs` SSA runs, of the exact solution at all times.

    exact is nan where there is no exact solution.
    """

    mechanics: float
    ssa: float
    ssa_runs: int
    exact: float


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """Held-out runs from one initial state beside their prediction. Arrays (T, S) over times (tu) and all species.

    label : name of the experiment, such as `80 cubes`
    runs : number n of held-out runs
    observed_mean, observed_low, observed_high : their mean with a Student t interval over the runs
    ssa_mean : mean of SSA runs at the point rates
    predicted_mean, predicted_sd : mean, and sd of a single run, at the point rates; solved where the state space is
        small enough, otherwise those of the SSA runs
    predicted_error : standard error of `predicted_mean` by sampling; 0 where that is exact
    low, high : predicted band of the mean of n runs, from intrinsic noise and the uncertainty of the rates
    z : (observed_mean - predicted_mean) over the predicted sd of that difference; nan where nothing varies
    misfit, p_misfit : mean squared z of the observed mean among predicted groups of n runs; share of groups with at
        least this misfit
    run_coverage : share of single runs, times and species (after time 0) inside the predicted band of a single run
    scores : one per species, then one of all species together
    first : first-passage times to the target, if one was named
    """

    label: str
    network: Network
    times: Floats
    runs: int
    level: float
    observed_mean: Floats
    observed_low: Floats
    observed_high: Floats
    ssa_mean: Floats
    predicted_mean: Floats
    predicted_sd: Floats
    predicted_error: Floats
    low: Floats
    high: Floats
    z: Floats
    misfit: float
    p_misfit: float
    run_coverage: float
    scores: tuple[Score, ...]
    first: FirstTimes | None
    cost: Cost

    @property
    def is_exact(self) -> bool:
        """Whether the predicted mean is free of sampling error."""
        return bool(np.isfinite(self.cost.exact))

    @property
    def coverage(self) -> float:
        """Share of times (after time 0) and species at which the observed mean lies inside the predicted band.

        Counts at neighbouring times are correlated, so the share itself scatters widely around the level.
        """
        inside = (self.low <= self.observed_mean) & (self.observed_mean <= self.high)
        return float(inside[self.times > 0].mean())

    @property
    def is_consistent(self) -> bool:
        """Whether mean, scores and first times of the held-out runs pass their tests against the model at 1 %."""
        results = [self.p_misfit, self.scores[-1].p_value] + ([self.first.p_value] if self.first else [])
        return min(results) * len(results) > 0.01

    def table(self) -> list[dict[str, Any]]:
        """One row per time and species."""
        columns = {
            "observed": self.observed_mean,
            "observed_low": self.observed_low,
            "observed_high": self.observed_high,
            "ssa": self.ssa_mean,
            "predicted": self.predicted_mean,
            "predicted_sd": self.predicted_sd,
            "predicted_error": self.predicted_error,
            "low": self.low,
            "high": self.high,
            "z": self.z,
        }
        return [
            {"label": self.label, "time": float(t), "species": species}
            | {name: float(values[i, s]) for name, values in columns.items()}
            for i, t in enumerate(self.times)
            for s, species in enumerate(self.network.species)
        ]

    def summary(self) -> dict[str, Any]:
        """One row: coverage, score beside its floor, first times and cost of both sides."""
        overall = self.scores[-1]
        row = {
            "label": self.label,
            "runs": self.runs,
            "coverage": self.coverage,
            "run_coverage": self.run_coverage,
            "misfit": self.misfit,
            "p_misfit": self.p_misfit,
            "crps": overall.score,
            "crps_floor": overall.floor,
            "p_crps": overall.p_value,
        }
        if self.first:
            row |= {
                "first_observed": self.first.observed_mean,
                "first_low": self.first.low,
                "first_high": self.first.high,
                "first_censored": self.first.censored,
                "first_predicted": self.first.predicted_mean,
                "first_predicted_error": self.first.predicted_error,
                "first_mean": self.first.mean,
                "first_sd": self.first.sd,
                "p_first": self.first.p_value,
            }
        return row | {
            "cpu_mechanics_s": self.cost.mechanics,
            "cpu_ssa_s": self.cost.ssa,
            "ssa_runs": self.cost.ssa_runs,
            "cpu_exact_s": self.cost.exact,
        }

    def to_dict(self) -> dict[str, Any]:
        """Everything in types that JSON can hold: arrays as lists, nan as None."""
        return _plain(
            {
                "summary": self.summary(),
                "is_consistent": self.is_consistent,
                "is_exact": self.is_exact,
                "level": self.level,
                "species": self.network.species,
                "scores": [vars(score) for score in self.scores],
                "first": vars(self.first) if self.first else None,
                "table": self.table(),
            }
        )

    def plot(self, axes: Sequence[Axes], species: Sequence[str] | None = None) -> Sequence[Axes]:
        """Plot observed and predicted means with bands, one species per axes; all species unless some are named."""
        from calibration import plots

        percent, sampled = f"{100 * self.level:g} %", f"SSA, {self.cost.ssa_runs} runs"
        label = f"{'exact' if self.is_exact else sampled}, {percent} band for {self.runs} runs"
        for ax, name in zip(axes, species or self.network.species, strict=True):
            s = self.network.index(name)
            predicted = plots.Limited(self.predicted_mean[:, s], self.low[:, s], self.high[:, s])
            observed = plots.Limited(self.observed_mean[:, s], self.observed_low[:, s], self.observed_high[:, s])
            plots.trajectory(
                ax,
                name,
                self.times,
                predicted=(label, predicted),
                observed=(f"mechanics, {percent} interval", observed),
                sampled=(sampled, self.ssa_mean[:, s]) if self.is_exact else None,
                title=self.label,
            )
        return axes


def crossvalidate(
    network: Network,
    rates: Rates,
    paths: Sequence[JumpPath],
    times: ArrayLike,
    target: str | None = None,
    label: str = "",
    runs: int = 1000,
    groups: int = GROUPS,
    level: float = 0.95,
    seed: int = 0,
    mechanics_cpu: float = float("nan"),
    exact_states: int = EXACT_STATES,
) -> CrossValidation:
    """Compare held-out `paths` (one initial state, not restarted, all channels open) with the prediction by `rates`.

    times : (T,) tu, rising, none after the end of a path
    target : species whose first-passage times are compared
    runs : number of SSA runs at the point rates
    groups : number of draws of the rates, each with as many runs as there are paths; the smallest p-value is
        1 / (groups + 1)
    mechanics_cpu : CPU time of the held-out runs, s
    exact_states : with more reachable states than this, mean and first times are predicted by SSA, with its error

    Rates without evidence are taken as exact: the band then holds intrinsic noise alone.
    """
    known = rates.apply(network)
    counts = _held_out(known, paths, times)
    grid = rising_times(times)
    initial = paths[0].initial

    # Once in little, so that the costs below are those of the work and not of compiling or loading kernels.
    simulate(known, Direct(), initial, grid[:1], runs=1)
    Transient().solve(known, np.minimum(initial, 2), [grid[-1]])
    begin = time.process_time()
    ssa = simulate(known, Direct(), initial, grid, runs=runs, seed=seed)
    ssa_cpu = time.process_time() - begin
    begin = time.process_time()
    try:
        exact = Transient(max_states=exact_states).solve(known, initial, grid)
        mean, sd = exact.mean(), exact.sd()
        error, exact_cpu = np.zeros_like(mean), time.process_time() - begin
    except TooManyStatesError:
        mean, sd, error, exact_cpu = ssa.mean(), ssa.sd(), ssa.standard_error(), float("nan")

    draws = _rate_draws(known, rates, groups, seed)
    predicted = _predicted_groups(draws, known, initial, grid, len(paths), seed, first_run=runs)
    means = predicted.mean(axis=1)
    low, high = central_band(means, level)
    run_low, run_high = central_band(predicted.reshape(-1, *predicted.shape[2:]), level)
    after = grid > 0
    first = None
    if target:
        is_exact = len(rates.without_evidence()) == len(rates.channels)
        beyond = runs + groups * len(paths)  # runs numbered from here on share no random numbers with those above
        first = compare_first_times(
            known, paths, target, level, seed, None if is_exact else draws, beyond, exact_states
        )
    observed = counts.mean(axis=0)
    misfit, p_misfit = mean_misfit(observed, means)
    observed_low, observed_high = student_interval(counts, level)
    return CrossValidation(
        label=label,
        network=known,
        times=grid,
        runs=len(paths),
        level=level,
        observed_mean=observed,
        observed_low=observed_low,
        observed_high=observed_high,
        ssa_mean=ssa.mean(),
        predicted_mean=mean,
        predicted_sd=sd,
        predicted_error=error,
        low=low,
        high=high,
        z=_z(observed - mean, sd / np.sqrt(len(paths)), error, means),
        misfit=misfit,
        p_misfit=p_misfit,
        run_coverage=float(((run_low <= counts) & (counts <= run_high))[:, after].mean()),
        scores=group_scores(known.species, counts, predicted),
        first=first,
        cost=Cost(float(mechanics_cpu), ssa_cpu, runs, exact_cpu),
    )


def _held_out(network: Network, paths: Sequence[JumpPath], times: ArrayLike) -> Ints:
    """Counts (n, T, S) of the paths, or a ValueError where they are no held-out runs of one experiment."""
    if not paths:
        raise ValueError("no held-out runs; give at least one path")
    for i, path in enumerate(paths):
        if path.network.fingerprint != network.fingerprint:
            raise ValueError(f"path {i} is of another network: its channels are {', '.join(path.network.channels)}")
        if not np.array_equal(path.initial, paths[0].initial):
            raise ValueError(
                f"path {i} starts from {path.initial.tolist()}, path 0 from {paths[0].initial.tolist()}; "
                "compare one initial state at a time"
            )
        if (path.channels == RESTART).any() or not path.open_channels.all():
            raise ValueError(f"path {i} was restarted or had channels closed: a calibration run, not a held-out one")
    return np.stack([path.at(times) for path in paths])


def _rate_draws(network: Network, rates: Rates, groups: int, seed: int) -> Floats:
    """Rate constants (groups, R) in the order of the network's channels."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1,)))
    names = list(rates.channels)  # `sample` keeps the order of the file
    return rates.sample(rng, groups)[:, [names.index(channel) for channel in network.channels]]


def _predicted_groups(
    draws: Floats, network: Network, initial: Ints, times: Floats, n: int, seed: int, first_run: int
) -> Counts:
    """Counts (groups, n, T, S): each group of n runs has its own draw of the rates."""
    counts = np.empty((len(draws), n, times.size, len(network.species)), dtype=np.int32)
    for g, drawn in enumerate(draws):
        group = Direct().simulate(
            network.with_rates(drawn), initial, times, runs=n, seed=seed, threads=1, first_run=first_run + g * n
        )
        counts[g] = group.counts
    return counts


def _z(difference: Floats, intrinsic: Floats, error: Floats, means: Floats) -> Floats:
    """Difference over its predicted sd (T, S).

    means : (groups, T, S), whose spread holds intrinsic noise and rate uncertainty; where events are so rare that the
        groups hardly show them, the intrinsic sd at the point rates is the larger and the better known
    error : of the prediction itself, by sampling
    """
    sd = np.hypot(np.maximum(intrinsic, means.std(axis=0, ddof=1)), error)
    return np.divide(difference, sd, out=np.full(sd.shape, np.nan), where=sd > 1e-9)


def _plain(value: Any) -> Any:
    """Nested dicts and lists of what JSON can hold: None for what is no finite number."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value
