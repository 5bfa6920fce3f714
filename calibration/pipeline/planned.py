"""What a plan is to reach; and of a plan what it will show, at which cost, and what it does not reach."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from calibration.pipeline.plan import PlannedRuns, StudyPlan, Tanks, VerdictRules
from calibration.planning.allocation import half_width
from calibration.planning.candidates import Candidate
from calibration.planning.held_out import MOST_RUNS, widest_sd
from calibration.validating.power import GroupPower
from kinetics.support.arrays import Floats, Ints
from kinetics.support.shown import on_axes
from kinetics.support.tables import figure, text_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class PlanRequest:
    """The aims of a plan: precision, power and budget.

    width : relative 95 % half-width of every rate; cpu_hours : of all runs together, None: as many as it takes
    cubes : numbers of cubes of the calibration; along : times on the predicted path at which tanks are taken, tu
    duration, held_out_duration : of a run, tu; held_out : numbers of cubes of the held-out runs
    each_break : whether each break is to have that width, not only all breaks together
    power, shift : probability with which held-out runs are to show rates that are off by this share, at level 1 %
    tank : edges; None for the scene's own; engine : of the mechanics; None for the scene's own
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
    engine: str | None = None
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


@dataclass(frozen=True, eq=False)
class PlannedStudy:
    """A plan, and what it will show at which cost.

    happening : names of what a tank's events count; wanted : each rate to be measured, as the part of them that it has
    tanks, runs, costs : candidate tanks, runs of each (K,), and CPU seconds of a run of each (K,)
    starts : number of cubes -> what a held-out tank holds at time 0
    purpose : the plan's, with a place for its width
    wanted_seconds : CPU time of calibration runs that reach the width asked for
    tests : of the held-out runs; held_out_runs, held_out_costs : by number of cubes, CPU seconds of a run
    gains : faster engine -> speed-up, measured by a trial in the most expensive tank
    """

    request: PlanRequest
    happening: tuple[str, ...]
    wanted: Mapping[str, NDArray[np.bool_]]
    tanks: tuple[Candidate, ...]
    runs: Ints
    costs: Floats
    starts: Mapping[int, dict[str, int]]
    purpose: str
    wanted_seconds: float
    tests: tuple[HeldOutTest, ...]
    held_out_runs: dict[int, int]
    held_out_costs: dict[int, float]
    verdict: VerdictRules
    gains: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def events(self) -> dict[str, float]:
        """Events expected in the calibration of each thing to be measured."""
        total = self.runs @ np.array([tank.events for tank in self.tanks])
        return {name: float(total[members].sum()) for name, members in self.wanted.items()}

    @property
    def width(self) -> float:
        """The largest half-width expected."""
        return float(max(half_width(list(self.events.values()))))

    @property
    def calibration_seconds(self) -> float:
        """CPU seconds of all calibration runs."""
        return float(self.runs @ self.costs)

    @cached_property
    def plan(self) -> StudyPlan:
        """The plan itself."""
        request = self.request
        calibrating = [
            (tank.composition, int(runs), request.duration, tank.along)
            for tank, runs in zip(self.tanks, self.runs, strict=True)
            if runs
        ]
        held_out = [(self.starts[n], runs, request.held_out_duration, None) for n, runs in self.held_out_runs.items()]
        parts = [
            PlannedRuns(
                seed=seed,
                tanks=tuple(
                    Tanks(
                        composition=start,
                        tank=request.tank,
                        runs=runs,
                        duration=duration,
                        along=along,
                        engine=request.engine,
                    )
                    for start, runs, duration, along in rows
                ),
            )
            for seed, rows in ((request.seed, calibrating), (request.seed + 1, held_out))
        ]
        return StudyPlan(
            name=request.name,
            purpose=self.purpose.format(
                width=f"{self.width:.1%} or less" if self.width < 1 else f"{self.width:.0%}, too wide to tell anything,"
            ),
            scene=request.scene,
            calibration=parts[0],
            held_out=parts[1],
            verdict=self.verdict,
        )

    def tank_rows(self) -> list[dict[str, Any]]:
        """One row a tank of the plan: composition, runs, CPU seconds, and events expected in all of its runs."""
        return [
            {
                "composition": tank.composition,
                "along": tank.along,
                "runs": int(runs),
                "cpu_seconds": float(runs * cost),
                "events": dict(zip(self.happening, (runs * tank.events).tolist(), strict=True)),
            }
            for tank, runs, cost in zip(self.tanks, self.runs, self.costs, strict=True)
            if runs
        ]

    @on_axes
    def plot(self, ax: Axes) -> Axes:
        """Shares of the tanks in the events of each channel, and in the CPU time; returns `ax`."""
        from calibration import plots

        rows = self.tank_rows()
        shares = {name: [row["events"][name] for row in rows] for name in self.happening}
        labels = [f"{row['runs']} x {_contents(row)}" for row in rows]
        return plots.planned_shares(ax, labels, shares | {"CPU minutes": [row["cpu_seconds"] / 60 for row in rows]})

    def tables(self) -> str:
        """The plan in three tables, for people."""
        found = self.to_dict()
        tanks = text_table(
            ("tank", "at (tu)", "runs", *self.happening, "CPU (min)"),
            [
                (
                    _contents(row),
                    "-" if row["along"] is None else f"{row['along']:g}",
                    str(row["runs"]),
                    *(f"{row['events'][name]:.0f}" for name in self.happening),
                    f"{row['cpu_seconds'] / 60:.1f}",
                )
                for row in found["tanks"]
            ],
        )
        rates = text_table(
            ("rate", "events", "half-width"),
            [(row["rate"], f"{row['events']:.0f}", figure(row["half_width"], ".1%")) for row in found["rates"]],
        )
        tests = text_table(
            ("cubes", "rates", "events of a run", "from the calibration", "runs needed", "runs", "power", "at most"),
            [
                (
                    str(row["cubes"]),
                    row["group"],
                    f"{row['events_of_a_run']:.1f}",
                    f"± {row['relative_sd_from_calibration']:.1%}",
                    "-" if row["runs_needed"] is None else str(row["runs_needed"]),
                    str(row["runs"]),
                    f"{row['power']:.0%}",
                    f"{row['largest_power']:.0%}",
                )
                for row in found["held_out"]
            ],
        )
        return f"calibration, events expected\n{tanks}\n\n{rates}\n\nheld-out runs\n{tests}\n\n{self.cost}"

    @property
    def held_out_seconds(self) -> float:
        """CPU seconds of all held-out runs."""
        return spent(self.held_out_runs, self.held_out_costs)

    @property
    def cost(self) -> str:
        """The CPU time of all runs, and what it would be with other engines, a line each."""
        seconds = {"": 1.0} | {f" with --engine {name}": gain for name, gain in self.gains.items()}
        return "\n".join(
            f"CPU time{by}: calibration {self.calibration_seconds / gain / 3600:.2f} h, held-out runs "
            f"{self.held_out_seconds / gain / 3600:.2f} h" + (f" ({gain:.1f} times quicker)" if by else "")
            for by, gain in seconds.items()
        )

    @property
    def shortfalls(self) -> list[str]:
        """Sentences on the aims that the plan does not reach, each with the options that would reach it."""
        wanted, found = self.request, []
        if self.width > wanted.width * (1 + 1e-6):
            found.append(
                f"the budget of {wanted.cpu_hours:g} CPU hours reaches a half-width of {self.width:.1%}; "
                f"{wanted.width:.1%} would cost {self.wanted_seconds / 3600:.3g} hours of calibration runs: "
                f"--cpu-hours {self._hours_for(wanted.width)}"
            )
        return found + [said for test in self.tests if (said := self._shortfall(test))]

    def _shortfall(self, test: HeldOutTest) -> str | None:
        """A sentence on a shift that the held-out runs of one size fail to detect; None: they do not fail."""
        request, has = self.request, self.held_out_runs[test.cubes]
        what = f"{test.power.group} off by {request.shift:.0%} at {test.cubes} cubes"
        sd = widest_sd(test.power, request.power, MOST_RUNS) if test.limit < request.power else None
        if sd is not None and math.isfinite(test.power.rates_sd):
            narrower = self.width * sd / test.power.rates_sd
            budget = "" if request.cpu_hours is None else f" --cpu-hours {self._hours_for(narrower)}"
            return (
                f"no number of held-out runs shows {what} with power {request.power:.0%}: the uncertainty of the "
                f"calibration allows {test.limit:.0%} at most; a width of {narrower:.1%} is needed: "
                f"--width {90 * narrower:.2g}%{budget}"
            )
        if test.needed is None:
            return (
                f"not even {MOST_RUNS} held-out runs show {what} with power {request.power:.0%}: give a longer "
                f"--held-out-duration, or more cubes by --held-out"
            )
        if has < test.needed:
            return (
                f"{test.needed} held-out runs would show {what}, for "
                f"{(test.needed - has) * self.held_out_costs[test.cubes] / 3600:.3g} CPU hours more; the plan has "
                f"{has}, with power {test.power.power(has):.0%}: --cpu-hours {self._hours_for(request.width)}"
            )
        return None

    def _hours_for(self, width: float) -> str:
        """CPU hours that pay for calibration runs to a half-width, and for all held-out runs that are needed."""
        calibration = self.wanted_seconds * max(1.0, self.request.width / width) ** 2
        needed = {
            n: max([2, *(test.needed or 2 for test in self.tests if test.cubes == n)]) for n in self.held_out_runs
        }
        return f"{1.1 * (calibration + spent(needed, self.held_out_costs)) / 3600:.3g}"  # runs are whole

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
            "other_engines": [
                {
                    "engine": name,
                    "gain": gain,
                    "cpu_seconds": (self.calibration_seconds + self.held_out_seconds) / gain,
                }
                for name, gain in self.gains.items()
            ],
            "shortfalls": self.shortfalls,
            "rates": [
                {"rate": name, "events": n, "half_width": float(half_width(n))} for name, n in self.events.items()
            ],
        }


def spent(runs: dict[int, int], costs: dict[int, float]) -> float:
    """CPU seconds of runs by number of cubes."""
    return sum(n * costs[cubes] for cubes, n in runs.items())


def _contents(row: Mapping[str, Any]) -> str:
    """The composition of a tank as text, such as `40 monomer 2 dimer`."""
    return " ".join(f"{n} {name}" for name, n in row["composition"].items())
