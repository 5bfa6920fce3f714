"""A trial of accuracy is kept beside runs, and never taken for one."""

import numpy as np
import pytest
from click.testing import CliRunner

from mechsim.accuracy.trial import AccuracyTrial
from mechsim.inspection.replay import replay
from mechsim.runs.contents import check_contents
from mechsim.runs.record import RunRecord, RunSpec
from mechsim.runs.store import RunStore, decode
from mechsim.scene import Scene
from wellmixed import main

FACTS = {"end": 1.0, "steps": 4, "block": 0.25, "channels": []}


@pytest.fixture
def stored(tmp_path):
    """A store with a trial, of made-up numbers; its file."""
    trial = AccuracyTrial(Scene.load("line4"), {"monomer": 4}, 1.0, 3, 0)
    store = RunStore(tmp_path / "runs")
    record = RunRecord(trial, "completed", {"speed": np.array([0.1, 0.2])}, FACTS, {"cpu_per_tu": 1.0})
    return store, trial, store.write(record)


def test_a_trial_is_read_as_what_it_is(stored):
    store, trial, _ = stored
    assert store.read(trial).arrays["speed"].tolist() == [0.1, 0.2]
    assert list(store.contents()) == []
    assert len(store.to_frames()[2]) == 0


def test_a_trial_is_no_run_to_replay_or_show(stored, tmp_path):
    _, _, path = stored
    with pytest.raises(ValueError, match="is a trial of the accuracy of mechanics, not a run"):
        replay(path)
    done = CliRunner().invoke(main, ["runs", "export", str(path.parent), "--out", str(tmp_path / "tables")])
    assert done.exit_code == 0, done.output


def test_a_run_cannot_hide_as_a_trial(stored):
    """Its arrays must be numbers, its facts those of a trial; and whoever reads runs refuses it all the same."""
    _, _, path = stored
    manifest, arrays = decode(path.read_bytes(), path)
    check_contents(manifest, arrays)
    with pytest.raises(ValueError, match="its array speed is of type"):
        check_contents(manifest, {"speed": np.array(["a"])})
    with pytest.raises(ValueError, match=r"'facts\.block' is missing"):
        check_contents(manifest | {"facts": {"steps": 1}}, arrays)
    with pytest.raises(ValueError, match="not a run"):
        RunSpec.of_inputs(manifest["inputs"], path)
