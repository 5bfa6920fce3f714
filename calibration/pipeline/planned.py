"""The aims of a plan, and of any plan its power, cost and shortfalls."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from calibration.planning.held_out import MOST_RUNS, widest_sd
from calibration.validating.power import GroupPower


@dataclass(frozen=True)
class PlanRequest:
    """The aims of a plan: precision, power and budget.

    width : relative 95 % half-width of every rate; cpu_hours : of all runs together, None: as many as it takes
    cubes : numbers of cubes of the calibration; along : times on the predicted path at which tanks are taken, tu
    duration, held_out_duration : of a run, tu; held_out : numbers of cubes of the held-out runs
    each_break : whether each break is to have that width, not only all breaks together
    power, shift : probability with which held-out runs are to show rates that are off by this share, at level 1 %
    tank : edges; None for the scene's own
    """

    name: str
    scene: str
    cubes: tuple[int, ...] = (60, 120)
    held_out: tuple[int, ...] = (40, 80, 160)
    width: float = 0.1
    cpu_hours: float | None = None
    along: tuple[float, ...] = (0.0, 50.0, 200.0, 800.0, 2000.0)
    duration: float = 500.0
    held_out_duration: float = 2000.0
    each_break: bool = False
    power: float = 0.9
    shift: float = 0.2
    tank: tuple[float, float, float] | None = None
    seed: int = 1

    def __post_init__(self) -> None:
        for name in ("width", "power", "shift"):
            if not 0 < getattr(self, name) < 1:
                raise ValueError(f"{name} = {getattr(self, name)}; expected a share between 0 and 1, such as 10%")
        for name in ("duration", "held_out_duration"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"{name} = {getattr(self, name)}; expected a finite number of tu above 0")
        if self.cpu_hours is not None and not (math.isfinite(self.cpu_hours) and self.cpu_hours > 0):
            raise ValueError(f"CPU hours = {self.cpu_hours}; expected a finite number above 0")
        if not self.cubes or not self.held_out or min(*self.cubes, *self.held_out) < 1:
            raise ValueError(f"cubes = {list(self.cubes)}, held out = {list(self.held_out)}; expected numbers above 0")
        if not self.along or min(self.along) < 0 or not np.isfinite(self.along).all():
            raise ValueError(f"along = {list(self.along)}; expected finite times of at least 0 tu")


@dataclass(frozen=True)
class HeldOutTest:
    """The power of held-out runs of one size for one group of channels.

    needed : runs that reach the power; None if `held_out.MOST_RUNS` do not
    limit : power that no number of runs exceeds, because the calibration leaves its uncertainty
    """

    cubes: int
    power: GroupPower
    needed: int | None
    limit: float

    def to_dict(self, runs: int) -> dict[str, Any]:
        """The power with so many runs planned, ready for JSON."""
        return {
            "cubes": self.cubes,
            "group": self.power.group,
            "events_of_a_run": self.power.expected,
            "relative_sd_from_calibration": self.power.rates_sd,
            "runs_needed": self.needed,
            "runs": runs,
            "power": self.power.power(runs),
            "largest_power": self.limit,
        }


class Planned(ABC):
    """A plan, and what it will show at which cost.

    wanted_seconds : CPU time of calibration runs that reach the width asked for
    tests : of the held-out runs; held_out_runs, held_out_costs : by number of cubes, CPU seconds of a run
    """

    request: PlanRequest
    wanted_seconds: float
    tests: tuple[HeldOutTest, ...]
    held_out_runs: dict[int, int]
    held_out_costs: dict[int, float]

    @property
    @abstractmethod
    def width(self) -> float:
        """The largest half-width expected."""

    @property
    @abstractmethod
    def calibration_seconds(self) -> float:
        """CPU seconds of all calibration runs."""

    @abstractmethod
    def tank_rows(self) -> list[dict[str, Any]]:
        """One row a tank of the calibration."""

    @abstractmethod
    def tables(self) -> str:
        """The plan for people."""

    @property
    def held_out_seconds(self) -> float:
        """CPU seconds of all held-out runs."""
        return spent(self.held_out_runs, self.held_out_costs)

    @property
    def cost(self) -> str:
        """The CPU time of all runs, on one line."""
        return (
            f"CPU time: calibration {self.calibration_seconds / 3600:.2f} h, held-out runs "
            f"{self.held_out_seconds / 3600:.2f} h"
        )

    @property
    def shortfalls(self) -> list[str]:
        """Sentences on the aims that the plan does not reach."""
        wanted, found = self.request, []
        if self.width > wanted.width * (1 + 1e-6):
            found.append(
                f"the budget of {wanted.cpu_hours:g} CPU hours reaches a half-width of {self.width:.1%}; "
                f"{wanted.width:.1%} would cost {self.wanted_seconds / 3600:.3g} hours of calibration runs"
            )
        return found + _held_out_shortfalls(wanted, self.tests, self.held_out_runs, self.held_out_costs, self.width)

    def to_dict(self) -> dict[str, Any]:
        """The plan as a dictionary, ready for JSON."""
        return {
            "request": asdict(self.request),
            "tanks": self.tank_rows(),
            "half_width": self.width,
            "held_out": [test.to_dict(self.held_out_runs[test.cubes]) for test in self.tests],
            "calibration_cpu_seconds": self.calibration_seconds,
            "held_out_cpu_seconds": self.held_out_seconds,
            "wanted_calibration_cpu_seconds": self.wanted_seconds,
            "shortfalls": self.shortfalls,
        }


def _held_out_shortfalls(
    request: PlanRequest, tests: Iterable[HeldOutTest], runs: dict[int, int], costs: dict[int, float], width: float
) -> list[str]:
    """Sentences on shifts that the held-out runs of each size fail to detect after a calibration to a half-width."""
    found = []
    for test in tests:
        has = runs[test.cubes]
        what = f"{test.power.group} off by {request.shift:.0%} at {test.cubes} cubes"
        if test.limit < request.power:
            narrower = width * widest_sd(test.power, request.power) / test.power.rates_sd
            found.append(
                f"no number of held-out runs shows {what} with power {request.power:.0%}: the uncertainty of the "
                f"calibration allows {test.limit:.0%} at most; a width of {narrower:.1%} is needed"
            )
        elif test.needed is None:
            found.append(f"not even {MOST_RUNS} held-out runs show {what} with power {request.power:.0%}")
        elif has < test.needed:
            found.append(
                f"{test.needed} held-out runs would show {what}, for "
                f"{(test.needed - has) * costs[test.cubes] / 3600:.3g} CPU hours more; the plan has {has}, with power "
                f"{test.power.power(has):.0%}"
            )
    return found


def spent(runs: dict[int, int], costs: dict[int, float]) -> float:
    """CPU seconds of runs by number of cubes."""
    return sum(n * costs[cubes] for cubes, n in runs.items())
