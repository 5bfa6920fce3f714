"""A prediction as one interactive HTML page: a picture with all that is known of the counts, and their final values."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kinetics.predicting.mean_field import MEAN_FIELD
from kinetics.predicting.pictures import ENOUGH, DrawnPrediction, left_out, panels_of
from kinetics.predicting.trajectories import Trajectories
from kinetics.support import plots
from kinetics.support.page import interactive_page, listed
from kinetics.support.tables import in_unit, of_unit

MOST_NAMED = 4  # species in the title
STYLE = """
#legend { display: flex; flex-wrap: wrap; gap: 0.2rem 1.5rem; margin: 0.5rem 0; }
#legend label { display: flex; align-items: center; gap: 0.4rem; cursor: pointer; }
#legend svg { flex: none; }
#panels { display: grid; gap: 0.5rem; grid-template-columns: repeat(auto-fit, minmax(min(19rem, 100%), 1fr)); }
#panels > div { min-width: 0; }
.table { overflow-x: auto; max-width: 100%; }
table { border-collapse: collapse; font-size: 0.9rem; font-variant-numeric: tabular-nums; }
th, td { padding: 0.15rem 0.6rem; border-bottom: 1px solid #e4e4e4; text-align: right; overflow-wrap: normal; }
th { border-bottom: 2px solid #888; vertical-align: bottom; }
th:first-child, td:first-child { text-align: left; overflow-wrap: anywhere; min-width: 4rem; }
@media print { #panels > div, tr { break-inside: avoid; } }
"""
ASIDE = "Point at a curve for its values; the boxes above show and hide what they name."


def prediction_page(made: DrawnPrediction) -> str:
    """The page of a prediction, as HTML text of about 5 MB.

    ModuleNotFoundError: Plotly is not installed

    >>> from kinetics import Model, Network, predict
    >>> from kinetics.predicting.page import prediction_page
    >>> binding = Model(Network.from_text("A + B <-> AB, 0.01, 0.1"), {"A": 20, "B": 10})
    >>> page = prediction_page(predict(binding, times=[0, 5], method="transient"))
    >>> page.count("</script>"), "<td>AB</td><td>4.673</td>" in page
    (3, True)
    """
    names = made.network.species
    title = f"Predicted counts of {', '.join(names) if len(names) <= MOST_NAMED else f'{len(names)} species'}"
    last = in_unit(f"{made.times[-1]:g}", made.network.time_unit)
    remarks = "".join(f"<li>{html.escape(note)}</li>" for note in made.notes)
    body = (
        f'<div id="legend"></div>\n<div id="panels"></div>\n<p>{" ".join(filter(None, (ASIDE, left_out(made))))}</p>\n'
        f"<h2>Counts at {html.escape(last)}</h2>\n{_table(*_final(made))}\n"
        f"<p>{html.escape(made.headline)}</p>\n{remarks and f'<ul>{remarks}</ul>'}"
    )
    return interactive_page(title, body, _content(made), Path(__file__).with_name("page.js"), STYLE)


def _content(made: DrawnPrediction) -> dict[str, Any]:
    """What the page draws: curves of each species, and which species share a panel."""
    places, bands = panels_of(made), made.bands
    return {
        "panels": [[i] for i in range(len(places))] if len(places) >= ENOUGH else [list(range(len(places)))],
        "time": of_unit("time", made.network.time_unit),
        "unit": made.network.time_unit,
        "count": plots.COUNT,
        "labels": {
            "mean": plots.MEAN,
            "band": plots.MOST_RUNS,
            "interval": plots.INTERVAL,
            "field": MEAN_FIELD,
            "run": plots.SINGLE_RUN,
        },
        "times": listed(made.times),
        "bandTimes": None if bands is None else listed(bands.times),
        "isWhole": bands is not None and bands.is_whole,
        "species": [_curves(made, place) for place in places],
    }


def _curves(made: DrawnPrediction, place: int) -> dict[str, Any]:
    """The curves of one species; null where there is none."""
    bands, field = made.bands, made.result.approximate()
    tables = {"sd": made.sd if field is None else None, "from": made.low, "to": made.high, "field": field}
    tables |= dict.fromkeys(("mean", "low", "high")) if bands is None else {
        "mean": bands.middle, "low": bands.low, "high": bands.high,
    }  # fmt: skip
    return {
        "name": made.network.species[place],
        "colour": plots.colour(place),
        "runs": [] if made.trajectories is None else _steps(made.trajectories, place),
        **{name: None if table is None else listed(table[:, place]) for name, table in tables.items()},
    }


def _steps(made: Trajectories, place: int) -> list[list[list[float]]]:
    """Times and counts of each run where this species changes, and at the end of the run."""
    found = []
    for run in range(len(made.paths)):
        times, counts = made.moments(run)
        column = counts[:, place]
        is_kept = np.append(True, column[1:] != column[:-1])
        is_kept[-1] = True
        found.append([times[is_kept].tolist(), column[is_kept].tolist()])
    return found


def _final(made: DrawnPrediction) -> tuple[list[str], list[list[str]]]:
    """Titles and rows of the values at the last time, a row a species."""
    bands, field = made.bands, made.result.approximate()
    columns: dict[str, list[str]] = {"": list(made.network.species)}
    if field is not None:
        columns[MEAN_FIELD] = [f"{value:.4g}" for value in field[-1]]
    if bands is not None:
        columns[plots.MEAN] = [f"{value:.4g}" for value in bands.middle[-1]]
    if field is None and not np.isnan(made.sd[-1]).all():
        columns["standard deviation of a run"] = [f"{value:.3g}" for value in made.sd[-1]]
    if bands is not None:
        columns[plots.MOST_RUNS] = _ranges(bands.low[-1], bands.high[-1])
    if made.low is not None and made.high is not None:
        columns[plots.INTERVAL] = _ranges(made.low[-1], made.high[-1])
    return list(columns), [list(row) for row in zip(*columns.values(), strict=True)]


def _ranges(low: Any, high: Any) -> list[str]:
    """Both ends of each range."""
    return [f"{bottom:.4g} to {top:.4g}" for bottom, top in zip(low, high, strict=True)]


def _table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table as HTML; names are escaped."""
    head = "".join(f"<th>{html.escape(title)}</th>" for title in titles)
    lines = ["".join(f"<td>{html.escape(cell)}</td>" for cell in row) for row in rows]
    body = "".join(f"<tr>{line}</tr>\n" for line in lines)
    return f'<div class="table" tabindex="0"><table>\n<tr>{head}</tr>\n{body}</table></div>'
