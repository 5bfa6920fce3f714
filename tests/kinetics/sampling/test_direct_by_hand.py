"""The direct method's kernels against the same runs in plain Python, draw by draw from streams of whole numbers.

Waits agree to rounding, channels and counts exactly: a kernel that draws, adds or chooses otherwise gives another run.
"""

from math import log

import numpy as np
import pytest
from known_systems import line, network
from numpy.testing import assert_allclose, assert_array_equal
from sampled_networks import MIXED, PRODUCTS, THIRD_ORDER

from kinetics.kernels import direct, exposures
from kinetics.kernels.direct import advance
from kinetics.kernels.ensemble_work import EVENTS, LOOK, RUN, ensemble_work, never
from kinetics.kernels.members import NAMING, Members, member_at
from kinetics.kernels.outcomes import REACHED_END, UNFINISHED
from kinetics.network import Model, Network
from kinetics.sampling import exposures_of_draws
from kinetics.sampling.base import stream_key
from kinetics.sampling.direct import RecomputingSampler
from kinetics.sampling.mass_action import mass_action
from kinetics.sampling.outlook import Outlook
from kinetics.sampling.watch import Watch

# Where kernels run as plain Python, numpy tells that words wrap around, as they should.
pytestmark = pytest.mark.filterwarnings("ignore:overflow encountered")

BITS = 2**64 - 1
KEY = stream_key(12)
TWINS = network(
    ("A", "B"),
    {"one": ((2, 0), (0, 1)), "two": ((2, 0), (0, 1)), "back": ((0, 1), (2, 0)), "by A": ((1, 1), (3, 0))},
    [0.1, 0.3, 1.0, 0.2],
    "ordered",
)
MANY = Network.from_reactions(
    {f"{i}": ({f"S{i}": 1}, {f"S{(i + 1) % 19}": 1}) for i in range(19)}, 0.1 + np.arange(19.0)
)
ALIKE = network("AB", {"one": ((1, 0), (0, 1)), "two": ((1, 0), (0, 1))}, [0.7, 0.4])
ALIKE_PAIRS = network("AB", {"one": ((2, 0), (0, 1)), "two": ((2, 0), (0, 1))}, [0.02, 0.05])
CASES = {
    "alike pairs": (ALIKE_PAIRS, [40, 0], 30.0),
    "alike": (ALIKE, [20, 0], 9.0),
    "line": (line(), [60, 0, 0, 0], 400.0),
    "twins": (TWINS, [12, 3], 1.5),
    "mixed": (MIXED, [9] * len(MIXED.species), 1.0),
    "products": (PRODUCTS, [6] * len(PRODUCTS.species), 1.0),
    "third order": (THIRD_ORDER, [8] * len(THIRD_ORDER.species), 1.0),
    "more than two blocks": (MANY, [1] * 19, 2.0),
}


class Stream:
    """xoshiro256++ whose state is SplitMix64 of a key and a run, on whole numbers (Blackman & Vigna 2021)."""

    def __init__(self, key, run):
        self.state = []
        for word in key.tolist():
            z = (word + (run + 1) * 0x9E3779B97F4A7C15) & BITS
            z = ((z ^ z >> 30) * 0xBF58476D1CE4E5B9) & BITS
            z = ((z ^ z >> 27) * 0x94D049BB133111EB) & BITS
            self.state.append(z ^ z >> 31)

    def uniform(self):
        s = self.state
        mixed = (s[0] + s[3]) & BITS
        word = ((mixed << 23 | mixed >> 41) + s[0]) & BITS
        shifted = s[1] << 17 & BITS
        s[2] ^= s[0]
        s[3] ^= s[1]
        s[1] ^= s[2]
        s[0] ^= s[3]
        s[2] ^= shifted
        s[3] = (s[3] << 45 | s[3] >> 19) & BITS
        return (word >> 11) * 2.0**-53


def chosen(weights, u):
    """The first whose running sum is above its share."""
    sums = np.cumsum(weights)
    return int(np.argmax(sums > u * sums[-1]))


def by_hand(net, initial, end, run):
    """Times, channels and states of one run; and the time to go after the last event."""
    merging = RecomputingSampler(net).merging
    groups = np.split(merging.members, merging.spans[1:-1])
    events, names = Stream(KEY, run), Stream(KEY ^ np.uint64(NAMING), run)
    t, state, times, channels, states = 0.0, np.array(initial), [], [], [np.array(initial)]
    while True:
        propensities = net.propensities(state[None])[0]
        sums = np.array([propensities[group].sum() for group in groups])
        if sums.sum() == 0:
            break
        t -= log(1.0 - events.uniform()) / sums.sum()
        if t > end:
            break
        group = groups[chosen(sums, events.uniform())]
        channel = group[0] if len(group) == 1 else group[chosen(propensities[group], names.uniform())]
        state = state + net.stoichiometry[channel]
        times.append(t)
        channels.append(channel)
        states.append(state)
    return np.array(times), np.array(channels), np.array(states)


