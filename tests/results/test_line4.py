"""The study's pages say what its files hold, and the files hold what its runs showed."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest

from calibration.estimating.break_comparison import BreakComparison
from calibration.pipeline.calibration_study import run_calibration
from calibration.pipeline.study_runs import StudyRuns
from calibration.validating.groups import event_groups
from kinetics.rates import Rates
from kinetics.runs import BY_SEVERAL, BY_UNKNOWN, RESTART
from mechsim.inspection.poses import record_at
from mechsim.runs.record import book_of
from mechsim.runs.store import RunStore
from mechsim.scene import Scene
from tests.results.studies import STUDIES, Study
from tests.results.study_pages import PAGES, filled, numbers

LINE4 = Study("line4")
STUDY, RUNS = LINE4.folder, LINE4.folder / "runs"
TEXTS = [page.read_text(encoding="utf-8") for page in PAGES]
SECTION = TEXTS[0]
# What is told of the past, whose data are no longer kept: physics 1 to 3, a threshold, seeds; and a level of 1 %.
TOLD = {"1", "2", "3", "0.008", "101", "202", "24"}  # and the runs of t5


@pytest.mark.parametrize("page", TEXTS, ids=["line_of_four", "crowding", *STUDIES])
def test_pages_say_what_the_files_hold(page):
    assert filled(page) == page
    changed = re.sub(r"(?<=\d\.)\d", lambda digit: str((int(digit[0]) + 1) % 10), page)  # control: other decimals
    assert filled(changed) != changed


def test_every_other_number_of_the_section_is_accounted_for():
    scene = Scene.load(LINE4.plan.scene)
    breaking, bonding = (next(e for e in scene.effects if e.effect == name) for name in ("breaking", "bonding"))
    table3 = Rates.load("table3").channels["1+1->2"]
    known = {f"{breaking.threshold:g}", f"{bonding.latch.probability:g}", f"{1e5 * table3.rate * table3.ways:.1f}e-5"}
    cubes = {sum(t.composition.values()) for t in LINE4.plan.held_out.tanks}
    known |= {f"{n}" for n in cubes}
    assert set(numbers(SECTION)) <= known | TOLD
    assert known - {f"{n}" for n in cubes} <= set(numbers(SECTION))
    assert "17" in numbers("text 17 <!-- line4: plan -->\n5\n<!-- end -->")  # control
    assert "5" not in numbers("text 17 <!-- line4: plan -->\n5\n<!-- end -->")


@cache
def held_out():
    """Stored held-out runs, a list for each tank of the plan."""
    whole = [record for file in sorted(RUNS.glob("*.run")) if (record := record_at(str(file), RUNS)).completed]
    ours = [record for record in whole if record.spec.seed == LINE4.plan.held_out.seed]
    return [
        [r for r in ours if (r.spec.scene, r.spec.composition) == (LINE4.plan.scene_of(tanks), tanks.composition)]
        for tanks in LINE4.plan.held_out.tanks
    ]


@pytest.mark.parametrize("file", ["rates.toml", "control-rates.toml"])
def test_rates_are_those_of_the_calibration_runs(file):
    """Events; joins and exposures but for the last digit, which depends on the processor; the shape of breaks to what a
    search resolves.

    They were made before the likelihood knew that several partners at once are not the wall alone, and are judged as
    made. Today's likelihood, the control, gives walls less.
    """
    specs = LINE4.plan.specs(LINE4.plan.calibration)
    if len(RunStore.found(RUNS).existing(specs)) < len(specs):
        pytest.skip("the stored runs were made with other versions of the engine or of numpy")
    breaks = LINE4.plan.verdict.control if file.startswith("control") else None
    study = run_calibration(StudyRuns.planned(LINE4.plan, "calibration"), RUNS, breaks=breaks, progress=False)
    known = Rates.load(STUDY / file)
    before = BreakComparison.asked_for(breaks or "auto", map(unaware_of_several, study.paths))
    assert known.breaks.model == (breaks or before.chosen.model.name)
    assert known.evidence["runs_digest"] == study.evidence["runs_digest"]
    for row in study.calibration.table():
        channel = known.channels[row["channel"]]
        assert channel.events == row["events"]
        if channel.exposures is None:
            figures = ("rate", "low", "high", "exposure")
            assert [getattr(channel, figure) for figure in figures] == pytest.approx(
                [row[figure] for figure in figures], rel=1e-13
            )
    for name, value in before.chosen.model.shape_values.items():
        assert known.breaks.shape[name] == pytest.approx(value, rel=1e-4)
    if "wall" in known.breaks.shape:
        assert study.break_models.chosen.model.shape_values["wall"] < 0.8 * known.breaks.shape["wall"]


def unaware_of_several(path):
    """The run as a likelihood reads it that knows nothing of breaks by several partners at once."""
    return replace(path, partners=np.where(path.partners == BY_SEVERAL, BY_UNKNOWN, path.partners))


def test_events_are_those_of_the_held_out_runs():
    """Seen and expected, counted here from the runs and the rates."""
    network = book_of(Scene.load(LINE4.plan.scene).rules)[1].network
    rows = pd.read_csv(STUDY / "events.csv")
    groups, totals = event_groups(network), {}
    for records in filter(None, held_out()):
        size = records[0].spec.scene.tank.size
        cubes = records[0].spec.n_cubes
        model = LINE4.rates.expected(network, records[0].path.tank)
        for record in records:
            path, end = record.path, record.spec.duration  # a run ends with a whole step, a little later
            assert (path.channels != RESTART).all()
            assert (path.times <= end).all()
            waits = np.diff(np.concatenate([[0.0], path.times, [end]]))
            promised = model.known_rates * model.ways * (waits @ model.combinations_of(path.states))
            for name, members in groups.items():
                seen = sum(int((path.channels == network.channel_places[each]).sum()) for each in members)
                is_member = [channel.split(" by ")[0] in members for channel in model.channels]
                for key in ((cubes, str(size), name), (None, None, name)):
                    before = totals.get(key, (0, 0.0))
                    totals[key] = (before[0] + seen, before[1] + promised[is_member].sum())
    assert len(rows) == len(totals)
    for row in rows.to_dict("records"):
        where = (int(row["cubes"]), row["tank"]) if row["cubes"] == row["cubes"] else (None, None)
        key = (*where, row["group"])
        assert row["seen"] == totals[key][0]
        assert row["expected"] == pytest.approx(totals[key][1], rel=1e-9)
