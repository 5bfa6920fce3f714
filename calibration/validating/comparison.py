"""The comparison of held-out runs with their prediction: numbers, tables, verdict and figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from calibration import plots
from calibration.estimating.joins_and_breaks import WHOLES
from calibration.validating.events import EventRow, HeldOutEvents, event_rows
from calibration.validating.first_times import FirstTimeComparison
from calibration.validating.overall import overall_verdict
from calibration.validating.scores import BandShare, Score
from calibration.validating.single_runs import SingleRuns
from calibration.validating.verdict import ConsistencyCheck, Verdict, event_checks
from kinetics.network import Network
from kinetics.support.arrays import Floats
from kinetics.support.packages import plt
from kinetics.support.plots import colour
from kinetics.support.shown import ResultTable, Shown
from kinetics.support.tables import in_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class Cost:
    """CPU seconds: of `ssa_runs` SSA runs, and of the exact solution at all times.

    exact is nan if there is no exact solution.
    """

    ssa: float
    ssa_runs: int
    exact: float


@dataclass(frozen=True, eq=False, repr=False)
class CrossValidation(Shown):
    """Held-out runs from one initial state beside their prediction. Arrays (T, S) over times (tu) and all species.

    runs : number n of held-out runs
    observed_mean, observed_low, observed_high : their mean with a Student t interval over the runs
    ssa_mean : mean of SSA runs at the posterior mean of each rate constant
    predicted_mean, predicted_sd : mean, and sd of a single run, at these rates; solved where the state space is small
        enough, otherwise those of the SSA runs
    predicted_error : standard error of `predicted_mean` by sampling; 0 if that is exact
    low, high : predicted band of the mean of n runs, from intrinsic noise and the uncertainty of the rates; it holds
        `predicted_mean`
    z : (observed_mean - predicted_mean) over the predicted sd of that difference; nan if nothing varies
    misfit, p_misfit : mean squared z of the observed mean among predicted groups of n runs; share of groups with at
        least this misfit
    coverage : share of times and species (after time 0) at which the observed mean lies inside the predicted band
    run_coverage : share of single runs, times and species inside the predicted band of a single run
    groups : number of simulated groups behind bands, shares, misfit and scores
    scores : one per species, then one of all species together
    first : first-passage times to the target, if one was named
    held_out : events of the held-out runs, and of simulated groups
    single_runs : randomised PIT of each run
    label : name of the experiment, such as `80 cubes`; engine : that made the held-out runs; mechanics_cpu : their CPU
        time, s; all as given by `dataclasses.replace`

    >>> from calibration import crossvalidate, estimate
    >>> from kinetics import Network, sample_path
    >>> pairs = Network.from_text("2 A <-> AA, 0.01, 0.1")
    >>> paths = [sample_path(pairs, {"A": 20}, end=50.0, seed=1, run=run) for run in range(10)]
    >>> other = pairs.with_rates([0.02, 0.1])  # joins are twice as fast
    >>> held_out = [sample_path(other, {"A": 20}, end=50.0, seed=2, run=run) for run in range(10)]
    >>> rates = estimate(paths).rates()
    >>> found = crossvalidate(rates, held_out, times=[10.0, 50.0], groups=199, most_groups=199)
    >>> bool(found.observed_mean[0, 0] < found.low[0, 0]), found.p_misfit  # none of 199 predicted groups is as far off
    (True, 0.005)
    """

    network: Network
    times: Floats
    runs: int
    level: float
    observed_mean: Floats
    observed_low: Floats
    observed_high: Floats
    ssa_mean: Floats
    predicted_mean: Floats
    predicted_sd: Floats
    predicted_error: Floats
    low: Floats
    high: Floats
    z: Floats
    misfit: float
    p_misfit: float
    coverage: BandShare
    run_coverage: BandShare
    groups: int
    scores: tuple[Score, ...]
    first: FirstTimeComparison | None
    held_out: HeldOutEvents
    single_runs: SingleRuns
    cost: Cost
    label: str = ""
    engine: str | None = None
    mechanics_cpu: float = float("nan")

    @property
    def headline(self) -> str:
        """One line: the name of the comparison, and the numbers of runs and predicted groups."""
        return f"{self.name}: {self.runs} held-out runs, compared with {self.groups} predicted groups of as many"

    def summary(self) -> ResultTable:
        """Observed means beside the predicted band at the last time, and the verdict."""
        rows = [
            (
                name,
                f"{self.observed_mean[-1, s]:.4g}",
                f"{self.predicted_mean[-1, s]:.4g} [{self.low[-1, s]:.4g}, {self.high[-1, s]:.4g}]",
            )
            for s, name in enumerate(self.network.species)
        ]
        at = in_unit(f"at {self.times[-1]:g}", self.network.time_unit)
        band = f"predicted, {100 * self.level:g} % band"
        return ResultTable(self.headline, (f"mean {at}", "observed", band), rows, [self.verdict.sentence])

    @property
    def is_exact(self) -> bool:
        """True if the predicted mean is free of sampling error."""
        return bool(np.isfinite(self.cost.exact))

    @property
    def cubes(self) -> int:
        """Number of cubes of a run; of all copies at its start where the network conserves no cubes."""
        initial = self.held_out.groups.initial
        return int(initial @ self.network.conserved.get("cubes", np.ones(initial.size)))

    @property
    def name(self) -> str:
        """The label, or the size where there is none."""
        return self.label or f"{self.cubes} cubes"

    @cached_property
    def events(self) -> tuple[EventRow, ...]:
        """Events seen and expected: joins, breaks, and every channel by itself."""
        return event_rows([self.held_out], self.name, self.cubes, self.held_out.tank, self.engine)

    @property
    def details(self) -> list[ConsistencyCheck]:
        """Events of every channel, scatter, means, scores, single runs and first times, each by itself."""
        where = f"at {self.name}"
        least, overall = 1 / (self.groups + 1), self.scores[-1]
        checks = event_checks(self.events, where)
        checks.append(
            ConsistencyCheck(
                f"mean counts {where} with a misfit of {self.misfit:.2g} (1 expected)", self.p_misfit, least
            )
        )
        score = f"CRPS {where} of {overall.score:.3g} ({overall.floor:.3g} expected)"
        checks.append(ConsistencyCheck(score, overall.p_value, least))
        checks.append(ConsistencyCheck(f"single runs {where} by their PIT", self.single_runs.p_value, least))
        if self.first:
            checks.append(ConsistencyCheck(f"first {self.first.species} {where}", self.first.p_value, 0.0))
        return checks

    @cached_property
    def verdict(self) -> Verdict:
        """Joins and breaks together, and what these runs would have shown."""
        return overall_verdict([self.held_out], f"at {self.name}", self.details)

    @property
    def is_consistent(self) -> bool:
        """True if joins and breaks together pass their test at 1 %."""
        return self.verdict.is_consistent

    def table(self) -> list[dict[str, Any]]:
        """One row per time and species."""
        columns = {
            "observed": self.observed_mean,
            "observed_low": self.observed_low,
            "observed_high": self.observed_high,
            "ssa": self.ssa_mean,
            "predicted": self.predicted_mean,
            "predicted_sd": self.predicted_sd,
            "predicted_error": self.predicted_error,
            "low": self.low,
            "high": self.high,
            "z": self.z,
        }
        return [
            {"label": self.label, "time": float(t), "species": species}
            | {name: float(values[i, s]) for name, values in columns.items()}
            for i, t in enumerate(self.times)
            for s, species in enumerate(self.network.species)
        ]

    def figures(self) -> dict[str, Any]:
        """One row: verdict, coverage and score beside their range under the model, first times, cost of both sides.

        A predicted first time without a finite mean (where the target may never come) is nan.
        """
        overall = self.scores[-1]
        row = {
            "label": self.label,
            "runs": self.runs,
            "is_consistent": self.is_consistent,
            "verdict": self.verdict.sentence,
            "coverage": self.coverage.share,
            "coverage_low": self.coverage.low,
            "coverage_high": self.coverage.high,
            "run_coverage": self.run_coverage.share,
            "run_coverage_low": self.run_coverage.low,
            "run_coverage_high": self.run_coverage.high,
            "misfit": self.misfit,
            "p_misfit": self.p_misfit,
            "crps": overall.score,
            "crps_floor": overall.floor,
            "p_crps": overall.p_value,
            "p_single_runs": self.single_runs.p_value,
        }
        row |= {f"p_{each.group}": each.p for each in self.events if each.group in WHOLES}
        row |= {f"p_scatter_{each.group}": each.p_scatter for each in self.events if each.group in WHOLES}
        if self.first:
            row |= {
                "first_observed": self.first.observed_mean,
                "first_low": self.first.low,
                "first_high": self.first.high,
                "first_censored": self.first.censored,
                "first_predicted": self.first.predicted_mean,
                "first_predicted_error": self.first.predicted_error,
                "first_mean": self.first.mean if np.isfinite(self.first.mean) else float("nan"),
                "first_sd": self.first.sd if np.isfinite(self.first.sd) else float("nan"),
                "p_first": self.first.p_value,
            }
        return row | {
            "cpu_mechanics_s": self.mechanics_cpu,
            "cpu_ssa_s": self.cost.ssa,
            "ssa_runs": self.cost.ssa_runs,
            "cpu_exact_s": self.cost.exact,
        }

    def to_dict(self) -> dict[str, Any]:
        """Everything in types that JSON can hold: arrays as lists, nan as None."""
        plain: dict[str, Any] = _plain(
            {
                "summary": self.figures(),
                "is_consistent": self.is_consistent,
                "verdict": self.verdict.sentence,
                "power": [vars(power) for power in self.verdict.powers],
                "events": [row.to_dict() for row in self.events],
                "single_runs": self.single_runs.to_dict(),
                "is_exact": self.is_exact,
                "level": self.level,
                "species": self.network.species,
                "scores": [vars(score) for score in self.scores],
                "first": vars(self.first) if self.first else None,
                "table": self.table(),
            }
        )
        return plain

    def plot(self, axes: Sequence[Axes] | None = None, species: Sequence[str] | None = None) -> Sequence[Axes]:
        """Plot observed and predicted means with bands, one species per axes; all species unless some are named.

        axes : as many; new ones, in a row, where none are given
        """
        if axes is None:
            across = len(species or self.network.species)
            axes = list(
                plt.figure(figsize=(4.0 * across, 3.2), layout="constrained").subplots(1, across, squeeze=False)[0]
            )
        percent, sampled = f"{100 * self.level:g} %", f"SSA, {self.cost.ssa_runs} runs"
        label = f"{'exact' if self.is_exact else sampled}, {percent} band for {self.runs} runs"
        for ax, name in zip(axes, species or self.network.species, strict=True):
            s = self.network.index(name)
            predicted = plots.Limited(self.predicted_mean[:, s], self.low[:, s], self.high[:, s])
            observed = plots.Limited(self.observed_mean[:, s], self.observed_low[:, s], self.observed_high[:, s])
            plots.trajectory(
                ax,
                name,
                self.times,
                predicted=(label, predicted),
                observed=(f"mechanics, {percent} interval", observed),
                sampled=(sampled, self.ssa_mean[:, s]) if self.is_exact else None,
                title=self.label,
                colour=colour(s),
            )
        return axes


def _plain(value: Any) -> Any:
    """Nested dicts and lists of what JSON can hold: None for what is no finite number."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value