@pytest.mark.parametrize(("net", "initial", "end"), CASES.values(), ids=CASES)
@pytest.mark.parametrize("run", [0, 5])
def test_a_path_is_that_by_hand(net, initial, end, run):
    times, channels, _ = by_hand(net, initial, end, run)
    found, fired = RecomputingSampler(net).path(np.array(initial), end, KEY, run, Watch(np.array([end])))
    assert len(times) > 8
    assert_array_equal(fired, channels)
    assert_allclose(found, times, rtol=1e-12)


@pytest.mark.parametrize(("net", "initial", "end"), CASES.values(), ids=CASES)
def test_counts_on_a_grid_are_those_by_hand(net, initial, end):
    grid = np.linspace(0.0, end, 7)
    out = np.empty((2, 7, len(initial)), np.int64)
    RecomputingSampler(net).ensemble(net.state(initial), grid, KEY, 3, out, Watch(grid))
    for run, counts in zip((3, 4), out, strict=True):
        times, _, states = by_hand(net, initial, end, run)
        assert_array_equal(counts, states[np.searchsorted(times, grid)])


@pytest.mark.parametrize(("net", "initial", "end"), CASES.values(), ids=CASES)
def test_events_and_exposures_are_those_by_hand(net, initial, end):
    ((events, exposures),) = exposures_of_draws(Model.of(net, initial), net.known_rates[None], end, 2, 12, first_run=3)
    for i, run in enumerate((3, 4)):
        times, channels, states = by_hand(net, initial, end, run)
        waits = np.diff(np.concatenate([[0.0], times, [end]]))
        assert_array_equal(events[i], np.bincount(channels, minlength=len(net.channels)))
        expected = net.ways * (waits @ net.combinations_of(states))
        assert_allclose(exposures[i], expected, rtol=1e-11, atol=1e-12 * end)


def test_a_run_of_more_events_than_a_buffer_goes_on():
    """Births and deaths, 1,024 at a time on a grid, 4,096 at a time as a path."""
    net = network("X", {"birth": ((0,), (1,)), "death": ((1,), (0,))}, [50.0, 1.0])
    times, channels, states = by_hand(net, [50], 52.0, 1)
    assert len(times) > 4096
    found, fired = RecomputingSampler(net).path(np.array([50]), 52.0, KEY, 1, Watch(np.array([52.0])))
    assert_array_equal(fired, channels)
    assert_allclose(found, times, rtol=1e-12)
    out = np.empty((1, 3, 1), np.int64)
    grid = np.array([1.0, 30.0, 52.0])
    RecomputingSampler(net).ensemble(net.state([50]), grid, KEY, 1, out, Watch(grid))
    assert_array_equal(out[0], states[np.searchsorted(times, [1.0, 30.0, 52.0])])
    ((events, exposures),) = exposures_of_draws(Model.of(net, [50]), net.known_rates[None], 52.0, 1, 12, first_run=1)
    assert_array_equal(events[0], np.bincount(channels))
    waits = np.diff(np.concatenate([[0.0], times, [52.0]]))
    assert_allclose(exposures[0], waits @ net.combinations_of(states), rtol=1e-10)


COMING = network("X", {"birth": ((0,), (1,)), "death": ((1,), (0,))}, [50.0, 1.0])
NOTHING = network("X", {"death": ((1,), (0,))}, [1.0])


def kernel_calls(kernel, net, start, grid, limits, out):
    """A kernel of many runs from number 3 on, as a function of the events it may make, and what it works on."""
    sampler, work = RecomputingSampler(net), ensemble_work(1)
    if kernel is direct:
        return work, lambda most: direct.ensemble(
            sampler.model, sampler.changes, work, net.state(start), grid, KEY, 3, np.array(limits), out, most,
            never(1), np.empty(0),
        )  # fmt: skip
    place = exposures.ExposureWork(work, np.empty(4, np.uint64), np.zeros(1))
    work.notes[LOOK] = limits[3]
    members, units = sampler.merging.named(None), mass_action(net.with_rates([1.0] * len(net.channels)))
    return work, lambda most: exposures.ensemble(
        sampler.model, members, units, None, sampler.changes, place, net.state(start), grid[-1], KEY, 3, *out, most
    )


