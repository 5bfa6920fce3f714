"""Panels over few states, such as people who go from stage to stage: all runs side by side, by dense matrices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import ceil, expm1, inf, log2
from typing import NoReturn

import numpy as np

from kinetics.markov.derivatives import ChannelEntries
from kinetics.markov.panels.data import PanelData
from kinetics.markov.panels.panel_step import amplified, recorded_channels, unreachable
from kinetics.markov.panels.slopes import Slopes
from kinetics.markov.passage.backward import jump_rate, one_step
from kinetics.markov.passage.until import Mask
from kinetics.markov.transient.poisson import ROUNDOFF, poisson_bounds
from kinetics.markov.transient.search import Search, TooManyStatesError
from kinetics.markov.transient.states import StateSpace
from kinetics.native.rate_tables import RateTable
from kinetics.network import Network
from kinetics.support.arrays import Floats, Ints

MOST_STATES = 64
MOST_MEAN = 100.0  # steps between two looks; for more, matrices of a shorter time are squared
MOST_SQUARINGS = 40
MOST_NUMBERS = 3e7  # of the powers and of the matrices, with their derivatives
LEFT_OUT = 1e-60  # of the Poisson probability


@dataclass(frozen=True, eq=False)
class FewStates:
    """All that does not depend on the rates: states, looks and lengths.

    space : all states that can be reached from any start
    order : (R,) runs by falling numbers of looks, as they stand in all that follows
    starts : (R, N) probabilities of the states in which each begins
    alive : (L,) how many runs have a look of each number
    lengths : (D,) tu, all different; which (L, R) of them precedes each look
    fired : (L, R) event that happens just before the look, -1 for none
    seen : (L, R, C)
    """

    space: StateSpace
    order: Ints
    starts: Floats
    alive: Ints
    lengths: Floats
    which: Ints
    fired: Ints
    seen: Floats

    @classmethod
    def of(cls, network: Network, data: PanelData) -> FewStates | None:
        """None if more than 64 states can be reached."""
        initial = np.concatenate([run.initial for run in data.runs])
        search = Search(network, np.unique(initial, axis=0), MOST_STATES)
        try:
            search.go_on(0)
        except TooManyStatesError:
            return None
        space = StateSpace(network, search.states.copy(), np.zeros(len(search), dtype=bool))
        n_looks = np.array([run.times.size for run in data.runs])
        order = np.argsort(-n_looks, kind="stable")
        most = int(n_looks.max())
        shape = most, len(order)
        lengths, fired = np.zeros(shape), np.full(shape, -1)
        seen = np.full((*shape, len(data.columns)), np.nan)
        for place, r in enumerate(order):
            run, n = data.runs[r], n_looks[r]
            lengths[:n, place] = run.lengths
            fired[:n, place], seen[:n, place] = run.fired, run.seen
        each, which = np.unique(lengths, return_inverse=True)
        alive = (n_looks[None, :] > np.arange(most)[:, None]).sum(axis=1)
        starts = np.zeros((len(order), len(space)))
        for place, r in enumerate(order):
            starts[place, space.index_of(data.runs[r].initial)] = data.runs[r].chances
        return cls(space, order, starts, alive, each, which.reshape(shape), fired, seen)

    @cached_property
    def numbers(self) -> list[list[tuple[Floats, Ints]]]:
        """Of each look and column all different numbers seen, and the place of each run's (R,) among them."""
        return [
            [np.unique(column, return_inverse=True) for column in seen[:alive].T]
            for seen, alive in zip(self.seen, self.alive, strict=True)
        ]

    @cached_property
    def entries(self) -> tuple[Ints, Ints, Ints]:
        """Rows, columns and channels (K,) of all transitions."""
        found = ChannelEntries(self.space.transitions(), len(self.space.network.channels))
        return found.transitions.rows, found.transitions.columns, found.channels


