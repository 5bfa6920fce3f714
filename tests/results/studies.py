"""The studies under results: their plans and stored files, and how their pages write numbers."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from calibration.pipeline.plan import StudyPlan
from kinetics.rates import Rates

ROOT = Path(__file__).parents[2]
STUDIES = {name: ROOT / "results" / name for name in ("line4", "t5")}


class Study:
    """One study's folder, and what stands in it."""

    def __init__(self, name: str) -> None:
        self.folder = STUDIES[name]
        self._stored: dict[str, Any] = {}

    def stored(self, name: str) -> dict[str, Any]:
        """What a command said with --json."""
        if name not in self._stored:
            self._stored[name] = json.loads((self.folder / name).read_text(encoding="utf-8"))
        return self._stored[name]

    @property
    def events(self) -> pd.DataFrame:
        """Held-out events, seen and expected."""
        return pd.DataFrame(self.stored("validation.json")["events"])

    @property
    def summaries(self) -> list[dict[str, Any]]:
        """Of each size of the held-out runs."""
        return [each["summary"] for each in self.stored("validation.json")["comparisons"]]

    @cached_property
    def plan(self) -> StudyPlan:
        return StudyPlan.load(self.folder / "plan.toml")

    @cached_property
    def rates(self) -> Rates:
        return Rates.load(self.folder / "rates.toml")


def table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = (titles, ["---"] * len(titles), *rows)
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def bullets(lines: Sequence[str]) -> str:
    return "\n".join(textwrap.fill(f"- {line}", 118, subsequent_indent="  ", break_on_hyphens=False) for line in lines)


def paragraph(text: str) -> str:
    return textwrap.fill(text, 120, break_on_hyphens=False)


def listed(things: Sequence[Any]) -> str:
    *others, last = map(str, things)
    return f"{', '.join(others)} and {last}" if others else last


def ratio(seen: float, expected: float) -> str:
    return f"{seen:.0f} / {expected:.{0 if expected >= 100 else 1}f} = {seen / expected:.2f}"


def cubes_in(composition: dict[str, int]) -> int:
    sizes = {"monomer": 1, "dimer": 2, "trimer": 3, "quadmer": 4}
    return sum(sizes[name.split(".")[0]] * n for name, n in composition.items())


def only(values: Any) -> Any:
    (value,) = set(values)
    return value


def one(values: Any) -> str:
    return f"{only(values):,g}"
