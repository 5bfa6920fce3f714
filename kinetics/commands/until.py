"""First times of a condition next to a prediction, from runs that end there."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

from kinetics.network.predicates import Condition
from kinetics.predicting import Job
from kinetics.runs import FirstTimes
from kinetics.sampling import SamplingMethod
from kinetics.sampling.methods import sampling_method
from kinetics.support.tables import in_unit

QUANTILES = (0.025, 0.5, 0.975)


@dataclass(frozen=True, eq=False)
class EndingRuns:
    """Runs of a job's model that end at a condition, checked before any is made."""

    job: Job
    method: SamplingMethod
    condition: Condition

    @classmethod
    def of(cls, job: Job, method: str | None, until: str) -> EndingRuns:
        """Runs by this method, `auto` for None. ValueError: no such condition, or a method that does not take any."""
        made = cls(job, sampling_method(method or "auto"), Condition(until, job.model))
        made.method.source(job.model.network, job.model.initial, job.seed, job.max_events, made.condition)
        return made

    def first_times(self, runs: int, end: float) -> FirstTimes:
        """When the condition first holds in so many runs, observed until `end`, tu."""
        job, model = self.job, self.job.model
        job.report("runs until the condition")
        return self.method.first_times(
            model.network, model.initial, self.condition, [end], runs, job.seed, job.threads, max_events=job.max_events
        )


def first_times_text(found: FirstTimes, has_evidence: bool) -> tuple[str, ...]:
    """The first times in a line, and what to know about them."""
    unit = found.network.time_unit
    ends = [
        in_unit(f"{each.value:.4g}", unit) if each.value < inf else f"later than {in_unit(f'{found.horizon:g}', unit)}"
        for each in map(found.answer, QUANTILES)
    ]
    lines = [f"{found.headline}; quantiles of 2.5, 50 and 97.5 %: {', '.join(ends)}; method {found.method}"]
    if found.truncated is not None:
        lines.append(f"some runs were truncated before the condition held: {found.truncated.cause}")
    if has_evidence:
        lines.append("these times are those at the posterior mean of each rate constant")
    return tuple(lines)


def first_times_data(found: FirstTimes) -> dict[str, Any]:
    """The first times for JSON."""
    return {
        "condition": found.condition,
        "method": found.method,
        "runs": found.runs,
        "censored": found.censored,
        "horizon": found.horizon,
        "mean": found.answer("mean").to_dict(),
        "probability": found.answer("probability").to_dict() if found.truncated is None else None,
        "quantiles": {q: found.answer(q).to_dict() for q in QUANTILES},
    }
