"""The rules of a plan: each holds, fails, or cannot be judged, as the rows say."""

from types import SimpleNamespace

import pytest

from calibration.pipeline.bars import bars
from calibration.pipeline.plan import VerdictRules
from calibration.validating.events import EventRow


def row(group, seen, expected, p, cubes=60):
    size = "all sizes" if cubes is None else f"{cubes} cubes"
    return EventRow(size, cubes, None, group, seen, expected, 0.0, 0.0, p, 1e-4, 1.0, 0.5, 1.5, 0.5, 1e-4)


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
    return [bar.is_cleared for bar in found]


def test_all_rules_hold_and_the_control_fails():
    found = bars(VerdictRules(), compared(*GOOD), compared(*FAR))
    assert judged(found) == [True] * 5
    assert "joins 60 cubes 310 / 300 = 1.03" in found[1].sentence
    assert found[0].sentence.startswith("p of every row at least 0.01: holds (least of 4: breaks 60 cubes 33 / 30")


def test_each_rule_can_fail():
    found = bars(VerdictRules(), compared(*FAR, pit=0.01), compared(*GOOD))
    assert judged(found) == [False, False, False, False, False]
    assert "they clear all of them" in found[-1].sentence


def test_the_control_cannot_fail_by_its_joins():
    odd_joins = (row("joins", 400, 300.0, 1e-4), *GOOD[1:3], row("joins", 800, 600.0, 1e-4, None), GOOD[-1])
    found = bars(VerdictRules(), compared(*odd_joins), compared(*odd_joins))
    assert judged(found) == [False, False, False, True, False]


def test_few_events_cannot_be_judged_by_their_ratio():
    few = (row("joins", 30, 20.0, 0.2), row("breaks", 3, 2.0, 0.4))
    found = bars(VerdictRules(), compared(*few))
    assert judged(found)[1] is None
    assert "no row expects 150 events" in found[1].came


@pytest.mark.parametrize(("pit", "is_cleared"), [(0.06, True), (0.04, False)])
def test_single_runs_are_judged_over_all_sizes(pit, is_cleared):
    bar = bars(VerdictRules(), compared(*GOOD, pit=pit))[3]
    assert bar.came == f"p = {pit}; by size 0.3, 0.6"
    assert bar.is_cleared is is_cleared
