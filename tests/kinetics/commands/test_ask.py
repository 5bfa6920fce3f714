"""`wellmixed ask`, from a book, a network file and explicit files."""

import json

import pytest
from click.testing import CliRunner

from kinetics import first_passage
from kinetics.commands.models import applied, described
from kinetics.formats import read
from kinetics.support.cli.options import ModelOptions
from wellmixed import main

LINE = ["ask", "line4", "--rates", "table3", "--cubes", "12"]
BIRTHS = """begin species
  1 X() 2
end species
begin reactions
  1 1 1,1 2.0
  2 1 0 1.0
end reactions
"""
WITHIN = "P=? [ F<=100 quadmer >= 1 ]"


def run(*arguments, code=0):
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    assert result.exit_code == code, result.output
    return result.output


def test_a_book_as_json():
    data = json.loads(run(*LINE, WITHIN, 'R{"dimer"}=? [ S ]', "--json"))
    known = first_passage(applied(*described(ModelOptions("line4", "table3", 12))), None, "quadmer")
    (answer, other) = data["answers"]
    assert answer["question"] == WITHIN
    assert answer["low"] <= answer["value"] <= answer["high"]
    assert abs(answer["value"] - float(known.cdf(100.0))) < 1e-13
    assert answer["kind"] == other["kind"] == "proven"
    assert data["states"] > 20


def test_text_and_files(tmp_path):
    text = run(*LINE, WITHIN, "P=? [ G<=100 quadmer = 0 ]", "--out", tmp_path / "line.tra")
    assert text.count("proven; uniformisation, backwards") == 2
    assert "wrote" in text
    (once,) = json.loads(run(*LINE, WITHIN, "--json"))["answers"]
    (again,) = json.loads(run("ask", tmp_path / "line.tra", WITHIN, "--json"))["answers"]
    assert abs(once["value"] - again["value"]) < 1e-13 * once["value"]
    run(*LINE, "--out", tmp_path / "line.sm")
    assert (tmp_path / "line.sm").read_text().startswith("ctmc\n")


def test_what_the_rates_do_to_the_answers(tmp_path):
    (answer,) = json.loads(run(*LINE, WITHIN, "--sensitivity", "--json"))["answers"]
    found = answer["sensitivity"]
    assert found["answer"]["value"] == pytest.approx(answer["value"], rel=1e-10)
    assert len(found["elasticity"]) == len(found["parameters"]) == 8
    assert max(found["elasticity"]) > 0.1
    (plain,) = json.loads(run(*LINE, WITHIN, "--json"))["answers"]
    assert plain["sensitivity"] is None
    assert "bounds proven; adjoint uniformisation" in run(*LINE, WITHIN, "--sensitivity")
    run(*LINE, "--out", tmp_path / "line.tra")
    assert "comes from no network" in run("ask", tmp_path / "line.tra", WITHIN, "--sensitivity", code=2)


def test_a_stopped_chain_has_fewer_states():
    asked = (*LINE, WITHIN, "E[dimer] @ 10", "--json")
    whole, part = (json.loads(run(*asked, *more)) for more in ((), ("--stop", "quadmer >= 1")))
    assert part["states"] < whole["states"]
    assert abs(part["answers"][0]["value"] - whole["answers"][0]["value"]) < 1e-12


