"""Work-precision diagrams: what is compared with what, errors with honest intervals, resumable and within a budget."""

import json
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.figure import Figure

from mechsim.accuracy import diagram, measuring, plot
from mechsim.accuracy.changes import RelativeChange, change_of
from mechsim.accuracy.measuring import measure
from mechsim.accuracy.plan import plan
from mechsim.accuracy.quantities import QUANTITIES, counter
from mechsim.accuracy.trial import AccuracyTrial, execute_trial, unbound, with_numerics
from mechsim.effects.faces import FacesWithinReach
from mechsim.runs.ensemble import Outcome, Quarantined, run_all
from mechsim.runs.record import RunSpec, book_of
from mechsim.runs.species import single_cubes
from mechsim.runs.store import RunStore
from mechsim.scene import Scene
from wellmixed import main

SMALL = {"cubes": 2, "duration": 0.3, "rounds": 2, "budget": 1e9, "seed": 5}  # two cubes that meet
SCENE = """
name = "two knobs"
rules = "line4"
tank = { size = [0.6, 0.6, 0.6] }
cubes = { edge = 0.15 }
numerics = { step = 0.0105, solver_iterations = 50 }
effects = [
  { effect = "agitation", sigma = 4.0, hold = 0.0105 },
  { effect = "drag" },
  { effect = "walls" },
]
"""


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenes") / "knobs.toml"
    path.write_text(SCENE)
    return str(path)


def run_here(specs, store, **_):
    """What run_all does, without a process for each run."""
    for spec in specs:
        store.write(execute_trial(spec))
    return Outcome(tuple(store.read(spec) for spec in specs), (), len(specs), 0)


@pytest.fixture(autouse=True, scope="module")
def _in_this_process():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measuring, "run_all", run_here)
        yield


@pytest.fixture(scope="module")
def measured(tmp_path_factory, line4, _in_this_process):
    """The whole of line4's plan, on two cubes and for a moment."""
    store = RunStore(tmp_path_factory.mktemp("runs"))
    told = []
    small = line4.replace(tank=line4.tank.replace(size=(0.6, 0.6, 0.6)))
    return measure(small, store, **SMALL, tell=told.append), store, told


def test_plan_turns_one_knob_at_a_time(line4):
    planned = plan(line4)
    own = line4.as_dict()
    for setting in planned.numerical:
        other = setting.scene.as_dict()
        changed = {key for key in own if own[key] != other[key]}
        if "sub-cycles" in setting.curve:
            assert changed <= {"numerics", "effects"}
            assert setting.scene.changed("drag", sub_cycles=1).effects == line4.effects
            assert setting.scene.effect("drag").sub_cycles > 1
        else:
            assert changed <= {"numerics"}
            assert sum(own["numerics"][k] != other["numerics"][k] for k in own["numerics"]) <= 1
    for setting in planned.model:
        other = setting.scene.as_dict()
        assert {key for key in own if own[key] != other[key]} == {"effects"}
        assert sum(a != b for a, b in zip(own["effects"], other["effects"], strict=True)) == 1
    assert planned.reference.scene.numerics.step == line4.numerics.step / 4
    assert [r.label for r in planned.refused if r.curve == "step"] == ["0.021"]
    assert planned.base.scene in [setting.scene for setting in planned.numerical]


def test_effects_that_are_absent_have_no_knobs(scene_of):
    curves = {s.curve for s in plan(scene_of("agitation", "drag", "walls")).model}
    assert curves == {"agitation hold", "agitation correlated over", "drag points"}
    field = {"effect": "random-field", "sigma": 4.0, "correlation_length": 0.3, "correlation_time": 0.0105}
    curves = {s.curve for s in plan(scene_of(field, "drag")).model}
    assert curves == {"random-field correlation length", "random-field correlation time", "drag points"}
    assert {s.curve for s in plan(scene_of("walls")).numerical} == {"step", "solver iterations"}


def test_sub_cycles_of_the_scene_itself_are_where_the_curves_start(scene_of):
    own = scene_of({"effect": "drag", "sub_cycles": 2})
    planned = plan(own)
    labels = [s.label for s in planned.numerical if s.curve == "drag sub-cycles"]
    assert labels == ["1"]
    assert planned.reference.scene.effect("drag").sub_cycles == 2
    assert not planned.refused
    assert "step, 4 drag sub-cycles" not in {s.curve for s in plan(own.changed("drag", sub_cycles=4)).numerical}


