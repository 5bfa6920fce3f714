"""Runs under many draws of the rate constants: the network is made ready once, and each draw costs some microseconds.

A draw is one row of rate constants, from the posterior of a calibration, say. Run i of draw d is number
first_run + d * runs + i of its stream, so all runs are independent, and draws may be asked for in parts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kinetics import kernels
from kinetics.kernels.ensemble_work import LOOK, ensemble_work
from kinetics.network import Model, Network
from kinetics.network.predicates import Condition
from kinetics.sampling.auto import Auto
from kinetics.sampling.base import SamplingMethod, check_numbers, stream_key
from kinetics.sampling.direct import RecomputingSampler
from kinetics.sampling.mass_action import mass_action
from kinetics.sampling.outlook import Outlook
from kinetics.sampling.stopping import stop_at
from kinetics.sampling.watch import MAX_EVENTS, Watch, in_turn
from kinetics.support.arrays import Floats, Ints, integers, reals, rising_times, some_times
from kinetics.support.memory import check_memory

PIECE_BYTES = 2**26  # of all counts of a draw that are there at a time, where only sums of them are asked for
BATCH = 16  # draws a thread at a time


def simulate_posterior(
    model: Model | Network,
    constants: ArrayLike | list[Network],
    times: ArrayLike,
    runs: int,
    seed: int = 0,
    *,
    method: SamplingMethod | None = None,
    first_run: int = 0,
    threads: int = 1,
    weights: ArrayLike | None = None,
    watch: Watch | None = None,
) -> Iterator[Ints]:
    """Yield the counts (runs, T, S) at `times` (T,), tu, of runs under each draw of rate constants (D, R), 1/tu.

    constants : or D networks that differ from the model's in the parameters of their rate laws, each made ready anew
    model : each run starts from its counts at time 0
    method : sampling method; Auto() by default
    weights : (S, V) whole weights, to get sums of counts (runs, T, V) instead
    watch : lets runs be truncated, which leaves fewer times; without it, a truncated run is a ValueError

    Memory holds a few draws a thread at a time. The same seed gives the same runs for any number of threads. Cost:
    some 20 us a draw beyond its runs, by the direct method or in lockstep.

    >>> from kinetics import Model, Network
    >>> from kinetics.sampling import simulate_posterior
    >>> decay = Model.of(Network.from_text("A -> 0, 1"), {"A": 3})
    >>> counts = list(simulate_posterior(decay, [[0.0], [100.0]], [1.0], runs=2, seed=1))
    >>> [each[:, 0, 0].tolist() for each in counts]
    [[3, 3], [0, 0]]
    """
    sampler_of: Callable[[Any], Any]
    table: Any
    if isinstance(constants, list) and constants and isinstance(constants[0], Network):
        given = Model.of(model)
        network, start, table = constants[0], given.initial, constants
        sampler_of = (method or Auto()).sampler
    else:
        network, start, table = _checked(model, constants, runs, first_run)  # type: ignore[arg-type]
        sampler_of = (method or Auto()).sampler_of_rates(network)
        network = network.with_rates(table[0])
    check_numbers(runs, threads, first_run)
    grid = some_times(times).copy()  # which may be written: kernels are compiled for one kind of array
    seen = watch or Watch(grid, Outlook(network), first_run=first_run)
    sums = None if weights is None else integers("weights", weights, (start.size, None), minimum=0)
    piece = runs if sums is None else min(runs, max(1, PIECE_BYTES // (8 * grid.size * start.size)))
    check_memory(
        f"counts of {piece} runs of {start.size} species at {grid.size} times",
        8.0 * piece * grid.size * start.size,
        "ask for fewer runs or times",
    )
    key = stream_key(seed)

    def draw(d: int) -> Ints:
        sampler = sampler_of(table[d])
        parts = []
        for begin in range(0, runs, piece):
            out = np.empty((min(piece, runs - begin), grid.size, start.size), dtype=np.int64)
            sampler.ensemble(start, grid, key, first_run + d * runs + begin, out, seen)
            parts.append(out if sums is None else out @ sums)
        if watch is None or not seen.n_times:
            seen.check()
        found = parts[0] if len(parts) == 1 else np.concatenate(parts)
        return found if seen.n_times == grid.size else found[:, : seen.n_times]

    if threads == 1:
        yield from map(draw, range(len(table)))
        return
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(threads) as pool:
        for begin in range(0, len(table), BATCH * threads):
            try:
                made = list(pool.map(draw, range(begin, min(begin + BATCH * threads, len(table)))))
            except BaseException:
                seen.is_stopped.set()
                pool.shutdown(wait=False, cancel_futures=True)
                raise
            yield from made


def first_times_of_draws(
    model: Model | Network,
    constants: ArrayLike,
    until: str | Condition,
    end: float,
    runs: int,
    seed: int = 0,
    *,
    method: SamplingMethod | None = None,
    first_run: int = 0,
) -> Iterator[Floats]:
    """Yield the time (runs,), tu, at which a condition first holds in each run, for each of `constants` (D, R), 1/tu.

    A run in which the condition does not hold by `end` has the time inf. The runs equal those of `simulate_posterior`
    up to that time, at which they stop. A condition that holds at the start is a ValueError.

    >>> from kinetics import Model, Network
    >>> from kinetics.sampling import first_times_of_draws
    >>> decay = Model.of(Network.from_text("A -> 0, 1"), {"A": 3})
    >>> made = first_times_of_draws(decay, [[0.0], [100.0]], "A == 0", end=9.0, runs=2)
    >>> [bool(times.max() < 0.5) for times in made]
    [False, True]
    """
    network, start, table = _checked(model, constants, runs, first_run)
    stop, is_there = stop_at(until, network, start)
    if is_there:
        raise ValueError(f"{until} holds at the start")
    grid = some_times([end]).copy()
    made = (method or Auto()).stopping(network, start)
    outlook = Outlook(network.with_rates(table[0]))
    watch = Watch(grid, outlook, first_run=first_run, until=stop, runs=runs * len(table))
    counts = simulate_posterior(model, table, grid, runs, seed, method=made, first_run=first_run, watch=watch)
    for d, _ in enumerate(counts):
        watch.check()
        yield watch.reached[d * runs : (d + 1) * runs]


def exposures_of_draws(
    model: Model | Network,
    constants: ArrayLike,
    end: float,
    runs: int,
    seed: int = 0,
    *,
    first_run: int = 0,
) -> Iterator[tuple[Ints, Floats]]:
    """Yield events and exposures (runs, R) of every channel until `end`, tu, under each of `constants` (D, R), 1/tu.

    An exposure is the integral over time of multiplicity * combinations of reactants, times the factor of the crowd
    if there is one, tu. In small networks, where `Direct` computes all propensities at every event, the runs equal
    those of `simulate_posterior` by `Direct`; in larger ones they are other runs of the same distribution. The network
    must be of mass action, in a crowd or not, else a ValueError. Cost: some 30 ns an event plus 3 ns a channel, and
    some 15 us a draw, more if channels are merged.

    >>> from kinetics import Model, Network
    >>> from kinetics.sampling import exposures_of_draws
    >>> decay = Model.of(Network.from_text("A -> 0, 1"), {"A": 3})
    >>> ((events, exposures),) = exposures_of_draws(decay, [[0.0]], end=2.0, runs=1)
    >>> events.tolist(), exposures.tolist()
    ([[0]], [[6.0]])
    """
    network, start, table = _checked(model, constants, runs, first_run)
    if not network.uncrowded.is_mass_action:
        raise ValueError("the network has rate laws or events; exposures are those of mass action alone")
    horizon = float(rising_times([end])[0])
    with_units = network.with_rates(np.ones(len(network.channels)))
    ready = RecomputingSampler(with_units)
    key, shape = stream_key(seed), (runs, len(network.channels))
    crowding, crowd, thinning = network.crowding, None, ready.merging.thinning(start)
    if crowding is not None:
        changed = np.flatnonzero(crowding.is_changed)
        crowd = kernels.exposures.Crowd(changed, crowding.weights, crowding.volumes, crowding.coefficients[changed])

    units = mass_action(with_units.uncrowded)
    for d, row in enumerate(table):
        kernel, members = ready.merging.model(row, thinning), ready.merging.named(row, thinning)
        seen, watched = np.zeros(shape, dtype=np.int64), np.zeros(shape)
        first = first_run + d * runs
        work = kernels.exposures.ExposureWork(ensemble_work(start.size), np.empty(4, dtype=np.uint64), np.zeros(1))
        work.runs.notes[LOOK] = MAX_EVENTS
        watch = Watch(np.array([horizon]), Outlook(network.with_rates(row)), first_run=first, is_path=True)

        def go_on(_: Ints, most: int, these: Any = (kernel, members, work, first, seen, watched)) -> int:
            kernel, members, work, first, *results = these
            outcome: int = kernels.exposures.ensemble(
                kernel, members, units, crowd, ready.changes, work, start, horizon, key, first, *results, most
            )
            return outcome

        in_turn(watch, first, work.runs.notes, work.runs.clock, work.runs.counts[:-1], go_on)
        yield seen, watched


def _checked(model: Model | Network, constants: ArrayLike, runs: int, first_run: int) -> tuple[Network, Ints, Floats]:
    """The network, the initial counts (S,), and the draws (D, R)."""
    check_numbers(runs, None, first_run)
    given = Model.of(model)
    return given.network, given.initial, reals("constants", constants, (None, len(given.network.channels)), minimum=0)
