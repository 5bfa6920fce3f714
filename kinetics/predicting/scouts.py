"""Scouts: runs in which a channel that hardly ever fires is made to, so that its effect is known before it is seen.

A burst that comes in one of 300 runs is missed by the first 300 more often than not, and their variance says nothing of
it. But its chance is known, for the propensities that runs meet say how often each channel fires; and what it does is
found by making it fire: from a state and at a time that runs have shown, in proportion to its propensity there, and by
going on from there as the network does. Counts that come out beyond all that the first runs have shown enter the
moments with the channel's chance, as far as runs have not shown as much themselves. What a rare event makes possible
but seldom leads to, stays unseen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import expm1, inf, log
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.network import Network
from kinetics.network.network import is_homogeneous
from kinetics.predicting.run_cost import FIRST_RUNS, SeenRates
from kinetics.runs.statistics import Tally
from kinetics.sampling.run_source import RunSource
from kinetics.support.arrays import Floats, Ints
from kinetics.support.tables import counted

SELDOM, NEVER = 30.0, 0.01  # firings in all runs that are needed: of a channel that shows itself; of all left out
TIMES, RUNS = 3, 64  # at which a channel fires, at most, and scouts of each
MOST_CHANNELS, MOST_TIMES = 256, 192  # of all channels together
BEYOND = 0.5  # widths of the range that runs have shown, by which a count has to be outside of it
SHOWN = 30  # runs outside of it, which say enough themselves
MOST_BYTES = 2**27  # about, of all that are beyond as many as there are first runs
SHARE = 1 / 4  # of the runs needed, that scouts may be beside the first runs, and may cost
LEAST_EVENTS = 3e6  # that all may have in any case
PROBES, PROBED = 8, 0.1  # scouts that are looked at on the way; share of those events that they may have until the end
FIRST_LOOK, LAST_LOOK = 1 / 64, 7 / 8  # of the way, while rates may become too large
MOST_LINEARISED = 100  # species
FIRST_GROWTH = 10.0  # until the first look: its logarithm, at most, if what grows was as quick as all together
SMALL_GROWTH = 0.01  # below which rates count as steady
KEPT_BYTES = 32  # of a count of a scout, while it enters moments
NEGLIGIBLE = 1e-9  # events, of a scout that does nothing more
MOST_NEXT = 64  # channels by which a scout may go on that are looked at before it does
MOST_NAMED = 3  # in a remark
NOT_SENT = "what hardly ever happens was not looked for: rates depend on the time, or events set counts"


class Scout(NamedTuple):
    """What came of a channel that was made to fire.

    chance : expected firings in a run that it stands for
    counts : (runs, T', S) at the times after, of which `first` is the first
    outside : (runs, T', S) which of them are beyond all that the first runs have shown
    """

    channel: str
    chance: float
    first: int
    counts: Ints
    outside: NDArray[np.bool_]


@dataclass(frozen=True)
class Scouts:
    """All scouts of a network.

    inner : least and largest counts (T, S) that are not beyond what the first runs have shown
    made : one for each rare channel and time at which it fired
    left_out : number of channels that hardly ever fire and were left out, being too many or too dear to follow
    """

    inner: tuple[Ints, Ints]
    made: tuple[Scout, ...] = ()
    left_out: int = 0

    @property
    def in_words(self) -> str:
        """What they found beyond what the first runs have shown, and what was left out; empty where neither."""
        found = [each.channel for each in self.made if each.outside.any()]
        chances = {r: sum(each.chance for each in self.made if each.channel == r) for r in dict.fromkeys(found)}
        rare = [f"{name!r} ({chance:.2g} firings a run)" for name, chance in chances.items()]
        more = f" and {len(rare) - MOST_NAMED} more" if len(rare) > MOST_NAMED else ""
        were = "was" if len(rare) == 1 else "were"
        made = f"{', '.join(rare[:MOST_NAMED])}{more} {were} made to fire, and what came of it is allowed for"
        left = f"left out, as too many or too dear to follow: {counted(self.left_out, 'rare channel')}"
        return "; ".join(filter(None, [made * bool(rare), left * bool(self.left_out)]))

    def moments(self, tally: Tally, mean: Floats, highest: int) -> Floats:
        """What to add to the moments (highest + 1, T, S) of runs about their mean (T, S), for what these have not
        shown."""
        added = np.zeros((highest + 1, *mean.shape))
        acting = [scout for scout in self.made if scout.outside.any()]
        if not acting:
            return added
        for scout in acting:
            away = np.where(scout.outside, scout.counts - mean[scout.first :], 0.0)
            term = scout.chance / len(away) * away
            for power in range(1, highest + 1):
                added[power, scout.first :] += term.sum(axis=0)
                term = term * away
        shown = tally.moments_outside(*self.inner, mean, highest)
        is_less = (np.abs(added) > np.abs(shown)) & (shown[0] * tally.runs < SHOWN)
        return np.where(is_less, added - shown, 0.0)


def send_scouts(
    network: Network, source: RunSource, seen: SeenRates, grid: Floats, most: int, seed: int, tally: Tally,
    needed: float,
) -> Scouts | None:  # fmt: skip
    """Scouts of all channels that fire seldom in so many runs; None where rates depend on time, or events set counts.

    source : the runs whose counts, or sums of these, are asked for at `grid` (T,)
    most : scouts in all, at most; more by a quarter of the runs needed
    tally : the first runs
    needed : runs that will be made, as far as is known

    Of more channels than can be followed some are drawn, by their chances, to stand for all. All together have no more
    events than the first runs and a quarter of the runs needed, or `LEAST_EVENTS`.
    """
    if not is_homogeneous(network):
        return None
    margin = np.ceil(BEYOND * (tally.high - tally.low)).astype(np.int64)
    inner = tally.low - margin, tally.high + margin
    fired = _firings(seen)
    chances = fired[-1]
    rare = np.flatnonzero(chances * needed < SELDOM)
    rare = rare[np.argsort(chances[rare], kind="stable")]
    rare = rare[np.cumsum(chances[rare]) * needed > NEVER][::-1]
    if not rare.size:
        return Scouts(inner)
    held = max(FIRST_RUNS, MOST_BYTES // (KEPT_BYTES * grid.size * source.width))
    most = min(max(most, int(SHARE * needed)), MOST_CHANNELS * RUNS, held)
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3,)))
    chosen, shares = rare, chances[rare]
    if rare.size > min(MOST_CHANNELS, most):
        shares = np.full(min(MOST_CHANNELS, most), shares.sum() / min(MOST_CHANNELS, most))
        chosen = rng.choice(rare, shares.size, p=chances[rare] / chances[rare].sum())
    times = max(1, min(TIMES, most // chosen.size, MOST_TIMES // chosen.size))
    runs = max(1, min(RUNS, most // (times * chosen.size)))
    events = max(LEAST_EVENTS, (FIRST_RUNS + SHARE * needed) * float(chances.sum()))
    following = _Following(network, source, events, rng)
    made, dear = list[Scout](), set[int]()
    for r, share in zip(chosen.tolist(), shares / times, strict=True):
        for k in reversed(range(times)):  # the latest first, which take least
            at = int(np.searchsorted(fired[:, r], (k + rng.random()) / times * chances[r], side="right")) - 1
            begin, state = _fired(network, seen, r, min(at, seen.times.size - 2), rng)
            first = int(np.searchsorted(grid, begin, side="right"))
            if first == grid.size:  # nothing is asked for afterwards
                continue
            counts = following.counts(state, begin, grid[first:], runs)
            if counts is None:
                dear.add(r)
                continue
            outside = (counts < inner[0][first:]) | (counts > inner[1][first:])
            made.append(Scout(network.channels[r], share, first, counts, outside))
    return Scouts(inner, tuple(made), rare.size - np.unique(chosen).size + len(dear))


def _firings(seen: SeenRates) -> Floats:
    """Expected firings (L, R) of each channel in a run until each of the times seen."""
    rates = seen.propensities.mean(axis=0)
    steps = (rates[1:] + rates[:-1]) / 2 * np.diff(seen.times)[:, None]
    return np.concatenate([np.zeros((1, rates.shape[1])), np.cumsum(steps, axis=0)])


def _fired(network: Network, seen: SeenRates, channel: int, at: int, rng: np.random.Generator) -> tuple[float, Ints]:
    """When and in what counts (S,) a channel leaves a run in which it fires at time number `at` of those seen, or at
    the next one where it could not."""
    if not seen.propensities[:, at, channel].any():
        at += 1
    weights = seen.propensities[:, at, channel]
    total = weights.sum()
    run = int(rng.choice(weights.size, p=weights / total)) if total > 0.0 else 0
    state = network.sparse_stoichiometry.added_to(seen.states[run, [at]], np.array([channel]))[0]
    return float(seen.times[at]), state


class _Following:
    """Follows scouts to the last time, as long as all together have not too many events."""

    def __init__(self, network: Network, source: RunSource, events: float, rng: np.random.Generator) -> None:
        self.network = network
        self.source = replace(source, key=rng.integers(2**64, size=4, dtype=np.uint64))
        self.most_probed, self.left = PROBED * events, events
        self.made = 0

    def counts(self, state: Ints, begin: float, times: Floats, runs: int) -> Ints | None:
        """Counts (runs, T', S) at `times` (T',) after they were in `state` (S,) at the time `begin`, of fewer runs
        where these would take too many events; None where a few would."""
        source, length = self.source.starting_at(state), float(times[-1]) - begin
        if state.min() < 0:
            return None
        try:
            events = self._events(replace(source, weights=None), length, min(runs, PROBES))
            runs = min(runs, int(self.left / max(events, 1.0)))
            if runs == 0:
                return None
            self.left -= runs * events
            self.made += runs
            return source.counts(times - begin, runs, self.made - runs, threads=1)
        except ValueError:  # a clock that stalls, counts beyond 2^63
            return None

    def _events(self, source: RunSource, length: float, probes: int) -> float:
        """Events of a scout, at the largest total propensity that at most `probes` have on average on the way to
        `length`; inf where these few have too many.

        They are looked at on the way, until neither growth that went on as it has, nor one at the rate of their
        linearised equations, would be too much; and before that at what is expected after the next event.
        """
        first = float(self.network.propensities(source.start).sum())
        if first * length < NEGLIGIBLE:
            return 0.0
        rate = max(first, self._rate_after_one(source.start, length))
        probes = max(1, min(probes, int(self.most_probed / (rate * length))))
        part = min(FIRST_LOOK, FIRST_GROWTH / (first * length))
        while part <= LAST_LOOK:
            if probes * rate * length > min(self.most_probed, self.left):
                return inf
            there = source.counts(np.array([part * length]), probes, self.made, threads=1)[:, 0]
            rates = self.network.propensities(there).sum(axis=-1)
            rate = max(rate, float(rates.mean()))
            growth = log(rate / first)
            self.left -= probes * part * length * ((rate - first) / growth if growth > SMALL_GROWTH else rate)
            room = log(self.most_probed / (probes * first * length))
            if growth / part <= room and self._growth(there[rates.argmax()]) * (1 - part) * length <= room:
                break
            part = min(2 * part, (1 + part) / 2)
        return rate * length

    def _growth(self, state: Ints) -> float:
        """How quickly means near these counts (S,) grow at most, 1 / tu, by their linearised rate equations."""
        size = state.size
        if size > MOST_LINEARISED:
            return inf
        here = self.network.propensities(state)
        change = self.network.sparse_stoichiometry
        slopes = self.network.propensities(state + np.eye(size, dtype=np.int64)) - here
        linear = np.zeros((size, size))
        np.add.at(linear, change.columns, change.copies[:, None] * slopes.T[change.rows])
        return float(np.linalg.eigvals(linear).real.max())

    def _rate_after_one(self, state: Ints, length: float) -> float:
        """Expected total propensity after the next event, of those that are most likely, if it is before the end."""
        rates = self.network.propensities(state)
        total = float(rates.sum())
        likely = np.argsort(rates)[-MOST_NEXT:]
        likely = likely[rates[likely] > 0.0]
        after = self.network.sparse_stoichiometry.added_to(np.tile(state, (likely.size, 1)), likely)
        expected = float(rates[likely] @ self.network.propensities(after).sum(axis=-1))
        return -expm1(-total * length) * expected / total
