"""Nothing from nothing: with no break, or too few of them, no break model is chosen, and rates are upper limits."""

import json
import math

import numpy as np
import pytest
from synthetic_runs import line_network

from calibration import estimate
from calibration.commands.tables import breaks_table, class_rates_table, rates_table
from calibration.estimating.break_comparison import BreakComparison, rates_with_breaks, too_few
from calibration.estimating.break_fit import break_channels, breaks_seen, deviance, fit_breaks
from calibration.estimating.class_calibration import BookRuns
from calibration.estimating.rate_fit import can_hold
from calibration.estimating.study import CalibrationStudy, ClassStudy
from calibration.reporting.overview import calibration_report
from kinetics.assembly import RuleBook, derive
from kinetics.rates.breaks import break_model, is_break
from kinetics.runs import JumpPath
from kinetics.sampling import sample_path
from kinetics.support.cli.options import plain

NONE = "no breaks were seen: each rate is an upper limit (95 %)"
UPPER = -math.log(0.025)  # of the mean of a Poisson count of which none came: the end of its 95 % interval
START, END = [20, 8, 6, 4], 10.0


def breaking(channels, network=None):
    """Runs, all alike, of which one has these breaks."""
    network = line_network() if network is None else network
    start = np.array(START)
    times = np.linspace(1, 9, len(channels))
    places = [network.channels.index(name) for name in channels]
    return [JumpPath(network, start, times, places, END), JumpPath(network, start, [], [], END)]


def study_of(channels, breaks="auto"):
    return CalibrationStudy("line4", breaking(channels), {}, "two runs", "Made by hand.", breaks=breaks)


KINDS = {
    "no breaks": ([], None),
    "one break": (["3->1+2"], None),
    "as many breaks as parameters": (["3->1+2"] * 2, None),
    "one break of each of two channels": (["3->1+2", "2->1+1"], None),
    "all breaks in one channel": (["3->1+2"] * 3, {"first-order", "collision"}),
    "many breaks in one channel": (["3->1+2"] * 6, {"first-order", "collision", "collision-wall", "collision-species"}),
}


@pytest.mark.parametrize("kind", KINDS)
def test_models_are_compared_as_far_as_the_breaks_hold_their_parameters(kind):
    channels, models = KINDS[kind]
    paths = breaking(channels)
    assert breaks_seen(paths).sum() == len(channels)
    compared = BreakComparison.asked_for("auto", paths)
    if models is None:
        assert compared is None
    else:
        assert {fit.model.name for fit in compared.fits} == models


def test_parameters_are_those_of_constants_that_were_seen():
    """A constant without events costs nothing: its rate is 0 under every model."""
    assert [can_hold(events, 1) for events in ([0, 0], [1, 0], [2, 0], [3, 0], [2, 1], [2, 2])] == [
        *(False, False, False, True, False, True)
    ]


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_said_and_written(kind, tmp_path):
    """Text, HTML, CSV, JSON and the rates file agree: without a chosen model there is no table of models."""
    channels, models = KINDS[kind]
    study = study_of(channels)
    page = tmp_path / "report.html"
    written = {path.name for path in calibration_report(study).write(page, data=True)}
    text, shown, data = rates_table(study), page.read_text(encoding="utf-8"), plain(study.to_dict())
    assert ("report_breaks.csv" in written) == ("What breaks a bond" in shown) == (data["breaks"] is not None)
    assert (data["breaks"] is not None) == (models is not None)
    assert (NONE in text) == (NONE in shown) == (NONE in data["evidence"].get("break_model", "")) == (not channels)
    if models is None and channels:
        n = len(channels)
        told = f"{n} break{'s were' if n > 1 else ' was'} seen, too few to compare break models"
        assert told in text
        assert told in shown
        assert told in data["evidence"]["break_model"]
    if models is None:
        assert study.rates.breaks.model == "first-order"
        for channel in study.rates.channels.values():
            if channel.events == 0:
                assert channel.high == pytest.approx(UPPER / channel.exposure)
    for row in data["channels"]:
        limit = f"< {row['high']:.3g}"
        for where in (text, shown.replace("&lt;", "<")):
            line = next(line for line in where.replace("&gt;", ">").splitlines() if row["channel"] in line)
            assert (limit in line) == (row["events"] == 0)
    assert not [value for value in numbers(data) if value < 0]


