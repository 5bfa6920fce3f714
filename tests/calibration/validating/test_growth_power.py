"""What held-out growth can tell: the power that is stated against brute force, and groups too few to fail anything."""

from dataclasses import replace

import numpy as np
import pytest
from derived_books import derived
from matplotlib.figure import Figure

from calibration.validating.growth_curves import compare_growth
from calibration.validating.growth_power import growth_powers, scaled
from calibration.validating.predictive import predictive_p
from kinetics.networkfree import grow
from kinetics.rates import ClassRates

JACK = derived("jack13").book
START = {JACK.monomer(): 20, JACK.seed(): 1}
TIMES = np.linspace(0, 60, 7)


def known(join=6e-4, events=400.0):
    """Rates of joins and breaks with evidence of so many joins."""
    entries = {"join": {"rate": join, "events": events, "exposure": events / join}, "break": {"rate": 4e-3}}
    return ClassRates(faces="two", classes=entries)


def compared(rates, groups=49, most_groups=99, seed=1, power_groups=20):
    seen = grow(JACK, known(), START, 60.0, 3, seed=3)
    return compare_growth(rates, seen.runs, TIMES, "here", groups, most_groups, seed, power_groups)


def test_evidence_moves_with_the_rates():
    """A factor moves every draw by itself; the other kind of event stays."""
    draws = [rates.draws(np.random.default_rng(2), 50) for rates in (known(), scaled(known(), "join", 1.2))]
    plain, moved = ([[d.classes[key].rate for d in some] for key in ("join", "break")] for some in draws)
    np.testing.assert_allclose(moved[0], 1.2 * np.array(plain[0]))
    assert moved[1] == plain[1]


def test_power_is_that_of_the_test_by_ranks():
    """Numbers of events of known distributions, 1,000 studies of 39,999 groups, beside the normal approximation."""
    rng = np.random.default_rng(5)
    means = {1.0: 400.0, 0.8: 330.0, 1.2: 465.0}

    def simulated(factor, n):
        return np.column_stack([rng.poisson(means[factor], n), np.zeros(n)])

    def off(rates, part):
        return simulated(round(rates.classes["join"].rate / 6e-4, 1), 400)

    (power,) = growth_powers(known(), simulated(1.0, 999), off, 8)
    for level, stated in ((0.01, power.in_row), (0.01 / 8, power.in_verdict)):
        shares = []
        for factor in (0.8, 1.2):
            seen, groups = simulated(factor, 1000)[:, 0], simulated(1.0, 39_999)[:, :1]
            shares.append(np.mean(predictive_p(seen, groups) <= level))
        assert stated == pytest.approx(min(shares), abs=0.1)
    assert power.in_verdict < power.in_row
    nothing = growth_powers(known(), simulated(1.0, 999), lambda *_: simulated(1.0, 400), 8)
    assert nothing[0].in_row < 0.03  # rates that are not off are found at the level alone


@pytest.fixture(scope="module")
def few():
    """Joins at a fifth of their rates are predicted, by 99 groups."""
    return compared(known(6e-4 / 5))


def test_groups_too_few_to_fail_anything_say_so(few):
    """Joins are several times as many as predicted; 99 groups cannot tell, and say so. Enough could."""
    (joins, _) = few.events
    assert joins.seen > 1.5 * joins.high
    assert few.is_consistent
    assert set(few.cannot_fail) == {"joins", "breaks", *few.curves}
    needed = 200 * (len(few.events) + len(few.curves)) - 1
    assert few.sentence.startswith("not decided: 99 groups cannot fail joins, breaks, ")
    assert few.sentence.endswith(f"give at least {needed}")
    assert few.to_dict()["cannot_fail"] == list(few.cannot_fail)
    assert replace(few, most_groups=needed).cannot_fail == ()
    assert replace(few, most_groups=needed - 1).cannot_fail == ("joins", "breaks")
    failed = replace(few, groups=needed, events=(replace(joins, p=2 / (needed + 1)),))
    assert failed.sentence.startswith("not consistent: ")


def test_what_would_have_shown_is_said(few):
    assert [power.group for power in few.powers] == ["joins", "breaks"]
    assert "this many runs would have shown joins off by 20 %" in few.verdict.sentence
    assert not few.powers[0].in_row > 0.9  # three small runs do not show everything


def test_every_curve_has_an_axis_of_its_own(few):
    """So many single cubes do not flatten the rest: each axis ends where its own curve and band do."""
    figure = few.plot(Figure())
    titles = {ax.get_title(): ax for ax in figure.axes}
    assert list(titles) == list(few.curves)
    for v, name in enumerate(few.curves):
        top = max(few.high[:, v].max(), few.observed[:, v].max(), few.predicted[:, v].max())
        assert titles[name].get_ylim()[1] <= (1.1 * top + 0.1 if top else 1.0)  # nothing at all has a height, too
        points = titles[name].lines[-1]
        np.testing.assert_allclose(points.get_ydata(), few.observed[:, v])
