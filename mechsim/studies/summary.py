"""Results of a study: first-passage times at each point, fitted exponents beside the paper's, and their tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kinetics.support.arrays import Floats
from kinetics.support.output import write_whole
from kinetics.support.plots import save
from kinetics.support.shown import on_axes
from kinetics.support.tables import columns, csv_text, rounded
from mechsim.runs.record import RunRecord
from mechsim.studies.cost import PointTrial
from mechsim.studies.fit import Estimate, Share, exponents, mean, median, power, ranking
from mechsim.studies.plots import boxes
from mechsim.studies.study import Study, StudyPoint

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class PointResult:
    """First times at a point.

    times : (n,) tu, inf where the cap came first; runs : their numbers
    stopped : runs that the guard stopped; they are left out, for what they would have become is not known
    cpu_seconds : of all its runs; paper : the paper's median, tu, where it gives one
    """

    point: StudyPoint
    trial: PointTrial
    times: Floats
    runs: tuple[int, ...]
    stopped: int
    cpu_seconds: float
    cap: float
    paper: float | None = None

    @property
    def censored(self) -> int:
        """Runs without a target by the cap."""
        return int(np.isinf(self.times).sum())

    @property
    def mean(self) -> Estimate:
        """Mean of min(time, cap), tu."""
        return mean(self.times, self.cap)

    @property
    def median(self) -> Estimate:
        """tu."""
        return median(self.times)


@dataclass(frozen=True)
class Exponent:
    """A power law. of : what it says; paper : the paper's exponent, where it gives one"""

    of: str
    estimate: Estimate
    paper: float | None = None

    @property
    def verdict(self) -> str:
        """Where the paper's exponent lies by our limits."""
        if self.paper is None:
            return ""
        if self.estimate.low <= self.paper <= self.estimate.high:
            return "the paper's is within"
        return "the paper's is above" if self.paper > self.estimate.high else "the paper's is below"


@dataclass(frozen=True)
class StudyResult:
    """All that a study found. why : what could not be fitted, and why"""

    study: Study
    seed: int
    points: tuple[PointResult, ...]
    exponents: tuple[Exponent, ...]
    shares: tuple[Share, ...]
    why: str = ""

    def __str__(self) -> str:
        parts = [self.study.title, columns(self._point_rows())]
        if self.exponents:
            parts.append(columns(self._exponent_rows()))
        if self.shares:
            parts.append(columns(self._share_rows()))
        return "\n\n".join([*parts, *([f"not fitted: {self.why}"] if self.why else [])])

    def tables(self) -> dict[str, list[dict[str, Any]]]:
        """Rows by table: points, times (each run), exponents, factors."""
        every = [
            dict(self._levels(found)) | {"run": run, "first_time": None if math.isinf(t) else t, "cap": found.cap}
            for found in self.points
            for run, t in zip(found.runs, found.times.tolist(), strict=True)
        ]
        return {
            "points": self._point_rows(),
            "times": every,
            "exponents": self._exponent_rows(),
            "factors": self._share_rows(),
        }

    def save(self, folder: Path) -> tuple[Path, ...]:
        """The tables as CSV files and the box plots as SVG, named after the study, each whole or not at all."""
        written = []
        for name, rows in self.tables().items():
            path = folder / f"{self.study.name}_{name}.csv"
            if rows:
                write_whole(path, csv_text(rounded(rows)))
                written.append(path)
        if any(found.times.size for found in self.points):
            path = folder / f"{self.study.name}.svg"
            save(str(path), self.plot, size=(6.4, 4.0) if len(self.study.factors) == 1 else (10.0, 4.6))
            written.append(path)
        return tuple(written)

    @on_axes
    def plot(self, ax: Axes) -> Axes:
        """Box plots, as the paper's Figs. 4 and 5; returns `ax`."""
        first, found = self.study.factors[0], self.points
        boxes(
            ax,
            [each.times for each in found],
            np.array([each.point.levels for each in found]),
            [factor.label for factor in self.study.factors],
            name=first.name,
            cap=self.study.cap,
            paper=np.array([math.nan if each.paper is None else each.paper for each in found]),
            speeds=[each.trial.speed for each in found] if first.is_speed else None,
        )
        target = found[0].point.specs(self.study.cap, 1, self.seed)[0].until
        ax.set_ylabel(f"time to the first {target} (tu)")
        ax.set_title(self.study.title, fontsize=10)
        return ax

    def _levels(self, found: PointResult) -> Iterable[tuple[str, float]]:
        return zip((factor.name for factor in self.study.factors), found.point.levels, strict=True)

    def _point_rows(self) -> list[dict[str, Any]]:
        rows = []
        for found in self.points:
            row: dict[str, Any] = dict(self._levels(found))
            row |= {"speed": found.trial.speed, "speed_error": found.trial.speed_error}
            for i, factor in enumerate(self.study.factors):
                if factor.paper_speeds:
                    row["paper_speed"] = factor.paper_speeds[factor.levels.index(found.point.levels[i])]
            row |= {"runs": found.times.size, "censored": found.censored, "stopped": found.stopped}
            for name, estimate in (("median", found.median), ("mean", found.mean)):
                row |= {name: estimate.value, f"{name}_low": estimate.low, f"{name}_high": estimate.high}
            rows.append(row | {"paper_median": found.paper, "cpu_seconds": found.cpu_seconds})
        return rows

    def _exponent_rows(self) -> list[dict[str, Any]]:
        return [
            {
                "of": e.of,
                "exponent": e.estimate.value,
                "low": e.estimate.low,
                "high": e.estimate.high,
                "paper": e.paper,
                "verdict": e.verdict,
            }
            for e in self.exponents
        ]

    def _share_rows(self) -> list[dict[str, Any]]:
        return [
            {
                "effect": " x ".join(share.factors),
                "spread_of_log_time": share.spread,
                "f": share.f,
                "degrees_of_freedom": f"{share.freedom}, {share.rest}",
                "p_value": share.p_value,
            }
            for share in self.shares
        ]


