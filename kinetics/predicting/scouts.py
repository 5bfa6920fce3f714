"""Scouts: runs in which a channel that hardly ever fires is made to, so that its effect is known before it is seen.

A burst that comes in one of 300 runs is missed by the first 300 more often than not, and their variance says nothing of
it. But its chance is known, for the propensities that runs meet say how often each channel fires; and what it does is
found by making it fire: from a state and at a time that runs have shown, in proportion to its propensity there, and by
going on from there as the network does. Counts that come out beyond all that ordinary runs have shown enter the moments
with the channel's chance, until runs have shown it themselves. What takes two rare channels in turn stays unseen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.network import Network
from kinetics.predicting.run_cost import FIRST_EVENTS, SeenRates
from kinetics.runs.statistics import Tally
from kinetics.sampling.run_source import RunSource
from kinetics.support.arrays import Floats, Ints
from kinetics.support.tables import counted

SELDOM, NEVER = 10.0, 0.01  # firings in all runs that are needed: what fires more often shows itself, less is left out
TIMES, RUNS = 3, 2  # at which a channel fires, and scouts of each
MOST_CHANNELS = 64
DEAREST = 100.0  # times the events of a run
MOST_NAMED = 3  # in a remark
NOT_SENT = "what hardly ever happens was not looked for: rates depend on the time, or events set counts"
BEYOND = 0.5  # widths of the range that runs have shown, by which a count has to be outside of it


class Scout(NamedTuple):
    """What came of a channel that was made to fire.

    chance : expected firings in a run that it stands for
    counts : (runs, T', S) at the times after, of which `first` is the first
    """

    channel: str
    chance: float
    first: int
    counts: Ints


@dataclass(frozen=True)
class Scouts:
    """All scouts of a network.

    made : one for each rare channel and time at which it fired
    left_out : number of channels that hardly ever fire and were left out, being too many or too dear to follow
    """

    made: tuple[Scout, ...] = ()
    left_out: int = 0

    def beyond(self, low: Ints, high: Ints) -> list[tuple[Scout, NDArray[np.bool_]]]:
        """Scouts that came out beyond the ranges (T, S) that runs have shown, and where (runs, T', S)."""
        margin = np.ceil(BEYOND * (high - low))
        found = []
        for scout in self.made:
            part = slice(scout.first, None)
            outside = (scout.counts > (high + margin)[part]) | (scout.counts < (low - margin)[part])
            if outside.any():
                found.append((scout, outside))
        return found

    def in_words(self, low: Ints, high: Ints) -> str:
        """What they found beyond the ranges that runs have shown, and what was left out; empty where neither."""
        chances: dict[str, float] = {}
        for scout, _ in self.beyond(low, high):
            chances[scout.channel] = sum(each.chance for each in self.made if each.channel == scout.channel)
        rare = [f"{name!r} ({chance:.2g} firings a run)" for name, chance in chances.items()]
        more = f" and {len(rare) - MOST_NAMED} more" if len(rare) > MOST_NAMED else ""
        were = "was" if len(rare) == 1 else "were"
        found = f"{', '.join(rare[:MOST_NAMED])}{more} {were} made to fire, and what came of it is allowed for"
        left = f"left out, as too many or too dear to follow: {counted(self.left_out, 'rare channel')}"
        return "; ".join(filter(None, [found * bool(rare), left * bool(self.left_out)]))

    def moments(self, tally: Tally, mean: Floats, highest: int) -> Floats:
        """What to add to the moments (highest + 1, T, S) of runs about their mean (T, S), for what these have not
        shown."""
        added = np.zeros((highest + 1, *mean.shape))
        for scout, outside in self.beyond(tally.low, tally.high):
            away = np.where(outside, scout.counts - mean[scout.first :], 0.0)
            term = scout.chance / len(away) * away
            for power in range(1, highest + 1):
                added[power, scout.first :] += term.sum(axis=0)
                term = term * away
        return added


def send_scouts(
    network: Network, source: RunSource, seen: SeenRates, grid: Floats, most: int, seed: int, needed: float
) -> Scouts | None:
    """Scouts of all channels that fire seldom in so many runs; None where rates depend on time, or events set counts.

    source : the runs whose counts, or sums of these, are asked for at `grid` (T,)
    most : scouts in all, at most
    needed : runs that will be made, as far as is known

    None is sent that would, at the rates it begins with, have `DEAREST` times the events of a run.
    """
    if not network.is_homogeneous:
        return None
    rates = seen.propensities.mean(axis=0)
    spans = np.diff(seen.times)
    fired = np.concatenate([np.zeros((1, rates.shape[1])), np.cumsum((rates[1:] + rates[:-1]) / 2 * spans[:, None], 0)])
    chances = fired[-1]
    rare = np.flatnonzero((chances * needed < SELDOM) & (chances * needed > NEVER))
    if not rare.size:
        return Scouts()
    chosen = rare[np.argsort(-chances[rare], kind="stable")][: min(MOST_CHANNELS, most)]
    times = max(1, min(TIMES, most // chosen.size))
    runs = max(1, min(RUNS, most // (times * chosen.size)))
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3,)))
    own, made, dear = replace(source, key=rng.integers(2**64, size=4, dtype=np.uint64)), list[Scout](), set[int]()
    most_events = DEAREST * (float(chances.sum()) + FIRST_EVENTS)
    for r in chosen.tolist():
        share = chances[r] / times
        for k in range(times):
            at = int(np.searchsorted(fired[:, r], (k + rng.random()) * share, side="right")) - 1
            begin, state = _fired(network, seen, r, min(at, spans.size - 1), rng)
            first = int(np.searchsorted(grid, begin, side="right"))
            if first == grid.size:  # nothing is asked for afterwards
                continue
            if float(network.propensities(state).sum()) * (seen.times[-1] - begin) > most_events:
                dear.add(r)
                continue
            counts = own.starting_at(state).counts(grid[first:] - begin, runs, len(made) * runs, threads=1)
            made.append(Scout(network.channels[r], share, first, counts))
    return Scouts(tuple(made), rare.size - chosen.size + len(dear))


def _fired(network: Network, seen: SeenRates, channel: int, at: int, rng: np.random.Generator) -> tuple[float, Ints]:
    """When and in what counts (S,) a channel leaves a run in which it fires at time number `at` of those seen, or at
    the next one where it could not."""
    if not seen.propensities[:, at, channel].any():
        at += 1
    weights = seen.propensities[:, at, channel]
    run = int(rng.choice(weights.size, p=weights / weights.sum()))
    state = network.sparse_stoichiometry.added_to(seen.states[run, [at]], np.array([channel]))[0]
    return float(seen.times[at]), state
