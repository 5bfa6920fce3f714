"""Tables of counts and of snapshots as panel data, their fit, and the command that does both."""

import re
import tomllib

import numpy as np
import pytest

from calibration.estimating.model_fit import fit_model
from calibration.observed.counts import read_counts, read_snapshots
from kinetics import Model, Network, simulate
from kinetics.markov.panels import PanelData, PanelLikelihood, PanelRun
from kinetics.markov.panels.observations import Detected
from tests.kinetics.markov.panels.test_published import EYAM

EPIDEMIC = "infect: S + I -> 2 I, beta\nremove: I -> R, alpha\nbeta = 0.02\nalpha = 3\nS = 254\nI = 7\n"
TABLE = "time,S,I\n" + "".join(f"{time},{s},{i}\n" for time, s, i in EYAM)


def epidemic():
    return Model.of(Network.from_text("infect: S + I -> 2 I, beta\nremove: I -> R, alpha", beta=0.02, alpha=3.0))


def written(folder, text, name="counts.csv"):
    (folder / name).write_text(text)
    return folder / name


def test_a_table_is_what_it_says(tmp_path):
    text = "run,time,S,I,event\na,0,5,1,\na,0.5,4,,infect\na,2,4,2,\nb,1,3,2,\nb,4,2,3,infect; remove\n"
    data = read_counts(epidemic(), written(tmp_path, text))
    first, second = data.runs
    assert first.initial.tolist() == [[5, 1, 0]]
    assert (first.start, first.times.tolist(), first.fired.tolist()) == (0.0, [0.5, 2.0], [0, -1])
    np.testing.assert_array_equal(first.seen, [[4, np.nan], [4, 2]])
    assert (second.start, second.times.tolist(), second.fired.tolist()) == (1.0, [4.0], [1])
    assert list(data.events) == [("infect",), ("infect", "remove")]
    assert first.where == ["counts.csv, line 3, run a", "counts.csv, line 4, run a"]


def test_long_tables_are_the_same(tmp_path):
    wide = read_counts(epidemic(), written(tmp_path, TABLE))
    rows = "".join(f"{t},S,{s}\n{t},I,{i}\n" for t, s, i in EYAM)
    long = read_counts(epidemic(), written(tmp_path, "time,species,count\n" + rows, "long.csv"))
    assert list(long.columns) == list(wide.columns)
    np.testing.assert_array_equal(long.runs[0].seen, wide.runs[0].seen)
    np.testing.assert_array_equal(long.runs[0].times, wide.runs[0].times)


def test_parquet_is_read_too(tmp_path):
    pd = pytest.importorskip("pandas")
    pd.DataFrame(EYAM, columns=["time", "S", "I"]).to_parquet(tmp_path / "counts.parquet")
    data = read_counts(epidemic(), tmp_path / "counts.parquet")
    np.testing.assert_array_equal(data.runs[0].seen, read_counts(epidemic(), written(tmp_path, TABLE)).runs[0].seen)


def test_an_observable_or_a_doubtful_column_leaves_the_start_to_the_model(tmp_path):
    model = Model(epidemic().network, {"S": 9, "I": 1}, {"ill": {"I": 1, "R": 1}})
    data = read_counts(model, written(tmp_path, "time,ill\n0,1\n1,3\n"))
    assert data.runs[0].initial.tolist() == [[9, 1, 0]]
    assert data.runs[0].times.tolist() == [0.0, 1.0]
    assert data.columns["ill"] == {"I": 1, "R": 1}
    seen = read_counts(model, written(tmp_path, "time,I\n0,1\n1,2\n"), {"I": Detected(0.5)})
    assert seen.runs[0].times.tolist() == [0.0, 1.0]


def test_cells_may_be_intervals(tmp_path):
    text = "run,time,S,I\na,0,5,1\na,1,3..5,<=2\na,2,4,>=2\nb,0,<=5,1\nb,1,4,2..2\n"
    data = read_counts(epidemic().with_counts({"S": 5, "I": 1}), written(tmp_path, text))
    first, second = data.runs
    assert first.times.tolist() == [1.0, 2.0]
    assert (second.start, second.times.tolist()) == (0.0, [0.0, 1.0])  # its first row does not tell the start
    how = data.observations
    for number, column, limits in (
        (first.seen[0, 0], "S", (3, 5)),
        (first.seen[0, 1], "I", (0, 2)),
        (first.seen[1, 1], "I", (2, np.inf)),
        (second.seen[0, 0], "S", (0, 5)),
        (second.seen[1, 1], "I", (2, 2)),
        (first.seen[1, 0], "S", (4, 4)),
    ):
        assert how[column].support(number) == limits
        assert limits[0] <= number <= limits[1]


