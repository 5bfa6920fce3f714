"""One test of all rows: exact over exchangeable groups, however rows depend on each other; wrong rates show."""

import numpy as np
import pytest
from scipy.stats import chi2

from calibration.validating.overall import misfits
from calibration.validating.predictive import predictive_p, upper_p

GROUPS, ROWS = 400, 12


@pytest.fixture(scope="module")
def groups():
    """Seen over expected (groups, rows): counts about 100, and an error of the rates that all rows of a group share."""
    rng = np.random.default_rng(11)
    shared = rng.gamma(400.0, 1 / 400, GROUPS)
    return rng.poisson(100 * shared[:, None], (GROUPS, ROWS)) / 100 + rng.uniform(0, 1e-6, (GROUPS, ROWS))


def p_of(seen, others):
    return upper_p(*misfits(seen, others))


def test_misfits_are_sums_of_squared_distances(groups):
    few = groups[:40]
    seen, others = misfits(few[0], few[1:])
    slow = []
    for row in few:
        parts = []
        for k in range(ROWS):
            roots = [x**0.5 for x in few[:, k]]
            mean = sum(roots) / 40
            parts.append((row[k] ** 0.5 - mean) ** 2 / (sum((x - mean) ** 2 for x in roots) / 40))
        slow.append(sum(parts))
    np.testing.assert_allclose([seen, *others], slow)


def test_what_the_rates_call_impossible_is_furthest_off(groups):
    assert p_of(np.r_[np.inf, groups[0, 1:]], groups[1:]) == 1 / GROUPS


def test_the_p_value_is_uniform_where_the_model_holds(groups):
    """Each group once in the place of what was seen: every rank comes once, though rows depend on each other."""
    found = sorted(p_of(row, np.delete(groups, i, axis=0)) for i, row in enumerate(groups))
    np.testing.assert_allclose(found, np.arange(1, GROUPS + 1) / GROUPS)
    # Control: with rows taken as independent, the same misfits are too often large.
    seen, others = misfits(groups[0], groups[1:])
    assert np.mean(chi2.sf([seen, *others], ROWS) < 0.01) > 0.02


def test_wrong_rates_show_in_all_rows_together(groups):
    rng = np.random.default_rng(12)
    off = rng.poisson(110 * rng.gamma(400.0, 1 / 400, 100)[:, None], (100, ROWS)) / 100
    together = np.mean([p_of(row, groups) <= 0.05 for row in off])
    alone = np.mean([predictive_p(row, groups)[0] <= 0.05 for row in off])
    assert alone < 0.3 < together


def test_ties_are_far_from_nothing():
    """Rows without events in any group say nothing."""
    seen, others = misfits(np.zeros(2), np.zeros((50, 2)))
    assert seen == 0
    assert not others.any()
    assert p_of(np.zeros(2), np.zeros((50, 2))) == 1
