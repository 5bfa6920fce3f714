"""A report in one self-contained HTML file: text, tables, charts and provenance."""

from __future__ import annotations

import base64
import html
import io
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from calibration.reporting.style import STYLE
from calibration.reporting.words import in_words
from kinetics.support.labels import keep_apart
from kinetics.support.output import checked_name, write_together
from kinetics.support.packages import mpl
from kinetics.support.plots import words_as_they_are
from kinetics.support.tables import Rows, csv_text

SENTENCE = 45  # characters; a longer cell of a table is read as words, not compared as a number
UNBROKEN = re.compile(r"(\d[\d.]*e-\d+|[^\s(]*->[^\s,;:)]*)")  # numbers and channels, which a line might break within
MANY = 10  # columns from which a table is set in smaller type on paper
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"


@dataclass(frozen=True)
class Heading:
    """A heading of a report.

    >>> from calibration import Heading
    >>> Heading("Joins & breaks").html()
    '<h2>Joins &amp; breaks</h2>'
    """

    text: str

    def html(self) -> str:
        """The heading as HTML."""
        return f"<h2>{html.escape(self.text)}</h2>"


@dataclass(frozen=True)
class Text:
    """Plain text of a report; an empty line begins a new paragraph.

    >>> from calibration import Text
    >>> Text("One paragraph.").html()
    '<p>One paragraph.</p>'
    """

    text: str

    def html(self) -> str:
        """The paragraphs as HTML."""
        paragraphs = re.split(r"\n\s*\n", self.text.strip())
        return "\n".join(f"<p>{html.escape(paragraph)}</p>" for paragraph in paragraphs)


@dataclass(frozen=True)
class ReportTable:
    """A table of a report. A named one is also written as CSV if files are requested.

    rows : mappings from column to number or text; the columns are those of the first row, with readable names
    shown : the rows of the page, where people are to read others than the CSV file has

    >>> from calibration import ReportTable
    >>> table = ReportTable("Rates", [{"channel": "bind", "rate": 0.0123456}])
    >>> "<td>0.01235</td>" in table.html()
    True
    """

    caption: str
    rows: Rows
    name: str = ""
    shown: Rows = ()

    def html(self) -> str:
        """The table as HTML, numbers to four figures."""
        table = _html_table(self.shown or self.rows)
        return f"<figure><figcaption>{html.escape(self.caption)}</figcaption>{table}</figure>"


@dataclass(frozen=True)
class Chart:
    """A figure of a report with its data.

    draw : called with the axes, or with a list of `panels` axes where there are several
    rows, name : the data, and the name under which picture and data are written if files are requested
    lines : of text that each panel must hold; 0 for none

    >>> from calibration import Chart
    >>> chart = Chart("Counts over time", lambda ax: ax.plot([0, 1], [2, 1]))
    >>> chart.svg == Chart("The same", lambda ax: ax.plot([0, 1], [2, 1])).svg
    True
    """

    caption: str
    draw: Callable[[Any], Any]
    panels: int = 1
    rows: Rows = ()
    name: str = ""
    lines: int = 0

    def html(self) -> str:
        """The figure as HTML, its picture within it as SVG."""
        caption = html.escape(self.caption)
        picture = base64.b64encode(self.svg).decode()
        source = f"data:image/svg+xml;base64,{picture}"
        return f'<figure><img alt="{caption}" src="{source}"><figcaption>{caption}</figcaption></figure>'

    @cached_property
    def svg(self) -> bytes:
        """The picture; the same drawing gives the same bytes."""
        columns = self.panels if self.panels <= 3 else 2
        rows = math.ceil(self.panels / columns)
        width, height = (6.4, 4.2) if self.panels == 1 else (max(10.0, 4.2 * columns), 3.6)
        size = (width, max(height, 1.2 + 0.2 * self.lines) * rows)
        # the hash salt and the missing date keep the file the same from one run to the next
        with mpl.rc_context({"svg.hashsalt": "wellmixed", "font.size": 9.0}):
            figure = mpl.figure.Figure(figsize=size, layout="constrained")
            axes = [figure.add_subplot(rows, columns, i + 1) for i in range(self.panels)]
            self.draw(axes[0] if self.panels == 1 else axes)
            words_as_they_are(figure)
            keep_apart(figure)
            buffer = io.BytesIO()
            figure.savefig(buffer, format="svg", metadata={"Date": None})
        return buffer.getvalue()


@dataclass(frozen=True)
class Fold:
    """Parts of a report under a title, closed until a reader opens it; on paper it is open.

    >>> from calibration import Fold, Text
    >>> Fold("Why", [Text("So.")]).html()
    '<details><summary>Why</summary>\\n<p>So.</p>\\n</details>'
    """

    title: str
    parts: Sequence[Heading | Text | ReportTable | Chart | Fold]

    def html(self) -> str:
        """The title, and the parts under it, as HTML."""
        body = "\n".join(part.html() for part in self.parts)
        return f"<details><summary>{html.escape(self.title)}</summary>\n{body}\n</details>"


