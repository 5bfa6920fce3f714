"""The outcome of a verification: findings, verdict, and the power that was measured, as text and for JSON."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from math import inf
from typing import Any

from kinetics.support.shown import ResultTable, Shown
from kinetics.support.tables import text_table
from kinetics.trust.verification.base import SamplerFinding
from kinetics.trust.verification.correlated_runs import LAGS
from kinetics.trust.verification.rate_scores import RateSight

CHECK_TITLES = ("check", "findings", "failed", "p-value", "sees")
MOST_SHOWN = 10  # findings that failed
NOT_SEEN = (
    "mistakes so small, or in so few runs, that correct runs scatter as much: see the tables above",
    f"runs that are similar but not equal, at distances other than {', '.join(map(str, LAGS))} and half of the runs",
    "seeds that share random numbers but are not consecutive",
    "anything after the last time, in other networks, or from other initial counts",
)


@dataclass(frozen=True)
class CheckSummary:
    """The result of one check: how many findings, and the smallest p-value times their number."""

    name: str
    sees: str
    findings: int
    failed: int
    p_value: float


@dataclass(frozen=True)
class MutantOutcome:
    """Whether a mutant of the runs was caught, and by which checks."""

    name: str
    caught_by: tuple[str, ...]

    @property
    def caught(self) -> bool:
        """Whether any check saw it."""
        return bool(self.caught_by)


@dataclass(frozen=True, repr=False)
class Verification(Shown):
    """The outcome of all checks of a sampler.

    false_alarm : largest probability that a correct sampler fails any check
    error : error of the exact probabilities, which the checks allow for
    is_bound : whether that error is proven; otherwise it is an estimate, and so is the false-alarm rate
    mutants : which mistakes, made to these runs, were seen; none if power was not asked for
    rates : how small an error of each rate constant is seen
    unbounded : channels whose rates have no proven error; the reference then is an estimate

    >>> from kinetics import Direct, Network, verify
    >>> decay = Network.from_text("decay: A -> 0, 0.1")
    >>> found = verify(decay, Direct(), {"A": 20}, [5.0, 10.0], runs=2000, seed=1)
    >>> found.passed, found.is_bound, [mutant.name for mutant in found.mutants if not mutant.caught]
    (True, True, ['the rate of decay 1 % too high'])
    """

    method: str
    runs: int
    seed: int
    false_alarm: float
    error: float
    is_bound: bool
    findings: tuple[SamplerFinding, ...]
    checks: tuple[CheckSummary, ...]
    mutants: tuple[MutantOutcome, ...] = ()
    rates: tuple[RateSight, ...] = ()
    unbounded: tuple[str, ...] = ()

    @property
    def failures(self) -> tuple[SamplerFinding, ...]:
        """The findings that failed, the worst first."""
        return tuple(sorted((f for f in self.findings if f.failed), key=lambda f: f.p_value / f.level))

    @property
    def passed(self) -> bool:
        """Whether no finding failed."""
        return not self.failures

    @property
    def headline(self) -> str:
        """Whether all checks passed, of how many findings."""
        word = "passed" if self.passed else f"{len(self.failures)} failed"
        return f"{self.method}: {word}; {len(self.findings)} findings on {self.runs} runs (seed {self.seed})"

    def summary(self) -> ResultTable:
        """One row a check; what failed, and what no check sees, below."""
        notes = [f"failed: {f.what}: {f.found:.6g}, exact {f.expected:.6g}, p {f.p_value:.1e}" for f in self.failures]
        unseen = [f"detected by no check: {what}" for what in NOT_SEEN]
        chance = f"a correct sampler fails with probability {self.false_alarm:g} at most"
        return ResultTable(self.headline, CHECK_TITLES, self._checks, [*notes[:MOST_SHOWN], chance, *unseen])

    @property
    def _checks(self) -> list[tuple[str, ...]]:
        return [(c.name, str(c.findings), str(c.failed), f"{c.p_value:.2g}", c.sees) for c in self.checks]

    def __str__(self) -> str:
        right = "" if self.is_bound else ", if the solution's error, an estimate, holds"
        if self.unbounded:
            right += f": no bound on the rounding of {', '.join(map(repr, self.unbounded))}"
        chance = f"a correct sampler fails one with probability {self.false_alarm:g} at most{right}"
        number = f"{len(self.findings)} findings on {self.runs} runs (seed {self.seed}), {len(self.failures)} failed"
        lines = [f"{self.method}: {number}; {chance}"]
        if self.failures:
            rows = [(f.what, f"{f.found:.6g}", f"{f.expected:.6g}", f"{f.p_value:.1e}") for f in self.failures]
            lines.append(text_table(("finding", "found", "exact", "p-value"), rows[:MOST_SHOWN]))
        lines.append(text_table(CHECK_TITLES, self._checks))
        if self.mutants:
            lines.append("power, measured on mutants of these runs, each made once:")
            seen = [(m.name, ", ".join(m.caught_by) or "NOT DETECTED") for m in self.mutants]
            lines.append(text_table(("mutant", "detected by"), seen))
        if self.rates:
            lines.append("wrong rates, detected with probability 0.999:")
            sights = [(r.channel, _percent(r.smallest), _number(r.runs_for_one_percent)) for r in self.rates]
            lines.append(text_table(("rate of", "error detected in these runs", "runs that detect 1 %"), sights))
        lines += ["detected by no check:", *(f"- {what}" for what in NOT_SEEN)]
        return "\n".join(lines)

    def to_json(self) -> dict[str, Any]:
        """Everything but the findings that passed, as plain values."""
        return {
            "method": self.method,
            "runs": self.runs,
            "seed": self.seed,
            "passed": self.passed,
            "false_alarm": self.false_alarm,
            "error": self.error,
            "is_bound": self.is_bound,
            "unbounded": list(self.unbounded),
            "findings": len(self.findings),
            "failures": [asdict(finding) for finding in self.failures],
            "checks": [asdict(check) for check in self.checks],
            "power": {
                "mutants": [{"name": m.name, "caught": m.caught, "caught_by": list(m.caught_by)} for m in self.mutants],
                "rates": [
                    {
                        "channel": r.channel,
                        "smallest": _finite(r.smallest),
                        "runs_for_one_percent": _finite(r.runs_for_one_percent),
                    }
                    for r in self.rates
                ],
                "not_seen": list(NOT_SEEN),
            },
        }


def _percent(value: float) -> str:
    return f"{100 * value:.2g} %" if value < 1.0 else "not at all"


def _number(value: float) -> str:
    return f"{value:,.0f}" if value < 1e7 else f"{value:.1e}" if value < inf else "never"


def _finite(value: float) -> float | None:
    return value if value < inf else None
