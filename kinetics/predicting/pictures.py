"""Pictures of a prediction: one pair of axes for one or two species, from three on a panel for each.

In one pair of axes the bands of many species cover each other; what is drawn is the same. The legend explains the
lines once for all panels.
"""

from __future__ import annotations

import math
import textwrap
from typing import Any, Protocol

import numpy as np

from kinetics.network import Network
from kinetics.predicting.counts_over_time import CountsOverTime
from kinetics.predicting.trajectories import Trajectories
from kinetics.support.arrays import Floats
from kinetics.support.plots import Bands
from kinetics.support.tables import of_unit

ENOUGH = 3  # species from which each has a panel
MOST_PANELS = 48
COLUMNS = 3
WIDE = 30  # characters of a title in a panel, in this size
SMALL = 9  # points


class DrawnPrediction(Protocol):
    """The part of a `Prediction` that is drawn. Arrays are (T, V), of V species or observables."""

    @property
    def network(self) -> Network:
        """Names what is counted, and the unit of time."""
        ...

    @property
    def times(self) -> Floats:
        """(T,) rising."""
        ...

    @property
    def mean(self) -> Floats:
        """Means, or what stands in their place."""
        ...

    @property
    def sd(self) -> Floats:
        """Standard deviation of a run; nan if not known."""
        ...

    @property
    def low(self) -> Floats | None:
        """Lower end of the interval of the mean; None if there is none."""
        ...

    @property
    def high(self) -> Floats | None:
        """Upper end of the interval of the mean; None if there is none."""
        ...

    @property
    def result(self) -> CountsOverTime:
        """That from which the means come."""
        ...

    @property
    def bands(self) -> Bands | None:
        """Means and the middle 95 % of runs; None where only an approximation is known."""
        ...

    @property
    def trajectories(self) -> Trajectories | None:
        """Single runs; None if there are none."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks for the reader."""
        ...

    @property
    def headline(self) -> str:
        """What the figures are, how they were made and how well they are known."""
        ...

    def plot(self, ax: Any, only: int | None = None) -> Any:
        """Draw all species, or only that of this number, onto axes."""
        ...


def panels_of(made: DrawnPrediction) -> list[int]:
    """Numbers of the species that have a panel: all, or the `MOST_PANELS` with the largest means at any time.

    Sorting is stable, so that species alike keep their order; the panels are in the order of the network.
    """
    largest = made.mean.max(axis=0, initial=0.0)
    return sorted(np.argsort(-largest, kind="stable")[:MOST_PANELS].tolist())


def left_out(made: DrawnPrediction) -> str:
    """A sentence on species without a panel; "" if each has one."""
    n = len(made.network.species)
    if n <= MOST_PANELS:
        return ""
    return f"{MOST_PANELS} of {n} are drawn, those with the largest means; choose others by --show NAME."


def size_of(made: DrawnPrediction) -> tuple[float, float]:
    """Width and height of a figure with all panels, inches."""
    n = len(panels_of(made))
    if n < ENOUGH:
        return 7.4, 4.0
    rows, columns = _layout(n)
    return 3.2 * columns, 2.5 * rows + 0.5


def draw_prediction(figure: Any, made: DrawnPrediction) -> None:
    """Fill a figure with the counts of all species.

    >>> from matplotlib.figure import Figure
    >>> from kinetics import Model, Network, predict
    >>> from kinetics.predicting.pictures import draw_prediction
    >>> made = predict(Model(Network.from_text("A + B <-> AB, 1, 1"), {"A": 5, "B": 4}), times=[0, 1, 2], runs=50)
    >>> draw_prediction(figure := Figure(), made)
    >>> [ax.get_title() for ax in figure.axes]
    ['A', 'B', 'AB']
    """
    places = panels_of(made)
    if len(places) < ENOUGH:
        made.plot(figure.add_subplot())
        return
    rows, columns = _layout(len(places))
    axes = figure.subplots(rows, columns, squeeze=False, sharex=True).ravel()
    for ax in axes[len(places) :]:
        ax.remove()
    for i, (place, ax) in enumerate(zip(places, axes, strict=False)):
        made.plot(ax, place)
        ax.set_title(
            textwrap.shorten(made.network.species[place], 3 * WIDE, placeholder="…"), fontsize=SMALL, wrap=True
        )
        ax.get_legend().remove()
        has_one_below = i + columns < len(places)
        ax.set_xlabel("" if has_one_below else of_unit("time", made.network.time_unit), fontsize=SMALL)
        ax.tick_params(labelsize=SMALL, labelbottom=not has_one_below)
        ax.set_ylabel("" if i % columns else ax.get_ylabel(), fontsize=SMALL)
    handles, labels = axes[0].get_legend_handles_labels()
    if left_out(made):
        figure.suptitle(left_out(made), fontsize=SMALL)
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=SMALL)


def _layout(n: int) -> tuple[int, int]:
    """Rows and columns of n panels."""
    columns = 2 if n == 4 else COLUMNS
    return math.ceil(n / columns), columns
