"""Studies: what a file expands to, what it may not say, what it will cost, and runs that are made once."""

import zlib

import numpy as np
import pytest

from kinetics.support.settings import validated
from mechsim.runs.ensemble import run_all
from mechsim.runs.record import RunRecord, book_of
from mechsim.runs.store import RunStore
from mechsim.scene import Scene
from mechsim.studies.cost import PointTrial, predict, trial
from mechsim.studies.study import STUDIES, Study
from mechsim.studies.summary import first_time, summarise

TO_A_T = ("1+1->dimer.a", "1+1->dimer.a", "dimer.a+dimer.a->quadmer.b", "1+quadmer.b->5")
NAMES = sorted(path.stem for path in STUDIES.glob("*.toml"))


def study_of(*factors, **settings):
    data = {"name": "own", "title": "own", "scene": "t5", "cubes": 10, "runs": 2, "cap": 1.0, "typical": 5.0}
    return validated(Study, data | settings | {"factors": list(factors)}, "own.toml")


def factor(setting="number", levels=(8.0, 12.0), name="number", **more):
    return {"name": name, "label": name, "setting": setting, "levels": list(levels)} | more


def fake_run(spec, progress):
    """A run whose first target comes after 24 tu / number of cubes, times 1 + its number; none by the cap."""
    network = book_of(spec.scene.rules)[1].network
    time = 24.0 / spec.n_cubes * (1 + spec.run)
    reached = time <= spec.duration
    arrays = {"initial": network.state(spec.composition), "times": np.zeros(0), "channels": np.zeros(0, np.int64)}
    if reached:
        arrays["times"] = np.linspace(time / 4, time, 4)
        arrays["channels"] = np.array([network.channels.index(name) for name in TO_A_T])
    facts = {
        "end": min(time, spec.duration),
        "steps": 1,
        "species": list(network.species),
        "channels": list(network.channels),
        "open_channels": [True] * len(network.channels),
    }
    progress(facts["end"])
    return RunRecord(spec, "completed", arrays, facts, {"cpu_seconds": 1.0, "wall_seconds": 1.0})


@pytest.mark.parametrize("name", NAMES)
def test_shipped_studies_can_be_run(name):
    study = Study.load(name)
    specs = [point.specs(study.cap, 1, 0)[0] for point in study.points]
    assert len({spec.key for spec in specs}) == len(specs) == int(np.prod([len(f.levels) for f in study.factors]))
    assert all(spec.until == "pentamer" and spec.duration == study.cap for spec in specs)
    assert study.name == name


def test_the_paper_s_settings_are_there():
    grid = {point.levels for point in Study.load("interactions").points}
    assert len(grid) == 27
    assert {(3.0, 40.0, 0.15), (5.0, 120.0, 0.25)} <= grid
    assert [p.cubes for p in Study.load("number").points] == [40, 60, 80, 100, 120]
    assert [p.scene.effect("agitation").sigma for p in Study.load("velocity").points] == [3.0, 3.5, 4.0, 4.5, 5.0]


def test_a_level_that_is_the_scene_s_own_leaves_it_alone():
    """So that studies share runs: the same scene, the same number of cubes, the same runs."""
    base = Scene.load("t5").by("own").fingerprint
    shared = [Study.load("velocity").points[2], Study.load("number").points[1]]
    assert {point.scene.fingerprint for point in shared} == {base}
    assert len({point.specs(9.0, 1, 3)[0].key for point in shared}) == 1
    assert Study.load("size").points[0].scene.fingerprint == Study.load("scale").points[0].scene.fingerprint == base


def test_what_goes_with_a_factor_goes_by_its_power():
    small, large = (Study.load("size").points[i].scene for i in (0, 2))
    ratio = 0.25 / 0.15
    assert large.cubes.edge == 0.25
    assert large.effect("breaking").threshold == pytest.approx(small.effect("breaking").threshold * ratio**3)
    assert large.effect("agitation").hold == pytest.approx(small.effect("agitation").hold * ratio)
    assert large.effect("bonding") == small.effect("bonding")
    scaled = Study.load("scale").points[1].scene
    assert scaled.tank.size == pytest.approx(tuple(side * 5 / 3 for side in small.tank.size))
    assert scaled.effect("bonding").latch.refractory == pytest.approx(small.effect("bonding").latch.refractory * 5 / 3)


