"""Break models and tanks on the command line."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from kinetics.rates import Rates
from tests.kinetics.commands.test_kinetics_commands import run

HAND = """
tank = [2.0, 2.0, 3.0]
[convention]
combinations = "distinct"
[breaks]
model = "collision-wall"
shape = { alpha = 1.3, wall = 20.0 }
[channels]
"1+1->2" = { rate = 2e-4, ways = 4 }
"1+2->3" = { rate = 2e-4, ways = 4 }
"1+3->4" = { rate = 2e-4, ways = 4 }
"2+2->4" = { rate = 2e-4, ways = 4 }
"2->1+1" = { rate = 1e-6, ways = 1 }
"3->1+2" = { rate = 1e-6, ways = 2 }
"4->1+3" = { rate = 1e-6, ways = 2 }
"4->2+2" = { rate = 1e-6, ways = 1 }
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "rates.toml"
    path.write_text(HAND, encoding="utf-8")
    return path


def predicted(file, *arguments):
    command = ["predict", "line4", "--rates", file, "--cubes", 8, "--method", "transient", "--times", 50, "--json"]
    return json.loads(run(*command, *arguments))


def test_predict_in_another_tank(file):
    """In eight times the volume joins are rarer; the tank of the rates itself changes nothing."""
    own, same, larger = (predicted(file, *tank) for tank in ((), ("--tank", 2, 2, 3), ("--tank", 4, 4, 6)))
    assert own["mean"] == same["mean"]
    assert own["tank"] == [2, 2, 3]
    assert larger["tank"] == [4, 4, 6]
    assert own["breaks"] == {"model": "collision-wall", "shape": {"alpha": 1.3, "wall": 20.0}}
    lost = [8 - made["mean"][0][0] for made in (own, larger)]
    assert lost[0] / lost[1] == pytest.approx(8, rel=0.4)
    text = run("predict", "line4", "--rates", file, "--cubes", 8, "--method", "transient", "--tank", 4, 4, 6)
    assert "breaks: collision-wall (alpha = 1.3, wall = 20); tank 4 x 4 x 6" in text


def test_passage_in_another_tank(file):
    """From two cubes one exponential wait, whose mean is 1 / (k N) times the volumes' ratio."""
    for tank, mean in (((), 1250.0), (("--tank", 2, 2, 6), 2500.0)):
        command = ["passage", "line4", "--rates", file, "--cubes", 2, "--species", "dimer", *tank]
        found = json.loads(run(*command, "--json"))
        assert found["mean"]["value"] == pytest.approx(mean, rel=1e-9)
        assert found["tank"] == [2, 2, 6 if tank else 3]
        assert f"tank 2 x 2 x {6 if tank else 3}" in run(*command)


def test_tanks_that_are_refused(file, tmp_path):
    command = ["predict", "line4", "--cubes", 8, "--method", "transient", "--times", 5]
    assert "expected three lengths above 0" in run(*command, "--rates", file, "--tank", 2, 0, 3, code=2)
    bare = tmp_path / "bare.toml"
    bare.write_text(HAND.replace("tank = [2.0, 2.0, 3.0]", ""), encoding="utf-8")
    assert "do not state the tank" in run(*command, "--rates", bare, "--tank", 2, 2, 6, code=2)
    assert json.loads(run(*command, "--rates", bare, "--json"))["tank"] is None
    assert "that the rates do not state" in run(*command, "--rates", bare)
    network = tmp_path / "line4.net"
    run("rules", "derive", "line4", "--rates", file, "--cubes", 8, "--out", network)
    for name in (["predict", network], ["passage", network, "--species", "dimer"]):
        assert "leave out --tank" in run(*name, "--tank", 2, 2, 6, code=2)
    exact = ["--method", "transient", "--times", 50, "--json"]
    assert_allclose(json.loads(run("predict", network, *exact))["mean"], predicted(file)["mean"], rtol=1e-9)


def test_derive_shows_partners():
    data = json.loads(run("rules", "derive", "line4", "--break-model", "collision-wall", "--json"))
    names = [channel["name"] for channel in data["channels"]]
    assert len(names) == 4 + 4 * 5
    assert "4->2+2 by wall" in names
    assert data["breaks"] == {"model": "collision-wall"}
    assert "dimer + quadmer -> 3 dimer" in run("rules", "derive", "line4", "--break-model", "collision")
    assert json.loads(run("rules", "derive", "line4", "--json"))["breaks"] == {"model": "first-order"}
    assert "the rates decide how bonds break" in run(
        "rules", "derive", "line4", "--break-model", "collision", "--out", "x.net", code=2
    )


def test_accuracy_and_ranking_take_any_break_model(file):
    command = [
        "trust",
        "accuracy",
        "kinetics",
        "line4",
        "--rates",
        file,
        "--cubes",
        4,
        "--duration",
        20,
        "--budget",
        0.01,
    ]
    out = json.loads(run(*command, "--json").splitlines()[-1])
    assert out["breaks"]["model"] == "collision-wall"
    ranked = json.loads(run("rules", "rank", "line4", "--rates", file, "--cubes", 8, "--horizon", 50, "--json"))
    exact = predicted(file)["mean"][0][3] / 2
    assert np.isclose(ranked["books"][0]["yield"]["value"], exact, rtol=1e-6)
    assert Rates.load(file).breaks.model == "collision-wall"
