"""the extrapolation read from real runs: exposures, the command, its figure and its refusals."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from mechsim.commands.loads import loads as command
from mechsim.inspection.tail_extrapolation import report
from mechsim.inspection.tail_extrapolation.loads import loads_of
from mechsim.inspection.tail_extrapolation.report import extrapolate
from mechsim.runs.record import RunSpec, execute
from mechsim.runs.store import RunStore

MIXED = {"quadmer": 12, "trimer": 6, "dimer": 6, "monomer": 6}


@pytest.fixture(scope="module")
def records(line4):
    scene = line4.changed("breaking", threshold=0.003, log_above=0.0015)
    return [execute(RunSpec(scene, MIXED, 12.0, 3, run)) for run in range(5)]


@pytest.fixture(scope="module")
def folder(records, tmp_path_factory):
    store = RunStore(tmp_path_factory.mktemp("runs"))
    for record in records:
        store.write(record)
    return store.folder


def test_exposures_are_integrals_over_the_path(records):
    record = records[0]
    found = loads_of([record])
    middles = (np.arange(40_000) + 0.5) * record.path.end / 40_000
    counts = record.path.at(middles).astype(float)
    step = record.path.end / 40_000
    pairs = (counts.T @ counts - np.diag(counts.sum(axis=0))) * step / 12.0
    np.testing.assert_allclose(found.alone, counts.sum(axis=0) * step, rtol=2e-3)
    np.testing.assert_allclose(found.pairs, pairs, rtol=5e-3)
    np.testing.assert_allclose(found.walls, found.alone * 32 / 12)  # the tank is 2 by 2 by 3
    assert np.abs(pairs + np.diag(counts.sum(axis=0)) * step / 12 - found.pairs).max() > 0.01 * pairs.max()  # control


def test_runs_are_pooled(records):
    whole, parts = loads_of(records), [loads_of([record]) for record in records]
    assert len(whole.value) == sum(len(part.value) for part in parts)
    np.testing.assert_allclose(whole.pairs, sum(part.pairs for part in parts))
    channels = np.concatenate([record.path.channels for record in records])
    is_break = np.array(["->" in c and "+" not in c.split("->")[0] for c in records[0].facts["channels"]])
    assert whole.breaks.sum() == is_break[channels].sum() > 20


def test_the_gauge_of_all_runs(records):
    found = extrapolate(records)
    assert {row.source for row in found.breaks} >= {"all", "bodies"}
    assert {row.threshold for row in found.breaks} == {0.003}
    by_all = {row.species: row for row in found.breaks if row.source == "all"}
    quadmers = found.loads.breaks[list(found.loads.species).index("quadmer")]
    row = by_all["quadmer"]
    expected, error = row.rate * row.exposure, (row.high - row.low) / 4 * row.exposure
    assert abs(quadmers - expected) < 4 * np.hypot(error, np.sqrt(expected))
    assert extrapolate(records[:4]).checks == ()  # too few to hold some out
    assert found.cpu_seconds == sum(record.cost["cpu_seconds"] for record in records)


def test_the_check_keeps_the_mix_of_tanks(records, monkeypatch):
    """Every fifth run of each tank: both parts hold both kinds, where every fifth of all would take one kind alone."""
    seen = {}
    monkeypatch.setattr(report, "check", lambda fitted, counted, runs: seen.update(parts=(fitted, counted, runs)) or [])
    kinds = iter(["60 cubes", "120 cubes", "120 cubes", "120 cubes", "120 cubes"] * 2)
    monkeypatch.setattr(report, "_tank_of", lambda record: next(kinds))
    extrapolate([*records, *records])
    fitted, counted, runs = seen["parts"]
    assert runs == 7  # one of two at 60 cubes and two of eight at 120 are in the extrapolation
    np.testing.assert_allclose(fitted.alone + counted.alone, 2 * loads_of(records).alone)


def test_the_command(folder, tmp_path):
    figure = tmp_path / "tails.svg"
    done = CliRunner().invoke(command, [str(folder), "--at", "0.003", "--at", "0.004", "--plot", str(figure), "--json"])
    assert done.exit_code == 0, done.output
    told = json.loads(done.output)
    assert (told["runs"], told["left_out"], told["threshold"]) == (5, 0, 0.003)
    assert {row["threshold"] for row in told["breaks"]} == {0.003, 0.004}
    assert all(row["low"] <= row["rate"] <= row["high"] for row in told["breaks"])
    assert figure.read_text().startswith("<?xml")
    one = next(folder.glob("*.run"))
    table = CliRunner().invoke(command, [str(one)])
    assert table.exit_code == 0, table.output
    for heading in ("hits above 0.0015 in 1 runs", "exponent of the partner's size", "rates of breaks"):
        assert heading in table.output


def test_what_cannot_be_gauged_is_refused(records, tmp_path):
    spec = replace(records[0].spec, scene=records[0].spec.scene.changed("breaking", log_above=None), duration=1.0)
    bare = execute(spec)
    RunStore(tmp_path).write(bare)
    done = CliRunner().invoke(command, [str(tmp_path)])
    assert "none of 1 runs has a log" in str(done.exception)
    with pytest.raises(ValueError, match="no log_above"):
        loads_of([bare])
    with pytest.raises(ValueError, match="stopped"):
        loads_of([replace(records[0], outcome="stopped: NaN")])
    with pytest.raises(ValueError, match="expected at least one"):
        loads_of([])
    other = replace(records[0].spec, scene=records[0].spec.scene.changed("breaking", log_above=0.002), duration=1.0)
    with pytest.raises(ValueError, match="one physics"):
        loads_of([records[0], execute(other)])
    with pytest.raises(ValueError, match="expected one above"):
        extrapolate(records, [0.001])
