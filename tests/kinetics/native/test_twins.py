"""The kernels in C give the bits of those by Numba: same counts, same chances, same outcomes."""

from unittest.mock import patch

import numpy as np
import pytest
from break_studies import TANK, by_first_coefficient
from crowded_networks import JOINING, LINE, SWELLING
from known_systems import line
from numpy.testing import assert_array_equal
from sampled_networks import ENZYME, MIXED, PRODUCTS, THIRD_ORDER, ring

from kinetics.kernels import direct, exploration, outcomes
from kinetics.kernels import statistics as tallies
from kinetics.kernels.ensemble_work import BEFORE, EVENTS, RUN, ensemble_work, never
from kinetics.markov.transient import reachable
from kinetics.markov.transient.search import key_multipliers, keys_of
from kinetics.native import library, state_tables, twins
from kinetics.native.lanes import Lanes
from kinetics.network import Network
from kinetics.rates.breaks import break_model
from kinetics.sampling.base import stream_key
from kinetics.sampling.merging import Merging
from kinetics.sampling.stopping import stop_at

pytestmark = pytest.mark.skipif(not library.is_built(), reason="the C kernels were not built: there was no compiler")

COLLIDING = by_first_coefficient(break_model("collision-wall"), {"alpha": 1.3, "wall": 40.0}, 1e-5).network(TANK)[1]
BIG = Network.from_reactions({"pair": ({"A": 2}, {"B": 1}), "more": ({}, {"A": 2**38})}, [1e-30, 1e3])
END = Network.from_reactions({"end": ({"A": 1}, {})}, [1.0])
SUDDEN = Network.from_reactions({"late": ({}, {"A": 1}), "grow": ({"A": 1}, {"A": 2})}, [1e-3, 1e18])
# 2,000 waits near t = 1, of which most are below half a unit in its last place.
SLOW_CLOCK = Network.from_reactions({"late": ({"B": 1}, {"A": 2000}), "fall": ({"A": 1}, {})}, [1.0, 1e13])
JUMP = Network.from_reactions({"jump": ({"B": 1}, {"A": 2**62, "B": 1})}, [1.0])
CASES = {
    "line": (line(), [60, 0, 0, 0], 2000.0),
    "broken by partners": (COLLIDING, np.eye(len(COLLIDING.species), dtype=int)[0] * 40, 2000.0),
    "hits in a crowd": (LINE, [8, 0, 0, 0], 60.0),
    "joins in a crowd": (JOINING, [8, 0, 0, 0], 60.0),
    "a crowd that swells": (SWELLING, [12, 1], 30.0),
    "enzyme": (ENZYME, [30, 90, 0, 0], 3.0),
    "mixed": (MIXED, [90, 10, 20], 1.0),
    "third order": (THIRD_ORDER, [11, 2], 2.0),
    "ordered pairs": (PRODUCTS, [13, 0], 0.25),
    "ring": (ring(40), np.full(40, 20), 1.0),
    "nothing left": (END, [5], 100.0),
    "nothing at all": (END, [0], 1.0),
    "counts beyond doubles": (BIG, [0, 0], 40.0),
    "a clock that stands still": (SUDDEN, [0], 1e9),
    "a clock that stands still at times": (SLOW_CLOCK, [1, 0], 1.0),
}


def one_by_one(model, changes, start, grid, out, events_a_call, stopping):
    """Outcome, and where the runs stand: those that cannot go on are left there."""
    work, limits = ensemble_work(start.size), np.array([grid.size, grid.size, 0, 10**6])
    go_on, outcomes_met = twins.direct(model, changes, work, start, grid, stream_key(3), 5, out, stopping), []
    while work.notes[RUN] < len(out):
        outcome = go_on(limits, events_a_call)
        if outcome not in (outcomes.REACHED_END, outcomes.UNFINISHED):
            outcomes_met.append((int(work.notes[RUN]), outcome, *work.clock, *work.counts))
            work.notes[RUN], work.notes[EVENTS] = work.notes[RUN] + 1, BEFORE
    return outcomes_met


def side_by_side(model, changes, start, grid, out, events_a_call, stopping):
    lanes, limits = Lanes(model, changes), np.array([grid.size, grid.size, 0, 10**6])
    is_odd = np.zeros(len(out), bool)
    go_on = twins.lockstep(model, changes, lanes, start, grid, stream_key(3), 5, out, is_odd, stopping)
    while True:
        go_on(limits, events_a_call)
        if not lanes.arrays["notes"][0]:
            return is_odd


KERNELS = {"direct": one_by_one, "lockstep": side_by_side}


