"""Hits on bonds in the accuracy diagram: tanks of structures that cannot break, and when their counts are compared."""

from dataclasses import replace

import numpy as np
import pytest

from mechsim.accuracy import measuring
from mechsim.accuracy.changes import RelativeChange
from mechsim.accuracy.plan import plan
from mechsim.accuracy.quantities import BY_NAME
from mechsim.accuracy.trial import BLOCKS, AccuracyTrial, compositions, execute_trial, mixture, unbreakable
from mechsim.runs.record import RunRecord, RunSpec, book_of, execute
from mechsim.runs.store import RunStore


def test_tanks_of_trials(line4):
    """Every species in equal numbers, and no tank of structures where nothing breaks or no structure fits."""
    derivation = book_of("line4")[1]
    assert mixture(derivation, 120) == {"monomer": 12, "dimer": 12, "trimer": 12, "quadmer": 12}
    assert mixture(derivation, 7) == {"quadmer": 1, "trimer": 1}
    assert compositions(line4, 2) == ({"monomer": 2}, {"dimer": 1})
    assert compositions(line4, 1) == ({"monomer": 1},)
    assert compositions(line4.without("breaking"), 2) == ({"monomer": 2},)


def test_hits_are_those_that_a_run_would_log(line4):
    """Of a run by the same random streams, in a scene that logs and cannot break; bonds that break are the control."""
    scene = line4.changed("breaking", threshold=0.002)
    trial = AccuracyTrial(scene, {"quadmer": 12, "trimer": 4}, 6.0, 3, 0)
    assert [quantity.name for quantity in trial.measured] == ["loads", "breaks"]
    record = execute_trial(trial)
    counted = {name: record.arrays[name].sum() for name in ("loads", "breaks")}
    runs = {
        name: execute(RunSpec(tank, trial.composition, record.facts["end"], 3, 0)).arrays
        for name, tank in (
            ("unbreakable", unbreakable(scene)),
            ("breaking", scene.without("bonding").changed("breaking", log_above=0.001)),
        )
    }
    begun = record.facts["end"] - BLOCKS * record.facts["block"]
    logged = {
        name: [int((run["load_value"][run["load_time"] > begun] > level).sum()) for level in (0.001, 0.002)]
        for name, run in runs.items()
    }
    assert not len(runs["unbreakable"]["times"])
    # A collision across the end of the warm-up may be counted on the other side of it.
    assert abs(counted["loads"] - logged["unbreakable"][0]) <= 1
    assert abs(counted["breaks"] - logged["unbreakable"][1]) <= 1
    assert counted["loads"] > counted["breaks"] > 3
    assert logged["breaking"] != logged["unbreakable"]


def made_up(scene, composition, rate, blocks, rng):
    """A record of a trial of structures with this many hits a block, one in ten of which would break."""
    trial = AccuracyTrial(scene, composition, 20.0, 1, 0)
    hits = rng.poisson(rate, blocks)
    arrays = {"times": np.zeros(0), "loads": hits, "breaks": rng.binomial(hits, 0.1)}
    return RunRecord(trial, "completed", arrays, {"block": 1.0, "steps": 1}, {"cpu_per_tu": 1.0})


def test_breaks_are_compared_where_there_are_enough(line4):
    planned, rng = plan(line4), np.random.default_rng(3)
    found = []
    for blocks in (100, 2000):
        own, other = (made_up(line4, {"quadmer": 5}, rate, blocks, rng) for rate in (3.3, 3.0))
        found.append(measuring._point(planned.base, [{0: own}], [{0: other}]).changes)
    assert set(found[0]) == {"loads"}  # some 30 breaks
    assert set(found[1]) == {"loads", "breaks"}
    for name, change in found[1].items():
        assert abs(change.value - 0.1) < change.half_width, name
    assert 5 > found[1]["breaks"].half_width / found[1]["loads"].half_width > 2  # a tenth of the events
    few = [made_up(line4, {"quadmer": 5}, 0.1, 100, rng) for _ in range(2)]
    assert not measuring._point(planned.base, [{0: few[0]}], [{0: few[1]}]).changes


def test_a_tank_that_is_stopped_shows_nothing_and_the_other_does(line4):
    planned, rng = plan(line4), np.random.default_rng(3)
    own, other = (made_up(line4, {"quadmer": 5}, 3.0, 100, rng) for _ in range(2))
    cubes = replace(own, arrays={"speed": rng.uniform(1, 2, 100)})
    assert set(measuring._point(planned.base, [{0: cubes}, {0: own}], [{0: cubes}, {0: other}]).changes) == {
        "speed", "loads"
    }  # fmt: skip
    own.outcome = "stopped: spin"
    point = measuring._point(planned.base, [{0: cubes}, {0: own}], [{0: cubes}, {0: other}])
    assert (point.stopped, set(point.changes)) == ("stopped: spin", {"speed"})


def test_of_a_wide_quantity_only_what_is_shown_counts():
    change = RelativeChange(-0.06, 0.05)
    assert BY_NAME["meetings"].against(change) == pytest.approx(0.11)
    assert BY_NAME["loads"].against(change) == pytest.approx(0.01)
    assert BY_NAME["loads"].against(RelativeChange(0.03, 0.05)) == 0.0


def test_settings_that_move_alike_share_a_trial(line4, tmp_path):
    """The reach of bonding is no part of a tank of structures; a restitution is."""
    start = {"quadmer": 2}
    scenes = (line4, line4.changed("bonding", capture_distance=0.01), line4.changed("contact", restitution=0.0))
    assert len({AccuracyTrial(scene, start, 1.0, 1, 0).key for scene in scenes}) == 2
    planned = plan(line4)
    due = measuring._missing(RunStore(tmp_path), planned, compositions(line4, 8), 1.0, 1, 0)
    assert len({trial.key for trial in due}) == len(due)
    knobs = sum(setting.curve.startswith("bonding") for setting in planned.model)
    assert knobs > 0
    settings = len(measuring._settings(planned, 0))
    assert sum(trial.has_structures for trial in due) == settings - knobs
    assert sum(not trial.has_structures for trial in due) == settings
