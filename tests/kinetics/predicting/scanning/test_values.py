"""The values of a scanned name, as text and checked."""

import numpy as np
import pytest

from kinetics.predicting.scanning.values import check_size, checked_values, is_logarithmic, read_values


@pytest.mark.parametrize(
    ("text", "name", "values"),
    [
        ("k1=1,2.5,1e3", "k1", [1.0, 2.5, 1000.0]),
        ("cubes = 20 , 40", "cubes", [20.0, 40.0]),
        ("k=7", "k", [7.0]),
        ("k=0:10:5", "k", [0.0, 2.5, 5.0, 7.5, 10.0]),
        ("k=0:10:2lin", "k", [0.0, 10.0]),
        ("k=-1:1:3 lin", "k", [-1.0, 0.0, 1.0]),
        ("k=1e-4:1e-2:3log", "k", [1e-4, 1e-3, 1e-2]),
        ("k=3:3:1", "k", [3.0]),
        ("1+1->2=1,2", "1+1->2", [1.0, 2.0]),
        ("A(b=1)=4", "A(b=1)", [4.0]),
    ],
)
def test_what_is_read(text, name, values):
    found = read_values(text)
    assert found[0] == name
    np.testing.assert_allclose(found[1], values, rtol=1e-12)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("k1", "names no values; expected NAME=a,b,c"),
        ("=1,2", "names no values"),
        ("k1=", "names no values"),
        ("k1=1,,2", "'' is no number"),
        ("k1=1,x", "'x' is no number"),
        ("k1=1,inf", "inf is not finite"),
        ("k1=1:nan:3", "nan is not finite"),
        ("k1=1:2", "is no range"),
        ("k1=1:2:3:4", "is no range"),
        ("k1=1:2:3exp", "is no range"),
        ("k1=1:2:-3", "is no range"),
        ("k1=1:2:0", "asks for 0 values; expected 1 to 100000"),
        ("k1=1:2:100001", "asks for 100001 values"),
        ("k1=1:2:" + "9" * 5000, "values; expected 1 to 100000"),
        ("k1=1:2:1", "one value with two different ends"),
        ("k1=0:1:3log", "both ends of a log range are above 0"),
        ("k1=1:-1:3log", "both ends of a log range are above 0"),
        ("k1=1,2,1", "takes 1 twice"),
        ("k1=2:2:3", "takes 2 twice"),
    ],
)
def test_what_is_refused(text, said):
    with pytest.raises(ValueError, match=said):
        read_values(text)


def test_values_from_python():
    assert checked_values("k", range(3)).tolist() == [0.0, 1.0, 2.0]
    for wrong, said in [([], "takes no value"), ([[1.0]], "shape"), ([np.nan], "expected finite"), (["x"], "k")]:
        with pytest.raises(ValueError, match=said):
            checked_values("k", wrong)


def test_grids_have_a_size():
    check_size([100, 1000])
    with pytest.raises(ValueError, match="a grid of 100 x 1001 = 100100 points; at most 100000"):
        check_size([100, 1001])


def test_logarithmic_where_values_are_even_there():
    assert is_logarithmic(np.geomspace(1e-4, 1.0, 9))
    assert is_logarithmic(np.array([1.0, 2.0, 5.0, 10.0, 20.0, 50.0]))
    assert not is_logarithmic(np.linspace(1.0, 9.0, 9))
    assert not is_logarithmic(np.array([0.0, 1.0, 10.0, 100.0]))
    assert not is_logarithmic(np.array([1.0, 100.0]))
