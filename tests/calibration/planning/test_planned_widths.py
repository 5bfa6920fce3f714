"""Planned half-widths against those reached, in simulated studies whose rates are known."""

from functools import cache

import numpy as np
import pytest

from calibration.estimating.break_comparison import BreakComparison, rates_with_breaks
from calibration.estimating.estimate import estimate
from calibration.planning.allocation import allocate, events_for, half_width
from calibration.planning.candidates import Candidate, candidates, wanted_rates
from calibration.planning.forecast import Forecast
from kinetics.assembly import RuleBook, derive
from kinetics.rates import Rates
from kinetics.sampling import sample_path
from tests.helpers.expanded_paths import on_base

SIZES, DURATION, ALONG = [1, 2, 3, 4], 500.0, [0.0, 200.0, 800.0]
TANK = (2.0, 2.0, 3.0)
JOINS = {"1+1->2": 4.0e-5, "1+2->3": 3.2e-5, "1+3->4": 2.8e-5, "2+2->4": 2.0e-5}
BREAKS = {"2->1+1": 3.7e-6, "3->1+2": 4e-6, "4->1+3": 4e-6, "4->2+2": 5e-6}
TRIALS, BAR = 20, 0.15


@cache
def network():
    return derive(RuleBook.load("line4")).network


@cache
def truth():
    """Rates like those of the scene line4, breaks by collisions."""
    bare = network()
    rates = {
        name: {"rate": k, "ways": float(n)} for (name, k), n in zip((JOINS | BREAKS).items(), bare.ways, strict=True)
    }
    assert list(rates) == list(bare.channels)
    breaks = {"model": "collision", "shape": {"alpha": 1.3}}
    return Rates(convention={"combinations": "distinct"}, tank=TANK, channels=rates, breaks=breaks)


def watched(composition, seed, run):
    """One run of the mechanics that there would be."""
    expansion = truth().expansion(network())
    return on_base(expansion, sample_path(truth().apply(network()), composition, DURATION, seed=seed, run=run))


def pilot(seed, runs=4):
    """Rates from the runs that `wellmixed study plan` makes: four from 60 and four from 120 single cubes."""
    starts = [{"monomer": n} for n in (60, 120) for _ in range(runs)]
    paths = [watched(network().state(start), seed, run) for run, start in enumerate(starts)]
    return rates_with_breaks(estimate(paths), BreakComparison.asked_for("first-order", paths))


def forgetful(tank: Candidate, rates: Rates) -> Candidate:
    """The control: as if reactants were never used up."""
    base = network().with_rates([rates.channels[name].rate for name in network().channels])
    events = base.propensities(network().state(tank.composition)) * DURATION
    return Candidate(tank.composition, tank.along, events)


def reached(plan, seed):
    """Half-widths (groups,) of one study that carries out a plan: pairs of tank and runs."""
    paths = [
        watched(network().state(tank.composition), seed, 1000 * i + run)
        for i, (tank, runs) in enumerate(plan)
        for run in range(runs)
    ]
    events = estimate(paths).total.events
    return [float(half_width(events[members].sum())) for members in wanted_rates(network()).values()]


def ratios(width, pilot_seed, trials=TRIALS, forgets=False):
    """Mean half-width reached over the half-width predicted (groups,)."""
    rates = pilot(pilot_seed)
    forecast = Forecast.of(rates, network(), seed=1)
    tanks = candidates(forecast, [{"monomer": 60}, {"monomer": 120}], SIZES, ALONG, DURATION)
    if forgets:
        tanks = [forgetful(tank, rates) for tank in tanks]
    groups = wanted_rates(network()).values()
    table = np.array([[tank.events[members].sum() for members in groups] for tank in tanks])
    costs = [sum(SIZES[network().index(s)] * n for s, n in tank.composition.items()) for tank in tanks]
    runs = allocate(table, costs, events_for(width))
    predicted = half_width(runs @ table)
    assert predicted.max() <= width * (1 + 1e-9)
    plan = [(tank, int(n)) for tank, n in zip(tanks, runs, strict=True) if n]
    return np.mean([reached(plan, 100 + trial) for trial in range(trials)], axis=0) / predicted


def test_half_widths_are_those_predicted():
    found = ratios(0.25, pilot_seed=1)
    assert np.abs(found - 1).max() < BAR


def test_a_planner_that_forgets_that_reactants_are_used_up_fails():
    found = ratios(0.25, pilot_seed=1, trials=3, forgets=True)
    assert found.max() > 1 + 2 * BAR


@pytest.mark.validate
def test_half_widths_are_those_predicted_by_most_pilots():
    found = np.array([ratios(0.25, pilot_seed=seed) for seed in range(1, 11)])
    assert (np.abs(found - 1) < BAR).mean() >= 0.9
