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
    """Neither hits nor shared ones depend on engine and step, to four standard errors, and few are shared.

    By physics 4, in which loads of partners in one step were added, shared hits would fail: 98 of 1,000 tu at the
    scene's step and 23 at a quarter of it.
    """
    table = pd.read_csv(TABLE)
    assert set(table.groupby(["engine", "divisor"]).size().items()) == {((c.engine, c.divisor), c.runs) for c in CASES}
    assert set(table["tu"]) == {LENGTH}
    sums = table.groupby(["engine", "divisor"]).sum()
    length = sums["tu"]
    for level in LEVELS:
        shared, alone = (sums[f"{kind} {level:g}"] for kind in ("shared", "alone"))
        for hits in (alone, shared):
            rate = hits.sum() / length.sum()
            assert ((hits / length - rate).abs() < 4 * (rate / length) ** 0.5).all()
        assert shared.sum() < 0.02 * (alone + shared).sum() + 4 * shared.sum() ** 0.5
    earlier = pd.Series({("pybullet", 1): 0.105, ("own", 1): 0.067, ("own", 4): 0.023})  # shared above .004 in a tu
    rate, some = earlier.mean(), length[earlier.index]
    assert ((earlier - rate).abs() > 4 * (rate / some) ** 0.5).any()  # the control


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
