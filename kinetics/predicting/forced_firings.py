"""Forced firings: runs in which a rare channel is made to fire, so that its effect is known before runs show it.

A burst that comes in one of 300 runs is missing from the first 300 more often than not, and their variance says nothing
of it. But its probability is known: the propensities that runs meet say how often each channel fires. Its effect is
found by importance sampling: the channel fires at a time and in a state that runs have shown, drawn in proportion to
its propensity, and the run goes on from there. Counts outside the range that the first runs have shown enter the
moments with the channel's probability, until runs have shown as much themselves. An unlikely turn after a rare event
stays unseen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.network import Network
from kinetics.network.network import is_homogeneous
from kinetics.predicting import tuning
from kinetics.predicting.first_runs import SeenRates
from kinetics.sampling.run_source import RunSource
from kinetics.sampling.statistics import Tally
from kinetics.support.arrays import Floats, Ints
from kinetics.support.tables import counted

MOST_NAMED = 3  # channels, in a note
NOT_FORCED = "not searched for: rates depend on the time, or events set counts"


class ForcedFiring(NamedTuple):
    """Runs that go on after a channel was made to fire at one time.

    chance : expected firings in a run that they stand for
    first : number of the first of the T times that comes after it
    counts : (runs, T - first, V)
    outside : which counts are outside the range that the first runs have shown
    """

    channel: str
    chance: float
    first: int
    counts: Ints
    outside: NDArray[np.bool_]


@dataclass(frozen=True)
class ForcedFirings:
    """All forced firings of a network.

    inner : least and largest counts (T, V) that are not outside the range that the first runs have shown
    made : one for each rare channel and time at which it fired
    left_out : number of rare channels that were not followed, as there are too many or they take too many events
    """

    inner: tuple[Ints, Ints]
    made: tuple[ForcedFiring, ...] = ()
    left_out: int = 0

    def until(self, n_times: int) -> ForcedFirings:
        """A copy with the forced firings before the first `n_times` times only."""
        made = tuple(
            each._replace(
                counts=each.counts[:, : n_times - each.first], outside=each.outside[:, : n_times - each.first]
            )
            for each in self.made
            if each.first < n_times
        )
        return replace(self, inner=(self.inner[0][:n_times], self.inner[1][:n_times]), made=made)

    @property
    def note(self) -> str:
        """A sentence on forced firings that left the range of the first runs, and on those left out; "" if none."""
        chances: dict[str, float] = {}
        found = {each.channel for each in self.made if each.outside.any()}
        for each in self.made:
            if each.channel in found:
                chances[each.channel] = chances.get(each.channel, 0.0) + each.chance
        rare = [f"{name!r} ({chance:.2g} firings a run)" for name, chance in chances.items()]
        more = f" and {len(rare) - MOST_NAMED} more" if len(rare) > MOST_NAMED else ""
        were = "was" if len(rare) == 1 else "were"
        made = f"{', '.join(rare[:MOST_NAMED])}{more} {were} forced to fire, and the effect is included"
        left = f"{counted(self.left_out, 'rare channel')} left out, as too many or too expensive to follow"
        return "; ".join(filter(None, [made * bool(rare), left * bool(self.left_out)]))

    def moments(self, tally: Tally, mean: Floats, highest: int) -> Floats:
        """Corrections (highest + 1, T, V) to the moments of runs about their mean (T, V), for rare firings not sampled.

        They are 0 if the runs themselves have shown as much outside the range, or have left it often enough.
        """
        added = np.zeros((highest + 1, *mean.shape))
        acting = [each for each in self.made if each.outside.any()]
        if not acting:
            return added
        for each in acting:
            away = np.where(each.outside, each.counts - mean[each.first :], 0.0)
            term = each.chance / len(away) * away
            for power in range(1, highest + 1):
                added[power, each.first :] += term.sum(axis=0)
                term = term * away
        shown = tally.moments_outside(*self.inner, mean, highest)
        is_less = (np.abs(added) > np.abs(shown)) & (shown[0] * tally.runs < tuning.SHOWN)
        return np.where(is_less, added - shown, 0.0)


def force_firings(
    network: Network, source: RunSource, seen: SeenRates, grid: Floats, most: int, seed: int, tally: Tally,
    needed: float,
) -> ForcedFirings | None:  # fmt: skip
    """Force all channels that fire seldom in so many runs; None if rates depend on time, or events set counts.

    source : the runs whose counts, or sums of these, are asked for at `grid` (T,)
    seen : the rates of the first runs, which are in `tally`
    most : forced firings in all, at most; more by a quarter of the runs needed
    needed : runs that will be made, as far as is known

    Together they have no more events than the first runs and a quarter of the runs needed, or `FORCED_EVENTS`; each
    has an equal share, and a channel that needs more is left out.
    """
    if not is_homogeneous(network):
        return None
    margin = np.ceil(tuning.BEYOND * (tally.high - tally.low)).astype(np.int64)
    inner = tally.low - margin, tally.high + margin
    fired = _expected_firings(seen)
    chances = fired[-1]
    rare = np.flatnonzero(chances * needed < tuning.SELDOM)
    rare = rare[np.argsort(chances[rare], kind="stable")]
    rare = rare[np.cumsum(chances[rare]) * needed > tuning.NEVER][::-1]
    if not rare.size:
        return ForcedFirings(inner)
    held = max(tuning.FIRST_RUNS, tuning.FORCED_COUNTS // (grid.size * source.width))
    most = min(max(most, int(tuning.SHARE * needed)), held)
    chosen = rare[: min(most, tuning.MOST_FORCED)]  # the likeliest
    times = max(1, min(tuning.TIMES, most // chosen.size, tuning.MOST_FORCED // chosen.size))
    runs = max(1, min(tuning.FORCED_RUNS, most // (times * chosen.size)))
    events = max(tuning.FORCED_EVENTS, (tuning.FIRST_RUNS + tuning.SHARE * needed) * float(chances.sum()))
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3,)))
    following = replace(
        source,
        key=rng.integers(2**64, size=4, dtype=np.uint64),
        outlook=None,
        max_events=max(1, int(events / (times * runs * chosen.size))),
    )
    made, left_out = list[ForcedFiring](), set[int]()
    for r in chosen.tolist():
        for k in reversed(range(times)):  # the latest first, which have the fewest events
            at = int(np.searchsorted(fired[:, r], (k + rng.random()) / times * chances[r], side="right")) - 1
            begin, state = _after_firing(network, seen, r, min(at, seen.times.size - 2), rng)
            first = int(np.searchsorted(grid, begin, side="right"))
            if first == grid.size:  # nothing is asked for afterwards
                continue
            number = len(made) * runs
            counts = (
                None if r in left_out else _followed(following.starting_at(state), grid[first:] - begin, runs, number)
            )
            if counts is None:
                left_out.add(r)
                continue
            outside = (counts < inner[0][first:]) | (counts > inner[1][first:])
            made.append(ForcedFiring(network.channels[r], float(chances[r]) / times, first, counts, outside))
    return ForcedFirings(inner, tuple(made), rare.size - chosen.size + len(left_out))


def _expected_firings(seen: SeenRates) -> Floats:
    """Expected firings (L, R) of each channel in a run until each of the times seen."""
    rates = seen.propensities.mean(axis=0)
    steps = (rates[1:] + rates[:-1]) / 2 * np.diff(seen.times)[:, None]
    return np.concatenate([np.zeros((1, rates.shape[1])), np.cumsum(steps, axis=0)])


def _after_firing(
    network: Network, seen: SeenRates, channel: int, at: int, rng: np.random.Generator
) -> tuple[float, Ints]:
    """The time, and the counts (S,) after a channel has fired in one of the runs, at time number `at` of those seen.

    It is the next time where the channel could fire in no run.
    """
    if not seen.propensities[:, at, channel].any():
        at += 1
    weights = seen.propensities[:, at, channel]
    total = weights.sum()
    run = int(rng.choice(weights.size, p=weights / total)) if total > 0.0 else 0
    state = network.sparse_stoichiometry.added_to(seen.states[run, [at]], np.array([channel]))[0]
    return float(seen.times[at]), state


def _followed(source: RunSource, times: Floats, runs: int, first_run: int) -> Ints | None:
    """Counts (runs, T', V) at `times` (T',) after a forced firing; None if one run has too many events."""
    if source.start.min() < 0:
        return None
    try:
        one = source.counts(times, 1, first_run, threads=1)  # alone, as an explosion shows in any run
        more = source.counts(times, runs - 1, first_run + 1, threads=1) if runs > 1 else one[:0]
    except ValueError:  # also a clock that stalls, and counts beyond 2^63
        return None
    return np.concatenate([one, more])
