"""Runs and paths by any sampling method: `simulate` and `sample_path`."""

from __future__ import annotations

from typing import overload

from numpy.typing import ArrayLike

from kinetics.network import Model, Network
from kinetics.network.predicates import Condition
from kinetics.runs import Ensemble, FirstTimes, JumpPath
from kinetics.sampling.auto import Auto
from kinetics.sampling.base import SamplingMethod
from kinetics.sampling.exact_methods import EXACT_METHODS
from kinetics.sampling.watch import MAX_EVENTS
from kinetics.support.arrays import Counts

SAMPLING_METHODS: tuple[type[SamplingMethod], ...] = (*EXACT_METHODS, Auto)
BY_NAME = {method.name: method for method in SAMPLING_METHODS}


@overload
def simulate(
    model: Model | Network,
    method: SamplingMethod | str,
    initial: Counts | None = None,
    times: ArrayLike = (),
    runs: int = 1000,
    seed: int = 0,
    threads: int | None = None,
    max_events: int = MAX_EVENTS,
) -> Ensemble: ...


@overload
def simulate(
    model: Model | Network,
    method: SamplingMethod | str,
    initial: Counts | None = None,
    times: ArrayLike = (),
    runs: int = 1000,
    seed: int = 0,
    threads: int | None = None,
    max_events: int = MAX_EVENTS,
    *,
    until: str,
) -> FirstTimes: ...


def simulate(
    model: Model | Network,
    method: SamplingMethod | str,
    initial: Counts | None = None,
    times: ArrayLike = (),
    runs: int = 1000,
    seed: int = 0,
    threads: int | None = None,
    max_events: int = MAX_EVENTS,
    *,
    until: str | None = None,
) -> Ensemble | FirstTimes:
    """Counts of `runs` independent runs at `times` (T,), tu; the same for any number of threads.

    method : one with its settings, or its name: "auto", "ssa" and the others of `SAMPLING_METHODS`
    initial : counts at time 0, as in {"A": 100}, that go before the model's; None for these
    max_events : the most events of a run. One that would come to more, or whose counts or propensities go beyond all
        numbers, is truncated: the ensemble then ends at the last time before that, and `truncated` says why
    until : a condition on counts at which runs end, as "AB >= 8 & !(A == 0)", which may name observables
        of the model. The result is then when it first held in each run, and `times` is the last time until which runs
        are followed: by default as long as anything can happen
    ValueError: a run truncated before the first time, no such method, one that does not take the network, missing
        rates, or more counts than memory holds
    TypeError: neither a name nor a sampling method

    The result holds all counts, (runs, T, S). If these are too many for memory, `simulate_statistics` keeps their
    statistics alone.

    >>> from kinetics import Network, simulate
    >>> binding = Network.from_text("A + B <-> AB, 0.01, 0.1")
    >>> runs = simulate(binding, "auto", {"A": 20, "B": 10}, [0.0, 5.0, 50.0], runs=400, seed=1)
    >>> runs.counts.shape
    (400, 3, 3)
    >>> bool((runs["B"] + runs["AB"] == 10).all())
    True
    >>> first = simulate(binding, "auto", {"A": 20, "B": 10}, runs=400, seed=1, until="AB >= 6")
    >>> print(first.answer("mean"))
    6.72804 [6.3452, 7.11089] (95 % confidence; auto (lockstep); 400 runs)
    """
    given, made = Model.of(model, initial), sampling_method(method)
    if until is not None:
        condition = Condition(until, given)
        return made.first_times(
            given.network, given.initial, condition, times, runs, seed, threads, max_events=max_events
        )
    return made.simulate(given.network, given.initial, times, runs, seed, threads, max_events=max_events)


def sample_path(
    model: Model | Network,
    initial: Counts | None,
    end: float,
    seed: int = 0,
    run: int = 0,
    max_events: int = MAX_EVENTS,
    until: str | None = None,
) -> JumpPath:
    """Every event of one exact run until `end`, tu, or until a condition on counts holds.

    initial : counts at time 0 that go before the model's; None for these
    The method is that of `path_method`: the direct method under mass action, `General` under other rate laws. (seed,
    run) name the run. ValueError: missing rates, no method that takes the network, or one with events; a run that
    would come to more than `max_events` events

    >>> from kinetics import Network, sample_path
    >>> decay = Network.from_text("A -> 0, 0.1")
    >>> sample_path(decay, {"A": 5}, end=1e6, seed=1).states[:, 0].tolist()
    [5, 4, 3, 2, 1, 0]
    """
    given = Model.of(model, initial)
    method, condition = path_method(given.network), None if until is None else Condition(until, given)
    return method.sample_path(given.network, given.initial, end, seed, run, max_events, condition)


def path_method(network: Network) -> SamplingMethod:
    """The method of `sample_path`: the first of `EXACT_METHODS` that takes the network. ValueError: none does."""
    refusals = []
    for kind in EXACT_METHODS:
        method = kind()
        refusal = method.unsupported_reason(network)
        if not refusal:
            return method
        refusals.append(refusal)
    raise ValueError(f"no exact method supports this network: {'; '.join(dict.fromkeys(refusals))}")


def sampling_method(method: SamplingMethod | str) -> SamplingMethod:
    """The sampling method of this name, with its default settings; a method itself as it is.

    ValueError: no such name. TypeError: neither a name nor a sampling method
    """
    if isinstance(method, SamplingMethod):
        return method
    if not isinstance(method, str):
        raise TypeError(f"method = {method!r}; expected a sampling method such as Direct(), or its name")
    if method not in BY_NAME:
        raise ValueError(f"unknown sampling method {method!r}; they are {', '.join(BY_NAME)}")
    return BY_NAME[method]()