def test_points_do_not_share_random_numbers():
    seeds = [point.specs(9.0, 1, 3)[0].seed for point in Study.load("velocity").points]
    assert len(set(seeds)) == len(seeds)
    assert seeds != [point.specs(9.0, 1, 4)[0].seed for point in Study.load("velocity").points]


def test_points_whose_checksums_agree_have_different_seeds():
    """These seeds give texts of one CRC-32, by which points were keyed before: the control."""
    point, seeds = Study.load("number").points[0], (319673993917, 449686726958)
    texts = [f"{seed} {point.scene.fingerprint}".encode() for seed in seeds]
    assert zlib.crc32(texts[0]) == zlib.crc32(texts[1])
    one, other = (point.specs(9.0, 1, seed)[0].seed for seed in seeds)
    assert one != other
    assert 2**32 < min(one, other) < 2**63  # more than 32 bits; they fit into any file


def test_points_are_chosen_by_their_levels():
    study = Study.load("interactions")
    chosen = study.chosen(["sigma=3,5", "edge=0.15"])
    assert {point.levels for point in chosen} == {(s, n, 0.15) for s in (3.0, 5.0) for n in (40.0, 80.0, 120.0)}
    assert study.chosen([]) == study.points


@pytest.mark.parametrize(
    ("choice", "said"),
    [
        ("speed=3", "with a factor of sigma, number, edge"),
        ("sigma", "expected FACTOR=LEVEL"),
        ("sigma=3,x", "is no list of numbers"),
        ("sigma=3.2", "sigma has no level 3.2; it has 3, 4, 5"),
    ],
)
def test_points_that_are_not_there(choice, said):
    with pytest.raises(ValueError, match=said):
        Study.load("interactions").chosen([choice])


@pytest.mark.parametrize(
    ("factors", "settings", "said"),
    [
        ([factor("agitation.sigmas")], {}, "no number 'agitation.sigmas' to vary.*agitation.sigma"),
        ([factor("magic.sigma")], {}, "no number 'magic.sigma'"),
        ([factor("bonding.latch.kind")], {}, "no number 'bonding.latch.kind'"),
        ([factor("tank.size")], {}, "no number 'tank.size'"),
        ([factor(also={"drag.cd": 1})], {}, "no number 'drag.cd'"),
        ([factor(levels=[])], {}, "factors.0.levels"),
        ([], {}, "factors"),
        ([factor(levels=[8, 8])], {}, "name one twice"),
        ([factor(levels=[0])], {}, "above 0"),
        ([factor(levels=[8.5])], {}, "whole number"),
        ([factor("numerics.solver_iterations", [50.5], "iterations")], {}, "whole number"),
        ([factor("cubes.edge", [2.5], "edge")], {}, "the tank holds"),
        ([factor("cubes.edge", [3.5], "edge")], {"cubes": 1}, "the tank holds"),
        ([factor(), factor()], {}, "appears twice"),
        ([factor(), factor(name="again")], {}, "two factors vary one setting"),
        ([factor("agitation.hold", [0.0107], "hold")], {}, "not a whole number of steps"),
        ([{"name": "n", "label": "n", "levels": [1.0]}], {}, "expected a `setting`"),
        ([factor(paper_speeds=[1.0])], {}, "1 paper_speeds for 2 levels"),
        ([factor()], {"scene": "nowhere"}, "unknown scene"),
        ([factor()], {"cap": 0.0}, "cap"),
        ([factor()], {"paper": [{"at": [9.0], "median": 5.0}]}, "is no point of the study"),
        ([factor()], {"color": "red"}, "unknown key 'color'"),
    ],
)
def test_what_a_study_may_not_say(factors, settings, said):
    with pytest.raises(ValueError, match=said):
        study_of(*factors, **settings)


def test_a_trial_measures_the_speed():
    study = study_of(factor("agitation.sigma", [2.0, 4.0], "sigma", is_speed=True))
    slow, fast = (trial(point, seed=1) for point in study.points)
    assert (slow.speed, slow.speed_error) == (trial(study.points[0], 1).speed, trial(study.points[0], 1).speed_error)
    assert 0.3 < slow.speed < 0.6
    assert 1.0 < fast.speed < 1.3
    assert 0 < fast.speed_error < 0.05
    assert fast.cpu_per_tu > 0
    assert fast.cpu_start > 0


