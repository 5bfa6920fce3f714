"""Exact leaping, with leaps forced where counts are small: the whole tree is walked, and exact laws are at hand.

`Leaps` never draws single events. With many open events a leap may hold all that happens; with a narrow box, most
leaps end by leaving it.
"""

import inspect
import re
from dataclasses import dataclass
from math import exp

import numpy as np
import pytest
from known_systems import assert_follows_cdf, assert_follows_table, decay, line, network
from numpy.testing import assert_array_equal
from sampled_networks import ENZYME, MIXED, PRODUCTS, THIRD_ORDER, ring
from scipy.stats import binom, poisson, uniform

from kinetics import Auto, Direct, Leaping, Lockstep, Model, Network, Transient, verify
from kinetics.kernels import leap_plan, leaping
from kinetics.kernels.leap_limits import LARGEST_COUNT
from kinetics.kernels.outcomes import REACHED_END
from kinetics.sampling import simulate_posterior, simulate_statistics
from kinetics.sampling.base import stream_key
from kinetics.sampling.cost_model import NetworkSize
from kinetics.sampling.leap_length import FEWEST_COPIES, events_of_leap
from kinetics.sampling.leaping import LeapingSampler
from kinetics.trust.verification import MUTANTS


@dataclass(frozen=True)
class Leaps(Leaping):
    """Leaps alone, of so many open events."""

    fewest: float = 0.0
    open_events: float = 2.0

    def prepared(self, network):
        sampler = LeapingSampler(network, self.fewest)
        sampler.model = sampler.model._replace(open_events=self.open_events)
        return sampler


SHORT, LONG = Leaps(), Leaps(open_events=40.0)
DIMERS = Network.from_text("2 A <-> B, 0.02, 0.1")
QUICK_LINE = line().with_rates(50 * line().rate_constants)
CATALYSED = Network.from_text("C + A -> C + B, 0.05\n0 -> C, 2\nC -> 0, 0.5")
FOURTH = network(
    ("A", "B"), {"four": ((4, 0), (0, 2)), "mixed": ((2, 2), (4, 0)), "back": ((0, 1), (2, 0))}, [0.01, 0.01, 0.5]
)
SMALL = {
    "dimers": (DIMERS, [60, 0], 3.0),
    "enzyme": (ENZYME, [3, 9, 0, 0], 1.5),
    "mixed": (MIXED.with_rates([0.2, 0.4, 0.15, 0.3, 0.2, 0.5]), [9, 1, 2], 0.6),
    "line of four": (QUICK_LINE, [12, 0, 0, 0], 20.0),
    "third order": (THIRD_ORDER, [14, 2], 2.0),
    "fourth order": (FOURTH, [12, 0], 2.0),
    "squares": (PRODUCTS, [13, 0], 0.25),
    "extinction": (Network.from_text("A + B -> 2 B, 0.1\nB -> 0, 0.9"), [12, 3], 2.0),
}
RUNS = 1500


def final_states(net, method, initial, end, runs=RUNS, seed=21):
    return method.simulate(net, initial, [end], runs=runs, seed=seed, threads=1).counts[:, 0]


def assert_joint_distribution(net, initial, end, states):
    exact = Transient().solve(net, initial, [end])
    observed = np.bincount(exact.space.index_of(states), minlength=len(exact.space))
    assert_follows_table(observed, exact.probabilities[0])


@pytest.mark.parametrize("method", [SHORT, LONG], ids=["short", "long"])
@pytest.mark.parametrize("case", SMALL)
def test_leaps_solve_the_master_equation(method, case):
    net, initial, end = SMALL[case]
    states = final_states(net, method, initial, end)
    assert_joint_distribution(net, initial, end, states)
    with pytest.raises(AssertionError, match="chi-square"):  # all rates 40 % too large is seen
        assert_joint_distribution(net, initial, 1.4 * end, states)


