"""docs/engines.md says what is stored; and engines agree as far as it says."""

import numpy as np
import pandas as pd
import pytest

from tests.results import engine_runs, engines_page
from tests.results.engine_runs import COMPARED, file_of, forget, make_trial, missing, planned, runs_of
from tests.results.engine_trials import TANKS, measure, names
from tests.results.engines_page import GROUPS, PAGE, changes, of_group, rates, table, written

# Of what is common enough: a hit that breaks is not in the crowded tank.
ALIKE = [begin for begin in GROUPS if not begin.startswith("hits")]


@pytest.fixture(scope="module")
def found():
    return changes()


def test_the_tables_are_those_of_the_stored_runs(found):
    text = PAGE.read_text("utf-8")
    assert written(text) == text
    assert table(found).count("\n") > len(GROUPS)
    with pytest.raises(ValueError, match="has not one block"):
        written("")


def test_every_quantity_is_in_one_group(found):
    for name in found["quantity"].unique():
        assert sum(name.startswith(begin + " ") for begin in GROUPS) == 1


def test_no_quantity_is_off_by_2_percent_beyond_its_error(found):
    """At five standard errors, over all of them: a false alarm in ten thousand such pages or so."""
    alike = pd.concat([of_group(found, begin) for begin in GROUPS])
    assert len(alike) > 100
    assert (alike["change"].abs() < 0.02 + 5 * alike["error"]).all()


def test_what_the_page_says_of_single_groups(found):
    """Meetings by pair, and loads of a quarter, are known to 1 % and alike; so are loads that break, where PyBullet
    does not limit spins."""
    crowded, unlimited = (found[found["tank"] == tank] for tank in ("crowded", "unlimited"))
    for group in (
        of_group(crowded, "meetings"),
        of_group(crowded, "hits above 0.25"),
        of_group(unlimited, "hits above 1"),
    ):
        assert group["error"].max() < 0.01
        assert (group["change"].abs() < 0.01 + 3 * group["error"]).all()


def test_spins_are_cut_by_pybullet_in_the_shaken_tank_alone(found):
    spins = found[found["quantity"] == "spin of 1"].set_index("tank")
    assert spins.loc["shaken", "change"] > 5 * spins.loc["shaken", "error"]
    for tank in ("crowded", "single", "unlimited"):
        assert abs(spins.loc[tank, "change"]) < 0.001 + 3 * spins.loc[tank, "error"]


def test_the_study_s_rates_lie_within_the_intervals_of_their_ratios():
    """At four standard errors of the logarithm of the ratio, for all channels; each interval holds 1, as is said."""
    seen = rates()
    error = np.sqrt(1 / seen["pybullet_events"] + 1 / seen["events"])
    assert (np.log(seen["ratio"]).abs() < 4 * error).all()
    assert ((seen["low"] < seen["ratio"]) & (seen["ratio"] < seen["high"])).all()
    assert ((seen["low"] < 1.0) & (seen["high"] > 1.0)).all()


def test_a_tank_is_watched_in_every_way():
    """A short run shows all that the page lists but rare loads, and nothing else."""
    short = TANKS["shaken"]._replace(length=0.2)
    seen = measure(short, "own", seed=1)
    assert list(seen) == names(short)
    assert all(value > 0 for name, value in seen.items() if not name.startswith(("hits", "pairs")))


def test_runs_that_were_cut_off_are_made_again(monkeypatch, tmp_path):
    """A row is there for both engines or for none; the next seeds come after those that are complete."""
    pytest.importorskip("pybullet")
    monkeypatch.setattr(engine_runs, "FOLDER", tmp_path)
    monkeypatch.setitem(TANKS, "single", TANKS["single"]._replace(composition={"monomer": 4}, length=0.1))
    for seed in (1, 2):
        make_trial("single", seed)
    lines = file_of("single").read_text("utf-8").splitlines(keepends=True)
    assert len(lines) == 1 + 2 * len(COMPARED)
    whole = runs_of("single")
    file_of("single").write_text("".join(lines[:-1]), encoding="utf-8")
    assert len(runs_of("single")) == len(COMPARED)
    make_trial("single", 2)
    pd.testing.assert_frame_equal(runs_of("single"), whole)


def test_an_engine_s_runs_are_made_anew_and_the_other_s_kept(monkeypatch, tmp_path):
    pytest.importorskip("pybullet")
    monkeypatch.setattr(engine_runs, "FOLDER", tmp_path)
    small = {"composition": {"monomer": 4}, "length": 0.1, "runs": 2}
    monkeypatch.setitem(TANKS, "single", TANKS["single"]._replace(**small))
    assert missing("single") == planned("single") == [(seed, name) for seed in (1, 2) for name in ("own", "pybullet")]
    for seed, engine in planned("single"):
        make_trial("single", seed, (engine,))
    assert missing("single") == []
    whole, lines = runs_of("single"), file_of("single").read_text("utf-8").splitlines()
    forget("own")
    assert file_of("single").read_text("utf-8").splitlines() == [line for line in lines if ",own," not in line]
    assert missing("single") == [(1, "own"), (2, "own")]
    assert len(runs_of("single")) == 0
    for seed, engine in missing("single"):
        make_trial("single", seed, (engine,))
    pd.testing.assert_frame_equal(runs_of("single"), whole)


@pytest.mark.validate
@pytest.mark.timeout(7200)
def test_engines_agree_in_runs_made_now(monkeypatch, tmp_path):
    """A twentieth of the stored runs; the control bounces more, and that is seen."""
    monkeypatch.setattr(engine_runs, "FOLDER", tmp_path / "honest")

    def made(tank, runs):
        engine_runs.FOLDER.mkdir()
        for seed in range(1001, 1001 + runs):
            make_trial(tank, seed)
        seen = changes()
        return pd.concat([of_group(seen, begin) for begin in ALIKE])

    monkeypatch.setattr(engines_page, "TANKS", {"crowded": TANKS["crowded"]})
    alike = made("crowded", 25)
    assert (alike["change"].abs() < 0.02 + 5 * alike["error"]).all()
    honest = type(TANKS["crowded"]).scene

    def bouncy(tank, engine):
        scene = honest(tank, engine)
        return scene.changed("contact", restitution=0.6) if engine == "own" else scene

    monkeypatch.setattr(type(TANKS["crowded"]), "scene", bouncy)
    monkeypatch.setattr(engine_runs, "FOLDER", tmp_path / "bouncy")
    off = made("crowded", 5)
    assert not (off["change"].abs() < 0.02 + 5 * off["error"]).all()
