"""The base of all diagnostics: what one asks of runs, and what it answers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from calibration.estimating.diagnosing.diagnosed_runs import DiagnosedRuns
from kinetics.network import Network
from kinetics.support.shown import on_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class DiagnosticResult:
    """The result of one diagnostic for one channel, or for several together.

    variant : which of several results, such as `within 2 tu`
    statistic : by the diagnostic's own definition; nan if it cannot be had
    p_value : None if the runs cannot answer; `reason` then says why
    seen : a sentence on what the runs show, with its size
    remedy : the model to try next, should the test fail
    draw : draws the evidence onto axes

    >>> from calibration import diagnose
    >>> from kinetics import JumpPath, Network
    >>> source = Network.from_text("make: 0 -> A, 1")
    >>> path = JumpPath(source, {"A": 0}, range(1, 41), [0] * 40, end=40.0)  # all waits are alike
    >>> result = diagnose([path]).worst("waits")
    >>> result.channel, result.events, result.p_value < 1e-3
    ('make', 40, True)
    """

    test: str
    channel: str
    events: int
    statistic: float = float("nan")
    p_value: float | None = None
    reason: str = ""
    seen: str = ""
    variant: str = ""
    remedy: str = ""
    draw: Callable[[Axes], Axes] | None = None

    @property
    def title(self) -> str:
        """Channel, test and variant."""
        return f"{self.channel}: {self.test} {self.variant}".rstrip()

    @property
    def subject(self) -> str:
        """Channel and variant, where the test has been named."""
        return f"{self.channel} {self.variant}".rstrip()

    @on_axes
    def plot(self, ax: Axes) -> Axes:
        """Draw the evidence, or the reason why there is none; returns `ax`."""
        if self.draw is not None:
            return self.draw(ax)
        ax.set_title(self.title)
        ax.text(0.5, 0.5, f"not testable: {self.reason}", ha="center", wrap=True, transform=ax.transAxes)
        ax.set_axis_off()
        return ax

    def row(self) -> dict[str, Any]:
        """The result as numbers and text, p None if it was not testable."""
        return {
            "test": self.test,
            "variant": self.variant,
            "channel": self.channel,
            "events": self.events,
            "statistic": self.statistic if self.p_value is not None else None,
            "p": self.p_value,
            "seen": self.seen or f"not testable: {self.reason}",
            "next": self.remedy,
        }


class Diagnostic(ABC):
    """One question to runs: is what a model of rates assumes true of them?

    The size of a channel's rate drops out of every test, so that only the shape of the hazard is judged; waits that an
    end or a restart cut short count in full. An event may end its own exposure, by using up its last reactant: a test
    must hold for that, which the contract tries.

    To add a diagnostic:
    1. write a frozen dataclass with a `name` and a `question`, whose docstring states the test and its source;
    2. give in `results` a `DiagnosticResult` a channel; if runs cannot answer, p None with the reason, never
       p = 1;
    3. if it makes sense for some networks only, say in `applies` for which;
    4. say in each which model to try next, and in `measured` the size and power that were measured, and how;
    5. import it in `calibration.estimating.diagnosing`: tests/contracts/test_diagnostics.py then tests it.

    >>> from calibration import DIAGNOSTICS
    >>> [test.name for test in DIAGNOSTICS]
    ['waits', 'drift', 'runs', 'age', 'start', 'size', 'crowd', 'rebinding']
    >>> DIAGNOSTICS[0].question
    'Are waits, rescaled by the hazard, exponential?'
    """

    name: ClassVar[str]
    question: ClassVar[str]
    measured: ClassVar[str]

    def applies(self, network: Network) -> bool:  # noqa: ARG002
        """Whether the question can be put to runs of a network at all."""
        return True

    @abstractmethod
    def results(self, diagnosed: DiagnosedRuns) -> list[DiagnosticResult]:
        """One or more results a channel, in the network's order."""


class Judged(NamedTuple):
    """The result of one test of one channel, by the fields of a `DiagnosticResult`."""

    statistic: float
    p_value: float
    seen: str
    remedy: str
    draw: Callable[[Axes], Axes]


class ChannelDiagnostic(Diagnostic):
    """A diagnostic that judges every channel by itself."""

    def results(self, diagnosed: DiagnosedRuns) -> list[DiagnosticResult]:
        """One result a channel."""
        found = []
        for j, channel in enumerate(diagnosed.network.channels):
            judged = self.unseen(diagnosed, j) or self.judge(diagnosed, j)
            n = int(diagnosed.events[j])
            if isinstance(judged, str):
                found.append(DiagnosticResult(self.name, channel, n, reason=judged))
            else:
                found.append(DiagnosticResult(self.name, channel, n, **judged._asdict()))
        return found

    def unseen(self, diagnosed: DiagnosedRuns, channel: int) -> str:
        """Why the runs say nothing of a channel; empty if they do."""
        if not diagnosed.exposure[channel] > 0:
            return "it was closed or had no reactants in any run"
        return "" if diagnosed.events[channel] else "no events"

    @abstractmethod
    def judge(self, diagnosed: DiagnosedRuns, channel: int) -> Judged | str:
        """The result for one channel that fired, or the reason why there is none."""
