"""A scan as one interactive HTML page: a picture over its first two names, sliders for others, bounds on hovering."""

from __future__ import annotations

import html
from pathlib import Path
from typing import Any

import numpy as np

from kinetics.predicting.scanning.pictures import DrawnScan, cell_edges
from kinetics.predicting.scanning.values import is_logarithmic
from kinetics.support.answer import KINDS, NONE
from kinetics.support.arrays import Floats
from kinetics.support.page import interactive_page, listed
from kinetics.support.plots import COLOURS

STYLE = """
#controls { display: flex; flex-wrap: wrap; gap: 0.5rem 2rem; }
label { display: flex; flex-direction: column; flex: 1 1 16rem; min-width: 0; max-width: 100%; }
select, input { width: 100%; font: inherit; } #plot { width: 100%; }
"""
ASIDE = "Point at the picture for bounds: proven or estimated if solved, 95 % intervals if sampled (hollow markers)."


def scan_page(scan: DrawnScan, headline: str, questions: tuple[str, ...]) -> str:
    """The page of a scan, as HTML text of about 5 MB.

    headline : a line on the scan as a whole
    questions : (Q,) as they were asked
    ModuleNotFoundError: Plotly is not installed

    >>> from kinetics import Network, scan
    >>> found = scan(Network.from_text("A -> B, k", k=1), {"k": [1, 2], "A": [3, 4]}, "E[A] @ 1")
    >>> page = scan_page(found, found.headline, found.questions)
    >>> page.count("</script>"), "A at time 0 (count)" in page
    (3, True)
    """
    body = (
        f'<p>{html.escape(headline)}</p>\n<div id="controls"></div>\n<h2 id="answer"></h2>\n<div id="plot"></div>\n'
        f'<p id="empty"></p>\n<p>{ASIDE}</p>'
    )
    script = Path(__file__).with_name("page.js")
    return interactive_page(f"Scan over {', '.join(scan.over)}", body, _content(scan, questions), script, STYLE)


def _content(scan: DrawnScan, questions: tuple[str, ...]) -> dict[str, Any]:
    """What the page draws: axes with rising values, and lists of answers to each question, the last name fastest."""
    orders = [np.argsort(values) for values in scan.over.values()]
    numbers = {what: scan.numbers(what)[np.ix_(*orders)] for what in ("value", "low", "high")}
    kind, method, why = (scan.words(what)[np.ix_(*orders)] for what in ("kind", "method", "why"))
    notes: dict[str, int] = {}
    answers = []
    for q, _ in enumerate(questions):
        columns = zip(method[..., q].ravel(), why[..., q].ravel(), strict=True)
        told = ["; ".join(filter(None, parts)) or "not asked yet" for parts in columns]
        found: dict[str, list[Any]] = {what: listed(table[..., q]) for what, table in numbers.items()}
        found["kind"] = [KINDS.index(each or NONE) for each in kind[..., q].ravel()]
        found["note"] = [notes.setdefault(each, len(notes)) for each in told]
        answers.append(found)
    return {
        "axes": [_axis(scan, name, values) for name, values in scan.over.items()],
        "questions": [{"text": text, "title": title} for text, title in zip(questions, scan.titles, strict=True)],
        "answers": answers,
        "kinds": KINDS,
        "notes": list(notes),
        "colours": COLOURS,
    }


def _axis(scan: DrawnScan, name: str, values: Floats) -> dict[str, Any]:
    rising = np.sort(values)
    return {
        "name": name,
        "label": scan.labels[name],
        "values": rising.tolist(),
        "edges": cell_edges(rising).tolist(),
        "log": is_logarithmic(rising),
    }
