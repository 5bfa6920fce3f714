"""Presets: chosen by what was measured, refused where nothing was, told before the run and kept with its result."""

import json
from dataclasses import replace

import pytest
from click.testing import CliRunner

from mechsim.accuracy import preset
from mechsim.accuracy.changes import RelativeChange
from mechsim.accuracy.diagram import Accuracy, SettingResult
from mechsim.accuracy.plan import plan
from mechsim.accuracy.preset import Presets, choose, load
from mechsim.runs.record import PHYSICS, RunSpec
from mechsim.scene import SCENES, Scene
from wellmixed import main


@pytest.fixture
def measured(line4):
    """measured(errors, others): a diagram of line4 whose curve of steps has these (speed, meetings) limits, coarse to
    fine; others : more points, (curve, label) -> (CPU s/tu, speed, meetings).
    """
    planned = plan(line4)
    steps = [setting for setting in planned.numerical if setting.curve == "step"]

    def changes(speed, meetings):
        return {"speed": RelativeChange(speed, 0.001), "meetings": RelativeChange(meetings, 0.01)}

    def make(*errors, others=None):
        points = tuple(
            SettingResult(s, 4, 0.12 / 2**k, changes(*e) if e else {}, None)
            for k, (s, e) in enumerate(zip(steps[::-1], errors[::-1], strict=True))
        )
        for setting in planned.numerical:
            cost, *found = (others or {}).get((setting.curve, setting.label), (None,))
            points += (SettingResult(setting, 2, cost, changes(*found), None),) if found else ()
        reference = SettingResult(planned.reference, 4, 0.24, {})
        return Accuracy(line4, 120, 1, 4, 50.0, planned, reference, points, (), {})

    return make


def test_the_cheapest_step_within_a_tolerance(measured, line4):
    found = choose(measured((0.05, 0.02), (0.005, -0.04), (0.001, 0.01))).presets
    step = line4.numerics.step
    assert [found[name].step for name in ("draft", "standard", "reference")] == [2 * step, step / 2, step / 4]
    assert found["draft"].cpu_per_cube == pytest.approx(0.03 / 120)
    met = {name: given.errors["meetings"] for name, given in found.items()}
    assert (met["standard"].error, met["standard"].half_width) == (0.01, 0.01)
    assert (met["reference"].error, met["reference"].half_width) == (0.0, 0.02)
    assert found["reference"].solver_iterations == 200


def test_an_interval_that_reaches_beyond_the_tolerance_does_not_count(measured, line4):
    found = choose(measured((0.05, 0.0951), (0.005, 0.0301), (0.001, 0.01))).presets
    assert found["draft"].step == line4.numerics.step
    assert found["standard"].step == line4.numerics.step / 2


