"""Pictures of scans: as many panels as there is to show, axes that say what they are, the same bytes again."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure

from kinetics import Network, scan
from kinetics.predicting.scanning.pictures import draw_scan, size_of
from kinetics.support import plots

TWO = ["E[AB] @ 10", "P=? [ F<=10 AB >= 4 ]"]
TITLES = [f"{question} (t in s)" for question in TWO]


def binding(over, questions=TWO, **given):
    network = Network.from_text("time unit: s\nbind: A + B -> AB, 1e-2\nAB -> A + B, k\nA = 12\nB = 8", k=0.1)
    return scan(network, over, questions, **given)


def drawn(found):
    figure = Figure(figsize=size_of(found), layout="constrained")
    draw_scan(figure, found)
    FigureCanvasAgg(figure).draw()
    panels = [ax for ax in figure.axes if ax.axison and ax.get_label() != "<colorbar>"]
    return panels, [ax for ax in figure.axes if ax.get_label() == "<colorbar>"]


def test_one_name_gives_lines_with_limits():
    panels, bars = drawn(binding({"k": np.geomspace(1e-3, 1, 7)}, max_states=0, runs=30))
    assert [ax.get_ylabel() for ax in panels] == TITLES
    assert [ax.get_xlabel() for ax in panels] == ["k", "k"]
    assert {ax.get_xscale() for ax in panels} == {"log"}
    assert bars == []
    (band,) = [each for each in panels[1].collections if hasattr(each, "get_paths") and each.get_alpha() == 0.2]
    y = band.get_paths()[0].vertices[:, 1]
    assert y.min() < panels[1].lines[0].get_ydata().max()


def test_what_is_sampled_is_hollow():
    (ax,), _ = drawn(binding({"B": [3, 4, 5, 6]}, TWO[:1], max_states=5, runs=30))
    faces = {text.get_text() for text in ax.get_legend().get_texts()}
    assert faces == {"exact", "sampled, 95 % interval"}
    assert {str(line.get_markerfacecolor()) for line in ax.lines if line.get_marker() == "o"} == {
        "white",
        plots.colour(0),
    }
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["3", "4", "5", "6"]
    assert ax.get_xlabel() == "B at time 0"


def test_two_names_give_a_heat_map_with_contours_at_the_marks_of_the_bar():
    found = binding({"k": np.geomspace(1e-3, 1, 6), "B": [2, 4, 6, 8, 10]})
    panels, bars = drawn(found)
    assert len(panels) == len(bars) == 2
    for q, (ax, bar) in enumerate(zip(panels, bars, strict=True)):
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("k", "B at time 0")
        assert bar.get_ylabel() == TITLES[q]
        (mesh,) = [each for each in ax.collections if isinstance(each, QuadMesh)]
        np.testing.assert_array_equal(np.asarray(mesh.get_array()), found.numbers("value")[..., q].T)
        (lines,) = [each for each in ax.collections if hasattr(each, "levels")]
        marks = {tick.get_position()[1] for tick in bar.get_yticklabels()}
        assert set(lines.levels) <= marks


def test_values_that_are_few_give_no_contours():
    (ax,), _ = drawn(binding({"k": np.geomspace(1e-3, 1, 6), "B": [2, 4, 6]}, TWO[:1]))
    assert not [each for each in ax.collections if hasattr(each, "levels")]


def test_more_names_give_a_panel_each_with_one_colour_scale():
    panels, bars = drawn(binding({"k": [0.01, 0.1], "A": [5, 10], "B": [2, 4, 6]}))
    assert [ax.get_title() for ax in panels] == ["B = 2", "B = 4", "B = 6"] * 2
    assert [bar.get_ylabel() for bar in bars] == TITLES
    for row in (panels[:3], panels[3:]):
        assert len({mesh.get_clim() for ax in row for mesh in ax.collections if isinstance(mesh, QuadMesh)}) == 1


def test_values_in_any_order_are_drawn_in_theirs():
    (up,), _ = drawn(binding({"B": [2, 4, 6]}, TWO[:1]))
    (down,), _ = drawn(binding({"B": [6, 4, 2]}, TWO[:1]))
    np.testing.assert_array_equal(up.lines[0].get_xydata(), down.lines[0].get_xydata())


def test_a_part_of_a_grid_is_drawn():
    def stop(text):
        if text.startswith("3 of"):
            raise KeyboardInterrupt

    panels, bars = drawn(binding({"k": [0.01, 0.1], "B": [2, 4]}, progress=stop))
    assert len(panels) == len(bars) == 2


def test_too_many_panels_are_refused():
    found = binding({"k": [0.1], "A": [5], "B": range(1, 26)})
    with pytest.raises(ValueError, match=r"50 panels, .* at most 48 are drawn"):
        size_of(found)


def test_plot_makes_a_figure_or_takes_one():
    found = binding({"k": [0.01, 0.1]})
    figure = found.plot()
    assert len(figure.axes) == 2
    plt.close(figure)
    given = Figure()
    assert found.plot(given) is given


def test_the_axis_of_a_rate_constant_has_its_unit():
    (ax,), _ = drawn(binding({"bind": [0.01, 0.1]}, TWO[:1]))
    assert ax.get_xlabel() == "rate constant of bind (1/s)"


def test_no_text_overlaps_another():
    found = binding({"k": np.geomspace(1e-3, 1, 6), "B": [2, 4, 6, 8, 10]})
    figure = Figure(figsize=size_of(found), layout="constrained")
    draw_scan(figure, found)
    FigureCanvasAgg(figure).draw()
    texts = [ax.xaxis.label for ax in figure.axes] + [ax.yaxis.label for ax in figure.axes]
    boxes = [text.get_window_extent() for text in texts if text.get_text()]
    assert len(boxes) == 6
    assert not [1 for i, a in enumerate(boxes) for b in boxes[:i] if a.overlaps(b)]
