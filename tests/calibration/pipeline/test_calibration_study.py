"""Which runs a study asks for."""

from types import SimpleNamespace

import numpy as np
import pytest
from synthetic_runs import line_network

from calibration.pipeline.study import CalibrationStudy, ValidationStudy, calibration_specs, validation_specs
from kinetics.rates import BreakTerms, Rates
from kinetics.sampling import sample_path
from mechsim.scene import Scene


@pytest.fixture(scope="module")
def line4():
    return Scene.load("line4")


def test_calibration_needs_an_effect_for_each_kind_of_channel(line4):
    for name, kind in (("bonding", "joins"), ("breaking", "breaks")):
        with pytest.raises(ValueError, match=rf"lists no effect that makes {kind} happen \({name}\)"):
            calibration_specs(line4.without(name), 60, 10.0, 10.0, seed=1)
    specs = calibration_specs(line4, 60, 10.0, 10.0, seed=1)
    tanks = {tuple(effect.effect for effect in spec.scene.effects if effect.opens) for spec in specs}
    assert tanks == {("breaking", "bonding"), ("breaking",)}


def test_too_few_cubes_for_some_channel(line4):
    with pytest.raises(ValueError, match=r"cubes = 3: too few to start runs from the reactants of 1\+3->4"):
        calibration_specs(line4, 3, 10.0, 10.0, seed=1)


def test_every_channel_of_t5_is_measured_with_60_cubes():
    specs = calibration_specs(Scene.load("t5"), 60, 10.0, 10.0, seed=1)
    assert all(spec.n_cubes == 60 and spec.restart for spec in specs)


def test_a_seeded_book_is_not_calibrated_channel_by_channel():
    with pytest.raises(ValueError, match="grows from a seed: a tank holds one growing structure"):
        calibration_specs(Scene.load("pyramid45"), 60, 10.0, 10.0, seed=1)


def test_held_out_runs_start_from_single_cubes_and_the_seed(line4):
    assert [spec.composition for spec in validation_specs(line4, [60, 80, 60], 2, 10.0, 2)] == [
        *({"monomer": 60}, {"monomer": 60}, {"monomer": 80}, {"monomer": 80}),
    ]
    (spec, _) = validation_specs(Scene.load("pyramid45"), [101], 2, 10.0, 2)
    assert spec.composition == {"monomer": 100, "seed": 1}


def records(network, has_bonds, n=4):
    """Stand-ins for records of full runs, whose cubes are known or not."""
    made = []
    for run in range(n):
        path = sample_path(network, [30 + 20 * (run % 2), 0, 0, 0], 20.0, seed=1, run=run)
        bonds = np.arange(2 * path.times.size).reshape(-1, 2)
        made.append(SimpleNamespace(completed=True, path=path, arrays={"bonds": bonds} if has_bonds else {}))
    return tuple(made)


def test_studies_judge_their_runs_by_the_break_model_and_the_pieces():
    """Held-out runs under the rates that predict, calibration runs under the model that was chosen."""
    network = line_network()
    plain = Rates(
        convention={"combinations": "distinct"},
        channels={name: {"rate": 1.0, "ways": 1.0} for name in network.channels},
    )
    by_collision = plain.model_copy(update={"breaks": BreakTerms(model="collision", shape={"alpha": 1.0})})
    known, unknown = (SimpleNamespace(records=records(network, has_bonds)) for has_bonds in (True, False))

    def p_of_breaks(study):
        return [f.p_value for f in study.diagnosis.results if (f.test, f.channel) == ("crowd", "all breaks")]

    held_out = ValidationStudy((), plain, known)
    assert p_of_breaks(held_out) != p_of_breaks(ValidationStudy((), by_collision, known))
    assert any("same pieces" in f.variant for f in held_out.diagnosis.results)
    assert not any("same pieces" in f.variant for f in ValidationStudy((), plain, unknown).diagnosis.results)
    calibrated = {name: CalibrationStudy(None, known, {}, name) for name in ("first-order", "collision")}
    assert p_of_breaks(calibrated["first-order"]) == pytest.approx(p_of_breaks(held_out))
    assert p_of_breaks(calibrated["collision"]) != p_of_breaks(held_out)