def ended(make, in_c, net, initial, end, runs, events_a_call=10**6, until=None):
    """What stopped runs, and counts; and when a condition held, if there is one."""
    merging, start = Merging.of(net), net.state(initial)
    out = np.full((runs, 7, start.size), -1, np.int64)
    changes, grid = net.stoichiometry[merging.representatives], np.linspace(0.0, end, 7)
    stop = never(len(changes)) if until is None else stop_at(until, net, start)[0].of_channels(merging.representatives)
    reached = np.full(runs, np.inf)
    with patch.object(twins, "is_built", return_value=in_c):
        model = merging.model(None, merging.thinning(start))
        return make(model, changes, start, grid, out, events_a_call, (stop, reached)), out, reached


@pytest.mark.parametrize("runs", [1, 20, 150])
@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("name", CASES)
def test_runs_have_the_same_bits(name, kernel, runs):
    stopped, counts, _ = ended(KERNELS[kernel], True, *CASES[name], runs)
    other, same, _ = ended(KERNELS[kernel], False, *CASES[name], runs, events_a_call=777)
    assert_array_equal(stopped, other)
    assert_array_equal(counts, same)


UNTIL = {
    "line": "dimer >= 9 & !(monomer > 40) | quadmer == 3",
    "broken by partners": "dimer >= 3",
    "hits in a crowd": "dimer >= 2",
    "mixed": "A + 2 * B >= 96",
    "ring": "place0 - 1.5 * place1 < -12",
    "third order": "A * B < 18",
}


@pytest.mark.parametrize("runs", [3, 150])
@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("name", UNTIL)
def test_runs_that_end_at_a_condition_have_the_same_bits(name, kernel, runs):
    _, counts, reached = ended(KERNELS[kernel], True, *CASES[name], runs, until=UNTIL[name])
    _, same, other = ended(KERNELS[kernel], False, *CASES[name], runs, events_a_call=777, until=UNTIL[name])
    assert_array_equal(reached, other)
    assert_array_equal(counts, same)
    assert np.isfinite(reached).any()


def test_an_event_that_is_too_much_is_taken_back():
    for in_c in (True, False):
        ((_, outcome, *stands),) = ended(one_by_one, in_c, JUMP, [1, 0], 1e3, 1)[0]
        assert (outcome, stands[-3:]) == (outcomes.OVERFLOW, [1, 2**62, 1])


def test_the_cases_reach_every_outcome():
    stopped = [ended(one_by_one, False, *case, 1)[0] for case in [*CASES.values(), (JUMP, [1, 0], 1e3)]]
    assert {each[1] for stops in stopped for each in stops} == {outcomes.STALLED_CLOCK, outcomes.OVERFLOW}
    assert any(Merging.of(net).model().terms.size for net, _, _ in CASES.values())
    assert any(Merging.of(net).model().is_general.any() for net, _, _ in CASES.values())
    assert any(len(net.channels) > 8 * 4 for net, _, _ in CASES.values())


def run_by(kernel, net, initial, end, model=None):
    """Outcome, all events of one run, in pieces of 50, and what the kernel writes to."""
    merging = Merging.of(net)
    counts, clock, stream = np.append(initial, 1).astype(np.int64), np.zeros(3), stream_key(4)
    outcome, found = outcomes.UNFINISHED, []
    changes = net.stoichiometry[merging.representatives]
    while outcome == outcomes.UNFINISHED and len(found) < 40:
        times, fired = np.empty(50), np.empty(50, np.int64)
        outcome, n = kernel(
            model or merging.model(None, merging.thinning(counts[:-1])),
            changes,
            counts,
            clock,
            end,
            stream,
            times,
            fired,
            never(len(changes)),
        )
        found.append((times[:n], fired[:n]))
    return outcome, *map(np.concatenate, zip(*found, strict=True)), counts, clock, stream


@pytest.mark.parametrize("name", CASES)
def test_the_times_of_events_have_the_same_bits(name):
    """Times show the last bit of every draw, propensity and sum; counts would not."""
    found = run_by(twins.events, *CASES[name])
    for one, other in zip(found, run_by(direct.advance, *CASES[name]), strict=True):
        assert_array_equal(one, other)


def test_a_rate_one_bit_off_is_seen():
    """The control: other arithmetic gives other times."""
    net, initial, end = CASES["line"]
    model = Merging.of(net).model()
    off = model._replace(coefficients=np.nextafter(model.coefficients, 1.0))
    (_, times, *_), (_, other, *_) = (run_by(twins.events, net, initial, end, each) for each in (model, off))
    assert (times != other).any()


def copies(*arrays):
    return [array.copy() for array in arrays]


def assert_same(in_c, by_numba, arguments):
    """Both change or give the same, whatever a function writes to."""
    one, other = copies(*arguments), copies(*arguments)
    left, right = in_c(*one), by_numba(*other)
    for a, b in zip(one, other, strict=True):
        assert_array_equal(a, b)
    if left is not None or right is not None:
        assert_array_equal(left, right)
    return one