def test_a_trial_is_no_run_of_the_same_scene(line4):
    trial, run = (kind(line4, {"monomer": 2}, 1.0, 1, 0) for kind in (AccuracyTrial, RunSpec))
    assert trial.key != run.key
    assert run.key == RunSpec(line4, {"monomer": 2}, 1.0, 1, 0).key


def test_scenes_that_differ_in_rules_and_bonds_alone_share_their_trials(line4, scene_of):
    """What moves is the same, bit for bit; the seed of a book that has one is a cube like the others."""
    pyramid = Scene.load("pyramid45")
    trials = [
        AccuracyTrial(line4, {"monomer": 3}, 0.2, 1, 0),
        AccuracyTrial(line4.changed("breaking", threshold=0.1), {"monomer": 3}, 0.2, 1, 0),
        AccuracyTrial(pyramid, single_cubes(book_of("pyramid45")[1], 3), 0.2, 1, 0),
    ]
    assert len(trials[2].composition) == 2
    assert len({execute_trial(trial).digest for trial in trials}) == 1
    others = [line4.changed("bonding", capture_distance=0.01), line4.changed("agitation", sigma=3.0)]
    assert len({AccuracyTrial(scene, {"monomer": 3}, 0.2, 1, 0).key for scene in (line4, *others)}) == 3


def test_trials_are_the_same_bit_for_bit(line4):
    trial = AccuracyTrial(line4, {"monomer": 3}, 0.2, 1, 0)
    assert execute_trial(trial).digest == execute_trial(trial).digest


def test_workers_make_trials(line4, tmp_path):
    trial = AccuracyTrial(line4, {"monomer": 2}, 0.1, 1, 0)
    (record,) = run_all([trial], RunStore(tmp_path), progress=False, execute=execute_trial).records
    assert record.digest == execute_trial(trial).digest


def test_meetings_are_counted_as_a_slow_look_counts_them(scene_of):
    """Against sets of pairs within reach, remembered for the refractory time; some number must come of it."""
    scene = scene_of(
        *("agitation", "drag", "walls", "contact"),
        {"effect": "bonding", "latch": {"kind": "encounter", "probability": 0.5, "refractory": 0.03}},
        tank=[0.5, 0.5, 0.5],
    )
    from mechsim.world.world import World

    book = book_of("line4")[0]
    with World(unbound(scene), book, 6, np.random.SeedSequence(5)) as world:
        count = counter(scene, world)
        world.populate([book.monomer()] * 6)
        last, slow = {}, 0
        faces = FacesWithinReach(world, 0.02, 135.0, 0.5 * world.bodies.edge, in_passing=True)
        for _ in range(800):
            world.step()
            for pair in map(tuple, faces.within_reach().tolist()):
                # Placed side by side at the start is not met.
                slow += world.step_count > 1 and world.time - last.get(pair, -9.0) > 0.03
                last[pair] = world.time
            assert count() == slow
        assert slow > 20
        with pytest.raises(ValueError, match="lists no bonding"):
            counter(scene_of("agitation", "drag"), world)


def test_meetings_of_any_faces_are_a_fixed_multiple_of_those_that_may_bond(make_world, scene_of):
    """All six faces are mechanically alike: of the 36 pairs of types line4 allows n, so a share n / 36 of meetings."""
    scene = scene_of("agitation", "drag", "walls", "contact", tank=[0.65, 0.65, 0.65])
    world = make_world({"monomer": 12}, scene)
    faces = FacesWithinReach(world, 0.02, 135.0, 0.5 * world.bodies.edge)
    seen = np.zeros((6, 6))
    for step in range(3000):
        world.step()
        if step % 4 == 0:
            found = faces.within_reach()
            np.add.at(seen, (found[:, 1], found[:, 3]), 1)
    share = seen.sum(axis=0) / seen.sum() + seen.sum(axis=1) / seen.sum()
    # One in six each; time correlations leave some 150 independent looks a face, so 0.15 is more than five sigma.
    np.testing.assert_allclose(share, 1 / 3, atol=0.15)


def test_speeds_come_with_noise_shared_between_steps(line4):
    """The same redraws of the fluid at any step: differences are known ten times better than speeds."""
    trials = [
        execute_trial(AccuracyTrial(with_numerics(line4, step=line4.numerics.step / n), {"monomer": 8}, 6.0, 1, 0))
        for n in (1, 2)
    ]
    a, b = (trial.arrays["speed"] for trial in trials)
    assert np.corrcoef(a, b)[0, 1] > 0.8
    shuffled = change_of(a, np.roll(b, 7))
    assert change_of(a, b).half_width < 0.7 * shuffled.half_width  # the control: blocks that do not belong together