@pytest.mark.parametrize("method", [SHORT, LONG], ids=["short", "long"])
@pytest.mark.parametrize("case", ["enzyme", "third order"])
def test_leaps_are_verified_with_all_checks(method, case):
    """Transitions between times, waits and choices of paths, independence of runs: not the law of one time alone."""
    net, initial, end = SMALL[case]
    found = verify(net, method, initial, [0.3 * end, end], runs=1000, seed=4, with_power=False)
    assert found.passed, str(found)


@pytest.mark.validate
@pytest.mark.parametrize("method", [SHORT, LONG], ids=["short", "long"])
@pytest.mark.parametrize("case", SMALL)
def test_leaps_are_verified_with_full_power(method, case):
    net, initial, end = SMALL[case]
    found, of_direct = (
        verify(net, each, initial, [0.3 * end, end], runs=20_000, seed=5) for each in (method, Direct())
    )
    assert found.passed, str(found)
    rearranged = {mutant.name for mutant in MUTANTS}  # not those of rates, some of which are seen by luck
    seen, seen_of_direct = ({m.name for m in each.mutants if m.caught_by} for each in (found, of_direct))
    assert seen & rearranged >= seen_of_direct & rearranged


def assert_follow_in_turn(first, second):
    """Shares (runs,) of distribution functions at two times, the second given the first: independent and uniform."""
    for shares in (first, second):
        assert_follows_cdf(shares, uniform().cdf)
    cells = np.floor(4 * first).astype(int) * 4 + np.floor(4 * second).astype(int)
    assert_follows_table(np.bincount(np.minimum(cells, 15), minlength=16), np.full(16, 1 / 16))


@pytest.mark.parametrize("rate", [1.0, 1.001])
def test_a_billion_decay_as_independent_copies(rate):
    """Each time's count is binomial given the one before; a thousandth in the rate is seen."""
    n, kept = 10**9, exp(-0.01)
    counts = Leaping().simulate(decay(rate), [n], [0.01, 0.02], runs=600, seed=31, threads=1).counts[:, :, 0]
    shares = binom(n, kept).cdf(counts[:, 0]), binom(counts[:, 0], kept).cdf(counts[:, 1])
    if rate == 1.0:
        assert_follow_in_turn(*shares)
    else:
        with pytest.raises(AssertionError, match="the laws differ"):
            assert_follow_in_turn(*shares)


@pytest.mark.parametrize("n", [10, 1000])
def test_few_decay_as_independent_copies(n):
    counts = SHORT.simulate(decay(), [n], [0.5, 1.0], runs=RUNS, seed=32, threads=1).counts[:, :, 0]
    assert_follows_cdf(counts[:, 0], binom(n, exp(-0.5)).cdf)
    assert_follows_cdf(counts[:, 1], binom(n, exp(-1.0)).cdf)
    assert_follows_cdf(counts[:, 0] - counts[:, 1], binom(n, exp(-0.5) - exp(-1.0)).cdf)


@pytest.mark.parametrize(("births", "end", "runs"), [(10.0, 1.0, 1000), (1e3, 1.0, 500), (1e9, 0.02, 400)])
def test_births_into_an_empty_state_are_poisson(births, end, runs):
    net = Network.from_reactions({"birth": ({}, {"X": 1}), "death": ({"X": 1}, {})}, [births, 1.0])
    counts = final_states(net, SHORT, [0], end, runs, seed=33)[:, 0]
    assert_follows_cdf(counts, poisson(births * (1 - exp(-end))).cdf)
    with pytest.raises(AssertionError, match="the laws differ"):
        assert_follows_cdf(counts, poisson(births * (1 - exp(-end)) + np.sqrt(births * end)).cdf)


def test_a_constant_source_alone_is_poisson():
    """Nothing depends on the counts, so one leap is as long as leaps may be."""
    net = Network.from_text("0 -> X, 1e11")
    assert_follows_cdf(final_states(net, SHORT, [0], 30.0, 400, seed=34)[:, 0], poisson(3e12).cdf)


def test_a_catalyst_sets_the_pace_of_a_billion():
    net = Network.from_text("C + A -> C + B, 1e-5")
    counts = final_states(net, Leaping(), [1000, 10**9, 0], 1.0, 400, seed=35)
    assert_array_equal(counts[:, 0], 1000)
    assert_follows_cdf(counts[:, 2], binom(10**9, 1 - exp(-0.01)).cdf)