def test_a_stopped_step_is_no_preset(measured, line4):
    assert choose(measured(None, (0.0, 0.0), (0.0, 0.0))).presets["draft"].step == line4.numerics.step
    found = measured((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
    coarsest, *others = sorted(found.numerical, key=lambda point: point.cost)
    stopped = replace(coarsest, stopped="stopped: spin")  # with structures alone: its cubes were compared
    assert choose(found).presets["draft"].step == 2 * line4.numerics.step
    assert choose(replace(found, numerical=(stopped, *others))).presets["draft"].step == line4.numerics.step


def test_sub_cycles_are_chosen_where_they_are_worth_it(measured, line4, tmp_path):
    """And no other knob is: fewer solver iterations are not what a tolerance is bought with."""
    bad = (0.2, 0.2)
    others = {
        ("drag sub-cycles", "2"): (0.04, 0.0, 0.0),
        ("step, 4 drag sub-cycles", "0.0105"): (0.03, 0.05, 0.05),
        ("solver iterations", "1"): (0.01, 0.0, 0.0),
    }
    presets = choose(measured(bad, bad, (0.0, 0.0), others=others))
    presets.write(tmp_path / "mine.toml")
    draft, standard = (load(f"{tmp_path / 'mine.toml'}:{name}", line4) for name in ("draft", "standard"))
    assert (draft.preset.step, draft.preset.sub_cycles) == (2 * line4.numerics.step, 4)
    assert (standard.preset.step, standard.preset.sub_cycles) == (line4.numerics.step, 2)
    assert standard.scene(line4) == line4.changed("drag", sub_cycles=2)
    assert "step 0.0105 tu with 4 drag sub-cycles, 50" in str(draft.expected(10, 1.0))
    assert presets.presets["reference"].sub_cycles == 1


def test_loads_that_are_shown_to_be_wrong_rule_a_step_out(measured, line4):
    """Their interval is wider than any tolerance; a preset says what was measured of them."""
    found = measured((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
    step = line4.numerics.step

    def with_loads(*loads):
        points = tuple(
            replace(point, changes=dict(point.changes) | {"loads": load})
            for point, load in zip(found.numerical, loads[::-1], strict=True)
        )
        return choose(replace(found, numerical=points)).presets

    wide, wrong = RelativeChange(0.05, 0.17), RelativeChange(0.30, 0.17)
    assert with_loads(wide, wide, wide)["draft"].step == 2 * step
    chosen = with_loads(wrong, wide, wide)["draft"]
    assert chosen.step == step
    assert (chosen.errors["loads"].error, chosen.errors["loads"].half_width) == (0.05, 0.17)


def test_too_short_a_measurement_is_told(measured):
    with pytest.raises(ValueError, match=r"no step is within 4% \(standard\).*best is within 6.0%"):
        choose(measured((0.05, 0.06), (0.05, 0.05), (0.05, 0.05)))


def test_they_survive_their_file(measured, line4, tmp_path):
    path = tmp_path / "mine.toml"
    presets = choose(measured((0.05, 0.02), (0.005, -0.04), (0.001, 0.01)))
    presets.write(path)
    assert load(f"{path}:draft", line4).preset == presets.presets["draft"]
    with pytest.raises(ValueError, match="there is no preset 'best'; scene line4 has draft, standard, reference"):
        load(f"{path}:best", line4)
    with pytest.raises(ValueError, match="never measured for scene line4"):
        load(f"{path}:draft", line4.changed("agitation", sigma=3.0))
    path.write_text(path.read_text().replace("errors.meetings", "errors.meeting"))
    with pytest.raises(ValueError, match="an error of 'meeting'; expected one of speed, meetings"):
        load(f"{path}:draft", line4)
    path.write_text("scene = 3")
    with pytest.raises(ValueError, match=r"mine\.toml"):
        load(f"{path}:draft", line4)


@pytest.mark.parametrize("name", ["line4", "t5", "pyramid45"])
def test_shipped_presets_know_their_scene(name):
    """Each is of a shipped scene as it stands, gets finer in order, and keeps its promise."""
    scene = Scene.load(name)
    found = [load(preset_name, scene).preset for preset_name in ("draft", "standard", "reference")]
    assert found[0].step >= found[1].step > found[2].step
    for given, tolerance in zip(found, preset.TOLERANCES.values(), strict=False):
        assert set(given.errors) == {"speed", "meetings"} | ({"loads"} if name != "pyramid45" else set())
        for quantity in ("speed", "meetings"):  # the sampling of the loads alone is above the tolerances
            expected = given.errors[quantity]
            assert abs(expected.error) + expected.half_width <= tolerance
    with pytest.raises(ValueError, match=f"never measured for scene {name} as it is"):
        load("draft", scene.changed("drag", sub_cycles=2))


def test_without_a_preset_the_scene_stays_as_it_is(line4):
    assert line4.fingerprint == "23fb51b4d2d7a3a65367dc77e3e86766b0835053d306e438ecbe47211168d8a5"
    chosen = load("reference", line4)
    assert chosen.scene(line4).without("bonding").effects == line4.without("bonding").effects
    run = RunSpec(line4, {"monomer": 2}, 1.0, 1, 0)
    assert RunSpec(chosen.scene(line4), {"monomer": 2}, 1.0, 1, 0).key != run.key


def test_a_preset_of_another_physics_says_so(measured, line4, tmp_path):
    presets = choose(measured((0.05, 0.02), (0.005, -0.04), (0.001, 0.01)))
    presets.write(tmp_path / "mine.toml")
    told = str(load(f"{tmp_path / 'mine.toml'}:draft", line4).expected(2, 1.0))
    assert "of the encounter rate +2.00 ± 1.00 %; expected cost" in told
    presets.replace(physics=0).write(tmp_path / "old.toml")
    told = str(load(f"{tmp_path / 'old.toml'}:draft", line4).expected(2, 1.0))
    assert f"± 1.00 % (measured by physics 0, these runs are {PHYSICS}); expected cost" in told


def simulate(tmp_path, *arguments):
    given = ["--duration", "0.2", "--runs-folder", str(tmp_path), *arguments]
    return CliRunner().invoke(main, ["simulate", "line4", "--cubes", "2", *given])


def test_a_run_tells_what_to_expect_and_keeps_it(tmp_path, line4):
    done = simulate(tmp_path, "--preset", "standard", "--runs", "2", "--json")
    assert done.exit_code == 0, done.output
    expected = load("standard", line4).preset
    assert f"preset standard: step {expected.step:g} tu" in done.stderr
    told = json.loads(done.stdout)["preset"]
    assert told["name"] == "standard"
    assert told["errors"]["speed"]["error"] == expected.errors["speed"].error
    assert told["expected_cpu_seconds"] == pytest.approx(expected.cpu_per_cube * 2 * 0.4)


def test_no_preset_no_word(tmp_path):
    done = simulate(tmp_path, "--json")
    assert json.loads(done.stdout)["preset"] is None
    assert not done.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--preset", "quick"], "there is no preset 'quick'"),
        (["--preset", "nowhere.toml:draft"], "does not exist"),
        (["--preset", "draft", "--without", "contact", "--without", "bonding", "--without", "breaking"], "contact"),
    ],
)
def test_bad_requests_make_no_run(tmp_path, arguments, message):
    done = simulate(tmp_path, *arguments)
    assert done.exit_code == 2
    assert message in done.output
    assert not list(tmp_path.glob("*.run"))


def test_a_scene_that_was_never_measured(tmp_path):
    file = tmp_path / "slow.toml"
    file.write_text((SCENES / "line4.toml").read_text().replace("sigma = 4.0", "sigma = 3.0"))
    given = ["simulate", str(file), "--cubes", "2", "--preset", "draft", "--runs-folder", str(tmp_path)]
    done = CliRunner().invoke(main, given)
    assert done.exit_code == 2
    assert "preset 'draft' was never measured for scene line4 as it is" in done.output
    assert "wellmixed trust accuracy mechanics" in done.output


def test_bonds_may_be_left_out(line4):
    assert load("draft", line4, ("bonding", "breaking")).name == "draft"
    with pytest.raises(ValueError, match="'fingerprint' is missing"):
        Presets(scene="line4")
