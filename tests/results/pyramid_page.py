"""What held-out growth says of class rates, from results/pyramid45/breaking: a block of the pyramid's page.

    python -m tests.results.pyramid_page

writes it anew, between the line `<!-- breaking -->` and the line `<!-- end -->`; `make pyramid` makes the files before.
"""

from __future__ import annotations

import json
import re
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from calibration.estimating.exposure import Exposure, count
from calibration.pipeline.plan import PlannedRuns, StudyPlan
from kinetics.assembly import Derivation, RuleBook, derive
from kinetics.rates import ClassRates
from kinetics.runs import NO_BREAK
from kinetics.support.intervals import exact_limits
from mechsim.runs.record import RunRecord
from mechsim.runs.store import RunStore
from tests.results.studies import ROOT, paragraph, table

PAGE = ROOT / "results" / "pyramid45" / "README.md"
FOLDER = PAGE.parent / "breaking"
BLOCK = re.compile(r"(<!-- breaking -->\n).*?(<!-- end -->)", re.DOTALL)
PLAN = StudyPlan.load(FOLDER / "plan.toml")


class Contacts(NamedTuple):
    """Dockings of free cubes at places that touch so many cubes."""

    touched: int
    events: int
    exposure: float

    @property
    def rate(self) -> float:
        """Dockings per way and tu."""
        return self.events / self.exposure

    @property
    def limits(self) -> tuple[float, float]:
        """Exact 95 % limits of the rate."""
        low, high = exact_limits(self.events, self.exposure)
        return float(low), float(high)


@cache
def derivation() -> Derivation:
    """The book's network; it takes seconds."""
    return derive(RuleBook.load("pyramid45_breaking"))


def records(part: PlannedRuns) -> list[RunRecord]:
    """The stored runs of the calibration, or the held-out ones."""
    return list(RunStore(FOLDER / "runs").existing(PLAN.specs(part)))


def contacts(runs: list[RunRecord]) -> list[Contacts]:
    """Dockings and exposure by the number of cubes that the place touches."""
    bonds = [len(structure.bonds) for structure in derivation().structures.values()]
    touched = np.array(
        [bonds[e.after[0]] - sum(bonds[b] for b in e.before) if len(e.before) == 2 else 0 for e in derivation().events]
    )
    whole: Exposure = sum(count(run.path) for run in runs)  # type: ignore[assignment]
    return [
        Contacts(n, int(whole.events[touched == n].sum()), float(whole.exposure[touched == n].sum()))
        for n in sorted(set(touched.tolist()) - {0})
        if whole.exposure[touched == n].sum() > 0
    ]


@cache
def compared() -> dict[str, Any]:
    """The stored comparison with the rates of jacks."""
    (found,) = json.loads((FOLDER / "by_jacks.json").read_text(encoding="utf-8"))["comparisons"]
    return dict(found)


def number(value: float) -> str:
    """Three digits at most."""
    return f"{value:.0f}" if value >= 100 else f"{value:.1f}" if value >= 10 else f"{value:.2f}"


def rates_of_places() -> str:
    """The rate of docking by the number of cubes touched, beside the jacks' constant."""
    runs = records(PLAN.held_out) + records(PLAN.calibration)
    found = contacts(runs)
    rows = [
        (
            str(each.touched), str(each.events), f"{each.exposure:,.0f}",
            f"{1e5 * each.rate:.2f} ({1e5 * each.limits[0]:.2f} to {1e5 * each.limits[1]:.2f})",
        )
        for each in found
    ]  # fmt: skip
    jacks = ClassRates.load(ROOT / "results" / "jack13" / "classes.toml").classes["join touching 1"]
    words = (
        f"Of the {len(runs)} runs, by how many cubes the place of a docking touches; the jacks' constant is "
        f"{1e5 * jacks.rate:.2f} ({1e5 * (jacks.low or 0):.2f} to {1e5 * (jacks.high or 0):.2f}) in the same unit:"
    )
    titles = ("cubes touched", "dockings", "exposure (tu)", "rate per way (1e-5/tu)")
    return f"{paragraph(words)}\n\n{table(titles, rows)}"


def growth() -> str:
    """The comparison as a table, and its verdict."""
    found = compared()
    rows = [
        (e["kind"], str(e["seen"]), f"{number(e['expected'])} ({e['low']:.0f} to {e['high']:.0f})", "", f"{e['p']:.2g}")
        for e in found["events"]
    ]
    for curve, each in found["curves"].items():
        seen, expected, low, high = (each[key][-1] for key in ("observed", "predicted", "low", "high"))
        band = f"{number(expected)} ({number(low)} to {number(high)})"
        rows.append((curve, number(seen), band, f"{100 * each['coverage']:.0f} %", f"{each['p_misfit']:.2g}"))
    titles = ("", "seen", "predicted (95 %)", "times inside", "p")
    ends = f"Rates of jacks, {found['groups']} predicted groups of {found['runs']} runs; curves at 400 tu:"
    return f"{paragraph(ends)}\n\n{table(titles, rows)}\n\n{paragraph('Verdict: ' + found['verdict'] + '.')}"


def cost() -> str:
    """What was run, and how many bonds broke."""
    parts = []
    for part, words in ((PLAN.held_out, "held out"), (PLAN.calibration, "calibration")):
        runs = records(part)
        broken = sum(int((run.arrays["partners"] != NO_BREAK).sum()) for run in runs)
        seconds = sum(run.cost["cpu_seconds"] for run in runs)
        planned = sum(tanks.runs for tanks in part.tanks)
        made = f"{len(runs)}" if len(runs) == planned else f"{len(runs)} of {planned}"
        if runs:
            parts.append(f"{words}, {made} runs of 400 tu ({seconds:.0f} s of CPU time, {broken} breaks)")
        else:
            parts.append(f"{words}, none of {planned} runs")
    return paragraph(f"Made of what the plan fixed: {'; '.join(parts)}.")


def block() -> str:
    """All of it."""
    return f"{cost()}\n\n{growth()}\n\n{rates_of_places()}"


def filled(page: str) -> str:
    """The page with its block as the files have it."""
    return BLOCK.sub(lambda found: f"{found[1]}\n{block()}\n\n{found[2]}", page)


def main() -> None:
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