class FewPass:
    """The filter over all runs at one set of rates.

    ValueError of a look that cannot be; `fits` says whether the matrices are few and small enough.
    """

    def __init__(self, few: FewStates, network: Network, data: PanelData, slopes: Slopes) -> None:
        self._few, self._network, self._data, self._of = few, network, data, slopes
        self.is_certified = all(each.is_certified for each in data.observations.values())
        space = StateSpace(network, few.space.states, few.space.is_stopped)
        self.chain = space.transitions()
        self.is_certified &= self.chain.is_certified
        rows, _, channels = few.entries
        self._rates = network.propensities(space.states)[rows, channels]
        self.n = len(space)
        self.rate = jump_rate(self.chain) or 1.0
        mean = self.rate * float(few.lengths[-1])
        self.squarings = ceil(log2(mean / MOST_MEAN)) if MOST_MEAN < mean < inf else 0
        self.n_steps = poisson_bounds(min(mean, MOST_MEAN), LEFT_OUT)[1] + 1
        self._counted = space.states @ data.weights(network).T

    def fits(self) -> bool:
        """Whether powers and matrices, with their derivatives, are small enough."""
        each = self.n**2 * (self._of.size + 1.0)
        numbers = each * (self.n_steps + self._few.lengths.size)
        return self.squarings <= MOST_SQUARINGS and numbers <= MOST_NUMBERS

    @cached_property
    def _weights(self) -> Floats:
        """Poisson probabilities (D, K) of so many steps in each length, or in the part of it that is then squared."""
        means = self.rate * self._few.lengths / 2.0**self.squarings
        found = np.empty((self.n_steps, means.size))
        found[0] = np.exp(-means)
        for k in range(1, self.n_steps):
            found[k] = found[k - 1] * (means / k)
        return np.ascontiguousarray(found.T)

    @cached_property
    def _step(self) -> Floats:
        moves, stays, _ = one_step(self.chain)
        if self._recorded.any():  # what fires between two looks without a record leads to nothing that was seen
            rows, columns, _ = self._few.entries
            inside = ~self._recorded
            share = self._rates[inside] / self.rate
            moves = RateTable.of(rows[inside], columns[inside], share, self.n)
        return np.asarray(moves.toarray() + np.diag(stays))

    @cached_property
    def _recorded(self) -> Mask:
        """Transitions (K,) of channels whose events are recorded."""
        return np.isin(self._few.entries[2], recorded_channels(self._network, self._data))

    @cached_property
    def _powers(self) -> Floats:
        """P^k (K, N, N)."""
        found = np.empty((self.n_steps, self.n, self.n))
        found[0] = np.eye(self.n)
        for k in range(1, self.n_steps):
            found[k] = found[k - 1] @ self._step
        return found

    @cached_property
    def _matrices(self) -> Floats:
        """Transition matrices (D, N, N) of all lengths."""
        return self._squared[-1]

    @cached_property
    def _squared(self) -> list[Floats]:
        """Transition matrices (D, N, N) of the part of each length, then twice it, and so on up to all of it."""
        flat = self._weights @ self._powers.reshape(self.n_steps, -1)
        found = [flat.reshape(-1, self.n, self.n)]
        for _ in range(self.squarings):
            found.append(found[-1] @ found[-1])
        return found

    def _slopes(self, slopes: Slopes) -> Floats:
        """Derivatives (D, P, N, N) of the transition matrices."""
        rows, columns, channels = self._few.entries
        shares = slopes.of_rates(self._few.space.states, rows, channels) * self._rates / self.rate
        change = np.zeros((slopes.size, self.n, self.n))
        for p in range(slopes.size):
            np.add.at(change[p], (rows, columns), np.where(self._recorded, 0.0, shares[p]))
            np.add.at(change[p], (rows, rows), -shares[p])
        found = np.zeros((self.n_steps, slopes.size, self.n, self.n))
        for k in range(1, self.n_steps):
            found[k] = found[k - 1] @ self._step + self._powers[k - 1] @ change
        flat = self._weights @ found.reshape(self.n_steps, -1)
        moved = flat.reshape(-1, slopes.size, self.n, self.n)
        for matrices in self._squared[:-1]:
            moved = matrices[:, None] @ moved + moved @ matrices[:, None]
        return moved

    @cached_property
    def _chances(self) -> list[Floats]:
        """Probability (R, N) of what was seen at each look in each state."""
        found = []
        for look, alive in enumerate(self._few.alive):
            chances = np.ones((alive, self.n))
            for column, observation in enumerate(self._data.observations.values()):
                chances *= self._table(look, column, observation.weights)
            found.append(chances)
        return found

    def _table(self, look: int, column: int, numbers: Callable[[Floats, float], Floats]) -> Floats:
        """What an observation gives (R, N) of what was seen in a column; 1 where nothing was."""
        seen, place = self._few.numbers[look][column]
        counted = self._counted[:, column]
        return np.array([np.ones(self.n) if np.isnan(each) else numbers(counted, float(each)) for each in seen])[place]

    def _events(self, network: Network) -> Floats:
        """Rates (E, N, N) at which each event leads from state to state."""
        found = np.zeros((len(self._data.events), self.n, self.n))
        rows, columns, channels = self._few.entries
        for event, names in enumerate(self._data.events):
            chosen = np.isin(channels, [network.channel_places[name] for name in names])
            np.add.at(found[event], (rows[chosen], columns[chosen]), self._rates[chosen])
        return found

    def _fired(self, look: int, rates: Floats, values: Floats, forwards: bool) -> Floats:
        """Probabilities after the event of a look from those before (forwards), or values before from those after."""
        found = values.copy()
        events = self._few.fired[look, : self._few.alive[look]]
        for event in np.unique(events[events >= 0]):
            mine = events == event
            found[mine] = values[mine] @ (rates[event] if forwards else rates[event].T)
        return found

    @cached_property
    def _filtered(self) -> tuple[list[Floats], list[Floats], float, float]:
        """Probabilities (R, N) before each look, those of what was seen, the log-likelihood and its error."""
        few, rates = self._few, self._events(self._network)
        now = few.starts
        before, seen, known, total, error = [], [], [], 0.0, 0.0
        for look, alive in enumerate(few.alive):
            now = now[:alive]
            before.append(now)
            there = np.einsum("rn,rnm->rm", now, self._matrices[few.which[look, :alive]])
            chances = self._chances[look]
            after = self._fired(look, rates, there, True) * chances
            chance = after.sum(axis=1)
            if not (chance > 0.0).all():
                self._refuse(look, int((~(chance > 0.0)).argmax()), now)
            now = after / chance[:, None]
            seen.append(chance)
            known.append(np.count_nonzero(chances, axis=1) == 1)
            total += float(np.log(chance).sum())
            error += alive * self._wrong
        left, fastest = 2.0 * LEFT_OUT * 2.0**self.squarings, max(1.0, float(rates.sum(axis=2).max(initial=0.0)))
        shape = few.which.shape
        tiny, ahead, is_known = np.zeros(shape), np.ones(shape), np.zeros(shape, dtype=bool)
        for look, alive in enumerate(few.alive):
            tiny[look, :alive], is_known[look, :alive] = left, known[look]
            ahead[look, :alive] = seen[look] / np.where(few.fired[look, :alive] >= 0, fastest, 1.0)
        error += float(amplified(tiny, ahead, is_known).sum())
        if not error < inf:
            self.is_certified, error = False, self._data.looks * self._wrong
        return before, seen, total, error

    @property
    def filtered(self) -> list[list[tuple[Ints, Floats]]]:
        """Of each run, before each of its looks: possible states, and their probabilities."""
        before, places = self._filtered[0], np.argsort(self._few.order)
        found: list[list[tuple[Ints, Floats]]] = []
        for place in places.tolist():
            rows = [now[place] for now in before if place < len(now)]
            found.append([(self._few.space.states[row > 0], row[row > 0]) for row in rows])
        return found

    @cached_property
    def _wrong(self) -> float:
        """Relative error that a look adds."""
        mean, parts = self.rate * float(self._few.lengths[-1]), 2.0**self.squarings
        k = self.n_steps * parts
        _, _, roundings = one_step(self.chain)
        jumps = k + float(self.chain.exits.max(initial=0.0)) * float(self._few.lengths[-1])
        relative = k * (roundings + 2.0 * self.n + 4.0) + (jumps + 1.0) * (self.chain.roundings + 1.0)
        relative += 5.0 * k + 2.0 * mean + parts * (2.0 * self.n + 4.0) + 4.0 * self.n + len(self._data.columns) + 16.0
        return 1.01 * expm1(ROUNDOFF * relative)

    def _refuse(self, look: int, place: int, now: Floats) -> NoReturn:
        # A run's number is too small where the likelihood underflows, too: both end here.
        run = self._data.runs[self._few.order[place]]
        raise unreachable(self._network, self._data, run, look, self._few.space.states[now[place] > 0])

    @property
    def log_likelihood(self) -> float:
        """Of all runs."""
        return self._filtered[2]

    @property
    def error(self) -> float:
        """Bound on the error of the log-likelihood, before its sum was rounded."""
        return self._filtered[3]

    @cached_property
    def gradient(self) -> Floats:
        """Derivatives (P,) by the logarithms of the parameters."""
        slopes = self._of
        if not slopes.size:
            return np.zeros(0)
        few, (before, seen, _, _) = self._few, self._filtered
        moved, rates = self._slopes(slopes), self._events(self._network)
        rows, columns, channels = few.entries
        event_slopes = slopes.of_rates(few.space.states, rows, channels) * self._rates
        found = np.zeros(slopes.size)
        later = np.ones((0, self.n))
        for look in reversed(range(len(few.alive))):
            alive = few.alive[look]
            later = np.concatenate([later, np.ones((alive - len(later), self.n))])
            chances = self._chances[look]
            values = chances * later / seen[look][:, None]
            goal = self._fired(look, rates, values, False)
            which, now = few.which[look, :alive], before[look]
            found += np.einsum("rn,rpnm,rm->p", now, moved[which], goal, optimize=True)
            there = np.einsum("rn,rnm->rm", now, self._matrices[which])
            events = few.fired[look, :alive]
            for event in np.unique(events[events >= 0]):
                mine = events == event
                chosen = np.isin(channels, [self._network.channel_places[name] for name in self._data.events[event]])
                flow = (there[mine][:, rows[chosen]] * values[mine][:, columns[chosen]]).sum(axis=0)
                found += event_slopes[:, chosen] @ flow
            there = self._fired(look, rates, there, True)
            found += self._of_observations(slopes, look, there, later / seen[look][:, None])
            later = np.einsum("rnm,rm->rn", self._matrices[which], goal)
        return found

    def _of_observations(self, slopes: Slopes, look: int, there: Floats, later: Floats) -> Floats:
        found = np.zeros(slopes.size)
        for p, chosen in slopes.columns.items():
            product = np.ones_like(there)
            for column, observation in enumerate(self._data.observations.values()):
                if column != chosen:
                    product *= self._table(look, column, observation.weights)
                    continue
                is_seen = ~np.isnan(self._few.seen[look, : len(there), column])
                table = self._table(look, column, observation.slopes)
                product *= (observation.parameter or 0.0) * table * is_seen[:, None]
            found[p] = float((there * product * later).sum())
        return found