@pytest.mark.parametrize("top", [3, 10**6, 2**61])
def test_tallies_are_the_same(top):
    rng = np.random.default_rng(1)
    counts = rng.integers(0, top, size=(30, 4, 3))
    low, high = counts[0].copy(), counts[0].copy()
    _, low, high = assert_same(twins.extend_range, tallies.extend_range, (counts, low, high))
    shift, origin = np.zeros_like(low), np.zeros_like(low)
    *_, shift, origin = assert_same(
        lambda *arrays: twins.fit_bins(*arrays[:2], 63, *arrays[2:]),
        lambda *arrays: tallies.fit_bins(*arrays[:2], 63, *arrays[2:]),
        (low, high, shift, origin),
    )
    histogram = np.zeros((4, 3, 63), np.int64)
    *_, histogram = assert_same(twins.tally, tallies.tally, (counts, shift, origin, histogram))
    assert histogram.sum() == counts.size
    assert_same(twins.rebin, tallies.rebin, (histogram, shift, origin, shift + 2, origin >> 2))
    part = counts % 2**20
    pairs = np.array(np.triu_indices(3))
    sums, products = np.zeros((4, 3), np.int64), np.zeros((4, 6), np.int64)
    assert_same(twins.add_products, tallies.add_products, (part, part[0], *pairs, sums, products))
    alone = np.arange(3)
    added = np.zeros((4, 3), np.int64), np.zeros((4, 3), np.int64)
    tallies.add_squares(part, part[0], *added)
    twins.add_products(part, part[0], alone, alone, sums, squares := np.zeros((4, 3), np.int64))
    assert_array_equal([sums, squares], added)


@pytest.mark.parametrize("name", ["line", "enzyme", "mixed", "broken by partners"])
def test_explorations_are_the_same(name, monkeypatch):
    net, initial, _ = CASES[name]
    start = np.minimum(initial, 12)
    here = reachable(net, start)
    moves = here.transitions()
    keys = keys_of(here.states, key_multipliers(len(net.species)))
    table = state_tables.tabulate(keys, keys.size, 2 ** int(np.ceil(np.log2(2 * keys.size))))
    assert_array_equal(table, exploration.tabulate(keys, keys.size, table.size))
    asked = np.concatenate([here.states[::3], here.states[:2] + 1000])
    asked_keys = keys_of(asked, key_multipliers(len(net.species)))
    assert_array_equal(
        state_tables.find(asked, asked_keys, (here.states, keys, table)),
        exploration.find(asked, asked_keys, here.states, keys, table),
    )
    half = len(here) // 2
    for in_c in (True, False):
        room, some_keys = here.states.copy(), keys.copy()
        slots = exploration.tabulate(keys, half, table.size)
        shuffled = np.random.default_rng(1).permutation(len(here))
        rows = np.empty(len(here), np.int64)
        with patch.object(state_tables, "is_built", return_value=in_c):
            new, place = (here.states[shuffled], keys[shuffled]), (room, some_keys, slots)
            assert state_tables.insert(*new, place, half, rows) == len(here)
        assert_array_equal(room[rows], here.states[shuffled])
        assert_array_equal(room[:half], here.states[:half])
        if in_c:
            found = room, some_keys, slots, rows
        else:
            for one, other in zip(found, (room, some_keys, slots, rows), strict=True):
                assert_array_equal(one, other)
    begins = np.zeros(len(here), dtype=bool)
    begins[0] = True
    back = moves.leading_to(begins)
    monkeypatch.setattr(library, "library", lambda: None)
    there = reachable(net, start)
    assert_array_equal(here.states, there.states)
    others = there.transitions()
    assert_array_equal(moves.rows, others.rows)
    assert_array_equal(moves.columns, others.columns)
    assert_array_equal(moves.rates, others.rates)
    assert_array_equal(back, others.leading_to(begins))


def test_a_search_that_is_too_large_ends_alike(monkeypatch):
    messages = []
    for _ in range(2):
        with pytest.raises(ValueError, match="over 1000 states are reachable") as caught:
            reachable(Network.from_reactions({"make": ({}, {"A": 1})}, [1.0]), [0], max_states=1000)
        messages.append(str(caught.value))
        monkeypatch.setattr(library, "library", lambda: None)
    assert messages[0] == messages[1]


def test_arrays_that_the_library_cannot_read_are_refused():
    counts = np.zeros((4, 2, 2), np.int64)
    with pytest.raises(ValueError, match="do not lie side by side"):
        twins.extend_range(counts[::2], counts[0], counts[1])
