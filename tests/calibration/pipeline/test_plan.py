"""The file of a plan, wherever it is kept."""

import shutil

import pytest

from calibration.pipeline.plan import PlannedRuns, StudyPlan, Tanks
from mechsim import scene as scenes

PART = {"tanks": [Tanks(composition={"monomer": 8}, runs=2, duration=1.0)]}


def plan_of(scene):
    return StudyPlan(
        name="small", scene=scene, calibration=PlannedRuns(seed=1, **PART), held_out=PlannedRuns(seed=2, **PART)
    )


def test_a_scene_file_is_found_from_the_folder_of_the_plan(tmp_path, monkeypatch):
    """From any working directory: a plan and a scene beside it can be moved together."""
    for folder in ("studies", "elsewhere"):
        (tmp_path / folder).mkdir()
    shutil.copy(scenes.SCENES / "line4.toml", tmp_path / "studies" / "mine.toml")
    monkeypatch.chdir(tmp_path)
    made = plan_of("studies/mine.toml")  # as seen from here
    made.save("studies/plan.toml")
    assert 'scene = "mine.toml"' in (tmp_path / "studies" / "plan.toml").read_text(encoding="utf-8")
    for place, path in (("studies", "plan.toml"), ("elsewhere", "../studies/plan.toml"), (".", "studies/plan.toml")):
        monkeypatch.chdir(tmp_path / place)
        read = StudyPlan.load(path)
        assert read.specs(read.calibration)[0].scene == scenes.Scene.load("line4")
        assert read.fingerprint == made.fingerprint
    assert StudyPlan.load("studies/plan.toml") == made
    made.save("elsewhere/plan.toml")
    assert StudyPlan.load("elsewhere/plan.toml").scene_of(made.held_out.tanks[0]).name == "line4"
    shutil.move("studies/plan.toml", "elsewhere/plan.toml")  # the control: without its scene
    with pytest.raises(ValueError, match=r"scene file elsewhere/mine\.toml does not exist"):
        StudyPlan.load("elsewhere/plan.toml").specs(made.calibration)


def test_the_name_of_a_shipped_scene_is_the_same_everywhere(tmp_path):
    plan = plan_of("line4")
    plan.save(tmp_path / "plan.toml")
    assert StudyPlan.load(tmp_path / "plan.toml") == plan
    assert plan.fingerprint != plan_of("t5").fingerprint


@pytest.mark.parametrize("copies", [-8, 2.5, True])
def test_copies_of_a_plan_are_whole_numbers_of_at_least_0(copies):
    with pytest.raises(ValueError, match=r"composition\.monomer = .*should be a whole number at least 0"):
        Tanks(composition={"monomer": copies}, runs=2, duration=1.0)
