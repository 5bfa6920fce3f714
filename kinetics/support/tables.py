"""Rows of named values as text: columns for a terminal, CSV for other programs."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from typing import Any

Rows = Sequence[Mapping[str, Any]]

ROUNDING = 1e-13  # of a mean: a smaller spread is what arithmetic leaves of none


def in_unit(value: str, unit: str) -> str:
    """A value with its unit, if it has one."""
    return f"{value} {unit}" if unit else value


def figure(value: float, form: str = ".4g") -> str:
    """A number for people: a dash if it is not known (nan), a word if it is infinite.

    >>> figure(2 / 3), figure(float("nan")), figure(float("inf"))
    ('0.6667', '-', 'infinite')
    """
    if math.isinf(value):
        return "infinite" if value > 0 else "-infinite"
    return "-" if math.isnan(value) else f"{value:{form}}"


def rate_figure(rate: float, high: float, form: str = ".3g") -> str:
    """A measured rate for people: below its upper limit if nothing was seen, a dash if it was not measured.

    >>> rate_figure(0.02, 0.0512), rate_figure(0.0, 0.0184), rate_figure(float("nan"), float("inf"))
    ('0.02', '< 0.0184', '-')
    """
    return f"< {high:{form}}" if rate == 0 and math.isfinite(high) else figure(rate, form)


def with_spread(mean: float, spread: float, form: str = ".3g") -> str:
    """A mean and its spread; the mean alone if there is none, as of a single run, or if it is rounding.

    >>> with_spread(60, 2.5), with_spread(60, float("nan")), with_spread(4.0, 8.9e-16)
    ('60 ± 2.5', '60', '4')
    """
    is_rounding = 0.0 < spread < ROUNDING * abs(mean)
    return figure(mean) if math.isnan(spread) or is_rounding else f"{figure(mean)} ± {figure(spread, form)}"


def of_unit(what: str, unit: str) -> str:
    """A title with its unit, if there is one.

    >>> of_unit("time", "s"), of_unit("time", "")
    ('time (s)', 'time')
    """
    return f"{what} ({unit})" if unit else what


def counted(n: int, what: str) -> str:
    """So many of something.

    >>> counted(1, "state"), counted(2, "state")
    ('1 state', '2 states')
    """
    return f"{n} {what}{'' if n == 1 else 's'}"


def inverse(unit: str) -> str:
    """The unit of a rate constant, per way and combination, where times have this one.

    >>> inverse("s"), inverse("")
    ('1/s', '')
    """
    return f"1/{unit}" if unit else ""


def text_table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Columns of text, aligned, for a terminal."""
    widths = [max(len(line[i]) for line in (titles, *rows)) for i in range(len(titles))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in (titles, *rows)
    )


def rounded(rows: Rows) -> list[dict[str, str]]:
    """Four digits for every number that is not whole, nothing if there is no finite value."""
    return [{key: _cell(value) for key, value in row.items()} for row in rows]


def columns(rows: Rows) -> str:
    """Aligned columns under their names, rounded, with infinite values as words."""
    return text_table(
        tuple(rows[0]), [["infinite" if value == math.inf else _cell(value) for value in row.values()] for row in rows]
    )


def csv_text(rows: Rows) -> str:
    """One line a row, as the values are; a cell is empty if there is no finite value, as in JSON it is null."""
    text = io.StringIO()
    table = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    table.writeheader()
    table.writerows({key: value if _is_there(value) else "" for key, value in row.items()} for row in rows)
    return text.getvalue()


def _is_there(value: Any) -> bool:
    return value is not None and not (isinstance(value, float) and not math.isfinite(value))


def _cell(value: Any) -> str:
    if not _is_there(value):
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def rough(number: float) -> str:
    """A large number as people say it: 20, 4000, 1e6, 2.5e12."""
    if number < 1e5:
        return f"{float(f'{number:.2g}'):.0f}" if number >= 10 else f"{number:.2g}"
    mantissa, exponent = f"{number:.1e}".split("e")
    return f"{mantissa.removesuffix('.0')}e{int(exponent)}"
