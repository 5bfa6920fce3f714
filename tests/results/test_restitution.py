"""The tables of bounces on the page on accuracy are those of the code."""

import pytest

from mechsim.runs.record import PHYSICS
from tests.results.restitution import FOLDER, rebounds, stored, written


def test_the_page_holds_what_is_stored():
    text = (FOLDER / "README.md").read_text("utf-8")
    assert written(text) == text
    assert written(text.replace("| pybullet |", "| bullet |")) == text  # the control


@pytest.mark.parametrize("engine", ["pybullet", "own"])
def test_bounces_are_those_stored(engine):
    pytest.importorskip("pybullet" if engine == "pybullet" else "numba")
    rows = [row for row in stored("bounces") if (row["physics"], row["engine"]) == (str(PHYSICS), engine)]
    assert len(rows) == 12
    for row in rows[::2]:
        restitution, speed = float(row["restitution"]), float(row["speed"])
        ratios = rebounds(engine, restitution, speed) / speed
        assert (ratios.min(), ratios.max()) == pytest.approx((float(row["least"]), float(row["largest"])), abs=2e-4)
        assert abs(ratios - restitution).max() < 0.02
