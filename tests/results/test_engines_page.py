"""docs/engines.md says what is stored; and engines agree as far as it says."""

import numpy as np
import pandas as pd
import pytest

from mechsim.scene import Scene
from tests.results import engine_trials
from tests.results.engine_trials import SINGLE, by_engine, measure, names
from tests.results.engines_page import FOLDER, GROUPS, PAGE, changes, table, trials, written

STORED = pd.read_csv(FOLDER / "line4.csv")


def test_the_tables_are_those_of_the_stored_trials():
    text = PAGE.read_text("utf-8")
    assert written(text) == text
    assert table(STORED).count("\n") == len(GROUPS) + 2
    with pytest.raises(ValueError, match="has not one block"):
        written("")


def test_every_quantity_is_in_one_group():
    found = STORED["quantity"].unique()
    assert [sum(name.startswith(begin + " ") for begin in GROUPS) for name in found] == [1] * len(found)


def test_no_quantity_is_off_by_2_percent_beyond_its_error():
    """At five standard errors, over all of them: a false alarm in a million such pages or so."""
    found = changes(STORED)
    measured = found[np.isfinite(found["error"])]
    assert len(measured) > 40
    assert (measured["change"].abs() < 0.02 + 5 * measured["error"]).all()


def test_a_tank_is_watched_in_every_way():
    """Each quantity that can be seen in a short trial is, and none that the page does not list."""
    seen = list(measure(by_engine(Scene.load("line4"), "own"), SINGLE, 2, 0.5, seed=1))
    assert set(seen[-1]) <= set(names(SINGLE))
    assert {name for name in seen[-1] if name.startswith(("speed", "spin", "meetings", "impulse"))} == {
        name for name in names(SINGLE) if name.startswith(("speed", "spin", "meetings", "impulse"))
    }


@pytest.mark.validate
@pytest.mark.timeout(7200)
def test_engines_agree_in_trials_made_now(monkeypatch):
    """A tenth of the stored trials; the control bounces more, and that is seen."""
    found = changes(trials(0.1))
    measured = found[np.isfinite(found["error"])]
    assert (measured["change"].abs() < 0.02 + 5 * measured["error"]).all()
    honest = engine_trials.by_engine

    def bouncy(scene, engine):
        made = honest(scene, engine)
        return made.changed("contact", restitution=0.6) if engine == "own" else made

    monkeypatch.setattr("tests.results.engines_page.by_engine", bouncy)
    off = changes(trials(0.1, {"single cubes": (SINGLE, 100)}))
    assert not (off["change"].abs() < 0.02 + 5 * off["error"]).all()
