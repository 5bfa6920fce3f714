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
from kinetics.rates import ClassRate, ClassRates
from kinetics.runs import NO_BREAK
from kinetics.support.intervals import exact_limits
from mechsim.runs.record import RunRecord
from mechsim.runs.store import RunStore
from tests.helpers.derived_books import derived
from tests.results.studies import ROOT, paragraph, table

PAGE = ROOT / "results" / "pyramid45" / "README.md"
FOLDER = PAGE.parent / "breaking"
BLOCK = re.compile(r"(<!-- breaking -->\n).*?(<!-- end -->)", re.DOTALL)
FIRST = StudyPlan.load(FOLDER / "plan.toml")  # whose held-out runs showed what places do
PLAN = StudyPlan.load(FOLDER / "touched.toml")  # which judges
BESIDE = {"control": "Control", "by_jacks": "Rates of jacks alone"}  # comparisons that do not judge
COMPARED = ("growth", *BESIDE)


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


def records(part: PlannedRuns) -> list[RunRecord]:
    """The stored runs of the calibration, or the held-out ones."""
    return list(RunStore(FOLDER / "runs").existing(PLAN.specs(part)))


def contacts(runs: list[RunRecord]) -> list[Contacts]:
    """Dockings and exposure by the number of cubes that the place touches."""
    book = derived("pyramid45_breaking")
    bonds = [len(structure.bonds) for structure in book.structures.values()]
    touched = np.array(
        [bonds[e.after[0]] - sum(bonds[b] for b in e.before) if len(e.before) == 2 else 0 for e in book.events]
    )
    whole: Exposure = sum(count(run.path) for run in runs)  # type: ignore[assignment]
    return [
        Contacts(n, int(whole.events[touched == n].sum()), float(whole.exposure[touched == n].sum()))
        for n in sorted(set(touched.tolist()) - {0})
        if whole.exposure[touched == n].sum() > 0
    ]


@cache
def compared(name: str) -> dict[str, Any]:
    """A stored comparison with the held-out runs: `growth`, `control` or `by_jacks`."""
    (found,) = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))["comparisons"]
    return dict(found)


def number(value: float) -> str:
    """Three digits at most."""
    return f"{value:.0f}" if value >= 100 else f"{value:.1f}" if value >= 10 else f"{value:.2f}"


def rates_of_places() -> str:
    """The rate of docking by the number of cubes touched, in the calibration runs, beside the constants in use."""
    runs = records(PLAN.calibration)
    classes = ClassRates.load(FOLDER / "classes.toml").classes
    rows = [
        (
            str(each.touched), str(each.events), f"{each.exposure:,.0f}", _per_way(each.rate, *each.limits),
            _per_way(*_constant(classes[f"join touching {each.touched}"])),
        )
        for each in contacts(runs)
    ]  # fmt: skip
    titles = ("cubes touched", "dockings", "exposure (tu)", "rate per way (1e-5/tu)", "constant, jacks too")
    words = f"Of the {len(runs)} calibration runs of pyramids, by how many cubes the place of a docking touches:"
    return f"{paragraph(words)}\n\n{table(titles, rows)}"


def _constant(entry: ClassRate) -> tuple[float, float, float]:
    return entry.rate, entry.low or 0.0, entry.high or 0.0


def _per_way(rate: float, low: float, high: float) -> str:
    return f"{1e5 * rate:.2f} ({1e5 * low:.2f} to {1e5 * high:.2f})"


def growth() -> str:
    """The comparison that judges, the control and the rates of jacks alone as a table, and their verdicts."""
    judge, *others = (compared(name) for name in COMPARED)
    rows = [
        (
            e["kind"], str(e["seen"]), f"{number(e['expected'])} ({e['low']:.0f} to {e['high']:.0f})", "",
            f"{e['p']:.2g}", *(_other(number(o["events"][i]["expected"]), o["events"][i]["p"]) for o in others),
        )
        for i, e in enumerate(judge["events"])
    ]  # fmt: skip
    for curve, each in judge["curves"].items():
        seen, expected, low, high = (each[key][-1] for key in ("observed", "predicted", "low", "high"))
        beside = [o["curves"][curve] for o in others]
        rows.append(
            (
                curve, number(seen), f"{number(expected)} ({number(low)} to {number(high)})",
                f"{100 * each['coverage']:.0f} %", f"{each['p_misfit']:.2g}",
                *(_other(number(o["predicted"][-1]), o["p_misfit"]) for o in beside),
            )
        )  # fmt: skip
    titles = ("", "seen", "predicted (95 %)", "times inside", "p", *(f"{name} (p)" for name in BESIDE.values()))
    words = (
        f"{judge['runs']} held-out runs beside predicted groups of as many, curves at 400 tu. Rates of jacks and "
        f"pyramids by number touched, {judge['groups']} groups: {_bare(judge['verdict'])}."
    )
    for name, other in zip(BESIDE.values(), others, strict=True):
        words += f" {name}, {other['groups']} groups: {_bare(other['verdict'])}."
    return f"{table(titles, rows)}\n\n{paragraph(words)}"


def _other(expected: str, p: float) -> str:
    return f"{expected} ({p:.2g})"


def _bare(verdict: str) -> str:
    """Without the power, which the page tells once, and without what so few groups cannot fail."""
    return "not decided by so few" if verdict.startswith("not decided") else verdict.split("; this many", maxsplit=1)[0]


def cost() -> str:
    """What was run, and how many bonds broke."""
    parts = []
    for part, words in (
        (PLAN.calibration, "calibration"),
        (PLAN.held_out, "held out"),
        (FIRST.held_out, "held out before"),
    ):
        runs = records(part)
        broken = sum(int((run.arrays["partners"] != NO_BREAK).sum()) for run in runs)
        seconds = sum(run.cost["cpu_seconds"] for run in runs)
        parts.append(f"{words}, {len(runs)} runs of 400 tu ({seconds:.0f} s of CPU time, {broken} breaks)")
    return paragraph(f"Runs: {'; '.join(parts)}.")


def block() -> str:
    """All of it."""
    return f"{cost()}\n\n{rates_of_places()}\n\n{growth()}"


def filled(page: str) -> str:
    """The page with its block as the files have it."""
    return BLOCK.sub(lambda found: f"{found[1]}\n{block()}\n\n{found[2]}", page)


def main() -> None:
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
