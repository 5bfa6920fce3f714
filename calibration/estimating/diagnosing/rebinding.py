"""Do pieces rebind after a break sooner than the model says?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from calibration import plots
from calibration.estimating.diagnosing.base import Diagnostic, DiagnosticResult
from calibration.estimating.diagnosing.diagnosed_runs import Clocked, DiagnosedRuns
from kinetics.network import Network
from kinetics.runs import RESTART
from kinetics.support.arrays import Floats, divided
from kinetics.support.intervals import exact_limits
from kinetics.support.packages import stats
from kinetics.support.tables import in_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ALL = "all breaks"


class Undoing(NamedTuple):
    """A join, and the breaks (indices of channels) that it undoes: the inverse changes of the state."""

    join: int
    breaks: tuple[int, ...]


@dataclass(frozen=True)
class Within:
    """Joins of one channel within a window after the breaks that they undo.

    breaks : breaks seen; joins : joins seen at any time; seen : of them in a window
    inside, outside : integrated hazard of the join, up to one factor
    """

    breaks: int
    joins: int
    seen: int
    inside: float
    outside: float

    @property
    def expected(self) -> float:
        """Joins within the windows at the rate of those outside; nan without exposure there."""
        return (self.joins - self.seen) * self._factor

    @property
    def expected_limits(self) -> tuple[float, float]:
        """95 % limits of the same, from the count of joins outside the windows (Garwood 1936)."""
        low, high = exact_limits(self.joins - self.seen, 1.0)
        return float(low) * self._factor, float(high) * self._factor

    @property
    def _factor(self) -> float:
        return self.inside / self.outside if self.outside > 0 else float("nan")


def excess(counted: Sequence[Within]) -> tuple[float, float, float]:
    """Joins in windows less those expected there, with 95 % limits that carry the uncertainty of both.

    Limits of a difference from the exact limits of its terms (Zou & Donner 2008, doi:10.1002/sim.3095).
    """
    seen, expected = sum(each.seen for each in counted), sum(each.expected for each in counted)
    low, high = map(float, exact_limits(seen, 1.0))
    limits = np.array([each.expected_limits for each in counted])
    below, above = np.sqrt(((limits - np.array([[each.expected] for each in counted])) ** 2).sum(axis=0))
    found = seen - expected
    return found, found - float(np.hypot(seen - low, above)), found + float(np.hypot(high - seen, below))


@dataclass(frozen=True)
class Rebinding(Diagnostic):
    """Joins within a window after a break that they undo, beside what the integrated hazard of the join expects there.

    Given their number, joins fall into windows with the windows' share of the integrated hazard: the p-value is a
    binomial tail, that of all channels together one of a sum of binomials. Windows end at a restart. Statistic: joins
    in windows, less those expected there. Where the cubes at each event are known, `same pieces` counts only joins of
    the two cubes that had parted; its expectation takes the pieces to stay available, so that its p-value is too large
    rather than too small. Rates of free-running runs are what they are: a break that is undone at once counts as a
    break and as a join; `net_path` gives the runs without such pairs.

    windows : tu; the first is for pieces that have not parted yet, the second for those that stay near

    >>> from calibration import diagnose
    >>> from calibration.estimating.diagnosing import Rebinding
    >>> from kinetics import JumpPath, Network
    >>> pairs = Network.from_text("2 A <-> AA, 1, 1")
    >>> times = [t + late for t in range(0, 400, 20) for late in (10.0, 10.1)]  # each break is undone at once
    >>> path = JumpPath(pairs, {"A": 10, "AA": 5}, times, [1, 0] * 20, end=400.0)
    >>> diagnose([path], tests=[Rebinding()]).worst("rebinding").p_value < 1e-3
    True
    """

    windows: tuple[float, ...] = (2.0, 50.0)

    name = "rebinding"
    question = "After a dissociation, does the reverse reaction come sooner than the model says?"
    measured = (
        "size 2 % at a level of 5 % (60 repeats); of 500 dissociation events, 4 % undone 1 tu later on average, "
        "power .97, 19 of 25 after correction for 60 tests, and 25 of 25 after it where the partners are known"
    )

    def __post_init__(self) -> None:
        if not self.windows or min(self.windows) <= 0:
            raise ValueError(f"windows = {self.windows}; expected one or more times above 0, tu")

    def applies(self, network: Network) -> bool:
        """Whether any channel undoes another."""
        return any(True for _ in undoings(network))

    def results(self, diagnosed: DiagnosedRuns) -> list[DiagnosticResult]:
        """For each window one result of all breaks, and one a join that undoes breaks."""
        found = []
        for window in self.windows:
            for same_pieces in (False, True) if diagnosed.bonds is not None else (False,):
                found += self._in_window(diagnosed, window, same_pieces)
        return found

    def _in_window(self, diagnosed: DiagnosedRuns, window: float, same_pieces: bool) -> list[DiagnosticResult]:
        variant = f"within {in_unit(f'{window:g}', diagnosed.network.time_unit)}" + (
            ", same pieces" if same_pieces else ""
        )
        pairs = list(undoings(diagnosed.network))
        collect = _by_pieces if same_pieces else _by_kind
        counted = [collect(diagnosed, pair, window) for pair in pairs]
        channels = [diagnosed.network.channels[pair.join] for pair in pairs]
        singles = [self._result([each], name, variant) for name, each in zip(channels, counted, strict=True)]
        return [self._result(counted, ALL, variant), *singles]

    def _result(self, counted: list[Within], channel: str, variant: str) -> DiagnosticResult:
        breaks = sum(each.breaks for each in counted)
        useful = [each for each in counted if each.inside > 0 and each.outside > 0 and each.joins]
        if not useful:
            reason = "runs were restarted, or joins closed, after each break" if breaks else "no breaks"
            if any(each.inside > 0 for each in counted):
                reason = "no joins to compare with"
            return DiagnosticResult(self.name, channel, breaks, reason=reason, variant=variant)
        seen, expected = sum(each.seen for each in useful), sum(each.expected for each in useful)
        more = excess(useful)
        share, low, high = np.clip(np.array(more) / max(breaks, 1), 0.0, 1.0)
        return DiagnosticResult(
            self.name, channel, breaks, more[0], binomial_tail(useful),
            seen=(
                f"{seen} of {breaks} breaks were undone {variant} where {expected:.3g} are expected by chance: "
                f"{share:.1%} of the breaks ({low:.1%} to {high:.1%}) are undone by rebinding"
            ),
            variant=variant,
            remedy=(
                f"the rates carry both the break and the join of each of these {max(more[0], 0.0):.0f} rebindings; "
                "compare them with the rates of net paths (`net_path`)"
            ),
            draw=partial(_draw, channel=f"{channel} {variant}", seen=seen, expected=expected),
        )  # fmt: skip


def undoings(network: Network) -> Iterator[Undoing]:
    """Every join that undoes a break: its change of the state is that of the break, the other way round."""
    change = network.stoichiometry
    for join in np.flatnonzero(change.sum(axis=1) < 0):
        breaks = np.flatnonzero((change == -change[join]).all(axis=1))
        if breaks.size:
            yield Undoing(int(join), tuple(breaks.tolist()))


def binomial_tail(counted: list[Within]) -> float:
    """Probability of as many joins in windows, or more: each channel's are binomial, their sum is what is seen."""
    total = np.ones(1)
    for each in counted:
        share = each.inside / (each.inside + each.outside)
        chances = np.trim_zeros(stats.binom.pmf(np.arange(each.joins + 1), each.joins, share), "b")
        total = np.convolve(total, chances)
    seen = sum(each.seen for each in counted)
    return float(min(np.sort(total[seen:]).sum(), 1.0))


