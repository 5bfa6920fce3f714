"""The likelihood of runs in which every event was recorded, with its time and with its channel or those it may be.

The density of a path is the product of the rates of what happened, times exp(- the integral of the total rate)
(Andersen, Borgan, Gill & Keiding 1993, section II.7). Where one of several channels fired, their rates add.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from kinetics.markov.panels.base import Likelihood, Scored
from kinetics.markov.panels.slopes import Slopes
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.states import StateSpace
from kinetics.network import Model, Network
from kinetics.network.network import check_homogeneous
from kinetics.runs import RESTART, JumpPath
from kinetics.support.answer import Answer, kind_of
from kinetics.support.arrays import Floats, Ints
from kinetics.support.frozen import set_fields

METHOD = "density of the path"


@dataclass(frozen=True, eq=False)
class EventData:
    """Runs of which every event is known.

    paths : the runs; where several channels may have fired, one of them
    causes : sets of channels that cannot be told apart, each with one change of the counts
    which : (E,) of each path, the place in `causes` of each event; -1 if its channel is known. None: all are known

    ValueError: no runs, channels of one set that change different counts, or times that a coarse clock gave

    >>> from kinetics import JumpPath, Network
    >>> from kinetics.markov.panels import EventData
    >>> ends = Network.from_text('''dies: A -> 0, 1
    ... leaves: A -> 0, 2''')
    >>> path = JumpPath(ends, {"A": 2}, times=[0.5, 1.5], channels=[0, 0], end=3.0)
    >>> EventData([path], [("dies", "leaves")], [[-1, 0]]).n_events
    2
    """

    paths: Sequence[JumpPath]
    causes: Sequence[tuple[str, ...]] = ()
    which: Sequence[Ints] | None = None

    def __post_init__(self) -> None:
        if not self.paths:
            raise ValueError("no runs: there is nothing to learn from")
        network = self.paths[0].network
        for names in self.causes:
            changes = np.array([network.stoichiometry[network.channel_places[name]] for name in names])
            if (changes != changes[0]).any():
                raise ValueError(
                    f"{' or '.join(names)}: they change different counts, so that the counts tell them apart; name the "
                    f"one that fired"
                )
        for path in self.paths:
            if path.resolution:
                raise ValueError(
                    f"events within {path.resolution:g} of each other share a time; give the counts at the times of "
                    f"the looks instead"
                )
        known = [np.full(path.times.size, -1) for path in self.paths]
        which = known if self.which is None else [np.asarray(each, dtype=np.int64) for each in self.which]
        set_fields(self, paths=tuple(self.paths), causes=tuple(self.causes), which=which)

    @property
    def n_events(self) -> int:
        """Events in all runs."""
        return sum(int((path.channels != RESTART).sum()) for path in self.paths)

    @property
    def digest(self) -> str:
        """SHA-256 of the times, changes and starts of all runs, by the names of the species."""
        found = hashlib.sha256(repr((self.paths[0].network.species, self.causes)).encode())
        for path, which in zip(self.paths, self.which or (), strict=True):
            found.update(np.float64(path.end).tobytes())
            for array in (path.initial, path.times, path.states, which):
                found.update(np.ascontiguousarray(array).tobytes())
        return found.hexdigest()


class _Sums(NamedTuple):
    """All that the likelihood needs of the runs that could do the same.

    states : (U, S) all that were visited, each once
    stays : (U,) tu in each
    rows, events : (E,) place of the state before each event, and the place of its channels in `sets`
    numbers : (E,) how often that happened
    is_open : (R,) channels that could fire
    """

    states: Ints
    stays: Floats
    rows: Ints
    events: Ints
    numbers: Ints
    is_open: Ints


@dataclass(frozen=True, eq=False)
class EventLikelihood(Likelihood):
    """The log-density of runs in which every event is known, at any values of the parameters of a model.

    The states visited are found once; each value costs one evaluation of their rates.

    ValueError: the rates depend on the time, or an event has a rate of 0 at the parameters

    >>> from kinetics import JumpPath, Model, Network
    >>> from kinetics.markov.panels import EventData, EventLikelihood
    >>> decay = Model.of(Network.from_text("A -> B, k", k=0.5))
    >>> path = JumpPath(decay.network, {"A": 2}, times=[1.0], channels=[0], end=4.0)
    >>> found = EventLikelihood(decay, EventData([path])).scored({}, ["k"])  # ln(2 k) - k (2 + 3)
    >>> round(found.answer.value, 6), found.gradient.round(9).tolist()
    (-2.5, [-1.5])
    """

    model: Model
    data: EventData

    def scored(self, point: Mapping[str, float] | None, names: Sequence[str]) -> Scored:
        """The log-density and its derivatives by the logarithms of the parameters `names`."""
        began = time.process_time()
        network = self.network_at(point or {})
        check_homogeneous(network)
        slopes = self._slopes(network, point or {}, names)
        total, rounded, gradient, certified = 0.0, 0.0, np.zeros(len(names)), True
        for sums in self._sums:
            space = StateSpace(network, sums.states, np.zeros(len(sums.states), dtype=bool))
            rates = network.propensities(sums.states) * sums.is_open
            relative = ROUNDOFF * (float(space.rate_errors.max(initial=0.0)) + rates.shape[1] + 4.0)
            certified &= bool(np.isfinite(relative))
            shares = rates[sums.rows] * self._members[sums.events]  # of each channel that may have fired
            happened = shares.sum(axis=1)
            if not (happened > 0.0).all():
                raise ValueError(self._impossible(network, sums, int((~(happened > 0.0)).argmax())))
            logs, waits = sums.numbers * np.log(happened), sums.stays @ rates
            total += float(logs.sum() - waits.sum())
            rounded += relative * (sums.numbers.sum() + waits.sum())
            rounded += ROUNDOFF * (len(logs) + len(sums.stays) + 4.0) * float(np.abs(logs).sum() + waits.sum())
            if names:
                gradient += self._gradient(slopes, sums, rates, shares / happened[:, None])
        why = f"{self.data.n_events} events in {len(self.data.paths)} runs"
        error = 1.01 * float(rounded)
        seconds = time.process_time() - began
        return Scored(Answer(total, total - error, total + error, kind_of(certified), METHOD, seconds, why), gradient)

    @property
    def data_digest(self) -> str:
        """SHA-256 of the events."""
        return self.data.digest

    @property
    def size(self) -> dict[str, Any]:
        """Numbers of runs and events."""
        return {"runs": len(self.data.paths), "events": self.data.n_events}

    @property
    def longest(self) -> float:
        """The time, tu, for which the longest run was observed."""
        return max(path.end for path in self.data.paths)

    def _gradient(self, slopes: Slopes, sums: _Sums, rates: Floats, shares: Floats) -> Floats:
        """Derivatives (P,): for every channel, the events that are its own less those expected of it."""
        rows, channels = np.nonzero(rates > 0.0)
        weights = -sums.stays[:, None] * rates
        np.add.at(weights, sums.rows, sums.numbers[:, None] * shares)
        return np.asarray(slopes.of_rates(sums.states, rows, channels) @ weights[rows, channels])

    @cached_property
    def _sets(self) -> dict[tuple[int, ...], int]:
        """Place of each set of channels that an event may be of: the channels by themselves first."""
        places = self.model.network.channel_places
        sets: dict[tuple[int, ...], int] = {(channel,): channel for channel in range(len(places))}
        for names in self.data.causes:
            sets.setdefault(tuple(sorted(places[name] for name in names)), len(sets))
        return sets

    @cached_property
    def _members(self) -> Floats:
        """Whether a channel (R,) is in each set (sets, R)."""
        table = np.zeros((len(self._sets), len(self.model.network.channels)))
        for members, place in self._sets.items():
            table[place, list(members)] = 1.0
        return table

    @cached_property
    def _sums(self) -> list[_Sums]:
        """One for each set of open channels."""
        places = self.model.network.channel_places
        causes = [self._sets[tuple(sorted(places[name] for name in names))] for names in self.data.causes]
        found: dict[bytes, list[tuple[JumpPath, Ints]]] = {}
        for path, which in zip(self.data.paths, self.data.which or (), strict=True):
            if list(path.network.channels) != list(places):
                raise ValueError("the runs are those of another network: its channels have other names")
            found.setdefault(path.open_channels.tobytes(), []).append((path, which))
        sums = []
        for members in found.values():
            states = np.concatenate([path.states for path, _ in members])
            stays = np.concatenate([np.diff(path.times, prepend=0.0, append=path.end) for path, _ in members])
            fired = np.concatenate([np.append(path.channels, RESTART) for path, _ in members])
            named = np.concatenate([np.append(which, -1) for _, which in members])
            events = np.where(named < 0, fired, np.array([*causes, -1])[named])
            visited, place = np.unique(states, axis=0, return_inverse=True)
            place = place.reshape(-1)
            happened = np.column_stack([place, events])[fired != RESTART]
            pairs, numbers = np.unique(happened, axis=0, return_counts=True)
            stay = np.bincount(place, weights=stays, minlength=len(visited)).astype(np.float64)
            is_open = members[0][0].open_channels.astype(np.int64)
            sums.append(_Sums(visited, stay, pairs[:, 0], pairs[:, 1], numbers, is_open))
        return sums

    def _impossible(self, network: Network, sums: _Sums, event: int) -> str:
        members = list(self._sets)[sums.events[event]]
        state = sums.states[sums.rows[event]]
        held = ", ".join(f"{network.species[s]} {state[s]}" for s in np.flatnonzero(state)) or "nothing"
        named = " or ".join(network.channels[channel] for channel in members)
        return f"{named} fired from {held}, where its rate is 0; begin with other values"


def log_probability(path: JumpPath, model: Model | Network | None = None) -> Answer:
    """The logarithm of the probability density of a path, with bounds; densities are by the times of its events.

    model : at which rates; None for those of the path's network. Channels that were not open in the path do not count

    >>> from kinetics import JumpPath, Network
    >>> from kinetics.markov.panels import log_probability
    >>> decay = Network.from_text("A -> B, 0.5")
    >>> log_probability(JumpPath(decay, {"A": 2}, times=[1.0], channels=[0], end=4.0)).value  # ln(2 k) - k (2 + 3)
    -2.5
    """
    given = Model.of(path.network if model is None else model)
    return EventLikelihood(given, EventData([replace(path, network=given.network)])).value()
