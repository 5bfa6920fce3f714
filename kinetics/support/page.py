"""Interactive pages: one HTML file with Plotly's script and data of ours, which needs no network.

Names and texts of a model are in one block of JSON, escaped so that no character can end the block; a script reads it
as `data`. The policy of the page forbids all access to a network.
"""

from __future__ import annotations

import html
import json
import math
from pathlib import Path
from typing import Any

from kinetics.support.arrays import Floats
from kinetics.support.limits import text_in
from kinetics.support.packages import extra

POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff; max-width: 64rem; margin: 1rem auto;
       padding: 0 1rem; overflow-wrap: anywhere; }
h1 { font-size: 1.3rem; line-height: 1.2; margin: 0.5rem 0; } h2 { font-size: 1.05rem; margin: 1rem 0 0; }
"""


def interactive_page(title: str, body: str, data: Any, script: Path, style: str = "") -> str:
    """A page, as HTML text of about 5 MB.

    title : as plain text
    body : HTML below the title; texts of a model in it are escaped by the caller
    data, script : what the page draws, for JSON, and the file of a script that draws it
    style : CSS besides that of all pages
    ModuleNotFoundError: Plotly is not installed

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "page.js")
    ...     _ = file.write_text("document.title = data.name;")
    ...     page = interactive_page("A & B", "<p>Two</p>", {"name": "</script>"}, file)
    >>> page.count("</script>"), "<h1>A &amp; B</h1>" in page
    (3, True)
    """
    library = extra("plotly.offline").get_plotlyjs()
    ours = "\n".join(text_in(file) for file in (Path(__file__).with_name("page.js"), script))
    title = html.escape(title)
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">\n'
        f"<title>{title}</title>\n<style>{STYLE}{style}</style></head>\n<body>\n<h1>{title}</h1>\n{body}\n"
        "<noscript><p>The picture needs JavaScript.</p></noscript>\n"
        f'<script type="application/json" id="data">{json_in_html(data)}</script>\n'
        f"<script>{library}</script>\n<script>{ours}</script>\n</body></html>\n"
    )


def json_in_html(content: Any) -> str:
    """JSON for a script element: the characters that HTML reads there are escaped as JSON's strings allow.

    >>> json_in_html({"name": "</script>"})
    '{"name": "\\\\u003c/script\\\\u003e"}'
    """
    text = json.dumps(content, allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def listed(table: Floats) -> list[float | str | None]:
    """Numbers in a flat list for JSON, which has no infinite ones: null if there is none, infinite ones as text.

    >>> import numpy as np
    >>> listed(np.array([[1.5, np.nan], [np.inf, -np.inf]]))
    [1.5, None, 'Infinity', '-Infinity']
    """
    return [
        None if math.isnan(each) else each if math.isfinite(each) else ("Infinity" if each > 0 else "-Infinity")
        for each in table.ravel().tolist()
    ]
