"""`calibrate` of data of others with priors, groups, other models, draws, a report; what `predict` makes of it."""

import importlib.util
import json
import tomllib

import numpy as np
import pytest

from kinetics import Model, Network, sample_path
from kinetics.rates import FittedParameters

ENDS = "dies: A -> 0, k\nkilled: A + B -> B, l\nk = 0.3\nl = 0.2\nA = 8\nB = 2\n"
FADE = "fade: A -> B, k\nk = 1\nA = 30\n"
HAS_SAMPLER = importlib.util.find_spec("emcee") is not None and importlib.util.find_spec("arviz") is not None


def table_of_events(groups=False):
    """Two runs of `ENDS`, in which a third of the events are known by their channel."""
    network = Network.from_text(ENDS)
    head, rows = "run,time,channel,A,B", []
    for run, seed in (("one", 1), ("two", 2)):
        path = sample_path(network, {"A": 8, "B": 2}, end=6.0, seed=seed)
        rows.append(f"{run},0,start,8,2")
        for event, (time, channel) in enumerate(zip(path.times.tolist(), path.channels.tolist(), strict=True)):
            name = network.channels[channel] if event % 3 == 0 else "dies; killed"
            rows.append(f"{run},{time!r},{name},,")
        rows.append(f"{run},6,end,,")
    if groups:
        head, rows = f"{head},group", [f"{row},{row.split(',')[0]}" for row in rows]
    return "\n".join([head, *rows]) + "\n"