Part = Heading | Text | ReportTable | Chart | Fold


@dataclass(frozen=True)
class HtmlReport:
    """A report in one HTML file.

    title, parts : what it shows, from top to bottom
    provenance : seeds, hashes, versions, costs: name -> number, text, list or nested mapping
    ValueError: a part's name that cannot be that of a file, or that another part has

    >>> from calibration import Heading, HtmlReport, Text
    >>> report = HtmlReport("A study", [Heading("Rates"), Text("None yet.")], provenance={"seed": 1})
    >>> report.html().count("<h2>"), report.html().count("<details>")  # of the parts, and of the provenance
    (1, 1)
    """

    title: str
    parts: Sequence[Part]
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        names = [part.name for part in self._named]
        for name in names:
            checked_name(name, "part name")
            if names.count(name) > 1:
                raise ValueError(f"two parts are named {name!r}; their CSV files would overwrite each other")

    @property
    def _named(self) -> list[ReportTable | Chart]:
        """The tables and charts that have files of their own, folded or not."""
        return [part for part in _unfolded(self.parts) if isinstance(part, ReportTable | Chart) and part.name]

    def html(self) -> str:
        """The whole page."""
        body = "\n".join(part.html() for part in self.parts)
        facts = [{"what": key, "value": value} for key, value in _flattened(self.provenance)]
        table = _html_table(facts, "facts", head=False)
        origin = f"<details><summary>Provenance</summary>\n{table}\n</details>" if facts else ""
        title = html.escape(self.title)
        return (
            '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">\n'
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f"<title>{title}</title>\n<style>{STYLE}</style></head>\n"
            f"<body>\n<h1>{title}</h1>\n{body}\n{origin}\n</body></html>\n"
        )

    def write(self, path: str | Path, data: bool = False) -> list[Path]:
        """Write the page and, with `data`, its named tables as `<page>_<name>.csv` and its charts as `.svg` too.

        Returns the paths written, the page last. Every picture is drawn before anything is written.
        """
        page = Path(path)
        contents: dict[Path, bytes | str] = {}
        for part in self._named if data else []:
            stem = f"{page.stem}_{part.name}"
            if part.rows:
                contents[page.with_name(f"{stem}.csv")] = csv_text(part.rows)
            if isinstance(part, Chart):
                contents[page.with_name(f"{stem}.svg")] = part.svg
        contents[page] = self.html()
        write_together(contents)
        return list(contents)


def _unfolded(parts: Sequence[Part]) -> Iterator[Part]:
    """All parts, those of folds in their place."""
    for part in parts:
        yield part
        if isinstance(part, Fold):
            yield from _unfolded(part.parts)


def _html_table(rows: Rows, kind: str = "", head: bool = True) -> str:
    if not rows:
        return "<p>No rows.</p>"
    columns = list(rows[0])
    titles = "".join(f"<th>{html.escape(in_words(str(column)))}</th>" for column in columns)
    cells = [[_cell(_shown(row.get(column)), column == columns[0]) for column in columns] for row in rows]
    lines = [f"<tr>{''.join(row)}</tr>" for row in cells]
    kind = kind or ("wide" if len(columns) >= MANY else "")
    first = f"<thead><tr>{titles}</tr></thead>\n" if head else ""  # which paper repeats on each page
    return f'<div class="table" tabindex="0"><table class="{kind}">\n{first}' + "\n".join(lines) + "\n</table></div>"


def _cell(text: str, is_name: bool) -> str:
    """Sentences are broken into lines; numbers and names are not. is_name: in the first column."""
    kind = ' class="words"' if len(text) > SENTENCE else ""
    pieces = [text] if is_name else UNBROKEN.split(text)  # every other one is not to be broken
    shown = [f"<span>{html.escape(piece)}</span>" if i % 2 else html.escape(piece) for i, piece in enumerate(pieces)]
    return f"<td{kind}>{''.join(shown)}</td>"


def _shown(value: Any) -> str:
    """A cell for a reader: four figures, a dash where there is nothing."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return "∞" if value == math.inf else f"{value:.4g}"
    if isinstance(value, list | tuple):
        items = [_shown(item) for item in value]
        return ("; " if any("," in item for item in items) else ", ").join(items)
    return str(value)


def _flattened(facts: Mapping[str, Any], above: str = "") -> list[tuple[str, Any]]:
    """Nested mappings as dotted names."""
    flat = []
    for key, value in facts.items():
        name = f"{above}{key}"
        flat += _flattened(value, f"{name}.") if isinstance(value, Mapping) else [(name, value)]
    return flat
