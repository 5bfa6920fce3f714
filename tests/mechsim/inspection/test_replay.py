"""A run that the guard stopped can be made again from its file alone, and its end looked at."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from mechsim.commands.replay import replay as command
from mechsim.inspection.replay import replay
from mechsim.runs.record import PHYSICS, RunSpec, execute
from mechsim.runs.store import RunStore


@pytest.fixture(scope="module")
def stopped(line4, tmp_path_factory):
    """A run stopped by the guard, and its file."""
    wild = line4.changed("agitation", sigma=7.5)
    record = execute(RunSpec(wild, {"monomer": 12, "dimer": 2}, 5.0, seed=4, run=0))
    assert record.outcome.startswith("stopped: spin beyond what a step resolves: body")
    assert record.facts["steps"] > 30
    return record, RunStore(tmp_path_factory.mktemp("runs")).write(record)


def test_the_file_is_a_bundle_that_replays_the_run(stopped):
    record, file = stopped
    again = replay(file, last=10)
    assert again.is_same
    assert again.record.outcome == record.outcome
    assert again.record.spec == record.spec
    arrays, step = again.record.arrays, record.spec.scene.numerics.step
    assert arrays["pose_times"] == pytest.approx(record.path.end - step * np.arange(10, -1, -1))
    assert arrays["centres"].shape == (11, 16, 3)
    np.testing.assert_array_equal(arrays["times"], record.arrays["times"])
    assert again.rows()[-1]["time"] == record.path.end
    slot = arrays["slots"][-1, again.worst]
    assert f"body {slot} " in record.outcome  # the cube to look at is of the body the guard named
    assert again.spin[-1, again.worst] * step > 0.7
    assert f"spin {again.spin[-1, again.worst]:.3g}" in record.outcome


def test_a_completed_run_is_replayed_too(line4, tmp_path):
    record = execute(RunSpec(line4, {"monomer": 6}, 0.1, seed=3, run=2, poses=0.05))
    again = replay(RunStore(tmp_path).write(record), last=1000)
    assert again.is_same
    assert len(again.speed) == record.facts["steps"] + 1
    assert again.speed[0].max() == 0.0


RESULTS = Path(__file__).parents[3] / "results" / "line4" / "runs"
NONE_STORED = "no stored run was made with this physics and these versions of the engine and of numpy"


def of_this_physics():
    """Stored runs that can be made again here; the folder may hold runs of more than one physics."""
    for manifest, arrays in RunStore(RESULTS).contents():
        spec = replace(RunSpec.of_inputs(manifest["inputs"], RESULTS), physics=PHYSICS)
        if spec.key == manifest["key"]:
            yield manifest, arrays


def test_a_stored_run_of_the_study_begins_as_it_did():
    """Bit for bit, whatever has been made faster since: the first events of runs from 60 and from 120 single cubes."""
    stored = list(of_this_physics())
    for n in (60, 120):
        runs = [run for run in stored if run[0]["inputs"]["composition"] == {"monomer": n} and len(run[1]["times"]) > 1]
        if not runs:
            pytest.skip(NONE_STORED)
        manifest, arrays = min(runs, key=lambda run: run[1]["times"][1])
        spec = RunSpec.of_inputs(manifest["inputs"], RESULTS)
        begun = execute(replace(spec, duration=float(arrays["times"][1]) + 0.1)).arrays  # of the same random streams
        assert len(begun["times"]) >= 2
        for name in ("times", "channels"):
            np.testing.assert_array_equal(begun[name], arrays[name][: len(begun[name])])


@pytest.mark.validate
@pytest.mark.timeout(7200)
def test_a_stored_run_of_the_study_comes_out_the_same():
    """From its start to its end."""
    manifest, _ = next(of_this_physics(), (None, None))
    if manifest is None:
        pytest.skip(NONE_STORED)
    assert replay(RESULTS / f"{manifest['key']}.run").is_same


def test_another_outcome_is_told(stopped, tmp_path):
    record, _ = stopped
    other = replace(record, outcome="completed")
    file = RunStore(tmp_path).write(other)
    assert not replay(file).is_same
    said = CliRunner().invoke(command, [str(file)])
    assert said.exit_code == 4
    assert "NOT identical" in said.output


def test_what_cannot_be_replayed_is_refused(stopped, tmp_path, monkeypatch):
    _, file = stopped
    cut = tmp_path / "cut.run"
    cut.write_bytes(file.read_bytes()[:-1])
    with pytest.raises(ValueError, match=r"cut\.run is not a valid run file"):
        replay(cut)
    with pytest.raises(ValueError, match="last = 0; expected 1 step or more"):
        replay(file, last=0)
    monkeypatch.setattr("mechsim.runs.record.PHYSICS", 1000)
    with pytest.raises(
        ValueError, match=r"cannot be made again here: physics differ; it was made with .*'wellmixed': \d,"
    ):
        replay(file)


def test_inputs_name_a_run_fully(stopped):
    spec = stopped[0].spec
    for other in (spec, replace(spec, restart=True, poses=0.5), replace(spec, until="quadmer")):
        again = RunSpec.of_inputs(json.loads(json.dumps(other.inputs, sort_keys=True)), "a.run")
        assert again.key == other.key
        assert list(again.composition) == ["monomer", "dimer"]


def test_the_command(stopped, tmp_path):
    _, file = stopped
    out = tmp_path / "end.npz"
    told = CliRunner().invoke(
        command, [str(file), "--last", "5", "--poses", str(out), "--json"], catch_exceptions=False
    )
    assert told.exit_code == 0
    data = json.loads(told.output)
    assert data["is_same"]
    assert len(data["last"]) == 6
    with np.load(out) as arrays:
        assert arrays["centres"].shape == (6, 16, 3)
        assert arrays["speed"].shape == (6, 16)
    text = CliRunner().invoke(command, [str(file)], catch_exceptions=False)
    assert "identical, bit for bit" in text.output
    assert CliRunner().invoke(command, [str(file), "--poses", "end.txt"]).exit_code != 0
