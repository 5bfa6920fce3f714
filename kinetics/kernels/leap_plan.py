"""The next exact leap: its length and the box of counts in which it is followed, see `leaping`."""

import math
from typing import NamedTuple

import numpy as np

from kinetics.kernels import leap_limits
from kinetics.kernels.compiled import compiled
from kinetics.kernels.ensemble_work import BEFORE
from kinetics.kernels.leap_limits import LARGEST_COUNT, MOST_EVENTS, TRIALS, WIDE

STRETCH = 1024  # events of the direct method, after which a leap is considered again
DEEPEST = 160  # halvings; two given events are not parted by 2**-160 of a leap
CELL, STRETCHES = 4, 5  # in `LeapWork.notes`, after those of `direct`
NO_CELL = -1  # between leaps

next_length = compiled(leap_limits.next_length)


class LeapLaws(NamedTuple):
    """Propensities and changes. What a function is given costs it: each array is passed by value, as seven words.

    coefficients (R,), factors (R, K, 3) : see `sampling.mass_action.MassAction`
    starts (R + 1,), species, gains (n,) : channel r changes species[starts[r] : starts[r + 1]] by gains
    """

    coefficients: np.ndarray
    factors: np.ndarray
    starts: np.ndarray
    species: np.ndarray
    gains: np.ndarray


class LeapModel(NamedTuple):
    """Tables of the network, which do not change during a run.

    open_events : how many a leap is to have; fewest : events of a leap, below which single ones are drawn
    merged, changes, members : for `direct.advance` and `members.attribute_channels`
    """

    laws: LeapLaws
    open_events: float
    fewest: float
    merged: NamedTuple
    changes: np.ndarray
    members: NamedTuple


class LeapCells(NamedTuple):
    """Counts, the box of the leap, and the cells that are still to come, each deeper one before the others.

    counts (S + 1,) int64, the last one 1; box_low, box_high, at_least, at_most (S + 1,) in doubles: of the leap, and of
    the cell at hand
    sure, open (D, R) int64 : events of each cell; low, high (D, R) : between which the marks of the open ones lie
    begins, ends (D,) : of each cell, tu after the leap's start; keys (D, 4) : of its random words
    means (R,) : events of a leap that are expected
    """

    counts: np.ndarray
    box_low: np.ndarray
    box_high: np.ndarray
    at_least: np.ndarray
    at_most: np.ndarray
    sure: np.ndarray
    open: np.ndarray
    low: np.ndarray
    high: np.ndarray
    begins: np.ndarray
    ends: np.ndarray
    keys: np.ndarray
    means: np.ndarray


class LeapWork(NamedTuple):
    """State of a run, and scratch arrays.

    stream (4,) uint64, state (S + 1,) int64, step_times, fired (STRETCH,) : for a cell, and for events drawn singly
    lengths (3,) : when the leap at hand began, its length, and that from which the next one is sought, tu
    of_run, of_leap (4,) uint64 : keys of their random words
    clock, notes : of `EnsembleWork`; notes (6,) then say at which cell the leap at hand is, -1 between leaps, and how
        many stretches the run has had. A cell that is looked at counts as an event
    """

    cells: LeapCells
    stream: np.ndarray
    state: np.ndarray
    step_times: np.ndarray
    fired: np.ndarray
    lengths: np.ndarray
    of_run: np.ndarray
    of_leap: np.ndarray
    clock: np.ndarray
    notes: np.ndarray