@pytest.mark.parametrize("shared", [0.0, 0.9])
def test_intervals_of_ratios_hold_as_often_as_they_say(shared):
    """95 % intervals of 2000 synthetic comparisons; false alarm 1e-6: 4.9 sigma of a binomial, 2.4 % of them."""
    rng = np.random.default_rng(2)
    held = 0
    for _ in range(2000):
        common = rng.standard_normal(60)
        x, r = (
            m * (1 + 0.2 * (shared * common + np.sqrt(1 - shared**2) * rng.standard_normal(60))) for m in (1.1, 1.0)
        )
        change = change_of(x, r)
        held += abs(change.value - 0.1) <= change.half_width
    assert abs(held / 2000 - 0.95) < 0.024
    assert abs(np.mean([0.9]) - 0.95) > 0.024  # a coverage of 90 % would be seen


def test_a_shared_factor_is_no_difference():
    blocks = np.random.default_rng(1).uniform(1, 2, 40)
    change = change_of(1.25 * blocks, blocks)
    assert change.value == pytest.approx(0.25)
    assert change.half_width == pytest.approx(0.0, abs=1e-12)


def test_diagram_of_a_moment(measured):
    found, _, told = measured
    assert "predicted cost" in told[0]
    assert found.runs == 2
    assert len(found.numerical) == len(found.plan.numerical)
    base = next(p for p in found.numerical if p.setting.scene == found.scene)
    assert base.cost > 0
    assert base.changes["speed"].half_width > 0
    assert set(found.means) == {"speed", "meetings"}  # too few hits on a bond to compare
    assert {"speed"} <= set(found.floor) <= set(found.means)
    assert {name for row in found.rows() for name in row} >= {f"{q.name}_change" for q in QUANTITIES}
    rows = found.rows()
    assert [row["panel"] for row in rows].count("reference") == 1
    assert json.loads(json.dumps(found.as_dict()))["cubes"] == 2
    assert {point.runs for point in found.numerical if point.setting.curve == "step"} == {2}
    assert {point.runs for point in (*found.numerical, *found.model) if point.setting.curve != "step"} == {1}
    assert "model sensitivity" in str(found)


def test_the_same_call_again_makes_nothing(measured):
    found, store, _ = measured
    again = measure(found.scene, store, **SMALL)
    assert again.cpu_seconds == 0
    assert again == found


def test_a_budget_ends_the_rounds_and_the_next_call_goes_on(tmp_path, scene_of, monkeypatch):
    def a_second_each_step(specs, store, **_):
        outcome = run_here(specs, store)
        for record in outcome.records:
            record.cost["cpu_seconds"] = (record.spec.duration + 1) / record.spec.scene.numerics.step
        return outcome

    monkeypatch.setattr(measuring, "pilot", lambda *_: 1.0)  # CPU s a step
    monkeypatch.setattr(measuring, "run_all", a_second_each_step)
    scene = scene_of("agitation", "drag")
    store, told = RunStore(tmp_path), []
    steps = sum((0.1 + 1) / s.scene.numerics.step for s in measuring._settings(plan(scene), 0))
    settings = {"cubes": 2, "duration": 0.1, "seed": 1}
    with pytest.raises(ValueError, match="first round alone is predicted"):
        measure(scene, store, **settings, rounds=3, budget=steps / 2)
    first = measure(scene, store, **settings, rounds=3, budget=steps + 1, tell=told.append)
    assert first.runs == 1
    assert "the same call again continues" in told[-1]
    second = measure(scene, store, **settings, rounds=2, budget=steps + 1)
    assert second.runs == 2


def test_what_is_given_up_is_named_and_the_rest_compared(tmp_path, scene_of, monkeypatch):
    def some_fail(specs, store, **_):
        made = run_here([s for s in specs if s.scene.numerics.solver_iterations != 5], store)
        lost = [Quarantined(s, ("killed",) * 3) for s in specs if s.scene.numerics.solver_iterations == 5]
        return Outcome(made.records, tuple(lost), made.computed, 0)

    monkeypatch.setattr(measuring, "run_all", some_fail)
    settings = {"cubes": 2, "duration": 0.1, "rounds": 1, "budget": 1e9, "seed": 1}
    found = measure(scene_of("agitation", "drag"), RunStore(tmp_path), **settings)
    assert len(found.given_up) == 1
    assert "given up: line4" in str(found)
    without = [point.setting.label for point in found.numerical if not point.changes]
    assert without == ["5"]
    plot.draw(found, Figure(figsize=(8, 6)))


