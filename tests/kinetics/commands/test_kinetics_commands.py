import json
import subprocess
import sys

import click
import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose

from kinetics.support.cli.options import NumbersCommand, plain
from wellmixed import main

LINE = ["predict", "line4", "--rates", "table3", "--cubes", "20"]
EXACT = [*LINE, "--method", "transient"]


def run(*arguments, code=0):
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    assert result.exit_code == code, result.output
    return result.output


def test_predict_as_json():
    data = json.loads(run(*EXACT, "--times", 10, 50, 100, "--json"))
    assert data["times"] == [10, 50, 100]
    assert data["species"] == ["monomer", "dimer", "trimer", "quadmer"]
    assert data["convention"]["combinations"] == "distinct"
    assert data["interval"] is None
    assert "no interval" in data["notes"][0]
    for row in data["mean"]:
        assert_allclose(row[0] + 2 * row[1] + 3 * row[2] + 4 * row[3], 20, rtol=1e-12)
    assert len(data["sd"]) == 3
    sampled = json.loads(run(*EXACT[:-1], "ssa", "--times", 10, 50, 100, "--json", "--runs", 400, "--seed", 1))
    assert (data["method_used"], sampled["method_used"]) == ("transient", "ssa")
    chosen = json.loads(run(*EXACT[:-1], "auto", "--times", 10, "--json", "--runs", 9))
    assert (chosen["method"], chosen["method_used"]) == ("auto", "auto (lockstep)")
    for t in range(3):
        for s in range(4):
            allowed = 4.9 * sampled["standard_error"][t][s] + 1e-9
            # Rare species: a sampled error of 0 means less than one in 400 runs.
            assert abs(sampled["mean"][t][s] - data["mean"][t][s]) < max(allowed, 0.02)


def test_predict_for_people(tmp_path):
    text = run(*EXACT, "--csv", tmp_path / "out.csv", "--plot", tmp_path / "out.png")
    assert text.startswith("time (tu)  monomer")
    assert "method transient; numerical error of the probabilities below" in text
    assert "no interval: these rates come without evidence" in text
    assert "breaks: first-order; tank 2 x 2 x 3" in text
    assert len(text.splitlines()) == 1 + 11 + 3
    assert (tmp_path / "out.csv").read_text(encoding="utf-8").startswith("time,species,mean,sd")
    assert (tmp_path / "out.png").read_bytes().startswith(b"\x89PNG")


def test_predict_with_measured_rates(tmp_path):
    text = run(*EXACT, "--times", 100)
    assert "[" not in text
    table = "\n".join(
        f'[channels."{name}"]\nrate = 1e-4\nways = 2\nevents = 20\nexposure = 2e5'
        for name in ("1+1->2", "1+2->3", "1+3->4", "2+2->4", "2->1+1", "3->1+2", "4->1+3", "4->2+2")
    )
    rates = tmp_path / "rates.toml"
    rates.write_text('[convention]\ncombinations = "distinct"\n' + table, encoding="utf-8")
    options = ["line4", "--rates", rates, "--initial", "monomer=10, dimer=5", "--posterior-draws", 10]
    data = json.loads(run("predict", *options, "--times", 100, "--json"))
    assert data["interval"]["low"][0][1] < data["mean"][0][1] < data["interval"]["high"][0][1]
    assert data["initial"] == {"monomer": 10, "dimer": 5, "trimer": 0, "quadmer": 0}
    assert "[95 % interval of the mean, from the rates]" in run("predict", *options, "--times", 100)
    assert "95 % interval of the mean" in run("passage", *options, "--species", "quadmer")
    picture = tmp_path / "bars.svg"
    more = ["--times", 50, 100, "--elasticity", "--elasticity-plot", picture]
    found = json.loads(run("predict", *options, *more, "--json"))["elasticities"]
    assert np.shape(found["value"]) == (8, 1, 4)
    assert found["exact"] is True
    assert_allclose(np.sum(found["share"], axis=0), 1.0)
    assert "<svg" in picture.read_text(encoding="utf-8")
    assert "elasticity of the mean at 100 tu" in run("predict", *options, *more)
    assert data["elasticities"] is None