def test_a_catalyst_that_comes_and_goes():
    """Catalyst and its work at two times, beside the direct method: means and covariance within chance."""
    times = [2.0, 6.0]
    one, other = (
        method.simulate(CATALYSED, [5, 60, 0], times, runs=3000, seed=seed, threads=1).counts.reshape(3000, -1)
        for method, seed in ((LONG, 36), (Lockstep(), 37))
    )
    for f in (one, one[:, :, None] * one[:, None, :]):
        g = other if f is one else other[:, :, None] * other[:, None, :]
        error = np.sqrt((f.var(axis=0) + g.var(axis=0)) / 3000) + 1e-9
        assert np.all(np.abs(f.mean(axis=0) - g.mean(axis=0)) < 6.0 * error)  # 42 of them: 1e-7


@pytest.mark.parametrize("order", [1, 2, 4, 17])
def test_one_set_of_like_reactants_meets_at_its_rate(order):
    net = network(("A", "B"), {"meet": ((order, 0), (0, 1))}, [0.5])
    assert_follows_cdf(final_states(net, SHORT, [order, 0], 2.0, 500)[:, 1], binom(1, 1 - exp(-1.0)).cdf)
    assert_array_equal(final_states(net, SHORT, [order - 1, 0], 2.0, 5), [[order - 1, 0]] * 5)


@pytest.mark.parametrize("method", [SHORT, LONG, Leaping(fewest=30)], ids=["short", "long", "both"])
@pytest.mark.parametrize(
    ("net", "initial"), [(QUICK_LINE, [3000, 0, 0, 0]), (ring(20), [9] * 20), (MIXED, [200, 9, 9])]
)
def test_a_run_is_the_same_however_it_is_asked_for(method, net, initial):
    """For any grid, number of runs, threads, and event by event."""
    times, fine = np.linspace(0, 1.0, 5), np.linspace(0, 1.0, 321)
    whole = method.simulate(net, initial, times, runs=12, seed=27, threads=1).counts
    finely = method.simulate(net, initial, fine, runs=12, seed=27, threads=1).counts
    assert_array_equal(finely[:, ::80], whole)
    assert_array_equal(method.simulate(net, initial, times[1:3], runs=12, seed=27, threads=3).counts, whole[:, 1:3])
    assert_array_equal(method.simulate(net, initial, times, runs=3, seed=27, first_run=9).counts, whole[9:])
    for run in (0, 11):
        path = method.sample_path(net, initial, 1.0, seed=27, run=run)  # itself refuses impossible events
        assert np.all(np.diff(path.times) > 0)
        assert_array_equal(path.at(fine), finely[run])
        at_events = method.simulate(net, initial, path.times[:40], runs=1, seed=27, first_run=run).counts[0]
        assert_array_equal(at_events, path.at(path.times[:40]))  # an event counts at its own time
    assert np.any(method.simulate(net, initial, times, runs=12, seed=28).counts != whole)


@pytest.mark.parametrize("cubes", [10**10, LARGEST_COUNT])
def test_cubes_are_conserved_at_any_count(cubes):
    model = line().with_rates(line().rate_constants * np.where(line().reactants.sum(axis=1) == 2, 60 / cubes, 1.0))
    end = 2000.0 / np.sqrt(cubes / 1e6)
    counts = Leaping().simulate(model, [cubes, 0, 0, 0], [end / 2, end], runs=2, seed=5, threads=1).counts
    assert_array_equal(counts @ [1, 2, 3, 4], cubes)
    assert counts[:, :, 1].min() > 10**5


def test_counts_beyond_exact_doubles_are_refused_before_the_runs():
    for method in (Leaping(), SHORT):
        with pytest.raises(ValueError, match=r"species 'X' starts with 9007199254740993 copies.*2\*\*53.*'ssa'"):
            method.simulate(decay(), [LARGEST_COUNT + 1], [1.0], runs=2)
        with pytest.raises(ValueError, match="9007199254740993 copies"):
            method.sample_path(decay(), [LARGEST_COUNT + 1], 1.0)
    assert Auto().choose(decay(), [LARGEST_COUNT + 1]) != Leaping()