def snapshots(n=40, k=0.5):
    rng = np.random.default_rng(3)
    rows = [f"{time},{rng.binomial(30, np.exp(-k * time))}" for time in (1, 2) for _ in range(n // 2)]
    return "time,A\n" + "\n".join(rows) + "\n"


@pytest.fixture
def place(tmp_path):
    for name, text in {
        "ends.rxn": ENDS,
        "one.rxn": ENDS.replace("dies: A -> 0, k", "dies: A -> 0, 0.3").replace("k = 0.3\n", ""),
        "fade.rxn": FADE,
        "events.csv": table_of_events(),
        "groups.csv": table_of_events(groups=True),
        "cells.csv": snapshots(),
    }.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def test_events_of_unseen_causes(wellmixed_here, place):
    plain = wellmixed_here("calibrate", "ends.rxn", "--events", "events.csv", "--out", "r.toml", cwd=place)
    assert plain.code == 2
    assert "may be dies or killed; name the one that fired in the column channel, or estimate parameters" in plain.err
    command = ["calibrate", "ends.rxn", "--events", "events.csv", "--free", "k", "--free", "l", "--starts", 1]
    done = wellmixed_here(*command, "--out", "r.toml", "--json", cwd=place)
    assert done.code == 0, done.err
    for name, truth in (("k", 0.3), ("l", 0.2)):
        row = done.json["parameters"][name]
        assert row["low"] < truth < row["high"]
    assert done.json["log_likelihood"]["is_bound"]
    assert done.json["evidence"]["events"] > 10


def test_groups_and_other_models(wellmixed_here, place):
    command = ["calibrate", "ends.rxn", "--events", "groups.csv", "--per-group", "l", "--starts", 1]
    done = wellmixed_here(
        *command, "--against", "k=0.3", "--against", "one.rxn", "--out", "r.toml", "--json", cwd=place
    )
    assert done.code == 0, done.err
    assert list(done.json["parameters"]) == ["k", "l[one]", "l[two]"]
    rows = {row["name"]: row for row in done.json["models"]}
    assert list(rows) == ["ends.rxn", "groups alike", "k=0.3", "one.rxn"]
    assert 0.001 < rows["groups alike"]["p_ratio"] <= 1
    assert 0.001 < rows["k=0.3"]["p_ratio"] <= 1
    assert rows["one.rxn"]["p_ratio"] is None  # another file: it may have other formulas
    assert min(row["aic_above_least"] for row in rows.values()) == 0
    predicted = wellmixed_here("predict", "ends.rxn", "--rates", "r.toml", "--times", 1, cwd=place)
    assert predicted.code == 2
    assert "l was fitted for each group of runs" in predicted.err


def test_predictions_have_the_uncertainty_of_the_fit(wellmixed_here, place):
    """30 copies that fade at a rate known to some 5 %: the interval of the mean is that of the rate."""
    command = ["calibrate", "fade.rxn", "--snapshots", "cells.csv", "--starts", 1, "--out", "r.toml", "--json"]
    fitted = wellmixed_here(*command, cwd=place).json["parameters"]["k"]
    done = wellmixed_here("predict", "fade.rxn", "--rates", "r.toml", "--times", 3, "--json", cwd=place).json
    low, high = (30 * np.exp(-3 * fitted[end]) for end in ("high", "low"))
    a = done["species"].index("A")
    assert done["interval"]["low"][0][a] == pytest.approx(low, rel=0.06)
    assert done["interval"]["high"][0][a] == pytest.approx(high, rel=0.06)
    exact = wellmixed_here(
        *("predict", "fade.rxn", "--rates", "r.toml", "--times", 3, "--method", "transient", "--elasticity", "--json"),
        cwd=place,
    )
    assert exact.code == 0, exact.err
    assert exact.json["mean"][0][a] == pytest.approx(30 * np.exp(-3 * fitted["value"]), rel=0.02)
    (elasticity,) = exact.json["elasticities"]["value"]
    assert elasticity[0][a] == pytest.approx(-3 * fitted["value"], rel=0.02)


@pytest.mark.skipif(not HAS_SAMPLER, reason="the sampler is an extra")
def test_draws_and_a_report(wellmixed_here, place):
    command = ["calibrate", "fade.rxn", "--snapshots", "cells.csv", "--starts", 1, "--out", "r.toml"]
    options = ["--posterior", 400, "--prior", "k=0.01:10", "--report", "page.html", "--json"]
    done = wellmixed_here(*command, *options, cwd=place)
    assert done.code == 0, done.err
    assert done.json["posterior"]["how"] == "sampled"
    kept = FittedParameters.load(place / "r.toml")
    assert kept.draws.table.shape == (400, 1)
    assert np.quantile(kept.draws.table, [0.025, 0.975]) == pytest.approx(
        [done.json["parameters"]["k"][end] for end in ("low", "high")], rel=0.03
    )
    page = (place / "page.html").read_text()
    assert "Parameters of fade.rxn" in page
    for word in ("cube", "tank", "join", "break", "rebinding", "paper", "tu)"):
        assert word not in page.lower().split("<style>")[0] + page.lower().split("</style>")[1], word
    assert "Likelihood times prior was maximised" in page


def test_a_wrong_model_is_found_out(wellmixed_here, place):
    """Snapshots that vary more than copies that fade alone can."""
    rng = np.random.default_rng(1)
    rows = [f"2,{rng.binomial(30, 0.1 if k % 2 else 0.7)}" for k in range(40)]
    (place / "mixed.csv").write_text("time,A\n" + "\n".join(rows) + "\n")
    command = ["calibrate", "fade.rxn", "--snapshots", "mixed.csv", "--starts", 1, "--out", "r.toml"]
    assert wellmixed_here(*command, "--report", "page.html", cwd=place).code == 0
    assert "The model does not describe these data: residuals of A, their spread" in (place / "page.html").read_text()


def test_rates_of_another_network_are_refused(wellmixed_here, place):
    command = ["calibrate", "fade.rxn", "--snapshots", "cells.csv", "--starts", 1, "--out", "r.toml"]
    assert wellmixed_here(*command, cwd=place).code == 0
    (place / "other.rxn").write_text("fade: A -> B, q\nq = 1\nA = 30\n")
    done = wellmixed_here("predict", "other.rxn", "--rates", "r.toml", "--times", 3, cwd=place)
    assert done.code == 2
    assert "these parameters are of another network: it has no k; it has q" in done.err
    content = tomllib.loads((place / "r.toml").read_text())
    assert content["parameters"]["k"]["value"] == pytest.approx(0.5, rel=0.2)


def test_laws_take_draws_too():
    """A parameter of a rate law: runs under networks that differ in it."""
    from kinetics import predict

    model = Model.of(Network.from_text("fade: A -> 0, k * A / (1 + A)", k=0.5), {"A": 20})
    fitted = FittedParameters(parameters={"k": {"value": 0.5}}, covariance_of_logarithms=((0.04,),))
    found = predict(model, fitted, [10.0], seed=1, draws=100)
    assert found.low[0, 0] < found.mean[0, 0] < found.high[0, 0]
    assert found.high[0, 0] - found.low[0, 0] > 2


def test_what_the_data_cannot_tell_is_null(wellmixed_here, place):
    """Deaths of one cause only: of the other there is an upper limit, and a prediction asks for a value."""
    (place / "short.csv").write_text("run,time,channel,A,B\na,0,start,1,0\na,1,dies,,\na,3,end,,\n")
    command = ["calibrate", "ends.rxn", "--events", "short.csv", "--free", "l", "--free", "k", "--starts", 1]
    done = wellmixed_here(*command, "--out", "r.toml", "--json", cwd=place)
    assert done.code == 0, done.err
    assert done.json["parameters"]["l"] == {"value": None, "low": 0.0, "high": None}
    assert done.json["covariance_of_logarithms"] is None
    assert done.json["posterior"] is None
    assert "the data cannot tell l" in done.json["notes"][0]
    predicted = wellmixed_here("predict", "ends.rxn", "--rates", "r.toml", "--times", 1, cwd=place)
    assert predicted.code == 2
    assert "the data could not tell l: fix it, as in calibrate --fix l=1" in predicted.err


def test_a_start_that_is_not_certain(wellmixed_here, place):
    (place / "starts.csv").write_text("A,B,probability\n30,0,0.5\n28,2,0.5\n")
    command = ["calibrate", "fade.rxn", "--snapshots", "cells.csv", "--starts", 1, "--out", "r.toml", "--json"]
    certain, mixed = (wellmixed_here(*command, *more, cwd=place) for more in ((), ("--initial", "starts.csv")))
    slower = [json.loads(done.out)["parameters"]["k"]["value"] for done in (certain, mixed)]
    assert slower[1] < slower[0]  # of fewer at the beginning, fewer are lost
    done = wellmixed_here(
        "calibrate", "ends.rxn", "--events", "events.csv", "--initial", "starts.csv", "--out", "r.toml", cwd=place
    )
    assert done.code == 2
    assert "--initial is for --counts and --snapshots, not for events; leave it out" in done.err