@pytest.mark.parametrize(
    ("cell", "observed", "said"),
    [
        ("3..x", {}, "counts.csv, line 3: S = 3..x; expected a finite number"),
        ("5..3", {}, "counts.csv, line 3: S = 5..3; expected whole numbers of at least 0 that rise"),
        ("-1..3", {}, "S = -1..3; expected whole"),
        ("1.5..3", {}, "S = 1.5..3; expected whole"),
        (">=nan", {}, "S = >=nan; expected whole"),
        ("1..3", {"S": Detected(0.5)}, "S = 1..3; an interval of true counts, in a column that is detected"),
        (">=7", {}, "counts.csv, line 3: S 7 or more cannot be reached from S 5, I 1"),
    ],
)
def test_intervals_that_cannot_be_are_refused(tmp_path, cell, observed, said):
    model = epidemic().with_counts({"S": 5, "I": 1})
    with pytest.raises(ValueError, match=re.escape(said)):
        PanelLikelihood(model, read_counts(model, written(tmp_path, f"time,S\n0,5\n1,{cell}\n"), observed)).value()


STARTS = "I,probability\n1,0.75\n2,0.25\n"


def test_runs_may_start_in_one_of_several_states(tmp_path):
    model = epidemic().with_counts({"S": 5, "I": 1})
    starts = written(tmp_path, STARTS, "starts.csv")
    data = read_counts(model, written(tmp_path, "time,S\n0,5\n1,4\n"), initial=starts)
    assert data.runs[0].initial.tolist() == [[5, 1, 0], [5, 2, 0]]
    assert data.runs[0].chances.tolist() == [0.75, 0.25]
    assert data.runs[0].times.tolist() == [0.0, 1.0]  # the first row is a look
    copies = read_snapshots(model, written(tmp_path, "time,S\n1,4\n2,3\n"), initial=starts)
    assert all(run.chances.tolist() == [0.75, 0.25] for run in copies.runs)
    alone = [read_snapshots(model.with_counts({"S": 5, "I": i}), tmp_path / "counts.csv") for i in (1, 2)]
    each = [PanelLikelihood(model, PanelData(a.columns, a.runs[:1])).value().value for a in alone]
    mixed = PanelLikelihood(model, PanelData(copies.columns, copies.runs[:1])).value().value
    assert mixed == pytest.approx(np.log(0.75 * np.exp(each[0]) + 0.25 * np.exp(each[1])), abs=1e-12)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("I\n1\n", "starts.csv has no column probability"),
        ("Z,probability\n1,1\n", "starts.csv: column 'Z' is no species; expected one of S, I, R"),
        ("I,probability\n1,0.5\n2,0.4\n", "the probabilities sum to 0.9; expected 1"),
        ("I,probability\n1,1.5\n2,-0.5\n", "line 3: a probability below 0"),
        ("I,probability\n1,0.5\n1,0.5\n", "line 3: a state that stands above, too"),
        ("I,probability\n,1\n", "line 2: I is empty"),
        ("I,probability\n0.5,1\n", "line 2: 0.5 copies of I"),
    ],
)
def test_starts_that_cannot_be_are_refused(tmp_path, text, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        read_counts(epidemic(), written(tmp_path, TABLE), initial=written(tmp_path, text, "starts.csv"))


def test_snapshots_start_as_the_model_does(tmp_path):
    model = epidemic().with_counts({"S": 9, "I": 1})
    data = read_snapshots(model, written(tmp_path, "time,I\n1,2\n0.5,1\n1,0\n"))
    assert [run.times.tolist() for run in data.runs] == [[1.0], [0.5], [1.0]]
    assert all(run.initial.tolist() == [[9, 1, 0]] for run in data.runs)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,Z\n0,1\n1,2\n", "column 'Z' is neither one of run, time, event nor a species"),
        ("S,I\n1,2\n", "has no column time"),
        ("time\n0\n1\n", "counts nothing"),
        ("time,S\n0,5\n0,4\n", "counts.csv, line 3: a second row at time 0"),
        ("time,S\n0,5\n2,4\n1,3\n", "counts.csv, line 4: time 1 does not come after 2"),
        ("time,S\n0,5.5\n1,4\n", "counts.csv, line 2: 5.5 copies of S; expected a whole number"),
        ("time,S\n0,5\n1,4.5\n", "counts.csv, line 3, column S: 4.5 is no count"),
        ("time,S\n0,5\n1,-1\n", "counts.csv, line 3, column S: -1 is no count"),
        ("time,S\n0,5\n1,x\n", "counts.csv, line 3: S = x; expected a finite number"),
        ("time,S\n0,5\n1,inf\n", "S = inf; expected a finite number"),
        ("time,S\n0,5\n,4\n", "time is empty"),
        ("time,S\n0,5\n", "every run has one row, its start"),
        ("time,S,event\n0,5,infect\n1,4,\n", "line 2: an event in the first row of a run"),
        ("time,S,event\n0,5,\n1,4,infekt\n", "unknown channel 'infekt'; did you mean infect?"),
        ("time,species,count\n0,S,5\n0,S,4\n", "line 3: a second count of S at time 0"),
        ("time,species,count,I\n0,S,5,1\n", "column 'I' in a long table"),
    ],
)
def test_tables_that_cannot_be_are_refused(tmp_path, text, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        read_counts(epidemic(), written(tmp_path, text))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("run,time,I\na,1,2\n", "a column 'run' in snapshots"),
        ("time,I\n-1,2\n", "line 2: a snapshot before time 0"),
    ],
)
def test_snapshots_that_cannot_be_are_refused(tmp_path, text, said):
    with pytest.raises(ValueError, match=said):
        read_snapshots(epidemic(), written(tmp_path, text))


