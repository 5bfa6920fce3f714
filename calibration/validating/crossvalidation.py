"""Validation on held-out mechanics runs: their events, means, spreads and first times beside the predicted ones.

The measure is the posterior predictive distribution of the experiment itself: rates are drawn from their posterior, and
with each draw the same number of runs is simulated. What n runs show should look like one more such group of n. The
mean is predicted at the posterior mean of each rate constant, by the exact solution where the states allow, else by SSA
runs.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from calibration.validating.comparison import Cost, CrossValidation
from calibration.validating.events import HeldOutEvents
from calibration.validating.first_times import compare_first_times
from calibration.validating.groups import FIRST_TIMES, SimulatedGroups
from calibration.validating.scores import central_band, group_scores, mean_misfit, share_inside
from calibration.validating.single_runs import judge_single_runs
from kinetics.markov.transient import Transient
from kinetics.markov.transient.search import TooManyStatesError
from kinetics.network import Network
from kinetics.rates import Rates
from kinetics.runs import RESTART, JumpPath
from kinetics.sampling import Direct
from kinetics.support.arrays import Floats, Ints, rising_times
from kinetics.support.intervals import student_interval

# The 50th of 1,999 groups from either end bound a 95 % band: one more group falls below it with chance 50 / 2000.
GROUPS = 1999
MOST_GROUPS = 9_999  # where the p-value of some events stays small: p < 5e-4 can then be told from larger ones
LEVEL = 0.95  # of bands and intervals
EXACT_STATES = 200_000  # with more reachable states than these the prediction is the mean of SSA runs


def crossvalidate(
    rates: Rates,
    paths: Sequence[JumpPath],
    times: ArrayLike,
    target: str | None = None,
    runs: int = 1000,
    groups: int = GROUPS,
    seed: int = 0,
    exact_states: int = EXACT_STATES,
    number: int = 0,
    most_groups: int = MOST_GROUPS,
) -> CrossValidation:
    """Compare held-out `paths` (one initial state, not restarted, all channels open) with the prediction by `rates`.

    times : (T,) tu, rising, none after the end of a path; events are counted until the last of them
    target : species whose first-passage times are compared
    runs : number of SSA runs at the posterior mean of each rate constant
    groups : number of draws of the rates, each with as many runs as there are paths; the smallest p-value is
        1 / (groups + 1)
    exact_states : with more reachable states than this, mean and first times are predicted by SSA, with its error
    number : of this comparison in its study; those of different numbers share draws of the rates, but no other
        random numbers
    most_groups : for the events of channels at most so many groups, twice as many each time while one of their p-values
        is small, see `sequential_p`
    ValueError: no paths, or paths that are no held-out runs of one network from one initial state

    Rates without evidence are taken as known: the band then holds intrinsic noise alone. At 120 cubes and 20 runs, a
    thousand groups of line4 cost about 0.4 s of CPU time.

    >>> from calibration import crossvalidate, estimate
    >>> from kinetics import Network, sample_path
    >>> pairs = Network.from_text("2 A <-> AA, 0.01, 0.1")
    >>> paths = [sample_path(pairs, {"A": 20}, end=50.0, seed=1, run=run) for run in range(20)]
    >>> rates = estimate(paths[:10]).rates()
    >>> found = crossvalidate(rates, paths[10:], times=[10.0, 50.0], groups=199, most_groups=199)
    >>> found.is_consistent
    True
    """
    counts = _held_out(paths, times)
    grid = rising_times(times)
    network, initial, n = paths[0].network, paths[0].initial, len(paths)
    simulated = SimulatedGroups(network, rates, initial, n, seed, number, paths[0].tank)
    known = simulated.model

    mean, sd, error, ssa_mean, cost = _predicted_mean(simulated, grid, runs, exact_states)
    predicted = simulated.counts(groups, grid)
    means = predicted.mean(axis=1)
    low, high = central_band(means, LEVEL)
    run_low, run_high = central_band(predicted.reshape(-1, *predicted.shape[2:]), LEVEL)
    after = grid > 0
    first = None
    if target:
        is_exact = len(rates.without_evidence()) == len(rates.channels)
        draws = None if is_exact else simulated.constants(0, groups)
        first_run = simulated.first_run(FIRST_TIMES)
        first = compare_first_times(known, paths, target, LEVEL, seed, draws, first_run, exact_states)
    observed = counts.mean(axis=0)
    misfit, p_misfit = mean_misfit(observed, means)
    most = _most_copies(network, initial)
    observed_low, observed_high = (np.clip(limit, 0.0, most) for limit in student_interval(counts, LEVEL))
    held_out = HeldOutEvents.of(simulated, paths, float(grid[-1]), groups, most_groups)
    return CrossValidation(
        network=known,
        times=grid,
        runs=n,
        level=LEVEL,
        observed_mean=observed,
        observed_low=observed_low,
        observed_high=observed_high,
        ssa_mean=ssa_mean,
        predicted_mean=mean,
        predicted_sd=sd,
        predicted_error=error,
        # what hardly ever happens has its mean above the middle 95 % of groups; the band that is shown holds it
        low=np.minimum(low, mean),
        high=np.maximum(high, mean),
        z=_z(observed - mean, sd / np.sqrt(n), error, means),
        misfit=misfit,
        p_misfit=p_misfit,
        coverage=share_inside(observed[after], means[:, after], low[after], high[after]),
        run_coverage=share_inside(counts[:, after], predicted[:, :, after], run_low[after], run_high[after]),
        groups=groups,
        scores=group_scores(known.species, counts, predicted),
        first=first,
        held_out=held_out,
        single_runs=judge_single_runs(
            *held_out.run_values(counts[:, -1], predicted[:, :, -1], known.species), seed=seed
        ),
        cost=cost,
    )


def _held_out(paths: Sequence[JumpPath], times: ArrayLike) -> Ints:
    """Counts (n, T, S) of the paths, or a ValueError if they are no held-out runs of one experiment."""
    if not paths:
        raise ValueError("no held-out runs; give at least one path")
    for i, path in enumerate(paths):
        if path.network.fingerprint != paths[0].network.fingerprint:
            raise ValueError(f"path {i} is of another network: its channels are {', '.join(path.network.channels)}")
        if not np.array_equal(path.initial, paths[0].initial):
            raise ValueError(
                f"path {i} starts from {path.initial.tolist()}, path 0 from {paths[0].initial.tolist()}; "
                "compare one initial state at a time"
            )
        if (path.channels == RESTART).any() or not path.open_channels.all():
            raise ValueError(f"path {i} was restarted or had channels closed: a calibration run, not a held-out one")
    return np.stack([path.at(times) for path in paths])


def _predicted_mean(
    simulated: SimulatedGroups, grid: Floats, runs: int, exact_states: int
) -> tuple[Floats, Floats, Floats, Floats, Cost]:
    """Mean, sd and error at the posterior mean rates, the mean of SSA runs, all (T, S), and what they cost."""
    known, initial, first_run = simulated.model, simulated.initial, simulated.first_run(0)
    # Once in little, so that the costs below are those of the work and not of compiling or loading kernels.
    Direct().simulate(known, initial, grid[:1], runs=1)
    Transient().solve(known, np.minimum(initial, 2), [grid[-1]])
    begin = time.process_time()
    ssa = Direct().simulate(known, initial, grid, runs=runs, seed=simulated.seed, first_run=first_run)
    ssa_cpu = time.process_time() - begin
    begin = time.process_time()
    try:
        exact = Transient(max_states=exact_states).solve(known, initial, grid)
        mean, sd = exact.mean(), exact.sd()
        error, exact_cpu = np.zeros_like(mean), time.process_time() - begin
    except TooManyStatesError:
        mean, sd, error, exact_cpu = ssa.mean(), ssa.sd(), ssa.standard_error(), float("nan")
    return mean, sd, error, ssa.mean(), Cost(ssa_cpu, runs, exact_cpu)


def _most_copies(network: Network, initial: Ints) -> Floats:
    """Copies (S,) that there can be of each species at most, by what the network conserves."""
    most = np.full(initial.size, np.inf)
    for amounts in network.conserved.values():
        holds = (amounts > 0) & (amounts.min() >= 0)
        most[holds] = np.minimum(most[holds], np.floor(initial @ amounts / amounts[holds] + 1e-9))
    return most


def _z(difference: Floats, intrinsic: Floats, error: Floats, means: Floats) -> Floats:
    """Difference over its predicted sd (T, S).

    means : (groups, T, S), whose spread holds intrinsic noise and rate uncertainty; if events are so rare that the
        groups hardly show them, the intrinsic sd at the mean rates is the larger and the better known
    error : of the prediction itself, by sampling
    """
    sd = np.hypot(np.maximum(intrinsic, means.std(axis=0, ddof=1)), error)
    return difference / np.where(sd > 1e-9, sd, np.nan)
