"""The states between one look and the next: reached from what was possible, leading to what was seen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kinetics.markov.derivatives import ChannelEntries
from kinetics.markov.panels.data import PanelData, PanelRun
from kinetics.markov.passage.backward import jump_rate, one_step, steps_until, weights_errors
from kinetics.markov.passage.until import Mask
from kinetics.markov.transient.poisson import ROUNDOFF, poisson_window
from kinetics.markov.transient.projection import likely_states
from kinetics.markov.transient.search import Search, TooManyStatesError
from kinetics.markov.transient.states import StateSpace
from kinetics.markov.transient.transitions import Transitions
from kinetics.markov.transient.uniformisation import MAX_STEPS, STEP_SECONDS
from kinetics.network import Network
from kinetics.support.arrays import Floats, Ints
from kinetics.support.cli.progress import forecast
from kinetics.support.packages import sparse
from kinetics.support.tables import rough

EXPLORED = 20_000  # states; where more can be reached, likely ones are enough
LOST_AT_MOST = 1e-13  # of the probability between two looks, where only likely states are kept


class Jumps(NamedTuple):
    """An event at a known time: from states `before` to states `after` by `channels`, (J,) each."""

    before: Ints
    after: Ints
    channels: Ints


@dataclass(frozen=True, eq=False)
class PanelStep:
    """The chain between two looks.

    Two states more are never left: what was lost because the states are not all that can be reached, and what cannot
    lead to the later look.

    states : (N, S)
    begins : (M,) places of the states that were possible at the earlier look, in their order
    ends : (E,) places of those possible just before the later one
    rows, columns, channels : (K,) of the transitions
    jumps : the event at the later look, between places in `ends` and in `seen_states`; None if there is none
    seen_states : (F, S) states that are possible after the later look
    is_projected : whether there are so many states that only likely ones are kept
    """

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
    def of(
        cls, network: Network, data: PanelData, run: PanelRun, look: int, begins: Ints, max_states: int
    ) -> PanelStep:
        """The step to a look of a run from the states (M, S) that were possible before.

        ValueError: what was seen cannot be, or too many states
        """
        fired = _channels_of(network, data, int(run.fired[look]))  # type: ignore[index]
        weights = data.weights(network)
        length = float(run.times[look] - (run.times[look - 1] if look else run.start))
        is_projected = False
        states, is_stopped = begins, np.ones(len(begins), dtype=bool)
        if length > 0.0:
            bounds = _bounds(data, run, look, weights, network, fired)
            try:
                states, is_stopped = _hopeful(network, begins, bounds, min(EXPLORED, max_states))
            except TooManyStatesError as error:
                try:
                    states = likely_states(network, begins, length, LOST_AT_MOST, max_states)
                    is_stopped, is_projected = _is_hopeless(states, *bounds), True
                except TooManyStatesError:
                    # What was seen may leave far fewer states than are likely: so it is for many events between looks.
                    if max_states <= EXPLORED:
                        raise error from None
                    states, is_stopped = _hopeful(network, begins, bounds, max_states)
        space = StateSpace(network, states, is_stopped)
        entries = ChannelEntries(space.transitions(), len(network.channels))
        out = _ways_out(network, space) if is_projected else (np.empty(0, dtype=np.int64),) * 2
        moves = entries.transitions
        rows, channels = np.append(moves.rows, out[0]), np.append(entries.channels, out[1])
        columns = np.append(moves.columns, np.full(out[0].size, len(states)))
        if fired is None:
            ends, jumps = np.flatnonzero(chances_of(data, run, look, states @ weights.T) > 0), None
            seen_states = states[ends]
        else:
            ends, jumps, seen_states = _jumps(network, states, fired)
            chances = chances_of(data, run, look, seen_states @ weights.T)
            ends, jumps, seen_states = _possible(ends, jumps, seen_states, chances)
        if not len(ends):
            raise unreachable(network, data, run, look, begins)
        # Only states that lead to an end; those of the beginning stay, so that their order does.
        n = len(states)
        whole = Transitions(rows, columns, np.ones(rows.size), np.zeros(n + 1), 0.0, channels)
        goal = np.zeros(n + 1, dtype=bool)
        goal[ends] = True
        kept = whole.leading_to(goal)
        kept[: len(begins)] = kept[n] = True
        part, place = ChannelEntries(whole.within(kept), 0), np.cumsum(kept) - 1
        moves = part.transitions
        begin_places = place[: len(begins)]
        return cls(
            states[kept[:n]],
            begin_places,
            place[ends],
            moves.rows,
            moves.columns,
            part.channels,
            jumps,
            seen_states,
            is_projected,
        )

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


def amplified(tiny: Floats, chances: Floats, is_known: Mask) -> float:
    """Bound on the share of a run's probability that is missing, where at each look (L,) a probability `tiny` was left
    out.

    chances : (L,) of each look given those before, over the largest that it may have: 1, or the rate of its event
    is_known : (L,) whether only one state is possible after it

    What was left out before a look might have made all later ones, each with certainty, up to the next look after which
    the state is known: from there on, the future is that of all else. inf where these looks together are too unlikely.
    """
    share, ahead = 0.0, 1.0
    for left, chance, known in zip(tiny[::-1], chances[::-1], is_known[::-1], strict=True):
        ahead = float(chance) * (1.0 if known else ahead)
        share += float(left) / ahead if ahead > 0.0 else np.inf
    return share


def carried(chain: Transitions, start: Floats, time: float, left_out: float) -> tuple[Floats, float]:
    """Probabilities (N,) after a time, tu, from those at the start (N,), and the relative error of each.

    left_out : of the Poisson probability of more steps, which is beyond that error, as are numbers below 1e-300

    As `expected_from_all`, forwards. ValueError: too many steps
    """
    if time == 0.0 or not chain.rates.any():
        return start.copy(), 0.0
    steps = steps_until(chain, time)
    if steps > MAX_STEPS:
        raise ValueError(
            f"the chain is too stiff: {steps:.3g} steps between two looks {time:g} tu apart, at most {MAX_STEPS}"
        )
    forecast(steps * STEP_SECONDS * (start.size + chain.rates.size), f"{rough(steps)} steps from look to look")
    moves, stays, roundings = one_step(chain)
    into = sparse.csr_array(moves.T)
    first, weights = poisson_window(jump_rate(chain) * time, left_out)
    now, found = start.copy(), np.zeros(start.size)
    for n in range(first + weights.size):
        if n >= first:
            found += weights[n - first] * now
        now = into @ now + stays * now
    n_steps, mean = first + weights.size, jump_rate(chain) * time
    roundings += 2.0 * (int(np.bincount(chain.columns, minlength=1).max()) + 2.0)
    jumps = n_steps + float(chain.exits.max()) * time
    relative = n_steps * roundings + jumps * (chain.roundings + 1.0) + 2.0 * weights.size + 4.0
    return found, 1.01 * float(np.expm1(ROUNDOFF * relative) + weights_errors(mean, first, weights.size).max())


def chances_of(data: PanelData, run: PanelRun, look: int, counted: Floats) -> Floats:
    """Probability, or density, (N,) of all numbers of a look where the columns count so much (N, C)."""
    found = np.ones(len(counted))
    for column, (observation, seen) in enumerate(zip(data.observations.values(), run.seen[look], strict=True)):
        if not np.isnan(seen):
            found *= observation.weights(counted[:, column], float(seen))
    return found


def _channels_of(network: Network, data: PanelData, event: int) -> Ints | None:
    """The channels one of which an event stands for; None for no event."""
    if event < 0:
        return None
    return np.array([network.channel_places[name] for name in data.events[event]], dtype=np.int64)


def _bounds(
    data: PanelData, run: PanelRun, look: int, weights: Floats, network: Network, fired: Ints | None
) -> tuple[Floats, Floats, Floats, Mask, Mask]:
    """Weights of the columns seen, the least and most that each may count just before the look, and whether no channel
    makes it more, or less."""
    low, high = np.full(len(weights), -np.inf), np.full(len(weights), np.inf)
    for column, observation in enumerate(data.observations.values()):
        seen = float(run.seen[look, column])
        if not np.isnan(seen):
            low[column], high[column] = observation.support(seen)
    changes = network.stoichiometry @ weights.T
    if fired is not None:
        low, high = low - changes[fired].max(axis=0), high - changes[fired].min(axis=0)
    works = network.known_rates > 0 if not network.laws else np.ones(len(network.channels), dtype=bool)
    never_more, never_less = np.all(changes[works] <= 0, axis=0), np.all(changes[works] >= 0, axis=0)
    return weights, low, high, never_more, never_less


def _hopeful(
    network: Network, begins: Ints, bounds: tuple[Floats, Floats, Floats, Mask, Mask], max_states: int
) -> tuple[Ints, Mask]:
    """The states (N, S) reached from `begins` through states from which the look is not out of reach, and which of
    them (N,) are out of reach, where the search ends. TooManyStatesError: more than `max_states`"""
    search = Search(network, begins, max_states, lambda states: _is_hopeless(states, *bounds))
    search.go_on(0)
    return search.states.copy(), search.stopped()


def _is_hopeless(states: Ints, weights: Floats, low: Floats, high: Floats, never_more: Mask, never_less: Mask) -> Mask:
    """Whether what was seen is out of reach of states (N, S): too little of what never grows, or too much of what never
    shrinks."""
    counted = states @ weights.T
    return np.asarray((((counted < low) & never_more) | ((counted > high) & never_less)).any(axis=1))


def _jumps(network: Network, states: Ints, fired: Ints) -> tuple[Ints, Jumps, Ints]:
    """Where the event may happen, and where it leads: ends (E,), jumps, and the states after it (F, S)."""
    rates = network.propensities(states)[:, fired] > 0
    before, which = np.nonzero(rates)
    after = states[before] + network.stoichiometry[fired[which]]
    reached, place = np.unique(after, axis=0, return_inverse=True) if len(after) else (after, before)
    ends, origin = np.unique(before, return_inverse=True)
    return ends, Jumps(origin, place.reshape(-1), fired[which]), reached


def _possible(ends: Ints, jumps: Jumps, states: Ints, chances: Floats) -> tuple[Ints, Jumps, Ints]:
    """Without the jumps to states in which the look cannot be."""
    lasts = chances[jumps.after] > 0
    before, after = jumps.before[lasts], jumps.after[lasts]
    kept_ends, origin = np.unique(before, return_inverse=True)
    kept_states, place = np.unique(after, return_inverse=True)
    return ends[kept_ends], Jumps(origin, place, jumps.channels[lasts]), states[kept_states]


def _ways_out(network: Network, space: StateSpace) -> tuple[Ints, Ints]:
    """Rows and channels (L,) of the transitions that lead out of the states."""
    happens = network.propensities(space.states) > 0
    happens[space.is_stopped] = False
    happens[:, ~network.sparse_stoichiometry.has_entries] = False
    rows, channels = np.nonzero(happens)
    is_out = space.index_of(space.states[rows] + network.stoichiometry[channels]) < 0
    return rows[is_out], channels[is_out]


def unreachable(network: Network, data: PanelData, run: PanelRun, look: int, before: Ints) -> ValueError:
    """The error about a look that cannot be, from the states (n, S) that were possible before."""
    numbers = zip(data.columns, run.seen[look], strict=True)
    seen = ", ".join(f"{name} {value:g}" for name, value in numbers if not np.isnan(value)) or "this"
    event = int(run.fired[look])  # type: ignore[index]
    named = f" after {' or '.join(data.events[event])}" if event >= 0 else ""
    held = [", ".join(f"{network.species[s]} {row[s]}" for s in np.flatnonzero(row)) or "nothing" for row in before[:3]]
    return ValueError(
        f"{run.named(look)}: {seen}{named} cannot be reached from {' or '.join(held)}{' …' if len(before) > 3 else ''} "
        f"by the channels of the network"
    )