def test_events_that_are_recorded_do_not_happen_between_rows(tmp_path):
    """One infection is recorded, so all are: the second row cannot be."""
    text = "time,S,I,event\n0,5,1,\n0.5,4,2,infect\n2,2,4,\n"
    data = read_counts(epidemic(), written(tmp_path, text))
    with pytest.raises(ValueError, match="so that between two looks there was no infect"):
        PanelLikelihood(epidemic(), data).value()


def test_a_species_named_like_a_column_is_refused(tmp_path):
    with pytest.raises(ValueError, match="the network calls something 'time'"):
        read_counts(Network.from_text("time -> B, 1"), written(tmp_path, "time,B\n0,1\n1,2\n"))


def test_eyam_to_all_digits_that_are_given(tmp_path):
    """Maximum likelihood 3.20384, .0196018 with log-likelihood -40.517992 (an own exact calculation)."""
    found = fit_model(PanelLikelihood(epidemic(), read_counts(epidemic(), written(tmp_path, TABLE))), starts=1)
    assert dict(zip(found.fit.names, found.fit.value.round(7).tolist(), strict=True)) == {
        "beta": pytest.approx(0.0196018, abs=1e-7),
        "alpha": pytest.approx(3.20384, abs=1e-5),
    }
    assert found.log_likelihood.value == pytest.approx(-40.517992, abs=1e-6)
    assert found.log_likelihood.is_bound
    assert found.model.network.parameters["alpha"] == found.fit.value[1]


def decay(k=1.0):
    return Model.of(Network.from_text("A -> B, k", k=k))


def decays(k, p, seed, cells=60):
    """Copies of A that fade at rate k and are seen with probability p, at four times."""
    runs = simulate(Network.from_text("A -> B, k", k=k), "ssa", {"A": 30}, [0.5, 1, 2, 3], runs=cells, seed=seed)
    seen = np.random.default_rng(seed).binomial(runs["A"], p).astype(float)
    return PanelData(
        {"A": {"A": 1}}, [PanelRun([30, 0], runs.times, row[:, None]) for row in seen], {"A": Detected(0.5)}
    )


def test_detection_is_estimated_too():
    found = fit_model(PanelLikelihood(decay(), decays(0.7, 0.8, 3)), ["k", "A"], starts=1)
    for truth, low, high in zip((0.7, 0.8), found.fit.low, found.fit.high, strict=True):
        assert low < truth < high
    blind = fit_model(PanelLikelihood(decay(), decays(0.7, 0.8, 3)), ["k"], fixed={"A": 0.999}, starts=1)
    assert blind.log_likelihood.value < found.log_likelihood.value - 20  # the control


@pytest.mark.parametrize(
    ("free", "fixed", "said"),
    [
        (["z"], {}, "unknown parameter 'z'; expected one of"),
        (["k"], {"k": 1.0}, "k is both free and fixed"),
        (None, {"k": 1.0}, "nothing is free"),
        (["A -> B"], {}, "unknown parameter"),
    ],
)
def test_parameters_that_cannot_be_are_refused(free, fixed, said):
    data = PanelData({"A": {"A": 1}}, [PanelRun([3, 0], [1.0], [[1]])])
    with pytest.raises(ValueError, match=said):
        fit_model(PanelLikelihood(decay(), data), free, fixed=fixed)


def test_a_free_parameter_starts_above_zero():
    data = PanelData({"A": {"A": 1}}, [PanelRun([3, 0], [1.0], [[1]])])
    with pytest.raises(ValueError, match="k = 0; a free parameter starts above 0"):
        fit_model(PanelLikelihood(decay(0.0), data))


@pytest.fixture
def place(tmp_path):
    (tmp_path / "eyam.rxn").write_text(EPIDEMIC)
    written(tmp_path, TABLE)
    written(tmp_path, "time,I\n1,2\n0.5,9\n", "cells.csv")
    return tmp_path


