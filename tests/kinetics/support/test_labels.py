"""Words of figures do not cover each other; the check that all figures of the suite pass must see where they do."""

from io import BytesIO

import pytest
from legible import illegible
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

from kinetics.support.labels import keep_apart


def crowded(labels=5, apart=0.0):
    figure = Figure(layout="constrained")
    ax = figure.add_subplot()
    ax.plot([0, 1], [0, 1], label="line")
    for i in range(labels):
        ax.annotate(f"label {i}", (0.5, 0.5 + apart * i), (5, 5), textcoords="offset points")
    ax.legend(loc="center")
    return figure


def test_the_check_sees_words_that_cover_each_other_and_words_cut_off():
    assert illegible(crowded(1, 0.3))  # by the legend
    found = illegible(crowded())
    assert any("'label 0' covers 'label 4'" in fault for fault in found)
    outside = Figure()
    outside.text(0.9, 0.5, "much too long to be seen as a whole")
    assert illegible(outside) == ["'much too long to be seen as a whole' is cut off"]
    assert illegible(Figure()) == []
    with pytest.raises(AssertionError, match="'label 0' covers 'label 4'"):
        crowded().savefig(BytesIO(), format="svg")  # which tests look at


def test_labels_are_kept_apart():
    figure = crowded(8)
    keep_apart(figure)
    assert illegible(figure) == []
    places = [a.xyann for a in figure.axes[0].texts]
    keep_apart(figure)
    assert_allclose([a.xyann for a in figure.axes[0].texts], places)


def test_labels_that_are_apart_stay():
    figure = Figure(layout="constrained")
    ax = figure.add_subplot()
    for i in range(3):
        ax.annotate("label", (0.5, 0.3 * i), (5, 5), textcoords="offset points")
    keep_apart(figure)
    assert [a.xyann for a in ax.texts] == [(5, 5)] * 3
