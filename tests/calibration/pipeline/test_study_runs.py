"""The runs of a study: which they are, and what they say together."""

from types import SimpleNamespace

import numpy as np
import pytest
from synthetic_runs import line_network

from calibration.estimating.study import CalibrationStudy
from calibration.pipeline.held_out_study import ValidationStudy, run_validation
from calibration.pipeline.study_runs import StudyRuns, bonds_of
from kinetics.rates import BreakTerms, Rates
from kinetics.sampling import sample_path
from mechsim.scene import Scene


def test_runs_start_from_single_cubes_and_the_seed_and_go_on_through_all_events():
    line4 = Scene.load("line4")
    specs = StudyRuns.assembly(line4, [60, 80, 60], 2, 10.0, 2).specs
    assert [(spec.composition, spec.run) for spec in specs] == [
        *(({"monomer": 60}, 0), ({"monomer": 60}, 1), ({"monomer": 80}, 0), ({"monomer": 80}, 1)),
    ]
    assert {(spec.scene, spec.duration, spec.seed, spec.restart) for spec in specs} == {(line4, 10.0, 2, False)}
    (spec,) = StudyRuns.assembly(Scene.load("pyramid45"), [101], 1, 10.0, 2).specs
    assert spec.composition == {"monomer": 100, "seed": 1}


@pytest.mark.parametrize(
    ("sizes", "runs", "said"),
    [([60], 0, "runs = 0; expected at least 1"), ([], 2, r"cubes = \[\]"), ([60, 0], 2, r"cubes = \[60, 0\]")],
)
def test_no_runs_or_sizes(sizes, runs, said):
    with pytest.raises(ValueError, match=said):
        StudyRuns.assembly(Scene.load("line4"), sizes, runs, 10.0, 2)


def test_one_held_out_run_has_no_interval(tmp_path):
    alone = StudyRuns.assembly(Scene.load("line4"), [60], 1, 10.0, 2)
    with pytest.raises(ValueError, match="runs = 1; a mean with an interval needs at least 2"):
        run_validation(alone, Rates.load("table3"), tmp_path / "runs")
    assert list(tmp_path.iterdir()) == []


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
    by_collision = plain.replace(breaks=BreakTerms(model="collision", shape={"alpha": 1.0}))
    known, unknown = (SimpleNamespace(sound=records(network, has_bonds)) for has_bonds in (True, False))

    def p_of_breaks(study):
        return [f.p_value for f in study.diagnosis.results if (f.test, f.channel) == ("crowd", "all breaks")]

    held_out = ValidationStudy((), plain, known)
    assert p_of_breaks(held_out) != p_of_breaks(ValidationStudy((), by_collision, known))
    assert any("same pieces" in f.variant for f in held_out.diagnosis.results)
    assert not any("same pieces" in f.variant for f in ValidationStudy((), plain, unknown).diagnosis.results)
    paths, bonds = [record.path for record in known.sound], bonds_of(known.sound)
    calibrated = {
        name: CalibrationStudy("line4", paths, {}, "", "", name, bonds=bonds) for name in ("first-order", "collision")
    }
    assert p_of_breaks(calibrated["first-order"]) == pytest.approx(p_of_breaks(held_out))
    assert p_of_breaks(calibrated["collision"]) != p_of_breaks(held_out)
