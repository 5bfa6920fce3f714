"""First times by hand: Kaplan and Meier's curve, means, quantiles and their limits."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from kinetics import Network
from kinetics.runs import FirstTimes
from kinetics.support.intervals import binomial_limits, student_interval

DECAY = Network.from_text("A -> 0, 1")


def made(times, observed, horizon):
    times, observed = np.array(times, float), np.array(observed, float)
    return FirstTimes(DECAY, "A == 0", times, observed, np.isnan(times)[:, None].astype(int), horizon)


ALL = made([1.0, 2.0, 2.0, 5.0], [1.0, 2.0, 2.0, 5.0], np.inf)
SOME = made([1.0, 3.0, np.nan, np.nan], [1.0, 3.0, 4.0, 4.0], 4.0)
CUT = made([6, 6, 6, np.nan, 7, np.nan, 10, np.nan], [6, 6, 6, 6, 7, 9, 10, 10], 20.0)


def bounds(answer):
    return answer.low, answer.high


def test_all_reached():
    curve = ALL.survival()
    assert curve.times.tolist() == [0.0, 1.0, 2.0, 5.0]
    assert_allclose(curve.probability, [1, 0.75, 0.25, 0])
    low, high = binomial_limits([0, 1, 3, 4], 4)
    assert_allclose(curve.low, 1 - high)
    assert_allclose(curve.high, 1 - low)
    assert ALL.mean == 2.5
    assert bounds(ALL.answer("mean")) == pytest.approx((0.0, student_interval(ALL.times)[1]))
    assert ALL.answer(0.5).value == ALL.median == 2.0
    assert ALL.answer(0.75).value == 2.0
    assert ALL.answer(0.76).value == 5.0
    assert ALL.reached_by(2.0).value == 0.75
    assert bounds(ALL.reached_by(2.0)) == pytest.approx(tuple(map(float, binomial_limits(3, 4))))


def test_censored_at_the_horizon():
    assert SOME.censored == 2
    assert SOME.mean == 3.0
    assert "mean of the time, or 4 where later" in str(SOME)
    assert SOME.median == 3.0
    assert SOME.answer(0.6).value == np.inf
    assert SOME.reached_by(4.0).value == SOME.answer("probability").value == 0.5
    with pytest.raises(ValueError, match="observed from 0 to 4"):
        SOME.reached_by(4.5)


def test_cut_short_by_hand():
    """At 6, 3 of 8 at risk; at 7, 1 of 4; at 10, 1 of 2. Greenwood: the variance of the log adds d / n (n - d)."""
    curve = CUT.survival()
    assert_allclose(curve.probability, [1, 5 / 8, 5 / 8 * 3 / 4, 5 / 8 * 3 / 4 / 2])
    spread = np.exp(1.959963984540054 * np.sqrt(3 / 8 / 5) / np.log(5 / 8))
    assert_allclose(sorted([curve.low[1], curve.high[1]]), sorted([(5 / 8) ** spread, (5 / 8) ** (1 / spread)]))
    assert (curve.low <= curve.probability).all()
    assert (curve.probability <= curve.high).all()
    assert CUT.mean == pytest.approx(6 + 5 / 8 * 1 + 15 / 32 * 3 + 15 / 64 * 10)
    assert np.isnan(bounds(CUT.answer("mean"))).all()
    assert CUT.median == 7.0


def test_the_table_has_a_row_a_run():
    table = SOME.to_dataframe()
    assert table["time"].tolist() == [1.0, 3.0, 4.0, 4.0]
    assert table["is_reached"].tolist() == [True, True, False, False]
    assert table["A"].tolist() == [0, 0, 1, 1]
    ax = SOME.plot()
    assert ax.get_xlabel().startswith("time")
    assert ax.get_ylabel() == "probability of not having been reached"
    assert ax.get_xlim()[1] > 4.0
    with pytest.raises(ValueError, match="1; expected 'mean', 'probability'"):
        SOME.answer(1)
