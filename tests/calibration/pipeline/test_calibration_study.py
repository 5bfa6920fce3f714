"""Which runs a study asks for."""

import pytest

from calibration.pipeline.study import calibration_specs, validation_specs
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