def numbers(data):
    """All values of keys that tell degrees of freedom or a deviance."""
    if isinstance(data, dict):
        for key, value in data.items():
            if key in ("freedom", "deviance", "p_deviance") and value is not None:
                yield value
            yield from numbers(value)
    elif isinstance(data, list):
        for value in data:
            yield from numbers(value)


def test_a_deviance_without_freedom_is_none(tmp_path):
    """Runs all alike leave nothing to judge: a dash in text and page, nothing in CSV and JSON. Control: unlike ones."""
    study = study_of(["3->1+2"] * 6)
    found = deviance(fit_breaks(break_model("collision"), study.paths))
    assert found.freedom == 0
    assert math.isnan(found.statistic)
    assert math.isnan(found.p_value)
    rows = json.loads(json.dumps(plain(study.to_dict())))["breaks"]["models"]
    assert {(row["deviance"], row["freedom"], row["p_deviance"]) for row in rows} == {(None, 0, None)}
    lines = breaks_table(study.break_models).splitlines()
    assert all(line.split()[-1] != "nan" and " -  " in line for line in lines[1 : 1 + len(rows)])
    calibration_report(study).write(tmp_path / "report.html", data=True)
    assert "nan" not in (tmp_path / "report_breaks.csv").read_text()
    few = JumpPath(line_network(), [10, 8, 3, 4], [1.0], [line_network().channels.index("3->1+2")], END)
    assert deviance(fit_breaks(break_model("first-order"), [*study.paths, few])).freedom == 1


def test_a_model_asked_for_by_name_keeps_its_word():
    """It is fitted, and its rates are upper limits; nothing is shown side by side."""
    study = study_of([], "collision")
    assert study.break_models.chosen.model.name == study.rates.breaks.model == "collision"
    assert study.shown_breaks is None
    assert study.to_dict()["breaks"] is None
    assert study.about_breaks == f"breaks are taken as collision; {NONE}"
    for name in break_channels(line_network()):
        channel = study.rates.channels[name]
        assert channel.rate == channel.low == 0
        assert channel.high == pytest.approx(UPPER / channel.exposure)


def test_upper_limits_beside_a_chosen_model_are_exact():
    """Channels without breaks, where another had many: the likelihood alone would give 1.92 / exposure."""
    paths = breaking(["3->1+2"] * 6)
    rates = rates_with_breaks(estimate(paths), BreakComparison.asked_for("auto", paths))
    for name in break_channels(line_network()):
        channel = rates.channels[name]
        if name != "3->1+2":
            assert channel.high == pytest.approx(UPPER / channel.exposure)


def test_nothing_is_said_of_breaks_that_cannot_be():
    network = line_network()
    joins = network.with_rates(network.known_rates * ~is_break(network))
    assert study_of([], None).about_breaks == ""
    study = CalibrationStudy("", [sample_path(joins, START, END, seed=1)], {}, "", "", breaks="auto")
    assert NONE in study.about_breaks


@pytest.mark.parametrize(("channels", "is_open"), [([], True), (["3->1+2"], True), (["3->1+2"] * 6, False)])
def test_classes_say_the_same(channels, is_open):
    derivation = derive(RuleBook.load("line4"))
    joins = derivation.network.with_rates(line_network().known_rates * ~is_break(line_network()))
    paths = (*breaking(channels, derivation.network), sample_path(joins, START, END, seed=1))
    study = ClassStudy([BookRuns(derivation, paths)], {}, "runs")
    calibration, text, rows = study.calibration, class_rates_table(study), plain(study.to_dict())["fits"]
    assert (len({fit.breaks for fit in calibration.break_fits}) == 1) == is_open
    said = too_few(len(channels))
    assert (said in calibration.reasons["breaks"]) == (said in text) == is_open
    assert {row["breaks"] for row in rows} >= ({None} if is_open else {"first-order", "collision"})
    if is_open:
        assert study.rates.breaks.model == "first-order"
        assert {row["breaks"] for row in rows} <= {None, "first-order"}
    if not channels:
        assert {row["event"] for row in rows} == {"join"}
        assert NONE in text
    limits = [row for row in calibration.table() if row["rate"] == 0]
    assert bool(limits) == (not channels)
    for row in limits:
        assert f"< {row['high']:.3g}" in next(line for line in text.splitlines() if line.startswith(row["class"]))