def test_passage(tmp_path):
    options = ["passage", "line4", "--rates", "table3", "--cubes", 60, "--species", "quadmer"]
    data = json.loads(run(*options, "--json"))
    assert_allclose([data["mean"]["value"], data["sd"]["value"]], [95.44, 58.54], atol=0.005)
    assert list(data["quantiles"]) == ["0.025", "0.25", "0.5", "0.75", "0.975"]
    assert_allclose(data["curve"]["cdf"][-1], 0.99, rtol=1e-9)
    assert data["certain"] is True
    text = run(*options, "--plot", tmp_path / "out.svg")
    assert text.startswith("time until 1 quadmer: mean 95.44 tu, sd 58.54 tu\nquantiles (tu): 0.025: 20.16")
    assert "<svg" in (tmp_path / "out.svg").read_text(encoding="utf-8")


def test_passage_sensitivity():
    """Doubling all rates halves the time: elasticities add up to -1; of a probability, to 0."""
    options = ["passage", "line4", "--rates", "table3", "--cubes", 12, "--species", "quadmer", "--sensitivity"]
    data = json.loads(run(*options, "--json"))
    found = data["sensitivity"]
    assert found["answer"]["value"] == pytest.approx(data["mean"]["value"], rel=1e-10)
    assert found["is_bound"] is True
    assert sum(found["elasticity"]) == pytest.approx(-1.0, rel=1e-10)
    assert min(found["elasticity"]) < -0.1
    spread, quantiles = data["sensitivity_sd"], data["sensitivity_quantiles"]
    assert spread["answer"]["value"] == pytest.approx(data["sd"]["value"], rel=1e-10)
    assert list(quantiles) == ["0.025", "0.25", "0.5", "0.75", "0.975"]
    assert quantiles["0.5"]["answer"]["value"] == pytest.approx(data["quantiles"]["0.5"]["value"], rel=1e-10)
    for each in (spread, *quantiles.values()):
        assert sum(each["elasticity"]) == pytest.approx(-1.0, rel=1e-8)
    text = run(*options)
    assert "elasticity of the mean time to each rate constant" in text
    assert text.count("->") >= 16
    header = next(row for row in text.splitlines() if row.split()[:2] == ["parameter", "sd"])
    assert header.count("q = 0.") == 5
    never = json.loads(run(*options, "--copies", 4, "--json"))
    assert never["certain"] is False
    assert not any(never["sensitivity"]["value"])
    assert never["sensitivity_sd"] is None
    assert not never["sensitivity_quantiles"]


def test_passage_that_never_happens():
    options = ["passage", "line4", "--rates", "table3", "--cubes", 60, "--species", "quadmer"]
    data = json.loads(run(*options, "--copies", 16, "--json"))
    assert data["mean"]["value"] is None
    assert data["certain"] is False
    assert data["probability"]["value"] == data["probability"]["high"] == 0
    assert "not certain" in run(*options, "--copies", 16)


def test_derive():
    data = json.loads(run("rules", "derive", "line4", "--json"))
    assert len(data["species"]) == 4
    assert data["ways"] == [4, 4, 4, 4, 1, 2, 2, 1]
    assert "8 channels" in run("rules", "derive", "line4")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--rates", "table4", "--cubes", 60], "unknown rates 'table4'"),
        (["--rates", "table3"], "either --cubes 60 or --initial"),
        (["--rates", "table3", "--cubes", 60, "--initial", "monomer=3"], "either --cubes 60 or --initial"),
        (["--rates", "table3", "--cubes", 0], "0 is not in the range"),
        (["--rates", "table3", "--cubes", 1.5], "not a valid integer"),
        (["--rates", "table3", "--initial", "pentamer=3"], "unknown species 'pentamer'"),
        (["--rates", "table3", "--initial", "monomer=-3"], "expected species=count"),
        (["--rates", "table3", "--initial", "monomer=3,monomer=4"], "names 'monomer' twice"),
        (["--cubes", 60], "a rule book has no rates; name some"),
        (["--rates", "table3", "--cubes", 60, "--seed", -1], "-1 is not in the range"),
    ],
)
@pytest.mark.parametrize("command", [["predict", "line4"], ["passage", "line4", "--species", "quadmer"]])
def test_bad_start(command, arguments, message):
    assert message in run(*command, *arguments, code=2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--times", 50, 10], "times must rise; 10 comes after 50"),
        (["--times", -5], "times holds -5.0"),
        (["--times", "nan"], "times holds nan"),
        (["--times", 5, "--duration", 5], "either --duration or --times"),
        (["--duration", 0], "--duration 0; expected a positive number"),
        (["--duration", "inf"], "expected a positive number"),
        (["--method", "guess"], "'guess' is not one of 'ssa', 'lockstep'"),
        (["--runs", 0], "0 is not in the range"),
        (["--threads", 0], "0 is not in the range"),
        (["--plot", "out.xyz"], "out.xyz must end in .png, .pdf, .svg"),
        (["--csv", "no/such/folder/out.csv"], "the folder of no/such/folder/out.csv does not exist"),
        (["--html", "no/such/folder/out.html"], "the folder of no/such/folder/out.html does not exist"),
        (["--html", "."], ". is a folder, which is not written to"),
        (["--html", "/dev/null"], "/dev/null is a device or a pipe"),
        (["--html", "-"], "'-' names no file; give a path, or ./- for a file of that name"),
        (["--html", ""], "'' names no file"),
        (["--csv", "-"], "'-' names no file"),
        (["--plot", "-"], "- must end in .png, .pdf, .svg"),
    ],
)
def test_bad_questions(arguments, message):
    assert message in run(*(LINE if "--method" in arguments else EXACT), *arguments, code=2)


