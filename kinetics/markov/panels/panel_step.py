"""The states between one look and the next: reached from what was possible, leading to what was seen."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from kinetics.markov.derivatives import ChannelEntries
from kinetics.markov.panels.data import PanelData, PanelRun
from kinetics.markov.panels.reach import Reach
from kinetics.markov.passage.until import Mask
from kinetics.markov.transient.search import Search
from kinetics.markov.transient.states import StateSpace
from kinetics.markov.transient.transitions import Transitions, totals
from kinetics.network import Network
from kinetics.support.arrays import Floats, Ints


class Jumps(NamedTuple):
    """An event at a known time: from states `before` to states `after` by `channels`, (J,) each."""

    before: Ints
    after: Ints
    channels: Ints


@dataclass(frozen=True, eq=False)
class PanelStep:
    """The chain over a time in which nothing is seen until its end: between two looks, or over a part of that time.

    Two states more are never left: N, for what leaves the states although it may matter, and N + 1, for what cannot
    lead to the later look.

    look : at the end; -1 if it is none, but a time between two looks
    length : tu
    states : (N, S)
    begins : (M,) places of the states that were possible at the beginning, in their order
    ends : (E,) places of those possible at the end, just before the look
    rows, columns, channels : (K,) of the transitions
    jumps : the event at the look, between places in `ends` and in `seen_states`; None if there is none
    seen_states : (F, S) states that are possible after the look
    is_projected : whether there are so many states that only likely ones are kept
    """

    look: int
    length: float
    states: Ints
    begins: Ints
    ends: Ints
    rows: Ints
    columns: Ints
    channels: Ints
    jumps: Jumps | None
    seen_states: Ints
    is_projected: bool

    @classmethod
    def of(cls, network: Network, data: PanelData, run: PanelRun, look: int, begins: Ints, most: int) -> PanelStep:
        """The step to a look of a run from the states (M, S) that were possible before, over all that can be reached.

        ValueError: what was seen cannot be. TooManyStatesError: more than `most`
        """
        length = float(run.lengths[look])
        states, is_stopped = begins, np.ones(len(begins), dtype=bool)
        if length > 0.0:
            search = Search(network, begins, most, reach_of(network, data, run, look).out_of_reach(np.inf))
            search.go_on(0)
            states, is_stopped = search.states.copy(), search.stopped()
        space = StateSpace(network, states, is_stopped)
        moves = space.transitions()
        ends, jumps, seen_states = ends_at(network, data, run, look, states)
        if not len(ends):
            raise unreachable(network, data, run, look, begins)
        goal = np.zeros(len(states), dtype=bool)
        goal[ends] = True
        channels = ChannelEntries(moves, len(network.channels)).channels
        columns, happens = without_record(network, data, moves.columns, channels, len(states) + 1)
        leading = moves._replace(rows=moves.rows[happens], columns=moves.columns[happens], rates=moves.rates[happens])
        kept = leading.leading_to(goal)
        kept[: len(begins)] = True  # so that their order stays
        whole = cls(
            look,
            length,
            states,
            np.arange(len(begins)),
            ends,
            moves.rows,
            columns,
            channels,
            jumps,
            seen_states,
            False,
        )
        return whole.within(kept, len(states) + 1)

    def within(self, kept: Mask, rest: int) -> PanelStep:
        """The step over the states kept (N,), begins and ends among them; the others become the state N or N + 1."""
        n, m = len(self.states), int(np.count_nonzero(kept))
        place = np.append(np.where(kept, np.cumsum(kept) - 1, m + rest - n), [m, m + 1])
        goes = kept[self.rows]
        return replace(
            self,
            states=self.states[kept],
            begins=place[self.begins],
            ends=place[self.ends],
            rows=place[self.rows[goes]],
            columns=place[self.columns[goes]],
            channels=self.channels[goes],
        )

    def with_begins(self, kept: Mask) -> PanelStep:
        """The step that begins only in these (M,) of its states."""
        return replace(self, begins=self.begins[kept])

    def with_ends(self, kept: Mask) -> PanelStep:
        """The step after which only these (F,) of `seen_states` are possible."""
        if self.jumps is None:
            return replace(self, ends=self.ends[kept], seen_states=self.seen_states[kept])
        ends, jumps, states = _possible(self.ends, self.jumps, self.seen_states, kept)
        return replace(self, ends=ends, jumps=jumps, seen_states=states)

    def chain(self, network: Network) -> Transitions:
        """The transitions at the rates of a network."""
        rates = np.empty(0)
        error = 0.0
        if self.rows.size:
            rates = network.propensities(self.states)[self.rows, self.channels]
            space = StateSpace(network, self.states, np.zeros(len(self.states), dtype=bool))
            error = float(space.rate_errors.max(initial=0.0))
        leaks = np.zeros(len(self.states) + 2)
        return Transitions(self.rows, self.columns, rates, leaks, error, self.channels)

    def forwards(self, network: Network, before: Floats) -> Floats:
        """Probabilities (F,) of the states after a look, from those (E,) just before the event that comes with it."""
        if self.jumps is None:
            return before
        flow = before[self.jumps.before] * self.jump_rates(network)
        return totals(self.jumps.after, flow, len(self.seen_states))

    def backwards(self, network: Network, after: Floats) -> Floats:
        """Values (N + 2,) just before the event of a look, from those (F,) of the states after it."""
        values = np.zeros(len(self.states) + 2)
        if self.jumps is not None:
            flow = after[self.jumps.after] * self.jump_rates(network)
            after = totals(self.jumps.before, flow, len(self.ends))
        values[self.ends] = after
        return values

    def chances(self, network: Network, data: PanelData, run: PanelRun) -> Floats:
        """Probability (F,), or density, of what was seen, in each of `seen_states`; 1 where it is no look."""
        if self.look < 0:
            return np.ones(len(self.seen_states))
        return chances_of(data, run, self.look, self.seen_states @ data.weights(network).T)

    def start(self, chances: Floats) -> Floats:
        """Probabilities (N + 2,) from those (M,) at the earlier look."""
        start = np.zeros(len(self.states) + 2)
        start[self.begins] = chances
        return start

    def jump_rates(self, network: Network) -> Floats:
        """Rates (J,) of the event at the later look, 1/tu."""
        if self.jumps is None:
            return np.empty(0)
        before = self.states[self.ends][self.jumps.before]
        return np.asarray(network.propensities(before)[np.arange(len(before)), self.jumps.channels])


def amplified(tiny: Floats, chances: Floats, is_known: Mask) -> Floats:
    """Bounds (...) on the share of each run's probability that is missing, if at each look (L, ...) a probability
    `tiny` was left out.

    chances : (L, ...) of each look given those before, over the largest that it may have: 1, or the rate of its event
    is_known : (L, ...) whether only one state is possible after it

    What was left out before a look might have made all later ones, each with certainty, up to the next look after which
    the state is known: from there on, the future is that of all else. inf where these looks together are too unlikely.
    """
    share, ahead = np.zeros(tiny.shape[1:]), np.ones(tiny.shape[1:])
    for left, chance, known in zip(tiny[::-1], chances[::-1], is_known[::-1], strict=True):
        ahead = chance * np.where(known, 1.0, ahead)
        with np.errstate(divide="ignore", over="ignore"):
            share = share + left / ahead
    return share


def chances_of(data: PanelData, run: PanelRun, look: int, counted: Floats) -> Floats:
    """Probability, or density, (N,) of all numbers of a look where the columns count so much (N, C)."""
    found = np.ones(len(counted))
    for column, (observation, seen) in enumerate(zip(data.observations.values(), run.seen[look], strict=True)):
        if not np.isnan(seen):
            found *= observation.weights(counted[:, column], float(seen))
    return found


def recorded_channels(network: Network, data: PanelData) -> Ints:
    """Places (C,) of the channels whose events are recorded, each with its time."""
    places = [network.channel_places[name] for names in data.events for name in names]
    return np.unique(np.array(places, dtype=np.int64))


def without_record(network: Network, data: PanelData, columns: Ints, channels: Ints, never: int) -> tuple[Ints, Mask]:
    """Columns (K,) of transitions between two looks, and which of them (K,) may have happened.

    A channel whose events are recorded did not fire there: it leads to the state `never`, and to nothing that was seen.
    """
    happens = ~np.isin(channels, recorded_channels(network, data))
    return np.where(happens, columns, never), happens


def _channels_of(network: Network, data: PanelData, run: PanelRun, look: int) -> Ints | None:
    """The channels one of which the event of a look stands for; None for no event."""
    event = int(run.fired[look])  # type: ignore[index]
    if event < 0:
        return None
    return np.array([network.channel_places[name] for name in data.events[event]], dtype=np.int64)


def reach_of(network: Network, data: PanelData, run: PanelRun, look: int) -> Reach:
    """From which states a look can be reached."""
    return Reach(network, data, run, look, _channels_of(network, data, run, look))


def ends_at(
    network: Network, data: PanelData, run: PanelRun, look: int, states: Ints
) -> tuple[Ints, Jumps | None, Ints]:
    """Which of the states (N, S) are possible just before a look (E,), the event there, and the states after it."""
    fired, weights = _channels_of(network, data, run, look), data.weights(network)
    if fired is None:
        ends = np.flatnonzero(chances_of(data, run, look, states @ weights.T) > 0)
        return ends, None, states[ends]
    ends, jumps, seen_states = _jumps(network, states, fired)
    return _possible(ends, jumps, seen_states, chances_of(data, run, look, seen_states @ weights.T) > 0)


def _jumps(network: Network, states: Ints, fired: Ints) -> tuple[Ints, Jumps, Ints]:
    """Where the event may happen, and where it leads: ends (E,), jumps, and the states after it (F, S)."""
    rates = network.propensities(states)[:, fired] > 0
    before, which = np.nonzero(rates)
    after = states[before] + network.stoichiometry[fired[which]]
    reached, place = np.unique(after, axis=0, return_inverse=True) if len(after) else (after, before)
    ends, origin = np.unique(before, return_inverse=True)
    return ends, Jumps(origin, place.reshape(-1), fired[which]), reached


def _possible(ends: Ints, jumps: Jumps, states: Ints, kept: Mask) -> tuple[Ints, Jumps, Ints]:
    """Only the jumps to the states kept (F,)."""
    lasts = kept[jumps.after]
    before, after = jumps.before[lasts], jumps.after[lasts]
    kept_ends, origin = np.unique(before, return_inverse=True)
    kept_states, place = np.unique(after, return_inverse=True)
    return ends[kept_ends], Jumps(origin, place, jumps.channels[lasts]), states[kept_states]


def unreachable(network: Network, data: PanelData, run: PanelRun, look: int, before: Ints) -> ValueError:
    """The error about a look that cannot be, from the states (n, S) that were possible before."""
    numbers = zip(data.observations.items(), run.seen[look].tolist(), strict=True)
    seen = ", ".join(f"{name} {how.words(value)}" for (name, how), value in numbers if not np.isnan(value)) or "this"
    event = int(run.fired[look])  # type: ignore[index]
    named = f" after {' or '.join(data.events[event])}" if event >= 0 else ""
    names = ", ".join(dict.fromkeys(name for names in data.events for name in names))
    recorded = (
        f"; events are recorded whenever they happen, so that between two looks there was no {names}" if names else ""
    )
    held = [", ".join(f"{network.species[s]} {row[s]}" for s in np.flatnonzero(row)) or "nothing" for row in before[:3]]
    return ValueError(
        f"{run.named(look)}: {seen}{named} cannot be reached from {' or '.join(held)}{' …' if len(before) > 3 else ''} "
        f"by the channels of the network{recorded}"
    )


def too_unlikely(run: PanelRun, look: int) -> ValueError:
    """The error about a look whose probability is no number."""
    return ValueError(f"{run.named(look)}: this has a probability below 1e-300 at these rates; begin with other values")
