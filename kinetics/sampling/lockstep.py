"""The direct method for many runs at once, side by side in vector lanes."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from kinetics.native import twins
from kinetics.native.lanes import LANES, Lanes
from kinetics.network import Network
from kinetics.sampling.base import SamplingMethod
from kinetics.sampling.cost_model import NetworkSize
from kinetics.sampling.direct import Direct, RecomputingSampler
from kinetics.sampling.merging import MergedChannels, Merging
from kinetics.sampling.run_source import Sampler
from kinetics.sampling.watch import Watch
from kinetics.support.arrays import Floats, Ints

LARGEST_CHANGE = 2**40  # of a count by one event
LARGEST_COUNT = 2**52
FEWEST_RUNS = 8  # in lockstep; fewer cost less one by one


@dataclass(frozen=True)
class Lockstep(SamplingMethod):
    """The direct method (Gillespie 1977, doi:10.1021/j100540a008) for 64 runs at a time, an exact sampling method.

    The runs are those of `Direct`, to the last bit. If the lanes are full, an event costs about 3 ns plus 0.8 ns per
    channel; beyond 8 species, 30 ns plus 0.36 ns per channel. Choose it for ensembles of networks with up to about a
    hundred channels. Fewer runs than `FEWEST_RUNS` are made one by one.

    >>> from kinetics import Direct, Lockstep, Network, simulate
    >>> decay = Network.from_text("A -> 0, 0.1")
    >>> one, other = (simulate(decay, method, {"A": 100}, [10.0], seed=1) for method in (Direct(), Lockstep()))
    >>> bool((one.counts == other.counts).all())
    True
    """

    name: ClassVar[str] = "lockstep"
    start_cost: ClassVar[float] = 50.0
    takes_until: ClassVar[bool] = True
    takes_crowds: ClassVar[bool] = True
    max_channels: ClassVar[float] = 2000
    is_for_ensembles: ClassVar[bool] = True

    def prepared(self, network: Network) -> Sampler:
        """The network made ready for `kernels.lockstep`."""
        return LockstepSampler(network)

    def sampler_of_rates(self, network: Network) -> Callable[[Floats], Sampler]:
        """The coefficients alone change; the few runs that are made one by one are prepared when they come."""
        with_units = network.with_rates(np.ones(len(network.channels)))
        self.sampler(with_units)  # refuses what it does not take
        one_by_one = Direct().sampler_of_rates(network)
        ready = LockstepSampler(with_units)
        return lambda constants: ready.with_constants(constants, one_by_one(constants))

    def cost(self, size: NetworkSize) -> float:
        """Processor time of an event, ns, in an ensemble that fills the lanes."""
        base, each = (30.0, 0.36) if size.n_species > 8 else (3.0, 0.8)
        return base + each * size.n_merged + 0.15 * (size.n_channels - size.n_merged)


class LockstepSampler:
    """Runs of an ensemble side by side; few runs and single paths as ever."""

    def __init__(self, network: Network):
        self.one_by_one = one_by_one = Direct().prepared(network)
        # Merged or not as there, so that the runs are the same.
        if isinstance(one_by_one, RecomputingSampler):
            self.merging = one_by_one.merging
        else:
            self.merging = Merging.of(network, np.arange(len(network.channels)))
        self.constants: Floats | None = None
        self.changes = network.stoichiometry[self.merging.representatives]
        self.path = self.one_by_one.path

    def with_constants(self, constants: Floats, one_by_one: Sampler) -> LockstepSampler:
        """A copy with rate constants (R,), 1/tu, in place of constants of 1."""
        other = copy(self)
        other.one_by_one, other.path = one_by_one, one_by_one.path
        vars(other).pop("model", None)
        other.constants = constants
        return other

    @cached_property
    def model(self) -> MergedChannels:
        """The tables that the kernels read, without the factors of a crowd."""
        return self.merging.model(self.constants)

    def model_from(self, initial: Ints) -> MergedChannels:
        """The tables for runs from counts (S,), on which those of a crowd depend."""
        # In a crowd runs one by one compute all propensities anew, as here.
        if isinstance(self.one_by_one, RecomputingSampler) and self.merging.crowded is not None:
            return self.one_by_one.model_from(initial)
        return self.model

    def ensemble(
        self, initial: Ints, grid: Floats, key: NDArray[np.uint64], first_run: int, out: Ints, watch: Watch
    ) -> None:
        """Fill `out` (runs, T, S) as far as the watch needs it."""
        # Lanes count in doubles.
        is_exact = initial.max() < LARGEST_COUNT and np.abs(self.changes).max(initial=0) < LARGEST_CHANGE
        if len(out) < FEWEST_RUNS or not is_exact:
            self.one_by_one.ensemble(initial, grid, key, first_run, out, watch)
            return
        model = self.model_from(initial)
        lanes, is_odd = Lanes(model, self.changes), np.zeros(len(out), dtype=bool)
        here = lanes.arrays
        stopping = watch.stop_of(self.merging.representatives), watch.reached_of(first_run, len(out))
        go_on = twins.lockstep(model, self.changes, lanes, initial, grid, key, first_run, out, is_odd, stopping)
        n_active, first_look = 1, watch.first_look
        while n_active:
            until = here["looks"][: here["notes"][0]].min(initial=here["notes"][2] + first_look)
            most = min(max(1, watch.most_events // min(LANES, len(out))), int(until - here["notes"][2]))
            began = perf_counter()
            go_on(watch.limits(first_run), most)
            n_active = int(here["notes"][0])
            unfinished = here["run"][:n_active].min(initial=len(out))
            watch.complete[first_run] = int(np.flatnonzero(is_odd).min(initial=unfinished))
            watch.pause(began)
            due = np.flatnonzero(here["looks"][:n_active] <= here["notes"][2])
            if due.size:
                self._look(here, due, first_run, watch)
        for i in np.flatnonzero(is_odd).tolist():
            self.one_by_one.ensemble(initial, grid, key, first_run + i, out[i : i + 1], watch)

    def _look(self, here: dict[str, Any], due: Ints, first_run: int, watch: Watch) -> None:
        """Look at the runs of some lanes, and end those that are truncated."""
        n_species, events = self.changes.shape[1], here["notes"][2] - here["begun"][due]
        counts = here["counts"][:n_species, due].T.astype(np.int64)
        again = np.zeros(due.size, dtype=np.int64)
        for i in np.argsort(here["run"][due]).tolist():
            lane = due[i]
            again[i] = watch.look(first_run + int(here["run"][lane]), int(events[i]), float(here["t"][lane]), counts[i])
        here["looks"][due] = here["begun"][due] + again
        cut = due[again == 0]
        here["looks"][cut], here["upcoming"][cut] = np.iinfo(np.int64).max, -np.inf
        here["seen"][cut] = watch.grid.size