def test_bad_species():
    start = ["passage", "line4", "--rates", "table3", "--cubes", 60]
    assert "'octamer' is neither a species nor an observable; did you mean trimer" in run(
        *start, "--species", "octamer", code=2
    )
    assert "0 is not in the range" in run(*start, "--species", "quadmer", "--copies", 0, code=2)


def test_unknown_book():
    assert "line5" in run("rules", "derive", "line5", code=2)


@pytest.mark.parametrize(
    ("words", "numbers", "name"),
    [
        ("book --n 10 50 100", (10, 50, 100), "book"),
        ("--n 10 50 book", (10, 50), "book"),
        ("--n 1 2 --n 3 book --flag", (1, 2, 3), "book"),
        ("--n=1 2 book", (1, 2), "book"),
        ("--n -1 -2.5 book", (-1, -2.5), "book"),
        ("book", (), "book"),
        ("--n 1 --flag -- 7", (1,), "7"),
        ("--n 1 --other 2 book", (1,), "book"),
    ],
)
def test_several_numbers_in_one_go(words, numbers, name):
    @click.command(cls=NumbersCommand)
    @click.argument("book")
    @click.option("--n", type=float, multiple=True)
    @click.option("--other", type=int)
    @click.option("--flag", is_flag=True)
    def command(book, n, other, flag):
        click.echo(json.dumps([book, n]))

    result = CliRunner().invoke(command, words.split())
    assert result.exit_code == 0, result.output
    assert json.loads(result.output) == [name, list(numbers)]


def test_plain_data():
    assert plain({"a": (1.0, float("inf")), 2: float("nan")}) == {"a": [1.0, None], "2": None}


def test_importing_is_light():
    heavy = ("numba", "scipy", "pandas", "matplotlib")
    code = f"import sys, kinetics, kinetics.commands.predict; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_public_names():
    import kinetics

    assert all(getattr(kinetics, name) is not None for name in kinetics.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        kinetics.nonsense  # noqa: B018


def test_a_sampled_passage(tmp_path):
    """Around the exact one; runs that never come to it end at the horizon, or are truncated and say so."""
    network = tmp_path / "pair.rxn"
    network.write_text("A + B <-> AB, 0.1, 0.2\nA = 12\nB = 9\nobservable: free = A + B\n", encoding="utf-8")
    asked = ["passage", network, "--species", "AB", "--copies", 7]
    exact = json.loads(run(*asked, "--json"))
    found = json.loads(run(*asked, "--method", "ssa", "--runs", 2000, "--json"))
    assert found["mean"]["low"] < exact["mean"]["value"] < found["mean"]["high"]
    assert found["quantiles"]["0.5"]["low"] < exact["quantiles"]["0.5"]["value"] < found["quantiles"]["0.5"]["high"]
    assert (found["censored"], found["truncated"]) == (0, None)
    text = run("passage", network, "--species", "free", "--copies", 22, "--method", "ssa", "--horizon", 3)
    assert "held in none of 1000 runs until 3" in text
    refused = run(*asked, "--method", "ssa", "--truncate", 3, code=2)
    assert "--method ssa takes neither --truncate nor --sensitivity" in refused
    figure = tmp_path / "curve.svg"
    run(*asked, "--method", "ssa", "--runs", 20, "--plot", figure)
    assert "probability of not having been reached" in figure.read_text(encoding="utf-8")