def test_counts_that_grow_beyond_exact_doubles_go_on_by_single_events():
    net = network(("A", "B"), {"jump": ((1, 0), (1, 2**50 + 1))}, [1.0])
    counts = final_states(net, SHORT, [1, 0], 20.0, 300, seed=9)[:, 1]
    assert_array_equal(counts % (2**50 + 1), 0)
    assert_follows_cdf(counts // (2**50 + 1), poisson(20.0).cdf)


@pytest.mark.parametrize("rate", [1e-320, 1e-312, 1e-300])
def test_events_that_hardly_ever_come_take_no_endless_leap(rate):
    """Below about 6e-297 the longest leap would be longer than any double."""
    counts = SHORT.simulate(Network.from_text(f"A -> 0, {rate}"), {"A": 10**6}, [1.0, 1e290], runs=2, seed=1).counts
    assert (counts == 10**6).all()


def test_settings_are_checked():
    for fewest in (-1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="expected a number of events of at least 0, or None"):
            Leaping(fewest=fewest)


def test_auto_looks_at_the_counts():
    few, many = {"A": FEWEST_COPIES - 1}, {"A": 10**8}
    by_counts = Network.from_text("2 A <-> B, 1e-8, 1")
    for auto, usual in ((Auto(), Lockstep()), (Auto(many=False), Direct())):
        assert auto.choose(by_counts) == auto.choose(by_counts, few) == usual
        assert auto.choose(by_counts, many) == Leaping()
    assert Auto().name_for(by_counts, few) == "auto (lockstep)"
    assert Auto().name_for(by_counts, many) == "auto (leaping)"
    times = [1e-3, 1e-2]
    chosen = Leaping().simulate(by_counts, many, times, runs=20, seed=3)
    found = Auto().simulate(by_counts, many, times, runs=20, seed=3)
    assert_array_equal(found.counts, chosen.counts)
    assert found.method == "auto (leaping)"
    assert simulate_statistics(by_counts, "auto", many, times, runs=20, seed=3).method == "auto (leaping)"
    (drawn,) = simulate_posterior(Model.of(by_counts, many), by_counts.known_rates[None], times, 20, 3)
    assert_array_equal(drawn, chosen.counts)
    path = Auto().sample_path(by_counts, many, 2e-6, seed=3, run=7)
    assert path.times.size > 50
    assert_array_equal(path.times, Leaping().sample_path(by_counts, many, 2e-6, seed=3, run=7).times)


def test_auto_leaves_alone_what_leaps_do_not_pay_for():
    enzyme = Network.from_text("E + S <-> ES, 1e-4, 100\nES -> E + P, 100")
    assert Auto(many=False).choose(enzyme, {"E": 5, "S": 10**6}) == Direct()  # each event changes a propensity by much
    assert Auto(many=False).choose(ring(40), [10**7] * 40) != Leaping()  # single events are cheaper elsewhere
    assert events_of_leap(decay(), np.array([FEWEST_COPIES - 1])) == 0.0
    assert events_of_leap(decay(0.0), np.array([10**9])) == 0.0
    assert events_of_leap(decay(1e300), np.array([10**9])) == 0.0
    assert events_of_leap(Network.from_text("A -> B, 5 * A / (2 + A)"), np.array([10**9, 0])) == 0.0


@pytest.mark.parametrize("counts", [[10**5, 0, 0, 0], [10**6, 3, 10**4, 10**5], [0, 0, 0, 10**12]])
def test_auto_expects_the_leaps_that_the_kernel_makes(counts):
    sampler = LeapingSampler(line(), 0.0)
    work = leap_plan.work_for(8, 4)
    work.cells.counts[:4] = counts
    _, events = leap_plan.plan_leap(sampler.model, work.cells, 0.0)
    assert events > 0
    assert events_of_leap(line(), np.array(counts)) == pytest.approx(events, rel=1e-9)
    assert NetworkSize.of(line(), np.array(counts)).leap_events == pytest.approx(events, rel=1e-9)


# The kernel as plain Python, with mistakes, each in a run in which it matters.


def narrow_box(model, work, length):
    """Eight copies to either side: leaps end by leaving it."""
    n = work.counts.size - 1
    work.box_low[:n], work.box_high[:n] = np.maximum(work.counts[:n] - 8, 0), work.counts[:n] + 8


SCENES = {  # network, start, end, runs, open events, names of the kernel that are replaced
    "turnover": ("A + B -> C, 0.15\nC -> A + B, 0.6", [16, 12, 0], 1.0, 500, 30.0, {"WIDE": 0.0}),
    "outbreak": ("A + B -> 2 B, 0.06", [30, 2], 1.2, 700, 30.0, {}),
    "edge": ("A + B -> 2 B, 0.06", [30, 2], 1.2, 400, 30.0, {"WIDE": -1.0}),
    "narrow": ("A -> B, 1", [100, 0], 0.5, 300, 6.0, {"set_box": narrow_box}),
}
DECIDED = "sure = binomial(undecided, (new_low - low) / (high - low), stream)"
RIGHT_WORDS = "start_stream(cells.keys[top], RIGHT, cells.keys[top])"
MISTAKES = {
    "open events are taken for sure": (DECIDED, "sure = undecided", "outbreak"),
    "open events are taken for rejected": (DECIDED, "sure, undecided = 0, 0", "turnover"),
    "marks are used again": ("cells.low[top, r], cells.high[top, r] = new_low, new_high", "pass", "turnover"),
    "open events are in both halves": ("cells.open[top, r] -= undecided", "pass", "turnover"),
    "halves share their words": (RIGHT_WORDS, RIGHT_WORDS.replace("RIGHT", "LEFT"), "outbreak"),
    "the box is not checked": ("not (can_leave or is_asked)", "not is_asked", "narrow"),
    "a leap goes on beyond its box": ("leaves = can_leave and is_outside(cells)", "leaves = False", "narrow"),
    "leaps that end early end in time": ("top, over = NO_CELL, time", "top = NO_CELL", "edge"),
}  # fmt: skip


def plain(net, initial, end, runs, open_events, replaced, right="", wrong=""):
    """Final counts (runs, S) by the kernel uncompiled."""
    source = (inspect.getsource(leap_plan) + inspect.getsource(leaping)).replace("@compiled\n", "")
    source = re.sub("from kinetics.kernels.leap_plan import .*", "", source)
    assert not right or source.count(right) == 1
    names = {"__name__": "plain_leaping"}
    exec(compile(source.replace(right, wrong) if right else source, "plain_leaping", "exec"), names)
    names.update(replaced)
    model = LeapingSampler(net, 0.0).model._replace(open_events=open_events)
    out = np.empty((runs, 1, len(initial)), dtype=np.int64)
    work, limits = leap_plan.work_for(len(net.channels), len(initial)), np.array([1, 1, 0, 10**6])
    found = names["ensemble"](model, work, np.array(initial), np.array([end]), stream_key(8), 0, limits, out, 10**9)
    assert found == REACHED_END
    return out[:, 0]


def test_the_kernel_is_its_own_plain_python():
    expected = final_states(DIMERS, LONG, [30, 0], 1.0, runs=8, seed=8)
    assert_array_equal(plain(DIMERS, [30, 0], 1.0, 8, LONG.open_events, {}), expected)


@pytest.mark.parametrize("scene", SCENES)
def test_narrow_boxes_leave_the_law_as_it_is(scene):
    text, initial, end, *rest = SCENES[scene]
    net = Network.from_text(text)
    assert_joint_distribution(net, initial, end, plain(net, initial, end, *rest))


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_seen(mistake):
    right, wrong, scene = MISTAKES[mistake]
    text, initial, end, *rest = SCENES[scene]
    net = Network.from_text(text)
    with pytest.raises((AssertionError, ValueError)):  # another law, states that cannot be, or a run that fails
        assert_joint_distribution(net, initial, end, plain(net, initial, end, *rest, right, wrong))