@compiled
def work_for(n_channels, n_species):
    """A new workspace for a run."""
    cells = LeapCells(
        np.ones(n_species + 1, dtype=np.int64),
        np.ones(n_species + 1),
        np.ones(n_species + 1),
        np.ones(n_species + 1),
        np.ones(n_species + 1),
        np.zeros((DEEPEST, n_channels), dtype=np.int64),
        np.zeros((DEEPEST, n_channels), dtype=np.int64),
        np.zeros((DEEPEST, n_channels)),
        np.zeros((DEEPEST, n_channels)),
        np.zeros(DEEPEST),
        np.zeros(DEEPEST),
        np.zeros((DEEPEST, 4), dtype=np.uint64),
        np.zeros(n_channels),
    )
    return LeapWork(
        cells,
        np.zeros(4, dtype=np.uint64),
        np.ones(n_species + 1, dtype=np.int64),
        np.zeros(STRETCH),
        np.zeros(STRETCH, dtype=np.int64),
        np.zeros(3),
        np.zeros(4, dtype=np.uint64),
        np.zeros(4, dtype=np.uint64),
        np.zeros(3),
        np.array([0, 0, BEFORE, 0, NO_CELL, 0]),
    )


@compiled
def propensity(laws, r, copies):
    """Propensity of channel r at counts `copies` (S + 1,) in doubles, the last one 1; it is monotone in each count."""
    value = laws.coefficients[r]
    for j in range(laws.factors.shape[1]):
        here = copies[laws.factors[r, j, 0]]
        value *= here - laws.factors[r, j, 1] if here >= laws.factors[r, j, 2] else 0.0
    return value


@compiled
def set_box(laws, cells, length):
    """The box of a leap of this length, by the events expected of it, `cells.means` per unit of time."""
    n_species = cells.counts.size - 1
    box_low, box_high, falls, rises = cells.box_low, cells.box_high, cells.at_least, cells.at_most
    # The box: WIDE standard deviations of Poisson falls and rises beyond their means, falls and rises by themselves, as
    # in the worst order.
    box_low[:n_species] = 0.0  # means and variances, until the end
    box_high[:n_species] = 0.0
    falls[:n_species] = 0.0
    rises[:n_species] = 0.0
    for r in range(cells.means.size):
        mean = cells.means[r] * length
        for i in range(laws.starts[r], laws.starts[r + 1]):
            s, gain = laws.species[i], float(laws.gains[i])
            if gain > 0.0:
                box_high[s] += mean * gain
                rises[s] += mean * gain * gain
            else:
                box_low[s] -= mean * gain
                falls[s] += mean * gain * gain
    for s in range(n_species):
        here = float(cells.counts[s])
        box_low[s] = max(here - math.ceil(box_low[s] + WIDE * math.sqrt(falls[s])), 0.0)
        box_high[s] = here + math.ceil(box_high[s] + WIDE * math.sqrt(rises[s]))


@compiled
def plan_leap(model, cells, length):
    """Choose a leap from the counts: its length, and the events expected of it, 0 if there should be none.

    length : that of the leap before, from which the search starts; the new box and its propensities are left in `cells`
    """
    laws = model.laws
    n_channels, n_species = cells.means.size, cells.counts.size - 1
    low, high = cells.low[0], cells.high[0]
    copies = cells.at_least
    for s in range(n_species):
        copies[s] = cells.counts[s]
        if copies[s] > LARGEST_COUNT:
            return length, 0.0
    total = 0.0
    for r in range(n_channels):
        cells.means[r] = propensity(laws, r, copies)
        total += cells.means[r]
    # A total of 0 or beyond double leaves nothing to leap over.
    longest = MOST_EVENTS / total if total > 0.0 else np.inf
    if not (longest < np.inf and total < np.inf):
        return length, 0.0
    length = min(max(length, 1.0 / total), longest)
    # Fixed-point search for the length whose expected open events, sum of (high - low) * length, are `open_events`.
    for _ in range(TRIALS):
        set_box(laws, cells, length)
        undecided = 0.0
        for r in range(n_channels):
            low[r] = propensity(laws, r, cells.box_low)
            high[r] = propensity(laws, r, cells.box_high)
            undecided += (high[r] - low[r]) * length
        tried, length = length, next_length(length, longest, undecided, model.open_events)
        if length == tried:
            break
    events = total * length
    fits = undecided < 4.0 * model.open_events
    for s in range(n_species):
        fits &= cells.box_high[s] <= LARGEST_COUNT
    return length, events if fits and events >= model.fewest else 0.0
