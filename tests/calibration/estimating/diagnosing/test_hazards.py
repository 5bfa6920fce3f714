"""Hazards by which runs are judged: those of the rates in use, in every tank and under every break model."""

import numpy as np
import pytest
from synthetic_runs import line_network

from calibration import diagnose
from calibration.estimating.break_fit import fit_breaks
from calibration.estimating.diagnosing.hazards import hazard_of
from calibration.estimating.diagnosing.sizes import Sizes
from kinetics.network import Tank
from kinetics.rates import BreakTerms, Rates
from kinetics.rates.breaks import BREAK_MODELS, base_channel, break_model
from kinetics.runs import JumpPath
from kinetics.sampling import sample_path
from tests.helpers.expanded_paths import on_base

SMALL, LARGE = Tank((2.0, 2.0, 3.0)), Tank((2.0, 2.0, 6.0))
BREAKS = slice(4, 8)


def line_rates(model, join=1e-3, per_break=2e-4):
    """Rates of the line of four under a break model, in the small tank, whatever shape the search starts from."""
    network = line_network()
    rates = {name: join if "+" in name.split("->")[0] else per_break for name in network.channels}
    shape = {parameter.name: 1.5 * parameter.start for parameter in break_model(model).parameters(network)}
    return Rates(
        convention={"combinations": "distinct"},
        channels={name: {"rate": r, "ways": w} for (name, r), w in zip(rates.items(), network.ways, strict=True)},
        breaks=BreakTerms(model=model, shape=shape),
        tank=SMALL.size,
    )


def run_under(rates, copies, tank, seed):
    """A run of the chain with these rates, which does not tell who broke what."""
    network = line_network()
    path = sample_path(rates.apply(network, tank), [copies, 0, 0, 0], 40.0, seed=seed)
    base = on_base(rates.expansion(network), path)
    return JumpPath(network, base.initial, base.times, base.channels, base.end, tank=tank)


@pytest.mark.parametrize("model", [law.name for law in BREAK_MODELS])
@pytest.mark.parametrize("tank", [SMALL, LARGE])
def test_rates_give_the_propensities_that_predictions_use(model, tank):
    """Of a base channel the propensities of all channels that belong to it add up."""
    rates = line_rates(model)
    path = run_under(rates, 60, tank, 1)
    known = rates.apply(line_network(), tank)
    each = known.propensities(path.states)
    found = hazard_of(rates, line_network(), None)(path)
    for r, name in enumerate(line_network().channels):
        mine = [base_channel(channel) == name for channel in known.channels]
        np.testing.assert_allclose(found[:, r], each[:, mine].sum(axis=1), rtol=1e-12)
    nothing = hazard_of(line_rates(model, per_break=0.0), line_network(), None)(path)  # events unseen: the same shape
    np.testing.assert_allclose(nothing[:, BREAKS] * 2e-4, found[:, BREAKS], rtol=1e-12)


@pytest.mark.parametrize("model", [law.name for law in BREAK_MODELS])
def test_a_fitted_break_model_has_the_hazards_of_its_rates(model):
    """In both tanks, up to a factor a channel; joins, which were not fitted, thin out with the volume."""
    truth = line_rates("collision")
    paths = [run_under(truth, 60, SMALL, 1), run_under(truth, 90, LARGE, 2)]
    fit = fit_breaks(break_model(model), paths)
    rates = line_rates(model)
    shape = BreakTerms(model=model, shape=fit.model.shape_values)
    by_fit = hazard_of(fit, line_network(), SMALL)
    by_rates = hazard_of(rates.replace(breaks=shape), line_network(), SMALL)
    both = [np.concatenate([hazard(path) for path in paths]) for hazard in (by_fit, by_rates)]
    found, expected = (each / each.mean(axis=0) for each in both)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_runs_with_and_without_a_tank_are_not_mixed():
    path = run_under(line_rates("first-order"), 20, SMALL, 1)
    with pytest.raises(ValueError, match="some runs state their tank and others do not"):
        diagnose([path, JumpPath(path.network, path.initial, [], [], 1.0)])


def test_breaks_by_collisions_point_to_their_model_and_pass_under_it():
    """In tanks of two sizes and densities: doubtful as first-order breaks, fitted or not, and sound as what they
    are."""
    truth = line_rates("collision", per_break=4e-4)
    starts = [(30, SMALL), (60, SMALL), (120, SMALL), (60, LARGE)] * 2
    paths = [run_under(truth, n, tank, seed) for seed, (n, tank) in enumerate(starts)]

    def all_breaks(fit):
        found = diagnose(paths, fit, tests=[Sizes()])
        return next(each for each in found.results if each.channel == "all breaks")

    for plain in (None, line_rates("first-order"), fit_breaks(break_model("first-order"), paths)):
        assert all_breaks(plain).p_value < 1e-4
        assert "--break-model collision" in all_breaks(plain).remedy
    for right in (truth, fit_breaks(break_model("collision"), paths)):
        assert all_breaks(right).p_value > 0.01
