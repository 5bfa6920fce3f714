"""The estimator's proof: calibrations of synthetic runs with known rates, in the shapes that the pipeline uses."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_runs import breaking_run, line_network, restarted_run

from calibration import count, estimate, exact_limits
from kinetics.sampling import sample_path

CALIBRATIONS, ALL = 500, 4000  # by default, and with --validate


def coverage(totals, level=0.95):
    """Share of calibrations (R,) whose interval holds the true rate."""
    low, high = exact_limits([t.events for t in totals], [t.exposure for t in totals], level)
    true = line_network().rate_constants
    return ((low <= true) & (true <= high)).mean(axis=0)


@pytest.fixture(scope="module")
def calibrations(request):
    """Each: one full run, two restarted ones, one of breaks alone; some 200 to 900 events of every channel."""
    network = line_network()
    totals = []
    for i in range(ALL if request.config.getoption("--validate") else CALIBRATIONS):
        rng = np.random.default_rng([11, i])
        runs = [
            sample_path(network, [60, 0, 0, 0], 300.0, seed=12, run=i),
            restarted_run(network, network.state([14, 12, 6, 1]), 300.0, rng),
            restarted_run(network, network.state([6, 20, 2, 2]), 300.0, rng),
            breaking_run(network, network.state([0, 0, 30, 200]), 50.0, seed=13, run=i),
        ]
        totals.append(estimate(runs).total)
    return totals


def test_intervals_cover_the_truth(calibrations):
    """95 % for every channel, give or take 4.9 %, or 2 % with --validate.

    Garwood's limits cover 95.0 to 95.4 % at these numbers of events, and the bounds are 4.6 standard errors (1.0 and
    0.35 %) beyond that: a false alarm in any of 16 comparisons has a chance below 3e-5. What lies as far again outside
    is seen all but surely.
    """
    apart = 0.004 + 4.6 * np.sqrt(0.95 * 0.05 / len(calibrations))
    assert min(total.events.min() for total in calibrations) > 100
    found = coverage(calibrations)
    assert (np.abs(found - 0.95) < apart).all(), found


def test_estimates_are_unbiased_and_as_wide_as_they_say(calibrations):
    """Standardised errors have mean 0 and sd 1 for every channel; 6 standard errors: false alarms below 2e-8."""
    true = line_network().rate_constants
    events, exposure = (np.array([getattr(t, name) for t in calibrations]) for name in ("events", "exposure"))
    z = (events - true * exposure) / np.sqrt(true * exposure.mean(axis=0))
    assert (np.abs(z.mean(axis=0)) < 6 / np.sqrt(len(z))).all()
    assert (np.abs(z.std(axis=0) - 1) < 6 / np.sqrt(2 * len(z))).all()


def test_wrong_rates_are_seen(calibrations):
    """Control: rates 15 % off are two to six standard errors off."""
    off = [replace(total, exposure=total.exposure * 1.15) for total in calibrations]
    assert (coverage(off) < 0.9).all()


def test_censored_waits_matter():
    """Many short runs: about one wait in two is cut off. Covered with them, and lost without them (the control)."""
    network = line_network()
    initial = network.state([14, 12, 6, 1])
    rng = np.random.default_rng(17)
    whole, cut = [], []
    for _ in range(100):
        runs = [restarted_run(network, initial, 0.3, rng) for _ in range(60)]
        whole.append(estimate(runs).total)
        without = [replace(run, end=run.times[-1]) for run in runs if run.times.size]
        cut.append(sum(count(run) for run in without))
    # Few events: the limits cover more than 95 %, never less; 800 comparisons fall below 0.92 with a chance < 1e-6.
    assert coverage(whole).mean() > 0.92
    assert coverage(cut).mean() < 0.85
