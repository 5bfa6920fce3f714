"""What can be calibrated, and what a calibration says of its runs."""

from types import SimpleNamespace

import pytest
from synthetic_runs import line_network

from calibration import Exposure, estimate
from calibration.estimating.break_comparison import BreakComparison, rates_with_breaks
from calibration.pipeline.calibration_study import CalibrationStudy, check_measurable
from calibration.reporting.overview import about_not_seen, not_seen
from kinetics.sampling import sample_path
from mechsim.scene import Scene


@pytest.fixture(scope="module")
def line4():
    return Scene.load("line4")


def test_calibration_needs_an_effect_for_each_kind_of_channel(line4):
    check_measurable(line4, [60])
    for name, kind in (("bonding", "joins"), ("breaking", "breaks")):
        with pytest.raises(ValueError, match=rf"lists no effect that makes {kind} happen \({name}\)"):
            check_measurable(line4.without(name), [60])


def test_too_few_cubes_for_some_channel(line4):
    with pytest.raises(
        ValueError, match=r"cubes = \[2, 3\]: too few for the reactants of 1\+3->4, 2\+2->4, 4->1\+3, 4"
    ):
        check_measurable(line4, [2, 3])
    check_measurable(line4, [3, 4])  # the larger tank shows what the smaller one cannot


def test_a_seeded_book_is_not_calibrated_channel_by_channel():
    with pytest.raises(ValueError, match="grows from a seed: a tank holds one growing structure"):
        check_measurable(Scene.load("pyramid45"), [60])


def study_of(end, settings):
    """A study of four runs of so many tu, whose rates are high."""
    network = line_network()
    paths = [sample_path(network, [40, 0, 0, 0], end, seed=1, run=run) for run in range(4)]
    records = tuple(SimpleNamespace(completed=True, path=path, arrays={}) for path in paths)
    return CalibrationStudy(None, SimpleNamespace(records=records, quarantined=()), settings, "first-order")


def test_channels_without_reactants_have_priors():
    """Breaks by the fit of their model, in its units; the control held everything."""
    calibration = study_of(0.2, {}).calibration
    paths = [sample_path(line_network(), [40, 0, 0, 0], 0.2, seed=1, run=run) for run in range(4)]
    missed = list(calibration.not_measured)
    assert {"1+3->4", "4->2+2"} <= set(missed)
    for model in ("first-order", "collision"):
        rates = rates_with_breaks(calibration, BreakComparison.asked_for(model, paths))
        assert rates.not_measured == missed
        assert {rates.channels[name].prior for name in missed} == {"joins", "breaks"}
        dimer, never = rates.channels["2->1+1"], rates.channels["4->2+2"]
        assert never.exposure == pytest.approx(0.5 * dimer.exposure / (dimer.events + 0.5))
        assert (rates.expected(line_network()).known_rates > 0).all()
    assert study_of(50.0, {}).calibration.not_measured == ()


def test_a_study_says_how_its_runs_were_made():
    assert "not restarted" in study_of(1.0, {"cubes": [40]}).made
    assert study_of(1.0, {"plan": "small"}).made == "Tanks, runs and lengths are those of the plan small."


def test_channels_without_events_are_named():
    """Those that could fire: the last one could not."""
    runs = [Exposure(line_network(), [5, 0, 1, 2, 3, 4, 0, 0], [9.0] * 7 + [0.0])]
    assert not_seen(estimate(runs)) == ["1+2->3", "4->1+3"]
    said = about_not_seen(estimate(runs))
    assert said.startswith("Not seen: 1+2->3, 4->1+3. For a rate without events ")
    assert "Not measured: 4->2+2. " in said
    assert about_not_seen(estimate([Exposure(line_network(), [1] * 8, [9.0] * 8)])) == ""
