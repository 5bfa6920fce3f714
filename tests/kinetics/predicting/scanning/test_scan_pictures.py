"""Pictures of scans: as many panels as there is to show, axes that say what they are, the same bytes again."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure

from kinetics import Network, scan
from kinetics.markov.questions import parse
from kinetics.predicting.scanning.pictures import draw_scan, size_of
from kinetics.support import plots

TWO = ["E[AB] @ 10", "P=? [ F<=10 AB >= 4 ]"]
TITLES = ["mean of AB at t = 10 s (count)", "probability of reaching AB >= 4 by t = 10 s"]


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
    assert [ax.get_xlabel() for ax in panels] == ["k, rate constant of channel r2 (1/s)"] * 2
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
    assert ax.get_xlabel() == "B at time 0 (count)"


def test_two_names_give_a_heat_map_with_contours_at_the_marks_of_the_bar():
    found = binding({"k": np.geomspace(1e-3, 1, 6), "B": [2, 4, 6, 8, 10]})
    panels, bars = drawn(found)
    assert len(panels) == len(bars) == 2
    for q, (ax, bar) in enumerate(zip(panels, bars, strict=True)):
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("k, rate constant of channel r2 (1/s)", "B at time 0 (count)")
        assert bar.get_ylabel() == TITLES[q]
        (mesh,) = [each for each in ax.collections if isinstance(each, QuadMesh)]
        np.testing.assert_array_equal(np.asarray(mesh.get_array()), found.numbers("value")[..., q].T)
        (lines,) = [each for each in ax.collections if hasattr(each, "levels")]
        marks = {tick.get_position()[1] for tick in bar.get_yticklabels()}
        assert set(lines.levels) <= marks


@pytest.mark.parametrize(("n", "values"), [(3, [2, 6]), (2, [2, 4, 6]), (5, [2, 6]), (9, [2, 6]), (3, [2, 4, 6])])
def test_contours_from_three_values_on_each_axis_else_cells_with_their_values(n, values):
    found = binding({"k": np.geomspace(1e-3, 1, n), "B": values}, TWO[:1])
    (ax,), _ = drawn(found)
    is_few = min(n, len(values)) < 3
    assert bool([each for each in ax.collections if hasattr(each, "levels")]) == (not is_few)
    texts = sorted(text.get_text() for text in ax.texts)
    assert texts == (sorted(f"{value:.3g}" for value in found.numbers("value").ravel()) if is_few and n < 9 else [])


def test_a_point_without_an_answer_leaves_a_hole_in_the_contours():
    network = Network.from_text("A -> B, k\nB -> A, 1e-2\nA = 3", k=1.0)
    found = scan(network, {"k": [0.0, 1.0, 2.0, 4.0], "A": [2, 4, 6, 8]}, 'R{"time"}=? [ F B >= 2 ]')
    assert found.unanswered == 4
    (ax,), _ = drawn(found)
    (lines,) = [each for each in ax.collections if hasattr(each, "levels")]
    across = np.concatenate([path.vertices for path in lines.get_paths() if len(path.vertices)])[:, 0]
    assert across.min() >= 1.0


QUESTIONS_IN_WORDS = {
    "E[AB] @ 1": "mean of AB at t = 1 s (count)",
    "var[AB] @ 1": "variance of AB at t = 1 s (count²)",
    "sd[AB] @ 1": "standard deviation of AB at t = 1 s (count)",
    "q0.9[AB] @ 1": "0.9-quantile of AB at t = 1 s (count)",
    'R{"AB"}=? [ C<=7 ]': "mean of AB, integrated up to t = 7 s (count s)",
    'R{"AB"}=? [ C ]': "mean of AB, integrated over all time (count s)",
    'R{"AB"}=? [ F AB >= 4 ]': "mean of AB, integrated until AB >= 4 (count s)",
    'R{"AB"}=? [ S ]': "mean of AB in the steady state (count)",
    'R{"time"}=? [ F AB >= 4 ]': "mean time until AB >= 4 (s)",
    'R[var]{"time"}=? [ F AB >= 4 ]': 'variance: R[var]{"time"}=? [ F AB >= 4 ] (t in s)',
    "P=? [ A > 3 U<=2.5 AB >= 4 ]": "probability of reaching AB >= 4 through A > 3 by t = 2.5 s",
    "P=? [ F AB >= 4 ]": "probability of reaching AB >= 4",
    "P=? [ F[1,2] AB >= 4 ]": "probability: P=? [ F[1,2] AB >= 4 ] (t in s)",
    "P=? [ G<=2 A > 3 ]": "probability of A > 3 up to t = 2 s",
    "S=? [ A > 3 ]": "probability of A > 3 in the steady state",
    "quantile(min T, P>=0.9 [ F<=T AB >= 4 ])": "0.9-quantile of the time until AB >= 4 (s)",
    "P>=0.9 [ F<=2 AB >= 4 ]": "1 if true, 0 if not: P>=0.9 [ F<=2 AB >= 4 ] (t in s)",
}


@pytest.mark.parametrize("question", QUESTIONS_IN_WORDS)
def test_what_is_answered_is_told_in_words_with_its_unit(question):
    assert parse(question).title(question, "s") == QUESTIONS_IN_WORDS[question]
    assert "s)" not in parse(question).title(question, "")


def test_what_is_varied_is_told_in_words_with_its_unit():
    network = Network.from_text(
        "time unit: min\nA -> B, k\nB -> C, k\nslow: C -> D, 2 * q\nother: D -> E, 1\nA = 2", k=0.1, q=1.0
    )
    labels = scan(network, {"k": [1], "q": [1], "other": [1], "A": [1]}, "E[B] @ 1").labels
    assert dict(labels) == {
        "k": "k, rate constant of channels r1, r2 (1/min)",
        "q": "parameter q",
        "other": "rate constant of channel other (1/min)",
        "A": "A at time 0 (count)",
    }
    without = scan(Network.from_text("A -> B, k\nA = 2", k=0.1), {"k": [1]}, "E[B] @ 1")
    assert dict(without.labels) == {"k": "k, rate constant of channel r1"}
    assert without.titles == ("mean of B at t = 1 (count)",)


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
    assert ax.get_xlabel() == "rate constant of channel bind (1/s)"


def test_no_text_overlaps_another():
    found = binding({"k": np.geomspace(1e-3, 1, 6), "B": [2, 4, 6, 8, 10]})
    figure = Figure(figsize=size_of(found), layout="constrained")
    draw_scan(figure, found)
    FigureCanvasAgg(figure).draw()
    texts = [ax.xaxis.label for ax in figure.axes] + [ax.yaxis.label for ax in figure.axes]
    boxes = [text.get_window_extent() for text in texts if text.get_text()]
    assert len(boxes) == 6
    assert not [1 for i, a in enumerate(boxes) for b in boxes[:i] if a.overlaps(b)]
