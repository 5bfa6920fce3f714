"""A scan as one interactive HTML page: a picture over its first two names, sliders for the others, bounds on hovering.

The page contains Plotly's script and needs no network, which its policy forbids. Names and questions of a model are in
one block of JSON, escaped so that no character can end the block; `page.js` reads it.
"""

from __future__ import annotations

import html
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from kinetics.predicting.scanning.pictures import DrawnScan, cell_edges
from kinetics.predicting.scanning.values import is_logarithmic
from kinetics.support.answer import KINDS, NONE
from kinetics.support.arrays import Floats
from kinetics.support.limits import text_in
from kinetics.support.packages import extra
from kinetics.support.plots import COLOURS

POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff; max-width: 64rem; margin: 1rem auto;
       padding: 0 1rem; overflow-wrap: anywhere; }
h1 { font-size: 1.3rem; line-height: 1.2; margin: 0.5rem 0; } h2 { font-size: 1.05rem; margin: 1rem 0 0; }
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
    library = extra("plotly.offline").get_plotlyjs()
    script = text_in(Path(__file__).with_name("page.js"))
    title = html.escape(f"Scan over {', '.join(scan.over)}")
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">\n'
        f"<title>{title}</title>\n<style>{STYLE}</style></head>\n"
        f"<body>\n<h1>{title}</h1>\n<p>{html.escape(headline)}</p>\n"
        '<div id="controls"></div>\n<h2 id="answer"></h2>\n<div id="plot"></div>\n<p id="empty"></p>\n'
        f"<p>{ASIDE}</p>\n<noscript><p>The picture needs JavaScript.</p></noscript>\n"
        f'<script type="application/json" id="data">{json_in_html(_content(scan, questions))}</script>\n'
        f"<script>{library}</script>\n<script>{script}</script>\n</body></html>\n"
    )


def json_in_html(content: Any) -> str:
    """JSON for a script element: the characters that HTML reads there are escaped as JSON's strings allow.

    >>> json_in_html({"name": "</script>"})
    '{"name": "\\\\u003c/script\\\\u003e"}'
    """
    text = json.dumps(content, allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


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
        found: dict[str, list[Any]] = {what: _listed(table[..., q]) for what, table in numbers.items()}
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


def _listed(table: Floats) -> list[float | str | None]:
    """Numbers in a list for JSON, which has no infinite ones: null if there is none, infinite ones as text."""
    return [
        None if math.isnan(each) else each if math.isfinite(each) else ("Infinity" if each > 0 else "-Infinity")
        for each in table.ravel().tolist()
    ]