def test_the_command(wellmixed_here, place):
    command = ["calibrate", "eyam.rxn", "--counts", "counts.csv", "--out", "rates.toml", "--starts", 1]
    done = wellmixed_here(*command, "--json", cwd=place)
    assert done.code == 0
    assert done.json["parameters"]["alpha"]["value"] == pytest.approx(3.20384, abs=1e-5)
    assert done.json["log_likelihood"]["is_bound"] is True
    low, value, high = (done.json["log_likelihood"][name] for name in ("low", "value", "high"))
    assert low < value < high < low + 1e-9
    kept = tomllib.loads((place / "rates.toml").read_text())
    assert kept["parameters"] == done.json["parameters"]
    assert done.json["posterior"]["how"] == "normal on logarithms"
    assert kept["evidence"]["looks"] == 7
    assert "alpha      3.20384    2.68148    3.82414" in wellmixed_here(*command, cwd=place).out
    assert tomllib.loads((place / "rates.toml").read_text()) == kept  # one seed, one result


def test_the_command_with_what_is_known(wellmixed_here, place):
    command = ["calibrate", "eyam.rxn", "--counts", "counts.csv", "--out", "r.toml", "--json", "--starts", 1]
    done = wellmixed_here(*command, "--fix", "alpha=3.2", "--observe", "I=rounded:2", cwd=place).json
    assert list(done["parameters"]) == ["beta"]
    assert done["fixed"] == {"alpha": 3.2}
    assert done["evidence"]["observed"]["I"] == {"model": "rounded", "half": 2.0}


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--counts", "no.csv"], "File 'no.csv' does not exist"),
        (["--counts", "counts.csv", "--snapshots", "cells.csv"], "--counts and --snapshots: one kind of data"),
        (["--counts", "counts.csv", "--runs", 3], "--runs applies to mechanics runs, and --counts makes none"),
        (["--counts", "counts.csv", "--tank", 1, 1, 1], "--tank is for --events, not for counts"),
        (["--counts", "counts.csv", "--prior", "alpha=3"], "--prior alpha=3; expected a name and two rising numbers"),
        (["--counts", "counts.csv", "--bounds", "alpha=3:2"], "--bounds alpha=3:2; expected a name and two rising"),
        (
            ["--counts", "counts.csv", "--prior", "gamma=1:3"],
            "gamma has a prior, but it is not free; free are beta, alpha",
        ),
        (["--counts", "counts.csv", "--per-group", "alpha"], "counts.csv has no column 'group'"),
        (["--counts", "counts.csv", "--against", "alpha=x"], "--against alpha=x; expected a model, or a name and a"),
        (["--counts", "counts.csv", "--fix", "alpha"], "--fix alpha; expected a name and a number"),
        (
            ["--counts", "counts.csv", "--fix", "alpha=x"],
            "--fix alpha=x; expected a name and a number, once a name, as in --fix k1=2e-3",
        ),
        (
            ["--counts", "counts.csv", "--observe", "I=seen:1"],
            "unknown observation model 'seen'; expected one of exact",
        ),
        (["--counts", "counts.csv", "--observe", "I=detected"], "detected takes a number"),
        (["--counts", "counts.csv", "--observe", "I=detected:x"], "--observe I=detected:x: could not convert"),
        (["--counts", "counts.csv", "--observe", "I=detected:0"], "p = 0; expected a probability above 0"),
        (["--counts", "counts.csv", "--observe", "Z=detected:0.5"], "no column 'Z'"),
        (["--counts", "counts.csv", "--free", "gamma"], "unknown parameter 'gamma'"),
        (["--snapshots", "counts.csv"], "cannot be reached"),
    ],
)
def test_options_that_do_not_go_together(wellmixed_here, place, options, said):
    if options == ["--snapshots", "counts.csv"]:
        written(place, "time,S,I\n1,300,7\n")
    done = wellmixed_here("calibrate", "eyam.rxn", *options, "--out", "rates.toml", cwd=place)
    assert (done.code, done.out) == (2, "")
    assert said in " ".join(done.err.split())
    assert not (place / "rates.toml").exists()


def test_a_rule_book_takes_counts(wellmixed_here, place):
    """Two cubes with four pairs of faces: after 10 tu they have joined with probability 1 - exp(-40 k)."""
    rows = [f"{run},0,2,0\n{run},10,{0 if run < 3 else 2},{int(run < 3)}\n" for run in range(8)]
    written(place, "run,time,monomer,dimer\n" + "".join(rows))
    options = ("--free", "1+1->2", "--fix", "2->1+1=0", "--starts", 1, "--out", "rates.toml", "--json")
    done = wellmixed_here("calibrate", "line4", "--counts", "counts.csv", *options, cwd=place)
    assert done.code == 0, done.err
    assert done.json["parameters"]["1+1->2"]["value"] == pytest.approx(-np.log(5 / 8) / 40, rel=1e-6)
