"""Work-precision diagram: the error of each quantity at each numerical setting, against CPU time.

Errors are relative to a reference, the scene at a quarter of its step and four times its solver iterations. Every
setting simulates the same runs: the same places, and where the fluid's noise does not depend on the step the same noise
as well, so what is compared block by block is alike, speeds above all, and its difference known better than either.
How far a setting of the model itself (a hold, a restitution) matters is listed apart: it is no error.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from kinetics.support.tables import text_table
from mechsim.accuracy.changes import Mean, RelativeChange
from mechsim.accuracy.plan import AccuracyPlan, Setting
from mechsim.accuracy.quantities import BY_NAME, QUANTITIES
from mechsim.scene import Scene


@dataclass(frozen=True)
class SettingResult:
    """Result of one setting.

    runs : made of it, with single cubes, and as many with structures where bonds break
    cost : CPU s a simulated tu with single cubes, median over blocks and runs; of what was stopped, up to there
    changes : of each quantity, against the reference (numerical settings) or the base (model)
    stopped : the guard's reason, or None; in a tank that was stopped nothing is compared
    """

    setting: Setting
    runs: int
    cost: float
    changes: Mapping[str, RelativeChange]
    stopped: str | None = None


@dataclass(frozen=True)
class Accuracy:
    """A work-precision diagram.

    runs, duration : the curve of steps has simulated so many runs of so many tu each, other settings half as many
    means : of the reference, by quantity, for those that were compared at some setting
    given_up : trials that failed at every try of that call, each with the last reason; the others are compared without
    cpu_seconds : spent by the call that returned this
    """

    scene: Scene
    cubes: int
    seed: int
    runs: int
    duration: float
    plan: AccuracyPlan
    reference: SettingResult
    numerical: tuple[SettingResult, ...]
    model: tuple[SettingResult, ...]
    means: Mapping[str, Mean]
    given_up: tuple[str, ...] = ()
    cpu_seconds: float = field(compare=False, default=0.0)

    @property
    def floor(self) -> dict[str, float]:
        """Half width of the 95 % interval that sampling alone leaves to a numerical setting, the median one."""
        widths = {n: [p.changes[n].half_width for p in self.numerical if n in p.changes] for n in self.means}
        return {name: float(np.median(found)) for name, found in widths.items() if found}

    def rows(self) -> list[dict[str, Any]]:
        """One flat row a setting, for tables."""
        found = [self._row("reference", self.reference)]
        found += [self._row("numerical", point) for point in self.numerical]
        found += [self._row("model", point) for point in self.model]
        return found

    def _row(self, panel: str, point: SettingResult) -> dict[str, Any]:
        numerics = point.setting.scene.numerics
        row: dict[str, Any] = {
            "panel": panel,
            "knob": point.setting.curve,
            "value": point.setting.label,
            "step": numerics.step,
            "solver_iterations": numerics.solver_iterations,
            "drag_sub_cycles": getattr(point.setting.scene.effect("drag"), "sub_cycles", None),
            "runs": point.runs,
            "cpu_s_per_tu": point.cost,
        }
        for quantity in QUANTITIES:
            change = point.changes.get(quantity.name)
            row |= {
                f"{quantity.name}_change": None if change is None else change.value,
                f"{quantity.name}_half_width_95": None if change is None else change.half_width,
            }
        return row | {"stopped": point.stopped}

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "scene": self.scene.name,
            "scene_hash": self.scene.fingerprint,
            "cubes": self.cubes,
            "seed": self.seed,
            "runs": self.runs,
            "duration": self.duration,
            "reference": {name: mean.as_dict() for name, mean in self.means.items()},
            "floor": self.floor,
            "settings": self.rows(),
            "refused": [{"knob": r.curve, "value": r.label, "reason": r.reason} for r in self.plan.refused],
            "given_up": list(self.given_up),
            "cpu_seconds": self.cpu_seconds,
        }

    def __str__(self) -> str:
        lines = [f"reference: step {self.reference.setting.label} tu, {self.reference.cost:.3g} CPU s/tu"]
        lines += [
            f"{BY_NAME[name].title} {m.value:.4g} ± {m.half_width:.2g} {BY_NAME[name].unit}"
            for name, m in self.means.items()
        ]
        heads = ("knob", "value", "CPU (ms/tu)", *(BY_NAME[name].title for name in self.means), "")
        for title, points in (("error against the reference", self.numerical), ("model sensitivity", self.model)):
            rows = [
                (
                    *(point.setting.curve, point.setting.label, f"{1e3 * point.cost:.1f}"),
                    *(str(point.changes.get(name, "-")) for name in self.means),
                    point.stopped or "",
                )
                for point in points
            ]
            lines += ["", f"{title} (± half of the 95 % interval)", text_table(heads, rows)]
        lines += [f"refused: {r.curve} {r.label}: {r.reason}" for r in self.plan.refused]
        lines += [f"given up: {trial}" for trial in self.given_up]
        return "\n".join(lines)
