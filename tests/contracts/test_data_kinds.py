"""What every kind of data keeps: a likelihood with right derivatives, groups that add up, errors that name a row."""

import numpy as np
import pandas as pd
import pytest

from calibration.estimating.model_fit import fit_model
from calibration.estimating.residuals import quantile_residuals
from calibration.observed.kinds import DATA_KINDS, Counts, Events, Snapshots
from kinetics import Model, Network

DECAY = Model.of(Network.from_text("fade: A -> B, k\nback: B -> A, l", k=0.6, l=0.2), {"A": 9})
TABLES = {
    Events: (
        "run,time,channel,A,B\na,0,start,3,0\na,0.5,fade,,\na,1.5,back,,\na,2,end,3,0\n"
        "b,0,start,2,1\nb,0.7,back,,\nb,1,fade,,\nb,3,fade,,\nb,4,end,1,2\n"
    ),
    Counts: "run,time,A,B\na,0,3,0\na,1,2,1\na,2,2,1\nb,0,2,1\nb,2,,2\nb,4,1,2\n",
    Snapshots: "time,A\n1,5\n1,6\n2,3\n2,5\n4,2\n4,3\n",
}


def of(kind, folder, text=None, **options):
    file = folder / "data.csv"
    file.write_text(text or TABLES[kind])
    return kind().read(DECAY, file, **options)


def with_groups(kind):
    """The table with a column of groups: of each run, or of each row of snapshots."""
    head, *rows = TABLES[kind].splitlines()
    names = [("ab"[k % 2] if kind is Snapshots else row.split(",")[0]) for k, row in enumerate(rows)]
    return "\n".join([f"{head},group", *(f"{row},{name}" for row, name in zip(rows, names, strict=True))]) + "\n"


def test_all_are_tried():
    assert set(TABLES) == set(DATA_KINDS)


@pytest.fixture(params=DATA_KINDS, ids=lambda kind: kind.name)
def kind(request):
    return request.param


def test_derivatives_are_those_of_the_value(kind, tmp_path):
    asked, names, step = of(kind, tmp_path), ["k", "l"], 1e-5
    point = {"k": 0.5, "l": 0.3}
    found = asked.scored(point, names)
    assert found.answer.value < 0
    assert found.answer.is_bound
    for name, slope in zip(names, found.gradient, strict=True):
        up, down = (asked.value({**point, name: point[name] * np.exp(sign * step)}).value for sign in (1, -1))
        assert slope == pytest.approx((up - down) / (2 * step), rel=1e-6, abs=1e-6)


def test_a_data_frame_is_a_table_too(kind, tmp_path):
    whole = of(kind, tmp_path)
    frame = kind().read(DECAY, pd.read_csv(tmp_path / "data.csv"))
    assert frame.value({"k": 0.5}).value == whole.value({"k": 0.5}).value
    assert frame.data_digest == whole.data_digest


def test_groups_add_up(kind, tmp_path):
    whole = of(kind, tmp_path).value({"k": 0.5})
    parts = of(kind, tmp_path, with_groups(kind))
    assert parts.value({"k": 0.5}).value == pytest.approx(whole.value, abs=1e-10)
    own = of(kind, tmp_path, with_groups(kind), own=["k"])
    assert own.usually_free == ("k[a]", "k[b]", "l")
    assert own.value({"k[a]": 0.5, "k[b]": 0.5}).value == pytest.approx(whole.value, abs=1e-10)
    assert own.value({"k[a]": 0.5, "k[b]": 0.9}).value != pytest.approx(whole.value, abs=1e-3)


def test_other_data_have_another_digest(kind, tmp_path):
    one, again = of(kind, tmp_path), of(kind, tmp_path)
    lines = TABLES[kind].splitlines()
    fewer = of(kind, tmp_path, "\n".join([line for line in lines if not line.startswith("b")][: len(lines) - 1]) + "\n")
    assert one.data_digest == again.data_digest
    assert one.data_digest != fewer.data_digest


def test_it_is_fitted_and_has_residuals(kind, tmp_path):
    asked = of(kind, tmp_path)
    found = fit_model(asked, ["k"], starts=1)
    assert 0 < found.fit.low[0] < found.fit.value[0] < found.fit.high[0]
    residuals = quantile_residuals(asked, found.point, seed=1)
    assert residuals.value.size > 4
    assert ((residuals.value > 0) & (residuals.value < 1)).all()
    again = quantile_residuals(asked, found.point, seed=1)
    np.testing.assert_array_equal(residuals.value, again.value)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("time", "when"), "no column time"),
        (("A", "Q"), "column 'Q' is neither"),
    ],
)
def test_wrong_tables_are_refused_by_name(kind, tmp_path, change, said):
    text = TABLES[kind].replace(*change, 1)
    with pytest.raises(ValueError, match=r"data\.csv") as error:
        of(kind, tmp_path, text)
    assert said in str(error.value)


def test_groups_that_cannot_be_are_refused(kind, tmp_path):
    with pytest.raises(ValueError, match=r"data\.csv has no column 'group', by which k would differ"):
        of(kind, tmp_path, own=["k"])
    text = with_groups(kind)
    with pytest.raises(ValueError, match=r"line 2.*: the group is not named"):
        of(kind, tmp_path, text.replace(",a\n", ",\n", 1))
    if kind is not Snapshots:
        with pytest.raises(ValueError, match=r"line 3, run a: this run is in group 'z' above"):
            of(kind, tmp_path, text.replace(",a\n", ",z\n", 1))