@pytest.mark.parametrize("kernel", [direct, exposures], ids=["counts", "exposures"])
def test_a_kernel_returns_where_it_may_go_no_further(kernel):
    """After 7 events, and at the event 30 of a run, where it is looked at; then it goes on from there."""
    grid, counts = np.linspace(0.0, 2.0, 6), np.full((3, 6, 1), -1, np.int64)
    tables = np.zeros((3, 2), np.int64), np.zeros((3, 2))
    out = counts if kernel is direct else tables
    work, go_on = kernel_calls(kernel, COMING, [50], grid, [4, 2, 1, 30], out)
    assert [(go_on(7), int(work.notes[EVENTS])) for _ in range(6)] == [(1, n) for n in (7, 14, 21, 28, 30, 30)]
    work.notes[LOOK] = 10**6
    for _ in range(1000):
        if go_on(7) == REACHED_END:
            break
        if work.notes[EVENTS] == 30:
            work.notes[LOOK] = 10**6
    assert work.notes[RUN] == 3
    for i in range(3):
        times, channels, states = by_hand(COMING, [50], 2.0, 3 + i)
        if kernel is direct:
            seen = 4 if i < 1 else 2
            assert_array_equal(counts[i, :seen], states[np.searchsorted(times, grid[:seen])])
            assert_array_equal(counts[i, seen:], -1)
        else:
            waits = np.diff(np.concatenate([[0.0], times, [2.0]]))
            assert_array_equal(tables[0][i], np.bincount(channels, minlength=2))
            assert_allclose(tables[1][i], waits @ COMING.combinations_of(states), rtol=1e-11)


@pytest.mark.parametrize("kernel", [direct, exposures], ids=["counts", "exposures"])
def test_runs_without_events_are_work_as_well(kernel):
    out = np.zeros((5, 1, 1), np.int64) if kernel is direct else (np.zeros((5, 1), np.int64), np.zeros((5, 1)))
    work, go_on = kernel_calls(kernel, NOTHING, [0], np.array([1.0]), [1, 1, 0, 10], out)
    assert (go_on(3), int(work.notes[RUN])) == (UNFINISHED, 3)
    assert (go_on(3), int(work.notes[RUN])) == (REACHED_END, 5)


def test_a_count_beyond_its_type_stops_the_run_that_it_is_in():
    """A third birth is one too many; the first run that has it before the end is told, as it was before."""
    net = network("X", {"birth": ((0,), (1,))}, [1.0])
    births = [len(by_hand(net, [0], 1.5, run)[0]) for run in range(20)]
    first = next(run for run in range(20) if births[run] < 3 <= births[run + 1])
    full = np.array([2**63 - 3])
    out = np.empty((9, 1, 1), np.int64)
    watch = Watch(np.array([1.5]), Outlook(net), first_run=first)
    RecomputingSampler(net).ensemble(net.state(full), watch.grid, KEY, first, out, watch)
    assert watch.truncation(9).reason == "overflow"
    assert watch.truncation(9).among == 9
    assert watch.truncation(9).truncated == sum(n >= 3 for n in births[first : first + 9])
    watch = Watch(np.array([1.5]))
    times, _ = RecomputingSampler(net).path(full, 1.5, KEY, first + 1, watch)
    assert len(times) == 2
    assert_array_equal(watch.stops[first + 1].counts, full + 2)
    with pytest.raises(ValueError, match=f"run {first + 1}: a count"):
        list(exposures_of_draws(Model.of(net, full), [[1.0]], 1.5, 9, 12, first_run=first))


def test_what_cannot_happen_does_not_where_the_draw_is_zero():
    """A state of the stream whose second word is 0: the share that is looked for ends before the first channel."""
    net = network("AB", {"never": ((1, 0), (0, 1)), "back": ((0, 1), (1, 0))}, [1.0, 1.0])
    sampler = RecomputingSampler(net)
    word = np.uint64(0x9E3779B97F4A7C15)
    stream = np.array([0, word, 5, word], np.uint64)
    times, fired, counts = np.zeros(1), np.zeros(1, np.int64), np.array([0, 9, 1])
    found = advance(sampler.model, sampler.changes, counts, np.zeros(3), 50.0, stream, times, fired, never(2))
    assert found == (UNFINISHED, 1)
    assert (fired.tolist(), counts.tolist()) == ([1], [1, 8, 1])
    members = Members(np.array([0, 2]), np.array([0, 1]), np.array([1.0, 1.0]), np.array([0, 1], np.int32), np.zeros(2))
    naming = np.array([0, 0, 5, 0], np.uint64)  # its first word
    assert member_at(members, 0, np.array([0.0, 9.0, 1.0]), naming) == 1
