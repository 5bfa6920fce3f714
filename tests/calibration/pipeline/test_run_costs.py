"""What runs cost."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from calibration.pipeline import run_costs
from calibration.pipeline.run_costs import RunCosts
from mechsim.runs.record import RunRecord, RunSpec
from mechsim.runs.store import RunStore
from mechsim.scene import Scene


def spec_of(run=0, **changes):
    return replace(RunSpec(Scene.load("line4"), {"monomer": 6}, 10.0, 1, run), **changes)


NOTHING = {"initial": np.array([9]), "times": np.zeros(0), "channels": np.zeros(0, np.int64)}
FACTS = {"steps": 1, "species": ["monomer"], "channels": [], "open_channels": []}


@pytest.fixture
def tried(monkeypatch):
    """The runs of which a trial was made: 7 s a tu each."""
    seen = []

    def timed(spec):
        seen.append(spec)
        return SimpleNamespace(cpu_per_tu=7.0)

    monkeypatch.setattr(run_costs, "timed", timed)
    return seen


def test_stored_runs_alike_are_the_guide(tmp_path, tried):
    store = RunStore(tmp_path)
    for run, end, seconds in ((0, 10.0, 2.0), (1, 4.0, 1.5)):  # the second was stopped
        store.write(RunRecord(spec_of(run), "any", NOTHING, FACTS | {"end": end}, {"cpu_seconds": seconds}))
    assert RunCosts(tmp_path)(spec_of(duration=40.0, seed=2)) == pytest.approx(3.5 / 14 * 40)
    assert tried == []
    other = spec_of(composition={"monomer": 9})
    costs = RunCosts(tmp_path)
    assert costs(other) == costs(replace(other, run=5)) == 7.0 * other.duration
    assert tried == [other]  # once


def test_without_a_folder_there_is_a_trial(tmp_path, tried):
    spec = spec_of()
    assert RunCosts(tmp_path / "none")(spec) == 7.0 * spec.duration
    assert tried == [spec]
    assert not (tmp_path / "none").exists()
