"""What cannot be known is left out, a dash or a word in every output: no cell holds nan, inf or None."""

import re
from dataclasses import replace

import matplotlib.pyplot as plt
import pytest
from command_line import run_here

from calibration import (
    MassActionRates,
    compare_first_times,
    crossvalidate,
    diagnose,
    estimate,
    fit_rates,
)
from calibration.estimating.break_comparison import BreakComparison
from kinetics import (
    Chain,
    Model,
    Network,
    Rates,
    Sensitivity,
    committor,
    first_passage,
    predict,
    sample_path,
    simulate_statistics,
    stationary,
)
from kinetics import simulate as simulated

NOTHING = re.compile(r"(?<![\w.])(nan|NaN|-?inf|None)(?![\w])")
FILES = {
    "pair.rxn": "bind: A + B <-> AB, k1, 0.1\nk1 = 0.01\nA = 20\nB = 10\n",
    "still.rxn": "go: A -> B, 0\nnever: C -> B, 1\nA = 5\nC = 0\n",
    "one.csv": "run,time,channel,A,B,AB\na,0,start,3,3,0\na,1,bind\na,2,end\n",
    "none.csv": "run,time,channel,A,B,AB\na,0,start,3,3,1\na,2,end\n",
    "line.csv": "run,time,channel,monomer\na,0,start,8\na,1,1+1->2\na,9,end\n",
    "die.rxn": "die: A -> 0, 1\nA = 2\n",
    "looks.csv": "run,time,channel\nr,1,die\nr,1,die\n",
    "looks_runs.csv": "run,start,end,A,resolution\nr,0,1,2,1\n",
}
TABLE3 = ("line4", "--rates", "table3", "--cubes")
GROWN = ("rules", "grow", "line4", "--cubes", 4, "--join", 1e-4, "--duration", 5)
RANKED = ("rules", "rank", "line4", "--cubes", 4, "--runs", 2, "--join", 0, "--horizon", 10)
WATCHED = ("--out", "rates.toml", "--break-model", "auto")
COMMANDS = [
    ("predict", "pair.rxn", "--runs", 1, "--times", 1, "--csv", "out.csv", "--plot", "out.svg"),
    ("predict", "still.rxn", "--runs", 1, "--times", 0, "--csv", "out.csv"),
    ("predict", "still.rxn", "--method", "transient", "--times", 0, 1),
    ("predict", "still.rxn", "--accuracy", "1%", "--times", 1),
    ("predict", *TABLE3, 4, "--runs", 1, "--times", 0, "--elasticity", "--elasticity-plot", "out.svg"),
    ("passage", "still.rxn", "--species", "B", "--copies", 5, "--sensitivity"),
    ("passage", "pair.rxn", "--species", "B", "--copies", 5, "--sensitivity"),  # where it is
    ("passage", *TABLE3, 3, "--species", "quadmer"),
    ("passage", "pair.rxn", "--species", "AB", "--copies", 9, "--truncate", 3),
    ("ask", "still.rxn", "P=? [ F B>=5 ]", "S=? [ B>=5 ]", "E[B] @ 0", "--sensitivity"),
    ("scan", "pair.rxn", "--over", "k1=0,1", "--ask", "E[AB] @ 1", "--ask", "P=? [ F<=1 AB>=30 ]", "--csv", "out.csv"),
    (*GROWN, "--runs", 1, "--csv", "out.csv", "--plot", "out.svg"),
    (*RANKED, "--csv", "out.csv"),
    ("calibrate", "pair.rxn", "--events", "one.csv", *WATCHED, "--report", "out.html"),
    ("calibrate", "pair.rxn", "--events", "none.csv", *WATCHED, "--report", "out.html"),
    ("calibrate", "line4", "--events", "line.csv", *WATCHED, "--report", "out.html"),  # most is not measured
    ("calibrate", "pair.rxn", "--events", "none.csv", *WATCHED),
    ("calibrate", "die.rxn", "--events", "looks.csv", "--run-table", "looks_runs.csv", *WATCHED[:2]),
]