def _by_kind(diagnosed: DiagnosedRuns, pair: Undoing, window: float) -> Within:
    """Joins and hazard within a window after the latest break of the kind."""
    breaks = joins = seen = 0
    inside = 0.0
    for clocked in diagnosed.clocked:
        latest = _latest_break(clocked, pair)
        inside += clocked.passed_between(latest, latest + window)[:, pair.join].sum()
        rows = np.flatnonzero(clocked.path.channels == pair.join)
        breaks += int(np.isin(clocked.path.channels, pair.breaks).sum())
        joins += rows.size
        seen += int((clocked.path.times[rows] - latest[rows] <= window).sum())
    return Within(breaks, joins, seen, float(inside), float(diagnosed.exposure[pair.join] - inside))


def _latest_break(clocked: Clocked, pair: Undoing) -> Floats:
    """(E + 1,) time of the latest break before each stretch in the same life of the tank; -inf where there is none."""
    happened = np.where(np.isin(clocked.path.channels, pair.breaks), clocked.path.times, -np.inf)
    latest = np.maximum.accumulate(np.concatenate(([-np.inf], happened)))
    rows = np.arange(latest.size)
    broke = np.maximum.accumulate(np.concatenate(([-1], np.where(np.isfinite(happened), rows[1:], -1))))
    is_restart = clocked.path.channels == RESTART
    restarted = np.maximum.accumulate(np.concatenate(([0], np.where(is_restart, rows[1:], 0))))
    return np.where(broke > restarted, latest, -np.inf)  # what broke before a restart is whole again


def _by_pieces(diagnosed: DiagnosedRuns, pair: Undoing, window: float) -> Within:
    """Joins of the two cubes that had parted, and the hazard of one pair of pieces after every break."""
    breaks = joins = seen = 0
    inside = 0.0
    for clocked, bonds in zip(diagnosed.clocked, diagnosed.bonds or (), strict=True):
        path, cubes = clocked.path, np.sort(bonds, axis=1)
        pairs = path.network.combinations_of(path.states)[:, pair.join]
        of_one = divided(clocked.level[:, pair.join], pairs)
        lasting = clocked._replace(level=np.where(np.arange(clocked.level.shape[1]) == pair.join, of_one[:, None], 0.0))
        broken = np.flatnonzero(np.isin(path.channels, pair.breaks) & (cubes[:, 0] >= 0))
        breaks += broken.size
        joins += int((path.channels == pair.join).sum())
        for row in broken:
            now, after = path.times[row], _rows_after(clocked, int(row), window)
            passed = lasting.passed_between(np.full(pairs.size, now), np.full(pairs.size, now + window))[:, pair.join]
            inside += passed[after.start : after.stop + 1].sum()
            again = (path.channels[after] == pair.join) & (cubes[after] == cubes[row]).all(axis=1)
            seen += bool(again.any())
    return Within(breaks, joins, seen, float(inside), float(diagnosed.exposure[pair.join] - inside))


def _rows_after(clocked: Clocked, row: int, window: float) -> slice:
    """Rows of the events after one, within the window and before the next restart."""
    path = clocked.path
    last = int(np.searchsorted(path.times, path.times[row] + window, side="right"))
    restarts = np.flatnonzero(path.channels[row + 1 : last] == RESTART)
    return slice(row + 1, row + 1 + int(restarts[0]) if restarts.size else last)


def _draw(ax: Axes, channel: str, seen: int, expected: float) -> Axes:

    return plots.seen_and_expected(ax, channel, seen, expected)
