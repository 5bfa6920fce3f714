"""All diagnostics of a set of runs: which fail, and which model to try next."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from calibration import plots
from calibration.estimating.coarse_looks import CoarseLooks
from calibration.estimating.diagnosing import DIAGNOSTICS
from calibration.estimating.diagnosing.base import Diagnostic, DiagnosticResult
from calibration.estimating.diagnosing.diagnosed_runs import DiagnosedRuns
from calibration.estimating.rate_fit import RateFit
from kinetics.rates import Rates
from kinetics.runs import JumpPath
from kinetics.support.arrays import Ints
from kinetics.support.cli.progress import stage
from kinetics.support.shown import ResultTable, Shown, on_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LOOK_CLOSER = "observe at shorter intervals before judging"
MOST_NAMED = 3  # failed tests in a verdict that is to be short
LEVEL = 0.01  # chance of one or more false alarms among all tests


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Shown):
    """The results of all diagnostics.

    tests : the diagnostics, in order
    results : theirs, in the same order, channel by channel
    looks : what looks at intervals do to the runs; if they are coarse, that may be all that a failed test sees

    >>> from calibration import diagnose
    >>> from kinetics import Network, sample_path
    >>> decay = Network.from_text("decay: A -> 0, 1")
    >>> diagnosis = diagnose([sample_path(decay, {"A": 40}, end=10.0, seed=1)])
    >>> diagnosis.doubtful, [row["test"] for row in diagnosis.verdicts() if row["p"] is None]
    ([], ['runs', 'start', 'size'])
    """

    tests: tuple[Diagnostic, ...]
    results: tuple[DiagnosticResult, ...]
    looks: CoarseLooks = field(default_factory=lambda: CoarseLooks(()))

    @property
    def headline(self) -> str:
        """One line: the number of results, and how many fail."""
        return f"{len(self.tested)} of {len(self.results)} answers have a p-value, {len(self.failed)} fail"

    def summary(self) -> ResultTable:
        """One row a diagnostic, the verdict below."""
        rows = [(row["test"], "" if row["p"] is None else f"{row['p']:.2g}", row["verdict"]) for row in self.verdicts()]
        return ResultTable(self.headline, ("test", "smallest p", "verdict"), rows, [self.verdict])

    @property
    def tested(self) -> list[DiagnosticResult]:
        """Answers with a p-value, the smallest first."""
        return sorted((f for f in self.results if f.p_value is not None), key=lambda f: (f.p_value or 0.0, f.title))

    @cached_property
    def failed(self) -> tuple[DiagnosticResult, ...]:
        """Answers that fail at 1 % for all tests together (Holm 1979, jstor:4615733), the most doubtful first."""
        tested = self.tested
        failed: list[DiagnosticResult] = []
        for rank, result in enumerate(tested):
            if (result.p_value or 0.0) * (len(tested) - rank) > LEVEL:
                break
            failed.append(result)
        return tuple(failed)

    @property
    def doubtful(self) -> list[str]:
        """The failed ones, as `channel: test`."""
        return [result.title for result in self.failed]

    @property
    def verdict(self) -> str:
        """A sentence on the evidence of the runs against the model of rates."""
        tested = self.tested
        if not tested:
            return "Nothing could be tested: there are too few events or runs."
        tests = f"{len(tested)} tests, at {LEVEL:.0%} for all together"
        if not self.failed:
            least = tested[0]
            return f"No sign against the model in {tests}; the smallest p is {least.p_value:.2g} ({least.title})."
        what = "The looks are too coarse to tell" if self.looks.channels else "The model is doubtful"
        return f"{what}: {len(self.failed)} of {tests}, fail ({', '.join(self.doubtful)})."

    @property
    def short_verdict(self) -> str:
        """The verdict, where many tests fail with their numbers in place of their names."""
        if len(self.failed) <= MOST_NAMED:
            return self.verdict
        counts = Counter(result.test for result in self.failed)
        told = ", ".join(f"{n} of {name}" for name, n in counts.items())
        return f"{self.verdict.partition(' (')[0]} ({told}); the least likely is {self.failed[0].title}."

    def verdicts(self) -> list[dict[str, Any]]:
        """One row a diagnostic: its question, the smallest p, a verdict, its measured size and power."""
        rows = []
        for test in self.tests:
            mine = [f for f in self.results if f.test == test.name]
            tested = [f for f in self.tested if f.test == test.name]
            failed = [f for f in self.failed if f.test == test.name]
            if failed:
                worst = failed[0]
                others = f", and {len(failed) - 1} more" if len(failed) > 1 else ""
                what = "perhaps only because looks are coarse" if self.looks.channels else "doubtful"
                words = f"{what} ({worst.title}{others}): {worst.seen}; {worst.remedy}"
            elif tested:
                words = f"nothing seen in {len(tested)} tests; least likely {tested[0].title}: {tested[0].seen}"
            else:
                words = "not testable: " + "; ".join(dict.fromkeys(f.reason for f in mine))
            p_value = tested[0].p_value if tested else None
            rows.append(
                {"test": test.name, "question": test.question, "p": p_value, "verdict": words, "power": test.measured}
            )
        return rows

    def table(self) -> list[dict[str, Any]]:
        """One row a result: test, channel, events, statistic, p (None: not testable), what was seen, what to try."""
        failed = set(self.doubtful)
        rows = []
        for result in self.results:
            row = result.row()
            doubtful = result.title in failed
            rows.append(row | {"doubtful": doubtful, "next": row["next"] if doubtful else ""})
        return rows

    def p_values(self) -> list[dict[str, Any]]:
        """One row a channel, one column a test with its variants; nan if it is not testable."""
        columns = list(dict.fromkeys(f"{f.test} {f.variant}".rstrip() for f in self.results))
        rows: dict[str, dict[str, Any]] = {}
        for result in self.results:
            row = rows.setdefault(result.channel, {"channel": result.channel} | dict.fromkeys(columns, float("nan")))
            if result.p_value is not None:
                row[f"{result.test} {result.variant}".rstrip()] = result.p_value
        return list(rows.values())

    def to_dict(self) -> dict[str, Any]:
        """Verdict, names of what is doubtful, and the rows by test and of all results, ready for JSON."""
        return {
            "verdict": self.verdict,
            "doubtful": self.doubtful,
            "by_test": self.verdicts(),
            "results": self.table(),
        }

    @on_axes
    def plot(self, ax: Axes) -> Axes:
        """Plot all p-values against those of as many true models, the failed ones named; returns `ax`."""
        tested = self.tested
        return plots.p_values(ax, [f.p_value or 0.0 for f in tested], self.doubtful)

    def worst(self, test: str) -> DiagnosticResult | None:
        """The result of a diagnostic with the smallest p-value; None if it could test nothing."""
        return next((result for result in self.tested if result.test == test), None)


def diagnose(
    paths: Iterable[JumpPath],
    fit: RateFit | Rates | None = None,
    bonds: Iterable[Ints] | None = None,
    seed: int = 0,
    tests: Sequence[Diagnostic] = DIAGNOSTICS,
) -> Diagnosis:
    """Judge runs, of calibration or held out, by all diagnostics: are they those of a well-mixed Markov chain?

    paths : one per run
    fit : the model of rates under which they are judged: fitted, or the rates that predictions use; None: mass action.
        Only the shape of its hazards is judged, never the size of a rate
    bonds : per run (E, 2), the two cubes whose faces met or parted at each event, -1 if unknown; with them rebinding
        is also counted by pieces
    seed : of the draws behind p-values over groups
    ValueError: no runs, runs of several networks, or bonds of another shape

    >>> from calibration import diagnose
    >>> from kinetics import Network, sample_path
    >>> turnover = Network.from_text("0 <-> A, 5, 1")
    >>> paths = [sample_path(turnover, {"A": 5}, end=20.0, seed=1, run=run) for run in range(10)]
    >>> diagnosis = diagnose(paths)
    >>> len(diagnosis.tested), diagnosis.failed  # none, at 1 % for all together
    (15, ())
    """
    diagnosed = DiagnosedRuns(tuple(paths), fit, None if bonds is None else tuple(bonds), seed)
    tests = [test for test in tests if test.applies(diagnosed.network)]
    looks = CoarseLooks(diagnosed.runs)
    results: list[DiagnosticResult] = []
    for number, test in enumerate(tests):
        stage(f"diagnosis: {test.name}, {number} of {len(tests)} tests done")
        results += test.results(diagnosed)
    if looks.channels:  # which show themselves in every test: no other model is to be tried before they are finer
        results = [replace(result, remedy=LOOK_CLOSER) for result in results]
    return Diagnosis(tuple(tests), tuple(results), looks)