def summarise(
    study: Study,
    points: Sequence[StudyPoint],
    trials: Mapping[StudyPoint, PointTrial],
    records: Sequence[RunRecord],
    seed: int,
) -> StudyResult:
    """Put the records to their points, and fit what can be fitted. Records of other points are passed over."""
    known = {paper.at: paper.median for paper in study.paper}
    by_start: dict[tuple[str, int], list[RunRecord]] = {}
    for record in records:
        by_start.setdefault((record.spec.scene.fingerprint, record.spec.n_cubes), []).append(record)
    found = []
    for point in points:
        mine = sorted(by_start.get((point.scene.fingerprint, point.cubes), []), key=lambda record: record.spec.run)
        sound = [record for record in mine if record.completed]
        found.append(
            PointResult(
                point=point,
                trial=trials[point],
                times=np.array([first_time(record) for record in sound]),
                runs=tuple(record.spec.run for record in sound),
                stopped=len(mine) - len(sound),
                cpu_seconds=sum(record.cost["cpu_seconds"] for record in mine),
                cap=study.cap,
                paper=known.get(point.levels),
            )
        )
    fitted: tuple[Exponent, ...] = ()
    shares: tuple[Share, ...] = ()
    why = ""
    try:
        fitted = _exponents(study, found)
        if len(study.factors) > 1:
            kept = [each for each in found if each.times.size]
            levels = np.array([each.point.levels for each in kept])
            shares = ranking([f.name for f in study.factors], [each.times for each in kept], levels, study.cap)
    except ValueError as error:
        why = str(error)
    return StudyResult(study, seed, tuple(found), fitted, shares, why)


def first_time(record: RunRecord) -> float:
    """Time of the first target, tu; inf where the run ended without one."""
    if record.spec.until is None:
        raise ValueError(f"{record.spec.title} is not a run of a study: it waits for nothing")
    time = float(record.path.first_time(record.spec.until))
    return math.inf if math.isnan(time) else time


def _exponents(study: Study, found: Sequence[PointResult]) -> tuple[Exponent, ...]:
    """Exponents of time in each factor that has several levels; in speed, for a factor that stands for it."""
    varied = [i for i, f in enumerate(study.factors) if len({each.point.levels[i] for each in found}) > 1]
    found_exponents: list[Exponent] = []
    for i in varied:
        factor = study.factors[i]
        if factor.is_speed:
            speeds = np.array([each.trial.speed for each in found])
            at = np.array([each.point.levels[i] for each in found])
            if len(set(at.tolist())) > 2 and np.isfinite(speeds).all() and (speeds > 0).all():
                theirs = factor.paper_speeds
                paper = power(np.array(factor.levels), np.array(theirs)).value if len(theirs) > 2 else None
                found_exponents.append(Exponent(f"speed ~ {factor.name}^p", power(at, speeds), paper))
    kept = [each for each in found if each.times.size]
    if not varied or not kept:
        return tuple(found_exponents)
    fitted = [_values(study, i, kept) for i in varied]
    estimates = exponents([each.times for each in kept], np.column_stack(fitted), study.cap)
    for i, estimate in zip(varied, estimates, strict=True):
        factor = study.factors[i]
        what = "speed" if factor.is_speed else factor.name
        found_exponents.append(Exponent(f"time ~ {what}^p", estimate, factor.paper_exponent))
    return tuple(found_exponents)


def _values(study: Study, i: int, found: Sequence[PointResult]) -> Floats:
    """Values that a factor is fitted against: its levels, or the mean speeds measured at those levels."""
    levels = np.array([each.point.levels[i] for each in found])
    if not study.factors[i].is_speed:
        return levels
    speeds = np.array([each.trial.speed for each in found])
    return np.array([speeds[levels == level].mean() for level in levels])
