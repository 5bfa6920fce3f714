"""Events judge: the test has its size, sees what it must, and its numbers are those of a count by hand."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import kstest
from synthetic_runs import breaking_run, line_network, restarted_run

from calibration import count, crossvalidate, estimate
from calibration.validating.events import EventTotals, HeldOutEvents, event_rows
from calibration.validating.groups import SimulatedGroups, event_groups
from calibration.validating.over_sizes import ComparedSizes
from calibration.validating.power import power_of_runs
from kinetics.assembly import RuleBook, derive
from kinetics.rates import Rates
from kinetics.rates.break_terms import BreakTerms
from kinetics.runs import JumpPath
from kinetics.sampling import sample_path

LINE4 = Path(__file__).parents[3] / "results" / "line4"
START = np.array([30, 0, 0, 0])
END, RUNS, GROUPS = 25.0, 3, 199


@cache
def calibrated():
    """Rates from so short a calibration that their uncertainty matters: some 20 events a channel."""
    network = line_network()
    restarted = restarted_run(network, network.state([14, 12, 6, 1]), 25.0, np.random.default_rng(3))
    return estimate([restarted, breaking_run(network, network.state([0, 0, 12, 30]), 3.0, 4)]).rates()


def taken_as_exact(rates):
    bare = {name: c.replace(events=None, exposure=None) for name, c in rates.channels.items()}
    return rates.replace(channels=bare)


def held_out(rates, constants, seed, runs=RUNS, number=0, most=GROUPS, groups=GROUPS):
    """Held-out runs under some rate constants, beside groups under these rates."""
    network = line_network()
    true = network.with_rates(constants)
    paths = [
        replace(sample_path(true, START, END, seed=10**6 + seed, run=number * runs + i), network=network)
        for i in range(runs)
    ]
    simulated = SimulatedGroups(network, rates, START, runs, seed, number)
    return HeldOutEvents.of(simulated, paths, END, groups, most)


def p_values(studies, rates):
    """Of joins, breaks and each channel, and of their scatter, where the true rates come from the posterior."""
    true = calibrated().draw_constants(line_network(), np.random.default_rng(8), studies)
    rows = [event_rows([held_out(rates, true[i], seed=i)], "30 cubes") for i in range(studies)]
    return np.array([[row.p for row in each] for each in rows]), np.array(
        [[row.p_scatter for row in each] for each in rows]
    )


def check_size(studies, low, high):
    p, scatter = p_values(studies, calibrated())
    for column in range(p.shape[1]):  # none too small; where no event came in many groups, some are larger
        assert kstest(p[:, column], "uniform", alternative="greater").pvalue > 1e-6
        assert kstest(scatter[:, column], "uniform", alternative="greater").pvalue > 1e-6
    assert kstest(p[:, 0], "uniform").pvalue > 1e-6
    assert kstest(scatter[:, 0], "uniform").pvalue > 1e-6
    for column in (0, 1):  # joins, breaks
        assert low <= (p[:, column] <= 0.05).mean() <= high
        assert low <= (scatter[:, column] <= 0.05).mean() <= high
    certain, _ = p_values(studies // 2, taken_as_exact(calibrated()))
    assert ((certain[:, :2] <= 0.05).mean(axis=0) > max(high, 0.06)).all()  # control: the uncertainty left out


@pytest.mark.validate
def test_size_short():
    """300 studies: 6 standard errors of 1.3 %."""
    check_size(300, 0.0, 0.13)


@pytest.mark.validate
def test_size():
    """2,000 studies: 5 % within 1 %, two standard errors."""
    check_size(2000, 0.04, 0.06)


def test_numbers_are_those_of_a_count_by_hand():
    rates = calibrated()
    network = line_network()
    paths = [sample_path(network, START, END, seed=2, run=i) for i in range(4)]
    simulated = SimulatedGroups(network, rates, START, 4, 1)
    row = {row.group: row for row in event_rows([HeldOutEvents.of(simulated, paths, END, GROUPS, GROUPS)], "30 cubes")}
    counted = [count(path) for path in paths]
    constants = simulated.mean_constants
    events = np.sum([each.events for each in counted], axis=0)
    expected = np.sum([each.exposure for each in counted], axis=0) * constants
    is_join = network.reactants.sum(axis=1) == 2
    assert row["joins"].seen == events[is_join].sum()
    assert row["breaks"].expected == pytest.approx(expected[~is_join].sum())
    assert row["4->2+2"].seen == events[network.channel_places["4->2+2"]]
    for name, channel in rates.channels.items():  # posterior means
        assert constants[network.channel_places[name]] == pytest.approx((channel.events + 0.5) / channel.exposure)
    for each in row.values():
        assert 0 <= each.low < each.expected < each.high
    # scatter: Pearson's statistic of the runs about their common seen / expected
    promised = np.array([each.exposure[is_join] @ constants[is_join] for each in counted])
    seen = np.array([each.events[is_join].sum() for each in counted])
    fitted = promised * seen.sum() / promised.sum()
    assert row["joins"].scatter == pytest.approx(((seen - fitted) ** 2 / fitted).sum() / 3)


def test_events_after_the_last_time_are_not_counted():
    network, rates = line_network(), calibrated()
    paths = [sample_path(network, START, 2 * END, seed=2, run=i) for i in range(3)]
    simulated = SimulatedGroups(network, rates, START, 3, 1)
    long, short = (
        HeldOutEvents.of(simulated, these, END, GROUPS, GROUPS)
        for these in (paths, [sample_path(network, START, END, seed=2, run=i) for i in range(3)])
    )
    np.testing.assert_array_equal(long.seen, short.seen)
    np.testing.assert_allclose(long.expected, short.expected)


def test_groups_of_channels():
    groups = event_groups(line_network())
    assert list(groups)[:2] == ["joins", "breaks"]
    assert set(groups["joins"]) | set(groups["breaks"]) == set(line_network().channels)
    assert groups["2->1+1"] == ("2->1+1",)


def test_more_groups_only_where_it_is_doubtful_and_pooled_over_experiments():
    good = calibrated()
    right, wrong = (
        [held_out(good, line_network().known_rates * factor, 5, 20, number, most=1999) for number in (0, 1)]
        for factor in (1.0, 2.0)
    )
    assert all(row.p > 0.05 and row.least == 2 / (GROUPS + 1) for row in event_rows(right, "all sizes") if row.p > 0.05)
    (joins, *_) = event_rows(wrong, "all sizes")
    assert joins.p == joins.least == 2 / 2000
    assert joins.seen == sum(int(each.observed.seen[0, 0]) for each in wrong)
    # the same draws of the rates in both experiments, but other runs
    first, second = (each.groups for each in wrong)
    np.testing.assert_array_equal(first.constants(0, 50), second.constants(0, 50))
    assert not np.array_equal(wrong[0].first_totals.seen, wrong[1].first_totals.seen)
    # all groups begin with the first ones
    np.testing.assert_array_equal(wrong[0].totals(1999).seen[:GROUPS], wrong[0].first_totals.seen)
    at_once = replace(wrong[0], first=1999)
    np.testing.assert_array_equal(wrong[0].totals(1999).chi_squared, at_once.first_totals.chi_squared)
    np.testing.assert_array_equal(wrong[0].totals(GROUPS).seen, wrong[0].first_totals.seen)
    np.testing.assert_array_equal(first.constants(1990, 2010)[10:], first.constants(2000, 2010))


def test_a_channel_never_seen_in_calibration_excuses_few_events():
    """Jeffreys' half an event: one held-out event is no wonder, ten are."""
    rates = calibrated()
    channel = rates.channels["4->2+2"]
    exposure = 2000.0
    unseen = channel.replace(rate=0.0, low=0.0, high=0.1, events=0, exposure=exposure)
    changed = rates.replace(channels=rates.channels | {"4->2+2": unseen})
    constants = line_network().known_rates.copy()
    place = line_network().channel_places["4->2+2"]
    seen = []
    for rate in (0.0, 0.3):
        constants[place] = rate
        (row,) = [
            row for row in event_rows([held_out(changed, constants, 3, most=1999)], "30 cubes") if row.group == "4->2+2"
        ]
        assert row.expected > 0
        assert np.isfinite([row.low, row.high]).all()
        seen.append((row.seen, row.p))
    assert seen[0][0] == 0
    assert seen[0][1] > 0.02
    assert seen[1][0] >= 10
    assert seen[1][1] < 0.01


