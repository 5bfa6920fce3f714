"""Logs of real runs: hits as the estimates read them, partners of breaks, and the command that tests crowding."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from calibration.commands.crowding import crowding as command
from calibration.pipeline.logged_hits import bodies_in, logged_hits, path_of
from kinetics.runs import BY_SEVERAL, BY_WALL, NO_BREAK
from mechsim.runs.record import RunSpec, execute
from mechsim.runs.store import RunStore
from mechsim.scene import Scene

MIXED = {"quadmer": 12, "trimer": 6, "dimer": 6, "monomer": 6}
FEW = {"quadmer": 4, "trimer": 2, "dimer": 2, "monomer": 2}


@pytest.fixture(scope="module")
def records():
    scene = Scene.load("line4").changed("breaking", threshold=0.003, log_above=0.0015)
    return [execute(RunSpec(scene, MIXED if run < 4 else FEW, 12.0, 3, run)) for run in range(6)]


@pytest.fixture(scope="module")
def folder(records, tmp_path_factory):
    store = RunStore(tmp_path_factory.mktemp("runs"))
    for record in records:
        store.write(record)
    return store.folder


def test_hits_of_a_record(records):
    found = logged_hits(records)
    assert [run.tank for run in found] == ["84 cubes in 2 x 2 x 3"] * 4 + ["28 cubes in 2 x 2 x 3"] * 2
    for run, record in zip(found, records, strict=True):
        arrays = record.arrays
        assert run.load.min() > run.log_above == 0.0015
        assert (run.struck > 0).all()  # a single cube has no bond
        assert run.shared.sum() == (arrays["load_flags"] & 1).sum()
        assert ((run.partner == BY_WALL) == (arrays["load_partner"] < 0)).all()
    np.testing.assert_allclose(bodies_in(records[0]).radius, 0.15 * (2 + np.arange(1, 5)) / 4)


def test_a_break_by_several_has_the_partner_of_the_largest_impulse(records):
    """Records that name no partner get the one that the log names, which is that of the untouched record."""
    named = 0
    for record in records:
        known = record.arrays["partners"]
        hidden = np.where(known == NO_BREAK, known, BY_SEVERAL)
        found = path_of(replace(record, arrays=record.arrays | {"partners": hidden})).partners
        right = (known >= 0) | (known == BY_WALL)
        named += (found == known)[right].sum()
        assert ((found == known) | (found == BY_SEVERAL))[right].all()  # two breaks at one blow may leave two partners
        bare = {key: values for key, values in record.arrays.items() if not key.startswith("load")}
        unnamed = path_of(replace(record, arrays=bare | {"partners": hidden})).partners
        assert (unnamed == hidden).all()  # control: nothing was logged
    assert named > 30


def test_the_command(folder, tmp_path):
    figure, csv = tmp_path / "tanks.svg", tmp_path / "tanks.csv"
    words = [str(folder), "--above", "0.002", "--plot", str(figure), "--csv", str(csv), "--json"]
    done = CliRunner().invoke(command, words)
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert told["runs"] == 6
    assert {fit["above"] for fit in told["fits"]} == {0.0, 0.0015, 0.002, 0.003}
    for fit in told["fits"]:
        assert sum(row["events"] for row in fit["tanks"]) == fit["events"]
        assert sum(row["expected"] for row in fit["tanks"]) == pytest.approx(fit["events"], rel=1e-6)
        assert fit["freedom"] in (0, 1)
    assert figure.read_text().startswith("<?xml")
    assert len(pd.read_csv(csv)) == 2 * len(told["fits"])
    table = CliRunner().invoke(command, [str(next(folder.glob("*.run")))])
    assert table.exit_code == 0, table.output
    assert "events per exposure in 1 runs in 1 kinds of tank" in table.output


def test_what_cannot_be_compared_is_refused(records, folder, tmp_path):
    scene = records[0].spec.scene
    bare = execute(replace(records[0].spec, scene=scene.changed("breaking", log_above=None), duration=1.0))
    RunStore(tmp_path).write(bare)
    assert "none of 1 runs has a log of hits" in str(CliRunner().invoke(command, [str(tmp_path)]).exception)
    assert "the logs begin at 0.0015" in str(CliRunner().invoke(command, [str(folder), "--above", "0.001"]).exception)
    other = execute(replace(records[0].spec, scene=scene.changed("contact", restitution=0.5), duration=1.0))
    with pytest.raises(ValueError, match="one physics"):
        logged_hits([records[0], other])