def test_a_network_without_end(tmp_path):
    """Births beat deaths: by a time the limits are close, and one state more than is followed is known."""
    path = tmp_path / "births.net"
    path.write_text(BIRTHS, encoding="utf-8")
    question = "P=? [ F<=1 X >= 4 ]"
    assert "--truncate" in run("ask", path, question, "E[X] @ 1", "--max-states", "1000", code=2)
    (near,) = json.loads(run("ask", path, question, "--truncate", "X <= 80", "--json"))["answers"]
    (same,) = json.loads(run("ask", path, question, "--truncate", "80", "--json"))["answers"]
    assert near["low"] <= near["value"] <= near["high"] < near["low"] + 1e-9
    assert abs(near["value"] - same["value"]) < 1e-12
    known = first_passage(read(path), [2], "X", 4)
    assert near["low"] <= known.cdf(1.0) <= near["high"]
    text = run("ask", path, "P=? [ F X = 0 ]", "--truncate", "X <= 40")
    assert " to 1 (proven; linear equations)" in text
    data = json.loads(run("passage", path, "--species", "X", "--copies", "4", "--truncate", "X <= 80", "--json"))
    assert data["probability"]["low"] <= data["probability"]["high"] <= 1.0
    assert data["quantiles"]["0.025"]["low"] <= data["quantiles"]["0.025"]["high"]
    assert "reached with probability" in run("passage", path, "--species", "X", "--copies", "4", "--truncate", "3")
    run("passage", path, "--species", "X", "--truncate", "3", "--plot", tmp_path / "a.png", code=2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (LINE, "nothing to do; ask a question"),
        ([*LINE, "P=? [ F quadmer >= ]"], "cannot read"),
        ([*LINE, "quadmer >= 1"], "cannot read the question"),
        ([*LINE, "P=? [ F pentamer >= 1 ]"], "unknown name 'pentamer'"),
        ([*LINE, 'R{"quadmer"}=? [ F trimer >= 9 ]'], "no finite mean"),
        ([*LINE, 'R{"pentamer"}=? [ S ]'], "unknown reward 'pentamer'"),
        ([*LINE, WITHIN, "--max-states", "5"], "over 5 states"),
        ([*LINE, "--out", "chain.txt"], r"expected a name that ends in .tra, .sm, .prism"),
        (["ask", "none.tra", WITHIN], "does not exist"),
        (["ask", "none.tra", WITHIN, "--cubes", "3"], "leave out --cubes"),
        (["ask", "line4", WITHIN], "a rule book has no rates"),
    ],
)
def test_bad_input_exits_2(arguments, message):
    assert message in run(*arguments, code=2)


PUMP = """ctmc
const double wear;
module pump
  up : bool init true;
  hits : [0..2];
  [] up -> wear : (up'=false) & (hits'=min(hits+1, 2));
  [] !up -> 2 : (up'=true);
endmodule
label "down" = !up;
rewards "cost" [] up : 3; endrewards
"""


def test_a_model_in_prisms_language(tmp_path):
    for suffix in (".sm", ".prism", ".pm"):
        (tmp_path / f"pump{suffix}").write_text(PUMP, encoding="utf-8")
    asked = ('S=? [ "down" ]', "P=? [ F<=3 hits=2 & !up ]", 'R{"cost"}=? [ S ]')
    found = [
        json.loads(run("ask", tmp_path / f"pump{s}", "--set", "wear=0.5", *asked, "--json")) for s in (".sm", ".pm")
    ]
    values = [answer["value"] for answer in found[0]["answers"]]
    assert values == [answer["value"] for answer in found[1]["answers"]]
    assert values[0] == pytest.approx(0.5 / 2.5, rel=1e-12)
    assert values[2] == pytest.approx(3 * 0.5 * 2 / 2.5, rel=1e-12)
    assert found[0]["states"] == 6 - 1
    run("ask", tmp_path / "pump.prism", "--set", "wear=0.5", "--out", tmp_path / "pump.tra")
    (again,) = json.loads(run("ask", tmp_path / "pump.tra", asked[0], "--json"))["answers"]
    assert again["value"] == pytest.approx(values[0], rel=1e-12)


def test_what_is_written_as_a_model_is_read_back(tmp_path):
    run(*LINE, "--out", tmp_path / "line.sm")
    (once,) = json.loads(run(*LINE, WITHIN, "--json"))["answers"]
    again = json.loads(run("ask", tmp_path / "line.sm", WITHIN, "--json"))
    assert again["answers"][0]["value"] == pytest.approx(once["value"], rel=1e-12)
    assert again["answers"][0]["kind"] == "proven"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["S=? [ up ]"],
            "pump.sm, line 2, column 14: the constant 'wear' has no value; give it one, as in --set wear=1",
        ),
        (["S=? [ up ]", "--set", "waer=1"], "there is no constant 'waer' to be set; those without a value are wear"),
        (["S=? [ up ]", "--set", "wear=-1"], "line 6, column 12: a rate is negative (-1)"),
        (["S=? [ up ]", "--set", "wear=1", "--max-states", "3"], "over 3 states are reachable. Choose smaller ranges"),
        (["S=? [ up ]", "--set", "wear=1", "--stop", "up"], "is a whole model; leave out --stop"),
        (["S=? [ up ]", "--set", "wear=1", "--truncate", "9"], "is a whole model; leave out --truncate"),
        (["S=? [ dwon ]", "--set", "wear=1"], "unknown name 'dwon'; the variables are up, hits, the labels down, up,"),
        (["--set", "wear=1", "--out", "pump.sm"], "a chain without a network has no model"),
    ],
)
def test_models_and_options_that_do_not_fit(arguments, message, tmp_path):
    (tmp_path / "pump.sm").write_text(PUMP, encoding="utf-8")
    assert message in run("ask", tmp_path / "pump.sm", *arguments, code=2)
