"""Pictures of a prediction: steps for counts, a panel a species from three on, words in the legend."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from kinetics import ChannelRate, Convention, Model, Network, Rates, predict
from kinetics.predicting.pictures import MOST_PANELS, draw_prediction, left_out, panels_of, size_of
from kinetics.support import plots

PAIR = "time unit: s\nbind: A + B -> AB, 0.01\nunbind: AB -> A + B, 0.1\nA = 20\nB = 12"
TIMES = np.linspace(0.0, 30.0, 11)


def pair(times=TIMES, **given):
    return predict(Model(Network.from_text(PAIR)), times=times, **given)


def drawn(made):
    draw_prediction(figure := Figure(figsize=size_of(made), layout="constrained"), made)
    figure.draw_without_rendering()
    return figure


def chain(n):
    """n species, of means that rise with their number."""
    network = Network.from_reactions({f"r{i}": ({f"S{i}": 1}, {}) for i in range(n)}, np.full(n, 1e-3))
    return predict(Model(network, np.arange(n)), times=TIMES, runs=5)


def legend_of(figure):
    (legend,) = figure.legends
    return [text.get_text() for text in legend.get_texts()]


@pytest.mark.parametrize("method", ["ssa", "transient"])
def test_bands_of_counts_are_steps_within_the_same_ends(method):
    made = pair(method=method)
    ax = made.plot(Figure().add_subplot(), 0)
    bottom, top = made.result.quantile(0.025)[:, 0], made.result.quantile(0.975)[:, 0]
    corners = ax.collections[0].get_paths()[0].vertices
    across = np.diff(corners, axis=0)
    assert (np.abs(across) < 1e-12).any(axis=1).all()  # each edge runs along an axis
    assert set(corners[:, 1]) == {*bottom, *top}
    middles = (TIMES[1:] + TIMES[:-1]) / 2
    assert set(corners[:, 0]) <= {TIMES[0], TIMES[-1], *middles}


def test_bands_of_other_numbers_are_lines():
    """The control."""
    ends = np.array([[0.0], [0.5], [2.0]])
    assert not plots.Bands(np.arange(3.0), ends, ends, ends).is_whole
    ax = plots.bands(Figure().add_subplot(), np.arange(3.0), ends, ends, ends + 1, ["A"])
    corners = ax.collections[0].get_paths()[0].vertices
    assert (np.abs(np.diff(corners, axis=0)) > 1e-12).all(axis=1).any()


def test_three_species_have_panels_with_one_legend():
    made = pair(runs=50, trajectories=2)
    figure = drawn(made)
    assert [ax.get_title() for ax in figure.axes] == ["A", "B", "AB"]
    assert [ax.get_ylabel() for ax in figure.axes] == ["count", "", ""]
    assert {ax.get_xlabel() for ax in figure.axes} == {"time (s)"}
    assert all(ax.get_legend() is None for ax in figure.axes)
    assert legend_of(figure) == ["mean", "middle 95 % of runs", "single run"]
    for s, ax in enumerate(figure.axes):
        means = [line for line in ax.lines if line.get_linewidth() > 1 and len(line.get_xdata())]
        np.testing.assert_array_equal([line.get_ydata() for line in means], [made.mean[:, s]])
        assert means[0].get_color() == plots.colour(s)
        assert sum(line.get_drawstyle() == "steps-post" for line in ax.lines) == 2


def test_panels_and_titles_do_not_overlap():
    figure = drawn(chain(7))
    boxes = [ax.get_tightbbox().extents for ax in figure.axes] + [figure.legends[0].get_window_extent().extents]
    for i, one in enumerate(boxes):
        for other in boxes[i + 1 :]:
            across = min(one[2], other[2]) - max(one[0], other[0])
            up = min(one[3], other[3]) - max(one[1], other[1])
            assert min(across, up) < 1
    assert [ax.get_xlabel() for ax in figure.axes] == ["", "", "", "", "time", "time", "time"]


def test_one_or_two_species_share_axes_with_words_in_the_legend():
    rate = ChannelRate(rate=0.1, events=40, exposure=400.0, ways=1)
    rates = Rates(convention=Convention(combinations="distinct"), channels={"decay": rate})
    made = predict(Model(Network.from_text("decay: A -> 0, 1"), {"A": 100}), rates, TIMES, draws=20)
    (ax,) = drawn(made).axes
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time", "count")
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    assert legend == ["A", "mean", "middle 95 % of runs", "95 % interval of the mean"]


def test_a_mean_field_is_dotted_in_every_panel():
    figure = drawn(pair(method="mean-field"))
    assert legend_of(figure) == ["mean", "middle 95 % of runs", "mean field (approximate)"]
    for ax in figure.axes:
        assert sum(line.get_linestyle() == ":" and len(line.get_xdata()) > 0 for line in ax.lines) == 1


def test_a_single_time_is_seen():
    ax = drawn(pair(times=[3.0], runs=50)).axes[0]
    assert [line.get_marker() for line in ax.lines if len(line.get_xdata())] == ["o"]
    assert ax.collections[0].get_linewidth()[0] > 1


def test_of_many_species_those_with_the_largest_means_have_panels():
    made = chain(MOST_PANELS + 2)
    assert panels_of(made) == list(range(2, MOST_PANELS + 2))
    assert left_out(made).startswith(f"{MOST_PANELS} of {MOST_PANELS + 2} are drawn")
    assert left_out(chain(3)) == ""
