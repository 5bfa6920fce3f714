"""The table of measured costs in docs/which_method.md, from results/accuracy_kinetics.

    python -m tests.results.cost_table

writes it anew, between a line `<!-- costs -->` and a line `<!-- end -->`.
"""

from __future__ import annotations

import re
from pathlib import Path

import pandas as pd

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "which_method.md"
STORED = ROOT / "results" / "accuracy_kinetics" / "line4_60.csv"
BLOCK = re.compile(r"(<!-- costs -->\n).*?(<!-- end -->)", re.DOTALL)
SHOWN = {  # method and setting of the stored table -> how the page calls them
    ("SSA, lockstep", 1e4): "`lockstep`, 10,000 runs",
    ("SSA, lockstep", 1e6): "`lockstep`, 1,000,000 runs",
    ("SSA, direct", 1e6): "`ssa`, 1,000,000 runs",
    ("SSA, leaping", 1e6): "`leaping`, 1,000,000 runs (no leap pays at 60 cubes)",
    ("fsp", 1e-2): "`fsp`, tolerance 0.01",
    ("fsp", 1e-12): "`fsp`, tolerance 1e-12",
    ("transient", 1e-12): "`transient`, tolerance 1e-12",
}


def table() -> str:
    """CPU seconds and errors as stored, two digits each."""
    stored = pd.read_csv(STORED)
    rows = ["| method | CPU (s) | error (copies) |", "|---|---|---|"]
    for (method, setting), name in SHOWN.items():
        (found,) = stored[(stored["method"] == method) & (stored["setting"] == setting)].to_dict("records")
        rows.append(f"| {name} | {found['cpu_seconds']:.2g} | {found['error_copies']:.1g} |")
    return "\n".join(rows) + "\n"


def written(text: str) -> str:
    """The page with its table made anew; ValueError: it has no block for it."""
    if not BLOCK.search(text):
        raise ValueError(f"{PAGE.name} has no block <!-- costs -->")
    return BLOCK.sub(lambda found: found[1] + table() + found[2], text)


if __name__ == "__main__":
    PAGE.write_text(written(PAGE.read_text("utf-8")), encoding="utf-8")
