"""The rules of a plan: each is kept, broken, or cannot be judged, as the rows say."""

from types import SimpleNamespace

import pytest

from calibration.pipeline.bars import bars, in_one_sentence
from calibration.pipeline.plan import VerdictRules
from calibration.validating.events import EventRow


def row(group, seen, expected, p, cubes=60, within=0.05):
    """A row whose predicted interval is `within` of what is expected, on both sides."""
    size = "all sizes" if cubes is None else f"{cubes} cubes"
    low, high = (1 - within) * expected, (1 + within) * expected
    return EventRow(size, cubes, None, None, group, seen, expected, low, high, p, 1e-4, 1.0, 0.5, 1.5, 0.5, 1e-4)


def compared(*rows, pit=0.4):
    runs = [SimpleNamespace(single_runs=SimpleNamespace(p_value=p)) for p in (0.3, 0.6)]
    return SimpleNamespace(events=list(rows), comparisons=runs, p_single_runs=pit)


GOOD = (
    row("joins", 310, 300.0, 0.6),
    row("breaks", 33, 30.0, 0.4),
    row("2->1+1", 3, 30.0, 1e-4),  # a single channel is no row of these rules
    row("joins", 620, 600.0, 0.5, None),
    row("breaks", 63, 60.0, 0.5, None),
)
FAR = (row("joins", 300, 300.0, 0.9), row("breaks", 260, 200.0, 0.001), row("breaks", 260, 200.0, 0.001, None))


def judged(found):
    return [bar.is_kept for bar in found]


def test_all_rules_are_kept_and_the_controls_break_them():
    found = bars(VerdictRules(), compared(*GOOD), {"first-order breaks": compared(*FAR), "no crowding": compared(*FAR)})
    assert judged(found) == [True] * 6
    assert "joins 60 cubes 310 / 300 = 1.03" in found[1].sentence
    assert found[0].sentence.startswith("p of every row at least 0.01: kept (least of 4: breaks 60 cubes 33 / 30")
    assert found[-1].rule == "the control, no crowding, breaks one of these"
    assert in_one_sentence(found) == "Rules of the plan: 6 kept."


def test_each_rule_can_be_broken():
    found = bars(VerdictRules(), compared(*FAR, pit=0.01), {"first-order breaks": compared(*GOOD)})
    assert judged(found) == [False] * 5
    assert "it keeps all of them" in found[-1].sentence
    assert in_one_sentence(found).startswith("Rules of the plan: 5 broken (p of every row at least 0.01: least ")


def test_a_control_cannot_break_a_rule_by_its_joins():
    odd_joins = (row("joins", 400, 300.0, 1e-4), *GOOD[1:3], row("joins", 800, 600.0, 1e-4, None), GOOD[-1])
    found = bars(VerdictRules(), compared(*odd_joins), {"first-order breaks": compared(*odd_joins)})
    assert judged(found) == [False, False, False, True, False]


def test_few_events_cannot_be_judged_by_their_ratio():
    few = (row("joins", 30, 20.0, 0.2), row("breaks", 3, 2.0, 0.4))
    found = bars(VerdictRules(), compared(*few))
    assert judged(found)[1] is None
    assert "no row expects 150 events" in found[1].came
    assert "2 cannot be judged (seen / expected wherever 150 events are expected" in in_one_sentence(found)


@pytest.mark.parametrize(("within", "is_kept"), [(0.14, False), (0.16, None)])
def test_a_range_narrower_than_the_predicted_interval_judges_nothing(within, is_kept):
    """Neither what lies outside, nor what lies inside."""
    for seen, verdict in ((400, is_kept), (300, None if is_kept is None else True)):
        found = bars(VerdictRules(), compared(row("joins", seen, 300.0, 0.5, within=within)))
        assert found[1].is_kept is verdict
    assert ("predicted intervals are wider" in found[1].came) is (is_kept is None)


@pytest.mark.parametrize(("p", "seen", "is_kept"), [(0.009, 220, False), (0.011, 220, None), (0.009, 290, None)])
def test_what_is_far_outside_breaks_a_rule_that_is_narrower_than_the_predicted_interval(p, seen, is_kept):
    """Where neither the range nor the prediction holds; not one of them alone."""
    found = bars(VerdictRules(), compared(row("joins", seen, 300.0, p, within=0.16)))
    assert found[1].is_kept is is_kept
    assert (found[1].came == f"joins 60 cubes {seen} / 300 = {seen / 300:.2f}") is (is_kept is False)


def test_breaks_of_all_sizes_may_have_a_range_of_their_own():
    rules = VerdictRules(pooled_ratio=(0.95, 1.05), pooled_breaks=(0.9, 1.1), from_events=50.0)
    rows = (row("joins", 620, 600.0, 0.5, None, 0.04), row("breaks", 650, 600.0, 0.5, None, 0.09))
    found = bars(rules, compared(*rows))
    assert [(bar.rule, bar.is_kept) for bar in found[2:4]] == [
        ("seen / expected of joins over all sizes from 0.95 to 1.05", True),
        ("seen / expected of breaks over all sizes from 0.9 to 1.1", True),
    ]
    alike = bars(VerdictRules(pooled_ratio=(0.9, 1.1)), compared(*rows))
    assert len(alike) == len(found) - 1  # the control: one range for both


@pytest.mark.parametrize(("pit", "is_kept"), [(0.06, True), (0.04, False)])
def test_single_runs_are_judged_over_all_sizes(pit, is_kept):
    bar = bars(VerdictRules(), compared(*GOOD, pit=pit))[3]
    assert bar.came == f"p = {pit}; by size 0.3, 0.6"
    assert bar.is_kept is is_kept
