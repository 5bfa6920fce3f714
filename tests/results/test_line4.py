"""The study's pages say what its files hold, and the files hold what its runs showed."""

import re
from functools import cache

import numpy as np
import pandas as pd
import pytest

from calibration.pipeline.calibration_study import run_calibration
from calibration.pipeline.study_runs import StudyRuns
from calibration.validating.groups import event_groups
from kinetics.rates import Rates
from kinetics.runs import RESTART
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
# What is told of the past, whose data are no longer kept; a level of 1 %, a tank's edges, and the runs of t5.
TOLD = {"1", "2", "3", "1.15", "72", "24"}


@pytest.mark.parametrize("page", TEXTS, ids=["line_of_four", "crowding", "paper", *STUDIES])
def test_pages_say_what_the_files_hold(page):
    assert filled(page) == page
    changed = re.sub(r"(?<=\d\.)\d", lambda digit: str((int(digit[0]) + 1) % 10), page)  # control: other decimals
    assert filled(changed) != changed


def test_every_other_number_of_the_section_is_accounted_for():
    scene = Scene.load(LINE4.plan.scene)
    breaking, bonding = (next(e for e in scene.effects if e.effect == name) for name in ("breaking", "bonding"))
    table3 = Rates.load("table3").channels["1+1->2"]
    known = {f"{breaking.threshold:g}", f"{bonding.latch.probability:g}", f"{1e5 * table3.rate * table3.ways:.1f}e-5"}
    known.add(f"{LINE4.plan.log_above:g}")
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


@pytest.mark.parametrize(
    ("file", "fixed"),
    [
        ("rates.toml", {}),
        pytest.param("first-order.toml", {"breaks": "first-order"}, marks=pytest.mark.validate),
        pytest.param("uncrowded.toml", {"crowding": "none"}, marks=pytest.mark.validate),
    ],
)
def test_rates_are_those_of_the_calibration_runs(file, fixed):
    """Events; joins and exposures but for the last digit, which depends on the processor; the shape of breaks to what a
    search resolves."""
    specs = LINE4.plan.specs(LINE4.plan.calibration)
    if len(RunStore.found(RUNS).existing(specs)) < len(specs):
        pytest.skip("the stored runs were made with other versions of the engine or of numpy")
    asked = {"breaks": LINE4.plan.breaks, "crowding": LINE4.plan.crowding} | fixed
    study = run_calibration(StudyRuns.planned(LINE4.plan, "calibration"), RUNS, **asked, progress=False)
    known, found = Rates.load(STUDY / file), study.rates
    assert known.breaks.model == found.breaks.model
    assert (known.crowding and known.crowding.models) == (found.crowding and found.crowding.models)
    assert known.evidence["runs_digest"] == study.evidence["runs_digest"]
    for name, channel in known.channels.items():
        again = found.channels[name]
        assert channel.events == again.events
        for figure in ("rate", "low", "high"):
            assert getattr(channel, figure) == pytest.approx(getattr(again, figure), rel=1e-6)
    for name, value in found.breaks.shape.items():
        assert known.breaks.shape[name] == pytest.approx(value, rel=1e-4)


def test_events_are_those_of_the_held_out_runs():
    """Seen and expected, counted here from the runs and the rates."""
    network = book_of(Scene.load(LINE4.plan.scene).rules)[1].network
    rows = pd.read_csv(STUDY / "events.csv")
    groups, totals = event_groups(network), {}
    for records in filter(None, held_out()):
        size = records[0].spec.scene.tank.size
        cubes, engine = records[0].spec.n_cubes, records[0].spec.scene.numerics.engine
        model = LINE4.rates.expected(network, records[0].path.tank)
        for record in records:
            path, end = record.path, record.spec.duration  # a run ends with a whole step, a little later
            assert (path.channels != RESTART).all()
            times = np.minimum(path.times, end)
            waits = np.diff(np.concatenate([[0.0], times, [end]]))
            promised, fired = waits @ model.propensities(path.states), path.channels[path.times <= end]
            for name, members in groups.items():
                seen = sum(int((fired == network.channel_places[each]).sum()) for each in members)
                is_member = [channel.split(" by ")[0] in members for channel in model.channels]
                for key in ((cubes, str(size), engine, name), (None, None, None, name)):
                    before = totals.get(key, (0, 0.0))
                    totals[key] = (before[0] + seen, before[1] + promised[is_member].sum())
    assert len(rows) == len(totals)
    for row in rows.to_dict("records"):
        where = (int(row["cubes"]), row["tank"], row["engine"]) if row["cubes"] == row["cubes"] else (None,) * 3
        key = (*where, row["group"])
        assert row["seen"] == totals[key][0]
        assert row["expected"] == pytest.approx(totals[key][1], rel=1e-9)
