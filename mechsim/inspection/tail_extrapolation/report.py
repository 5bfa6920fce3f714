"""Rates of hits and breaks from the logs of runs: as a table, for programs, and as a figure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from kinetics.support import plots
from kinetics.support.intervals import exact_limits
from kinetics.support.tables import columns
from mechsim.inspection.tail_extrapolation.loads import Loads, logs_of, pooled
from mechsim.inspection.tail_extrapolation.rates import (
    BreakRate,
    CountedBreaks,
    HitRate,
    SizeExponent,
    break_rate,
    check,
    exponent,
    exponent_doubts,
    hit_rates,
    levels_of,
)
from mechsim.runs.record import RunRecord

SOURCES = ("all", "bodies", "walls")
MOST_SHOWN = 2.0  # thresholds, in the figure
FIFTH = 5  # an extrapolation from every fifth run of each kind of tank is checked against the breaks in the others


@dataclass(frozen=True, eq=False)
class TailExtrapolation:
    """Rates of hits and breaks from the logs of runs.

    cpu_seconds : of all runs
    missing : species and sources with too few hits for a tail, and why
    checks : an extrapolation from every fifth run of each kind of tank against the breaks counted in the others; empty
        below five runs
    """

    loads: Loads
    runs: int
    cpu_seconds: float
    hits: tuple[HitRate, ...]
    exponents: tuple[SizeExponent, ...]
    exponent_doubts: tuple[str, ...]
    breaks: tuple[BreakRate, ...]
    missing: tuple[str, ...]
    checks: tuple[CountedBreaks, ...]

    def as_dict(self) -> dict[str, Any]:
        """For programs."""
        return {
            "runs": self.runs,
            "cpu_seconds": self.cpu_seconds,
            "log_above": self.loads.log_above,
            "threshold": self.loads.threshold,
            "hits": [asdict(row) for row in self.hits],
            "exponents": [asdict(row) for row in self.exponents],
            "exponent_doubts": self.exponent_doubts,
            "breaks": [asdict(row) | {"is_trustworthy": row.is_trustworthy} for row in self.breaks],
            "missing": self.missing,
            "checks": [asdict(row) for row in self.checks],
        }

    def __str__(self) -> str:
        n = len(self.loads.value)
        parts = [f"{n} hits above {self.loads.log_above:g} in {self.runs} runs, {self.cpu_seconds:.0f} s of CPU time"]
        parts.append("hits per body, 1 / tu, with 95 % intervals\n" + columns([asdict(row) for row in self.hits]))
        if self.exponents:
            parts.append("exponent of the partner's size\n" + columns([asdict(row) for row in self.exponents]))
        if self.exponent_doubts:
            parts.append("exponent not trustworthy: " + "; ".join(self.exponent_doubts))
        if self.breaks:
            shown = [_shown(row) for row in self.breaks]
            parts.append("rates of breaks, extrapolated, with 95 % intervals\n" + columns(shown))
        for row in self.breaks:
            if not row.is_trustworthy:
                what = f"{row.species} by {row.source} at {row.threshold:g}"
                parts.append(f"extrapolation not trustworthy, {what}: {'; '.join(row.doubts)}")
        parts += list(self.missing)
        if self.checks:
            title = "an extrapolation from every fifth run of each tank against the breaks counted in the others"
            parts.append(f"{title}\n" + columns([asdict(row) for row in self.checks]))
        return "\n\n".join(parts)


def extrapolate(records: Sequence[RunRecord], thresholds: Sequence[float] = ()) -> TailExtrapolation:
    """Read the logs of runs of one physics. thresholds: at which rates are wanted; none: the runs' own."""
    runs, tanks = logs_of(records), [_tank_of(record) for record in records]
    loads = pooled(runs)
    for value in thresholds:
        if not value > loads.log_above:
            raise ValueError(f"threshold {value:g}; the logs begin at {loads.log_above:g}: expected one above")
    wanted = tuple(thresholds) or (loads.threshold,)
    if not max(wanted) > loads.log_above:
        raise ValueError(f"the logs begin at the threshold, {loads.log_above:g}; name a higher one by --at")
    levels = levels_of(loads.log_above, wanted[0])
    exponents = [e for level in levels if (e := exponent(loads, level)) is not None]
    alpha = exponents[0].alpha if exponents else 0.0
    breaks, missing = [], []
    for s in loads.can_break:
        for source in SOURCES:
            for threshold in wanted:
                try:
                    breaks.append(break_rate(loads, s, source, threshold, alpha))
                except ValueError as error:
                    missing.append(f"{loads.species[s]} by {source} at {threshold:g}: {error}")
    fifth, others = _split(runs, tanks)
    can_check = len(records) >= FIFTH and loads.threshold > loads.log_above
    return TailExtrapolation(
        loads,
        len(records),
        sum(record.cost.get("cpu_seconds", 0.0) for record in records),
        tuple(hit_rates(loads, sorted({*levels, *wanted}))),
        tuple(exponents),
        tuple(exponent_doubts(exponents)) if exponents else (),
        tuple(breaks),
        tuple(missing),
        tuple(check(pooled(fifth), pooled(others), len(others))) if can_check and others else (),
    )


