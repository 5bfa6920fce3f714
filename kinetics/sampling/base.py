"""The base of all sampling methods: their traits, checks of arguments, and random streams."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from itertools import count
from math import inf
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.network import Network
from kinetics.network.predicates import Condition
from kinetics.runs import Ensemble, FirstTimes, JumpPath
from kinetics.sampling.cost_model import NetworkSize
from kinetics.sampling.crowds import unbounded
from kinetics.sampling.mass_action import order_refusal
from kinetics.sampling.outlook import Outlook
from kinetics.sampling.run_source import RunSource, Sampler
from kinetics.sampling.stopping import stop_at
from kinetics.sampling.watch import MAX_EVENTS, Watch
from kinetics.support.arrays import Counts, Floats, rising_times, some_times, whole_number


class SamplingMethod(ABC):
    """A method that draws independent runs: a frozen dataclass that holds nothing but its settings.

    To add one:
    1. Write its class in a file of its own, with a `name` for the command line and for tables.
    2. Declare which networks it can sample by the traits below; the base refuses others. For other limits, override
       `unsupported_reason`.
    3. Give `prepared`: a `Sampler` of a network, by a kernel (see `BufferedSampler`) or in plain Python.
    4. Give `cost` and `start_cost` if `auto` may choose it.
    5. Import it in `kinetics.sampling.exact_methods`. Command line, `auto`, hard cases and contract tests read the
       tuple made there.

    >>> from kinetics import Network
    >>> from kinetics.sampling import SAMPLING_METHODS
    >>> by_law = Network.from_text("A -> B, 5 * A / (2 + A)")
    >>> [method.name for method in SAMPLING_METHODS if method().supports(by_law)]
    ['general', 'auto']
    """

    name: ClassVar[str]
    takes_rate_laws: ClassVar[bool] = False  # other than mass action
    takes_crowds: ClassVar[bool] = False  # by thinning, see `sampling.crowds`; who takes rate laws takes them too
    takes_events: ClassVar[bool] = False
    takes_until: ClassVar[bool] = False  # a condition at which runs end: its sampler heeds `Watch.until`
    most_reactants: ClassVar[float] = inf  # of a channel
    max_species: ClassVar[float] = inf
    max_channels: ClassVar[float] = inf
    most_factors: ClassVar[float] = 1e7  # channels times reactants of the largest, a table; up to 4 reactants, any
    start_cost: ClassVar[float] = 2e4  # processor time of a run without events, ns
    is_for_ensembles: ClassVar[bool] = False  # its cost is that of many runs made at once

    @abstractmethod
    def prepared(self, network: Network) -> Sampler:
        """The network made ready for sampling; the traits have been checked."""

    def cost(self, size: NetworkSize) -> float:  # noqa: ARG002
        """Processor time of an event, ns, as measured on long runs; inf keeps `auto` from choosing the method."""
        return inf

    def unsupported_reason(self, network: Network, size: NetworkSize | None = None) -> str:
        """Why the method cannot sample the network; empty if it can. `supports`, `auto` and `sampler` all ask this.

        A method with a limit that no trait expresses overrides it, and asks this one first.
        """
        if self.takes_crowds and network.crowding is not None:
            size = NetworkSize.of(network) if size is None else size
            if not size.has_bounds:
                return f"{unbounded(network)}; the method {self.name!r} takes no others: use 'general', or 'auto'"
            return self.unsupported_reason(network.uncrowded, size)
        odd = [] if self.takes_rate_laws else [f"a rate law for channel {name!r}" for name in network.laws]
        odd += [] if self.takes_events else [f"event {event.name!r}" for event in network.events]
        if odd:
            more = f" and {len(odd) - 1} more" if len(odd) > 1 else ""
            takes = "no events" if self.takes_rate_laws else "mass action only"
            return f"the network has {odd[0]}{more}; the method {self.name!r} takes {takes}: use 'general', or 'auto'"
        size = NetworkSize.of(network) if size is None else size
        for what, here, most in (
            ("species", size.n_species, self.max_species),
            ("channels", size.n_channels, self.max_channels),
        ):
            if here > most:
                return f"the network has {here} {what}; the method {self.name!r} takes at most {most}: use 'auto'"
        if size.order > self.most_reactants:
            orders = NetworkSize.orders(network)
            r = int(orders.argmax())
            return (
                f"channel {network.channels[r]!r} has {orders[r]} reactants; the method {self.name!r} takes at "
                f"most {self.most_reactants}: use 'auto'"
            )
        refusal = order_refusal(network)
        if not refusal and size.order > 4 and size.n_channels * size.order > self.most_factors:
            r = int(NetworkSize.orders(network).argmax())
            return (
                f"channel {network.channels[r]!r} has {size.order} reactants, among {size.n_channels} channels; the "
                f"method {self.name!r} takes at most {self.most_factors:g} as their product: use 'general', or 'auto'"
            )
        return refusal

    def name_for(self, network: Network, initial: Counts) -> str:  # noqa: ARG002
        """The method's name in results from this network and these counts; `auto` adds the method that it chose."""
        return self.name

    def supports(self, network: Network) -> bool:
        """True if the method can sample the network; `unsupported_reason` gives the reason if not."""
        return not self.unsupported_reason(network)

    def sampler(self, network: Network) -> Sampler:
        """A sampler of the network; a ValueError if the method cannot sample it."""
        refusal = self.unsupported_reason(network)
        if refusal:
            raise ValueError(refusal)
        return self.prepared(network)

    def sampler_of_rates(self, network: Network) -> Callable[[Floats], Sampler]:
        """A function from rate constants (R,), checked before, to the network made ready with them.

        A method overrides it where most of the work can be done once for all rate constants.
        """
        return lambda constants: self.sampler(network.with_rates(constants))

    def stopping(self, network: Network, initial: Counts) -> SamplingMethod:  # noqa: ARG002
        """The method for runs that end at a condition: itself, or the one it chooses; a ValueError if there is none."""
        if not self.takes_until:
            raise ValueError(
                f"the method {self.name!r} does not support a condition that ends runs (until): use 'auto'"
            )
        return self

    def source(
        self,
        network: Network,
        initial: Counts,
        seed: int = 0,
        max_events: int = MAX_EVENTS,
        until: str | Condition | None = None,
    ) -> RunSource:
        """The source of the runs from `initial` under a seed, by run number; a ValueError as for `simulate`."""
        start = network.state(initial)
        stop, is_there = (None, False) if until is None else stop_at(until, network, start)
        return RunSource(
            (self if until is None else self.stopping(network, start)).sampler(network),
            start,
            stream_key(seed),
            outlook=Outlook(network),
            max_events=whole_number("max_events", max_events, 1),
            until=stop,
            ends_at_once=is_there,
        )

    def simulate(
        self,
        network: Network,
        initial: Counts,
        times: ArrayLike,
        runs: int = 1000,
        seed: int = 0,
        threads: int | None = None,
        first_run: int = 0,
        max_events: int = MAX_EVENTS,
    ) -> Ensemble:
        """Counts of `runs` independent runs at `times` (T,), tu.

        threads : at most this many; by default one a processor core
        first_run : number of the first run; with one seed, runs of different numbers are independent
        max_events : the most events of a run; one that would come to more is truncated, and the ensemble ends at the
            last time before that, see `Ensemble.truncated`
        The same seed gives the same runs for any number of threads and any grid of times.
        """
        check_numbers(runs, threads, first_run)
        grid = some_times(times)
        source = self.source(network, initial, seed, max_events)
        watch = source.watch(grid, first_run)
        counts = source.counts(grid, runs, first_run, threads, watch)
        name = self.name_for(network, initial)
        return Ensemble(network, grid[: counts.shape[1]], counts, name, watch.truncation(runs))

    def first_times(
        self,
        network: Network,
        initial: Counts,
        until: str | Condition,
        times: ArrayLike = inf,
        runs: int = 1000,
        seed: int = 0,
        threads: int | None = None,
        first_run: int = 0,
        max_events: int = MAX_EVENTS,
    ) -> FirstTimes:
        """When a condition on counts first holds in `runs` independent runs, those of `simulate` under the same seed.

        until : the condition, at which runs end, as "AB >= 8 & !(A == 0)"; a `Condition` where it names observables
        times : the last of these is when a run ends at the latest, tu; inf for as long as anything can happen
        """
        check_numbers(runs, threads, first_run)
        end = _horizon(times)
        source, method = self.source(network, initial, seed, max_events, until), self.stopping(network, initial)
        text = until if isinstance(until, str) else until.text
        name = self.name if method is self else f"{self.name} ({method.name})"
        grid = np.array([min(end, np.finfo(float).max)])
        watch = source.watch(grid, first_run, runs)
        counts = source.counts(grid, runs, first_run, threads, watch)[:, 0]
        observed = np.minimum(watch.reached, end)
        for run, stop in watch.stops.items():
            observed[run - first_run], counts[run - first_run] = stop.time, stop.counts
        reached = np.where(watch.reached < inf, watch.reached, np.nan)
        return FirstTimes(network, text, reached, observed, counts, end, name, watch.truncation(runs))

    def sample_path(
        self,
        network: Network,
        initial: Counts,
        end: float,
        seed: int = 0,
        run: int = 0,
        max_events: int = MAX_EVENTS,
        until: str | Condition | None = None,
    ) -> JumpPath:
        """Every event of one run until `end`, tu: run number `run` of `simulate` under the same seed.

        until : a condition on counts; the path ends when it first holds
        ValueError: a run that has, or would come to, more than `max_events` events
        """
        return next(self.sample_paths(network, initial, end, seed, run, max_events, until))

    def sample_paths(
        self,
        network: Network,
        initial: Counts,
        end: float,
        seed: int = 0,
        first_run: int = 0,
        max_events: int = MAX_EVENTS,
        until: str | Condition | None = None,
    ) -> Iterator[JumpPath]:
        """Paths of runs first_run, first_run + 1, ..., an infinite number; the network is made ready once."""
        horizon = float(rising_times([end])[0])
        source = self.source(network, initial, seed, max_events, until)
        for run in count(whole_number("run", first_run, 0)):
            watch = Watch(np.array([horizon]), source.outlook, max_events, run, is_path=True, until=source.until)
            times, channels = source.path(horizon, run, watch)
            yield JumpPath(network, source.start, times, channels, min(horizon, float(watch.reached.min(initial=inf))))


def _horizon(times: ArrayLike) -> float:
    """The last time until which runs are followed that end at a condition; inf for none."""
    last = np.atleast_1d(np.asarray(times))[-1:].tolist()
    return inf if last in ([], [inf]) else float(some_times(last)[-1])


def check_numbers(runs: int, threads: int | None, first_run: int) -> None:
    """Raise a ValueError if one of these arguments of `simulate` is no whole number, or too small."""
    whole_number("runs", runs, 1)
    whole_number("first_run", first_run, 0)
    if threads is not None:
        whole_number("threads", threads, 1)


def stream_key(seed: int) -> NDArray[np.uint64]:
    """Key (4,) from which the random stream of every run is derived."""
    return np.asarray(np.random.SeedSequence(whole_number("seed", seed, 0)).generate_state(4, np.uint64), np.uint64)
