"""docs/crowding.md says of shared hits what the table holds, and the table what runs give."""

from itertools import pairwise

import pandas as pd
import pytest

from tests.results.shared_hits import CASES, LENGTH, LEVELS, PAGE, TABLE, Case, counted, scene_of, written


def test_the_page_says_what_the_table_holds():
    text = PAGE.read_text("utf-8")
    assert written(text) == text
    with pytest.raises(ValueError, match="expected one block"):
        written("")


def test_what_the_page_concludes():
    """Hits alone do not depend on engine and step, to four standard errors; shared ones do, on both."""
    table = pd.read_csv(TABLE)
    assert set(table.groupby(["engine", "divisor"]).size().items()) == {((c.engine, c.divisor), c.runs) for c in CASES}
    assert set(table["tu"]) == {LENGTH}
    sums = table.groupby(["engine", "divisor"]).sum()
    alone = sums["alone 0.004"] / sums["tu"]
    error = (alone / sums["tu"]) ** 0.5
    assert ((alone - alone.mean()).abs() < 4 * error).all()
    shared = sums["shared 0.004"] / sums["tu"]
    errors = (shared / sums["tu"]) ** 0.5

    def fewer(one, other):
        return (shared[other] - shared[one]) / (errors[one] ** 2 + errors[other] ** 2) ** 0.5

    assert fewer(("own", 2), ("own", 1)) > 3
    assert fewer(("own", 4), ("own", 1)) > 3
    assert fewer(("own", 1), ("pybullet", 1)) > 3
    assert fewer(("pybullet", 2), ("pybullet", 1)) > 2


def test_a_run_is_counted_again():
    pytest.importorskip("pybullet")
    case = Case("own", 2, 1)
    scene = scene_of(case)
    assert scene.numerics.step == pytest.approx(scene_of(Case("own", 1, 1)).numerics.step / 2)
    assert "bonding" not in {each.effect for each in scene.effects}
    row = counted(case, 0, length=20.0)
    for level, above in pairwise(LEVELS):
        assert row[f"alone {level:g}"] >= row[f"alone {above:g}"]
    assert row[f"alone {LEVELS[0]:g}"] > 5