def _tank_of(record: RunRecord) -> str:
    """The kind of tank of a run, for people."""
    spec = record.spec
    return f"{spec.n_cubes} cubes in {' x '.join(f'{edge:g}' for edge in spec.scene.tank.size)}"


def _split(runs: Sequence[Loads], tanks: Sequence[str]) -> tuple[list[Loads], list[Loads]]:
    """Every fifth run of each kind of tank, and the others: both parts hold the same mix of tanks."""
    seen: Counter[str] = Counter()
    parts: tuple[list[Loads], list[Loads]] = [], []
    for run, tank in zip(runs, tanks, strict=True):
        parts[seen[tank] % FIFTH > 0].append(run)
        seen[tank] += 1
    return parts


def _shown(row: BreakRate) -> dict[str, Any]:
    found = {"species": row.species, "by": row.source, "threshold": row.threshold, "rate": row.rate}
    found |= {"low": row.low, "high": row.high, "hits": row.tails[0].number, "shape": row.tails[0].shape}
    return found | {"trustworthy": "yes" if row.is_trustworthy else "no"}


def plot_tails(ax: Any, found: TailExtrapolation) -> Any:
    """Rate of hits on a body above each load, by struck species, with 95 % limits and fitted tails; returns `ax`."""
    loads = found.loads
    for s in loads.can_break:
        value = np.sort(loads.value[loads.struck == s])
        if not len(value):
            continue
        above = np.arange(len(value), 0, -1)  # at least so large
        low, high = exact_limits(above, loads.alone[s])
        ax.plot(value, above / loads.alone[s], color=plots.colour(s), label=loads.species[s])
        ax.fill_between(value, low, high, color=plots.colour(s), alpha=0.2, linewidth=0)
        fits = [row for row in found.breaks if (row.species, row.source) == (loads.species[s], "all")]
        if fits:
            tail = fits[-1].tails[0]
            far = np.linspace(tail.level, MOST_SHOWN * loads.threshold, 200)
            rate = tail.number / loads.alone[s] * tail.beyond(far)
            ax.plot(far[rate > 0], rate[rate > 0], color=plots.colour(s), linestyle="--", linewidth=0.9)
    ax.axvline(loads.threshold, color="0.4", linestyle=":", label="threshold")
    ax.set_xlim(right=MOST_SHOWN * loads.threshold)  # a single load far out would squeeze all others
    ax.set_yscale("log")
    ax.set_ylim(bottom=0.1 / max(float(loads.alone.max()), 1.0))
    ax.set_xlabel("load on the most loaded bond")
    ax.set_ylabel("hits above it, per body (1 / tu)")
    ax.legend(frameon=False)
    return ax