def test_events_that_the_rates_call_impossible_are_the_least_likely():
    totals = EventTotals.of(np.array([[[3], [0]]]), np.zeros((1, 2, 1)))
    assert totals.ratio[0, 0] == np.inf
    assert EventTotals.of(np.zeros((1, 2, 1), int), np.zeros((1, 2, 1))).ratio[0, 0] == 0


# The line of four, with the rates of the study


@cache
def line4():
    return derive(RuleBook.load("line4")).network, Rates.load(LINE4 / "rates.toml")


@cache
def assemblies(cubes, breaks=1.0):
    """Ten runs of 2,000 tu by the chain of the study's rates, seen as mechanics is: breaks without their partners.

    breaks : how much more often they come than the rates say
    """
    network, rates = line4()
    expansion, model = rates.expansion(network), rates.apply(network)
    is_break = np.array([" by " in name for name in model.channels])
    true = model.with_rates(model.known_rates * np.where(is_break, breaks, 1.0))
    made = [sample_path(true, model.state({"monomer": cubes}), 2000.0, seed=11, run=i) for i in range(10)]
    return [JumpPath(network, path.initial, path.times, expansion.base_of[path.channels], 2000.0) for path in made]


def test_joins_twenty_per_cent_off_in_ten_runs_of_sixty_cubes_are_seen():
    """At p <= 0.05 in at least 85 %; control: joins that are right are seen in 5 %."""
    network, rates = line4()
    simulated = SimulatedGroups(network, rates, assemblies(60)[0].initial, 10, 3)
    seen = HeldOutEvents.of(simulated, assemblies(60), 2000.0, 1999, 1999)
    assert power_of_runs([seen], "joins").power(level=0.05) >= 0.85
    assert power_of_runs([seen], "joins", off_by=0.0).power(level=0.05) == pytest.approx(0.05)