def test_the_cost_follows_collisions_and_counts_what_is_missing(tmp_path):
    study = study_of(factor(levels=[10, 20]), cap=3.0)
    store, trials = RunStore(tmp_path), {p: PointTrial(1.0, 0.01, 2.0, 0.5) for p in study.points}
    few, many = predict(study, study.points, trials, 4, 0, store).points
    assert (few.expected, many.expected) == (3.0, 2.5)  # 5 tu are more than the cap; twice the cubes, half the time
    assert (many.cpu, many.most) == (4 * (0.5 + 2.5 * 2), 4 * (0.5 + 3 * 2))
    run_all(study.points[1].specs(study.cap, 3, 0), store, execute=fake_run)
    left = predict(study, study.points, trials, 4, 0, store)
    assert [point.missing for point in left.points] == [4, 1]
    assert "5 runs to make: about" in str(left)
    still = predict(study, study.points, dict.fromkeys(study.points, PointTrial(np.nan, np.nan, 2.0, 0.5)), 4, 0, store)
    assert [point.expected for point in still.points] == [3.0, 3.0]


def test_runs_are_made_once_and_summed_up(tmp_path):
    study = study_of(factor(levels=[8, 12]), cap=7.0, typical=2.0)
    specs = [spec for point in study.points for spec in point.specs(study.cap, 4, 0)]
    store = RunStore(tmp_path)
    run_all(specs[:3], store, execute=fake_run)
    outcome = run_all(specs, store, execute=fake_run)
    assert (outcome.computed, outcome.reused) == (5, 3)
    trials = {p: PointTrial(1.0, 0.01, 2.0, 0.5) for p in study.points}
    result = summarise(study, study.points, trials, outcome.records, 0)
    few, many = result.points
    assert few.times.tolist() == [3.0, 6.0, np.inf, np.inf]
    assert many.times.tolist() == [2.0, 4.0, 6.0, np.inf]
    assert (few.censored, many.censored) == (2, 1)
    assert many.mean.value == pytest.approx((2 + 4 + 6 + 7) / 4)
    assert result.tables()["times"][3] == {"number": 8.0, "run": 3, "first_time": None, "cap": 7.0}
    written = {path.name for path in result.save(tmp_path)}
    assert written == {"own_points.csv", "own_times.csv", "own_exponents.csv", "own.svg"}


def test_speeds_stand_beside_the_paper_s():
    study = Study.load("velocity")
    trials = {p: PointTrial(0.1 * p.levels[0] ** 1.4, 0.0, 2.0, 0.5) for p in study.points}
    records = [fake_run(spec, print) for point in study.points for spec in point.specs(study.cap, 5, 0)]
    result = summarise(study, study.points, trials, records, 0)
    speed, time = result.exponents
    assert (speed.of, time.of) == ("speed ~ sigma^p", "time ~ speed^p")
    assert (speed.estimate.value, speed.paper) == (pytest.approx(1.4), pytest.approx(1.23, abs=0.01))
    assert speed.verdict == "the paper's is below"
    assert time.estimate.low < 0 < time.estimate.high  # the fake runs take no notice of sigma
    assert result.tables()["points"][0]["paper_speed"] == 0.8


def test_runs_the_guard_stopped_are_counted_apart(tmp_path):
    study = study_of(factor(levels=[8]), cap=7.0)
    records = [fake_run(spec, print) for spec in study.points[0].specs(7.0, 3, 0)]
    records[1].outcome = "stopped: too fast"
    trials = {p: PointTrial(1.0, 0.01, 2.0, 0.5) for p in study.points}
    (found,) = summarise(study, study.points, trials, records, 0).points
    assert (found.times.tolist(), found.runs, found.stopped) == ([3.0, np.inf], (0, 2), 1)


def test_first_times_are_those_of_the_path():
    (point,) = study_of(factor(levels=[8]), cap=7.0).points
    seen, unseen = (fake_run(spec, print) for spec in (point.specs(7.0, 3, 0)[0], point.specs(7.0, 3, 0)[2]))
    assert first_time(seen) == 3.0
    assert first_time(unseen) == np.inf


@pytest.mark.parametrize("name", ["../../x", "/tmp/x", "a/b", "..", ".hidden", "two words", "", "x" * 81])
def test_a_name_that_could_leave_its_folder_is_refused(name):
    with pytest.raises(ValueError, match=r"own.toml: study name .*: it names files"):
        study_of(factor(), name=name)
    assert study_of(factor(), name="x" * 80)  # the control