def found_in(text):
    """Lines that show what is no number; pictures within a page are no text."""
    shown = re.sub(r'src="data:[^"]*"', "", text)
    return [line for line in shown.splitlines() if NOTHING.search(line)]


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: " ".join(map(str, command[:3])))
def test_no_output_of_a_degenerate_command_holds_nan(command, tmp_path):
    for name, content in FILES.items():
        (tmp_path / name).write_text(content, encoding="utf-8")
    known = set(tmp_path.iterdir())
    done = run_here(*command, cwd=tmp_path)
    assert done.code == 0, done.err
    assert found_in(done.out) == []
    written = [path for path in set(tmp_path.iterdir()) - known if path.suffix in (".csv", ".html", ".svg")]
    assert [(path.name, found_in(path.read_text(encoding="utf-8"))) for path in written] == [
        (path.name, []) for path in written
    ]
    if "--report" not in command:  # of values that JSON has, by the schema: null where there is no number
        assert run_here(*command, "--json", cwd=tmp_path).json


def one_run_results():
    """Results of one run, of nothing that happens, and of what never ends."""
    pair = replace(
        Network.from_text("bind: A + B -> AB, 0.01\nsplit: AB -> A + B, 0.1"), conserved={"cubes": [1, 1, 2]}
    )
    start, end = {"A": 20, "B": 20}, 20.0
    yield simulated(pair, "ssa", start, [0.0, end], runs=1, seed=1)
    yield simulate_statistics(pair, "ssa", start, [0.0, end], runs=1, seed=1)
    short = [sample_path(pair, {"A": 2, "B": 2}, end=1e-3, seed=1)]
    paths = [sample_path(pair, start, end=end, seed=1)]
    for runs in (short, paths):
        yield from (estimate(runs), diagnose(runs), fit_rates(MassActionRates(), runs))
        yield BreakComparison.of(runs)
    rates = estimate(paths).rates()
    yield predict(Model(pair, start), rates, [end], runs=1, seed=1, draws=2)
    yield crossvalidate(rates, paths, times=[end], groups=40, most_groups=40)
    yield compare_first_times(pair, paths, "AB")
    still = Network.from_text("A -> B, 0")
    yield first_passage(still, {"A": 1}, "B")
    yield committor(still, {"A": 1}, {"b": lambda states: states[:, 1] == 1})
    yield stationary(still, {"A": 1})
    chain = Chain.of(still, {"A": 1})
    yield from (chain.passage("B == 1"), Sensitivity(chain).until("B == 1"), chain.committor({"b": "B == 1"}))
    part = Chain.of(Network.from_text("0 <-> A, 1, 0.1"), {"A": 0}, truncate="A < 5")
    yield from (part.passage("A == 9"), part.reward("A", until="A == 9"))


def test_no_result_shows_nan_in_text_or_html_or_picture():
    seen = 0
    for result in one_run_results():
        name, seen = type(result).__name__, seen + 1
        assert (name, found_in(str(result))) == (name, [])
        if hasattr(result, "_repr_html_"):
            assert (name, found_in(result._repr_html_())) == (name, [])
        if hasattr(result, "plot") and name not in ("BreakComparison", "CrossValidation"):
            axes = result.plot()
            assert (name, found_in("\n".join(text.get_text() for text in axes.figure.findobj(plt.Text)))) == (name, [])
            plt.close("all")
    assert seen > 20


@pytest.mark.parametrize("cell", ["nan", "a ± nan", "[0, inf]", "<td>None</td>", "1,nan,2", "-inf"])
def test_what_must_not_be_there_is_seen(cell):
    assert found_in(f"fine\n{cell}\n") == [cell]


@pytest.mark.parametrize("cell", ["finance", "none", "events_file none.csv", "infinite", "Info", "max-width: none"])
def test_what_may_be_there_is_not(cell):
    assert found_in(cell) == []


def test_rates_without_evidence_have_no_shares(tmp_path):
    out = run_here("predict", *TABLE3, 4, "--times", 10, "--elasticity", cwd=tmp_path).out
    assert "(nan %)" not in out
    assert "no shares of variance: the rates have no evidence" in out
    assert Rates.load("table3").has_evidence is False
