"""How many runs of each tank."""

from itertools import product

import numpy as np
import pytest

from calibration.planning.allocation import affordable, allocate, events_for, half_width
from kinetics.support.intervals import exact_limits

# two dear tanks that each show one thing well, and a cheap one that shows both badly
EVENTS = np.array([[5.0, 0.2], [0.3, 4.0], [1.0, 0.9]])
COSTS = np.array([3.0, 2.0, 1.0])


def test_half_widths_are_those_of_the_exact_limits():
    low, high = exact_limits(50, 200.0)
    assert half_width(50) == pytest.approx((high - low) / 2 / (50 / 200.0))
    assert half_width(1e6) == pytest.approx(1.96e-3, rel=1e-3)
    assert half_width([0.0, 1.0])[0] == np.inf
    for width in (0.01, 0.1, 0.5):
        assert half_width(events_for(width)) == pytest.approx(width)
    assert 380 < events_for(0.1) < 400
    for width in (0.0, -1.0, np.inf, np.nan):
        with pytest.raises(ValueError, match=r"expected a finite share above 0"):
            events_for(width)
    with pytest.raises(ValueError, match=r"width = 1e-09; expected 2e-06 or more, which takes 1e\+12 events"):
        events_for(1e-9)


@pytest.mark.parametrize("needed", [1.0, 7.3, 20.0])
def test_runs_are_nearly_the_cheapest(needed):
    runs = allocate(EVENTS, COSTS, needed)
    assert ((runs @ EVENTS) >= needed * (1 - 1e-9)).all()
    every = [np.array(n) for n in product(range(24), repeat=3)]
    least = min(n @ COSTS for n in every if ((n @ EVENTS) >= needed).all())
    assert least <= runs @ COSTS <= least + COSTS.max()
    for tank in np.flatnonzero(runs):  # none is superfluous
        fewer = runs - np.eye(3, dtype=int)[tank]
        assert not ((fewer @ EVENTS) >= needed).all()


def test_any_precision_takes_no_more_work():
    """What rounding up made superfluous is left out at once, not run by run: 1e11 runs take as long as 10."""
    runs = allocate(EVENTS, COSTS, 1e12)
    assert ((runs @ EVENTS) >= 1e12 * (1 - 1e-9)).all()
    assert runs @ COSTS <= 1.001 * 1e11 * (allocate(EVENTS, COSTS, 10.0) @ COSTS)


def test_a_dear_tank_is_not_taken_where_cheap_ones_do():
    assert allocate([[1.0], [1.0]], [2.0, 1.0], 10).tolist() == [0, 10]
    assert allocate([[1.0], [3.0]], [1.0, 2.0], 9).tolist() == [0, 3]  # dearer a run, cheaper an event


def test_what_no_tank_shows():
    with pytest.raises(ValueError, match="no tank shows events of kind 1"):
        allocate([[1.0, 0.0]], [1.0], 10)


@pytest.mark.parametrize("budget", [3.0, 17.0, 400.0])
def test_a_budget_is_kept_and_used(budget):
    runs = affordable(EVENTS, COSTS, budget)
    assert runs @ COSTS <= budget
    assert allocate(EVENTS, COSTS, (runs @ EVENTS).min() + 4.0) @ COSTS > budget - 3.0
    assert affordable(EVENTS, COSTS, 0.5).tolist() == [0, 0, 0]
