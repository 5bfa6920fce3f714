"""`runs export --every`: what a camera sees of stored runs, as `calibrate --counts` reads it."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from calibration.observed.counts import read_counts
from kinetics.runs import RESTART
from mechsim.runs.record import RunRecord, RunSpec, book_of
from mechsim.runs.store import RunStore
from mechsim.scene import Scene
from wellmixed import main

SCENE = Scene.load("line4")
SPEC = RunSpec(SCENE, {"monomer": 6}, duration=2.0, seed=1, run=0)
NETWORK = book_of("line4")[1].network
JOIN, BREAK = (NETWORK.channels.index(name) for name in ("1+1->2", "2->1+1"))


def stored(store, spec, times=(), channels=(), outcome="completed"):
    """A run of these events, as if mechanics had made it."""
    arrays = {
        "initial": np.array([6, 0, 0, 0]),
        "times": np.array(times, dtype=float),
        "channels": np.array(channels, dtype=np.int64),
    }
    facts = {
        "end": spec.duration, "steps": 1, "species": list(NETWORK.species), "channels": list(NETWORK.channels),
        "open_channels": [True] * len(NETWORK.channels),
    }  # fmt: skip
    store.write(RunRecord(spec, outcome, arrays, facts))


@pytest.fixture
def store(tmp_path):
    found = RunStore(tmp_path / "runs")
    stored(found, SPEC, [0.6, 1.2, 1.5], [JOIN, JOIN, BREAK])
    stored(found, replace(SPEC, run=1), [1.7], [JOIN])
    stored(found, replace(SPEC, run=2), [1.7], [JOIN], outcome="stopped: too fast")
    return found


def exported(store, *words):
    return CliRunner().invoke(main, ["runs", "export", str(store.folder), *map(str, words)])


def test_counts_are_written_beside_the_other_tables(store, tmp_path):
    done = exported(store, "--out", tmp_path / "tables", "--every", 0.5, "--json")
    assert done.exit_code == 0, done.output
    names = [name.rpartition("/")[2] for name in json.loads(done.stdout)["written"]]
    assert names == [
        f"{name}.{kind}" for name in ("events", "runs", "settings", "counts") for kind in ("parquet", "csv")
    ]
    table = pd.read_csv(tmp_path / "tables" / "counts.csv")
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "tables" / "counts.parquet"), table)
    assert set(table["run"]) == {SPEC.key, replace(SPEC, run=1).key}  # the one that the guard stopped is left out
    mine = table[table["run"] == SPEC.key]
    assert mine["time"].tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert mine["monomer"].tolist() == [6, 6, 4, 4, 4]
    assert mine["dimer"].tolist() == [0, 0, 1, 1, 1]


def test_calibrate_reads_them(store, tmp_path):
    """Both files: a run starts with its first row, and all others are looks."""
    assert exported(store, "--out", tmp_path, "--every", 0.5).exit_code == 0
    for name in ("counts.csv", "counts.parquet"):
        data = read_counts(NETWORK, tmp_path / name)
        assert (len(data.runs), data.looks) == (2, 8)
        assert all(run.initial.tolist() == [[6, 0, 0, 0]] and run.times.size == 4 for run in data.runs)


def test_without_the_option_there_is_no_such_table(store, tmp_path):
    assert exported(store, "--out", tmp_path).exit_code == 0
    assert not list(tmp_path.glob("counts.*"))


@pytest.mark.parametrize(
    ("every", "said"),
    [
        ("0", "every = 0; expected a time between two looks in tu, finite and above 0"),
        ("-1", "every = -1; expected"),
        ("nan", "every = nan; expected"),
        ("2.5", "every = 2.5 tu is longer than run"),
        ("0.001", f"every = 0.001 tu is shorter than {SCENE.numerics.step:g} tu, the time within which"),
        ("ten", "'ten' is not a valid float"),
    ],
)
def test_bad_times_write_nothing(store, tmp_path, every, said):
    done = exported(store, "--out", tmp_path / "tables", "--every", every)
    assert done.exit_code == 2
    assert said in done.output
    assert not (tmp_path / "tables").exists()


@pytest.mark.parametrize(
    ("change", "events", "said"),
    [
        ({"restart": True}, ([0.6, 0.6], [JOIN, RESTART]), "is put back to its start after each event"),
        ({"restart": True}, ([], []), "is put back to its start after each event"),  # it chose to have none
        ({"until": "dimer"}, ([0.6], [JOIN]), "ends at its first dimer"),
    ],
)
def test_runs_that_an_event_ends(store, tmp_path, change, events, said):
    """Frames come too late for the event; these rates would be too low."""
    spec = replace(SPEC, run=9, **change)
    stored(store, spec, *events)
    done = exported(store, "--out", tmp_path / "tables", "--every", 0.5)
    assert done.exit_code == 2
    assert f"run {spec.key} {said}: looks at fixed times miss the event" in done.output
    assert "leave --every out" in done.output
    assert not (tmp_path / "tables").exists()
    assert exported(store, "--out", tmp_path / "tables").exit_code == 0  # as events they are good


def test_a_book_that_has_changed_since(store, tmp_path):
    manifest, arrays = next(store.contents())
    changed = [(manifest | {"inputs": manifest["inputs"] | {"rules": "0"}}, arrays)]
    from mechsim.runs.frames import counts_every

    with pytest.raises(ValueError, match=r"rule book line4 is no longer the one .* leave --every out"):
        counts_every(0.5, changed, store.folder)
    assert len(counts_every(0.5, changed, store.folder, rules="t5")) == 0