def test_stopped_settings_are_crosses_at_their_cost(measured):
    """A setting that the guard stopped is shown at its cost; the others go on."""
    found, _, _ = measured
    point = next(p for p in found.numerical if "sub-cycles" in p.setting.curve)
    stopped = diagram.SettingResult(point.setting, 1, 0.123, {}, "stopped: spin")
    changed = diagram.Accuracy(
        found.scene, found.cubes, found.seed, found.runs, found.duration, found.plan, found.reference,
        (*found.numerical[:3], stopped), (), found.means,
    )  # fmt: skip
    figure = plot.draw(changed, Figure(figsize=(8, 4)))
    crosses = [line for ax in figure.axes for line in ax.lines if line.get_marker() == "x"]
    assert len(crosses) == 2
    assert {float(line.get_xdata()[0]) for line in crosses} == {0.123}
    assert "stopped: spin" in str(changed)


def test_crosses_and_their_names_stand_apart_whatever_they_cost(measured, monkeypatch):
    """Three stopped settings of one cost; the control draws them at one height."""
    found, _, _ = measured
    stopped = [diagram.SettingResult(p.setting, 1, 0.123, {}, "stopped: spin") for p in found.numerical[:3]]
    changed = replace(found, numerical=(*stopped, *found.numerical), model=())

    def names_overlap():
        figure = plot.draw(changed, Figure(figsize=(10, 4)))
        figure.draw_without_rendering()
        boxes = [text.get_window_extent() for text in figure.axes[0].texts if text.get_color() == plot.RED]
        assert len(boxes) == 3
        return any(a.overlaps(b) for a, b in combinations(boxes, 2))

    assert not names_overlap()
    monkeypatch.setattr(plot, "APART", 0.0)
    assert names_overlap()


def test_a_model_setting_of_a_multiple_is_shown_as_a_ratio(measured):
    """Twenty times as much and none at all fit one panel: the axis is one of ratios, and never ends at or below 0."""
    found, _, _ = measured
    name = next(iter(found.means))
    points = [
        replace(p, changes={name: RelativeChange(x, 0.1)}) for p, x in zip(found.numerical, (20, -1), strict=False)
    ]
    ax = plot.sensitivity(Figure().subplots(), replace(found, model=tuple(points)))
    assert ax.get_xscale() == "log"
    assert sorted(ax.lines[0].get_xdata()) == [plot.LEAST_RATIO, 21.0]


def test_a_guarded_trial_keeps_its_reason(line4):
    scene = line4.replace(guard=line4.guard.replace(max_speed=0.5))
    record = execute_trial(AccuracyTrial(scene, {"monomer": 2}, 0.5, 1, 0))
    assert record.outcome.startswith("stopped: ")
    assert record.arrays["speed"].size == 0
    assert 0 < record.cost["cpu_per_tu"] <= record.cost["cpu_seconds"] / scene.numerics.step


def test_a_scene_that_stops_at_once_is_told(line4, tmp_path):
    scene = line4.replace(guard=line4.guard.replace(max_speed=0.5))
    with pytest.raises(ValueError, match=r"was stopped in step \d: runaway"):
        measure(scene, RunStore(tmp_path), cubes=2, duration=0.1, rounds=1, budget=1e9, seed=1)


def test_command(scene_file, tmp_path):
    arguments = ["--cubes", "2", "--duration", "0.2", "--rounds", "1", "--runs-folder", str(tmp_path / "runs")]
    out = [str(tmp_path / "a.csv"), str(tmp_path / "a.svg")]
    done = CliRunner().invoke(
        main, ["trust", "accuracy", "mechanics", scene_file, *arguments, "--json", "--csv", out[0], "--plot", out[1]]
    )
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert "predicted cost" in done.stderr
    assert told["floor"].keys() == {"speed"}  # no bonding, no faces that could meet
    assert len((tmp_path / "a.csv").read_text().splitlines()) == 1 + len(told["settings"])
    assert (tmp_path / "a.svg").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--budget", "0"], "budget"),
        (["--budget", "1e-9"], "budget"),
        (["--cubes", "1"], "cubes"),
        (["--duration", "-1"], "duration"),
        (["--plot", "nowhere/x.png"], "does not exist"),
    ],
)
def test_bad_requests(scene_file, tmp_path, arguments, message):
    given = [
        "trust",
        "accuracy",
        "mechanics",
        scene_file,
        "--cubes",
        "2",
        "--duration",
        "1",
        "--runs-folder",
        str(tmp_path),
        *arguments,
    ]
    done = CliRunner().invoke(main, given)
    assert done.exit_code == 2
    assert message in done.output