def compared(paths, most_groups=999):
    _, rates = line4()
    return crossvalidate(rates, paths, np.linspace(0, 2000, 41), seed=2, groups=999, most_groups=most_groups)


def test_breaks_twice_as_often_as_promised_are_refuted():
    found = compared(assemblies(60, breaks=2.0), most_groups=4_999)
    row = {row.group: row for row in found.events}["breaks"]
    assert abs(row.seen - 2.0 * row.expected) < 4.0 * (2.0 * row.expected) ** 0.5
    assert row.p == row.least == 2 / 5_000
    assert not found.is_consistent
    assert found.verdict.sentence.startswith("not consistent: ")
    assert "joins and breaks at 60 cubes, p ≤ 0.001" in found.verdict.sentence
    assert f"(furthest by itself: breaks at 60 cubes {row.seen} seen" in found.verdict.sentence


def test_runs_of_the_chain_itself_are_consistent_with_it():
    alone = ComparedSizes((compared(assemblies(60)),))
    assert alone.pooled == ()
    assert alone.comparisons[0].is_consistent
    assert alone.is_consistent
    assert alone.verdict.sentence.startswith(
        "consistent with the prediction at 1 %: joins and breaks at 60 cubes, p = "
    )
    assert len(alone.verdict.details) == 15  # shown, not judged
    assert "joins off by 20 % with probability" in alone.verdict.sentence


def test_breaks_by_collisions_are_counted_with_their_partners():
    """Expected breaks are the sum over their partners."""
    network = line_network()
    known = calibrated()
    breaks = BreakTerms(model="collision", shape={"alpha": 2.0})
    unknown = dict.fromkeys(("low", "high", "events", "exposure"))
    thinner = {
        name: known.channels[name].replace(**unknown | {"rate": known.channels[name].rate / 50})
        for name in event_groups(network)["breaks"]
    }
    collisions = known.replace(breaks=breaks, channels=known.channels | thinner)
    simulated = SimulatedGroups(network, collisions, START, 2, 1)
    expansion = collisions.expansion(network)
    assert len(simulated.model.channels) == 4 + 4 * 4
    path = sample_path(simulated.model, START, END, seed=4)
    base = JumpPath(network, START, path.times, expansion.base_of[path.channels], END)
    seen = HeldOutEvents.of(simulated, [base, base], END, GROUPS, GROUPS)
    by_hand = count(path).exposure * simulated.mean_constants
    is_break = [" by " in name for name in simulated.model.channels]
    row = {row.group: row for row in event_rows([seen], "30 cubes")}
    assert row["breaks"].expected == pytest.approx(2 * by_hand[is_break].sum())
    assert row["breaks"].seen == 2 * np.count_nonzero(np.array(is_break)[path.channels])
    assert list(row) == list(event_groups(network))
