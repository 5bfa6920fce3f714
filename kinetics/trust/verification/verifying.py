"""Verification of a sampler: its runs against the exact solution of the master equation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from kinetics.markov.transient import SolvingMethod
from kinetics.network import Model, Network
from kinetics.support.arrays import Counts, whole_number
from kinetics.support.cli.progress import stage
from kinetics.trust.verification.base import SamplerFinding
from kinetics.trust.verification.checks import SAMPLER_CHECKS
from kinetics.trust.verification.mutants import MUTANTS, Mutant, rate_mutant
from kinetics.trust.verification.rate_scores import RateScores, RateSight, sight_of_rates
from kinetics.trust.verification.reference import Reference
from kinetics.trust.verification.report import CheckSummary, MutantOutcome, Verification
from kinetics.trust.verification.sampler_runs import PATHS, CountSampler, SamplerRuns

FALSE_ALARM = 1e-6
ONE_PERCENT = 0.01
LARGEST_OFF = 0.3  # relative errors of rates up to which what is seen follows from the slope at 0
MOST_RATES = 6  # that are made wrong one by one


def verify(
    model: Model | Network,
    method: CountSampler,
    initial: Counts | None = None,
    times: ArrayLike = (),
    runs: int = 20_000,
    seed: int = 0,
    false_alarm: float = FALSE_ALARM,
    solver: SolvingMethod | None = None,
    with_power: bool = True,
) -> Verification:
    """Check runs of `method` against the exact probabilities at `times` (T,), tu, and against each other.

    method : a sampling method; of an object that has `name` and `simulate` alone, only counts are checked
    initial : counts at time 0 that go before the model's; None for these
    solver : Transient() by default; give FiniteStateProjection() where the state space is infinite
    with_power : also make the mistakes of `mutants` to these runs and say which are seen
    ValueError: fewer than 100 runs, times that begin at 0, or what the method or the solver refuses

    The checks are the family `SAMPLER_CHECKS`: of each time, of transitions, of rates, of runs that are equal or
    correlated within a seed and between neighbouring seeds, and of waits. Every p-value is exact or a proven bound, and
    Bonferroni's correction is over all findings, so that the false-alarm rate holds at any number of runs, as far as
    the solution's error is proven (`is_bound`): not if a rate law cannot be bounded, whose channel is then named.

    >>> from kinetics import Direct, Network, verify
    >>> decay = Network.from_text("decay: A -> 0, 0.1")
    >>> verify(decay, Direct(), {"A": 20}, [5.0, 10.0], runs=2000, seed=1, with_power=False).passed
    True
    """
    return verify_against(Reference.of(model, initial, times, solver), method, runs, seed, false_alarm, with_power)


def verify_against(
    reference: Reference,
    method: CountSampler,
    runs: int = 20_000,
    seed: int = 0,
    false_alarm: float = FALSE_ALARM,
    with_power: bool = True,
    paths: float = PATHS,
) -> Verification:
    """Verify a sampler against a reference shared by several; `paths` is the share of runs also made event by event.

    >>> from kinetics import Direct, Lockstep, Network
    >>> from kinetics.trust.verification import Reference, verify_against
    >>> reference = Reference.of(Network.from_text("A -> 0, 0.1"), {"A": 20}, [5.0, 10.0])
    >>> [verify_against(reference, method(), runs=500, with_power=False).passed for method in (Direct, Lockstep)]
    [True, True]
    """
    n = whole_number("runs", runs, 100)
    if not 0 < false_alarm < 1:
        raise ValueError(f"false_alarm = {false_alarm}; expected a probability")
    sample = SamplerRuns.of(reference, method, n, seed, paths)
    found = judge(sample, false_alarm)
    summaries = tuple(_summary(found, kind.name, kind.sees) for kind in SAMPLER_CHECKS)
    of_rates = [f.level for f in found if f.check == RateScores.name]
    sights = sight_of_rates(reference, n, of_rates[0]) if of_rates else ()
    outcomes: list[MutantOutcome] = []
    for mutant in (*MUTANTS, *_rates_off(reference, method, seed, sights)) if with_power else ():
        stage(f"{method.name}: runs with a mistake, {mutant.name}")
        changed = mutant.applied(sample)
        if changed is not None:
            seen = {f.check: None for f in judge(changed, false_alarm) if f.failed}
            outcomes.append(MutantOutcome(mutant.name, tuple(seen)))
    return Verification(
        method.name,
        n,
        seed,
        false_alarm,
        reference.error,
        reference.is_bound,
        found,
        summaries,
        tuple(outcomes),
        sights,
        reference.unbounded,
    )


def judge(sample: SamplerRuns, false_alarm: float = FALSE_ALARM) -> tuple[SamplerFinding, ...]:
    """Findings of all checks, the false alarms shared equally among checks and then among the findings of each.

    >>> from kinetics import Direct, Network
    >>> from kinetics.trust.verification import Reference, judge
    >>> from kinetics.trust.verification.sampler_runs import SamplerRuns
    >>> reference = Reference.of(Network.from_text("A -> 0, 0.1"), {"A": 20}, [5.0])
    >>> found = judge(SamplerRuns.of(reference, Direct(), 500, seed=1), false_alarm=1e-6)
    >>> any(finding.failed for finding in found), f"{sum(finding.level for finding in found):.1e}"
    (False, '1.0e-06')
    """
    judged: list[SamplerFinding] = []
    for kind in SAMPLER_CHECKS:
        found = list(kind().findings(sample))
        level = false_alarm / (len(SAMPLER_CHECKS) * max(len(found), 1))
        judged += [replace(finding, level=level, check=kind.name) for finding in found]
    return tuple(judged)


def _rates_off(
    reference: Reference, method: CountSampler, seed: int, sights: tuple[RateSight, ...]
) -> Iterator[Mutant]:
    """Rates off by 1 %, and by what should be seen, of each channel, or of some spread over them."""
    able = [sight for sight in sights if sight.smallest < LARGEST_OFF]
    for i in np.unique(np.linspace(0, len(able) - 1, min(MOST_RATES, len(able))).astype(int)):
        for off in (ONE_PERCENT, able[i].smallest):
            yield rate_mutant(reference.network, method, seed, able[i].channel, off)


def _summary(findings: tuple[SamplerFinding, ...], name: str, sees: str) -> CheckSummary:
    own = [finding for finding in findings if finding.check == name]
    smallest = min((finding.p_value for finding in own), default=1.0)
    return CheckSummary(name, sees, len(own), sum(f.failed for f in own), min(smallest * len(own), 1.0) if own else 1.0)
