"""Work-precision diagram: error of mean speed and encounter rate at each numerical setting, against CPU time.

Errors are relative to a reference, the scene at a quarter of its step and four times its solver iterations. Every
setting simulates the same runs: the same places, and where the fluid's noise does not depend on the step the same noise
as well, so what is compared block by block is much alike and its difference known better than either.
How far a setting of the model itself (a hold, a restitution) matters is listed apart: it is no error.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kinetics.support.intervals import student_quantile
from kinetics.support.tables import text_table
from mechsim.accuracy.plan import AccuracyPlan, Setting, plan
from mechsim.accuracy.trial import AccuracyTrial, counter, execute_trial, unbound
from mechsim.runs.ensemble import run_all
from mechsim.runs.executors import Executor
from mechsim.runs.record import RunRecord, book_of
from mechsim.runs.species import single_cubes
from mechsim.runs.store import RunStore
from mechsim.scene import Scene

if TYPE_CHECKING:
    from mechsim.runs.executors import Executor

QUANTITIES = {"speed": "mean speed", "meetings": "encounter rate"}
PILOT_STEPS = 200


@dataclass(frozen=True)
class RelativeChange:
    """A relative difference and half the width of its 95 % interval."""

    value: float
    half_width: float

    @property
    def limit(self) -> float:
        """The largest magnitude within the interval."""
        return abs(self.value) + self.half_width

    def as_dict(self) -> dict[str, float]:
        """For JSON."""
        return {"value": self.value, "half_width_95": self.half_width}


@dataclass(frozen=True)
class SettingResult:
    """What a setting came to.

    runs : made of it
    cost : CPU s a simulated tu, median over blocks and runs; of what was stopped, up to there
    changes : of each quantity, against the reference (numerical settings) or the base (model)
    stopped : the guard's reason, or None; such a setting has no changes
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
    means : of the reference: mean speed, length / tu, and meetings a pair of cubes and tu, each with its half width
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
    means: Mapping[str, RelativeChange]
    given_up: tuple[str, ...] = ()
    cpu_seconds: float = field(compare=False, default=0.0)

    @property
    def floor(self) -> dict[str, float]:
        """Half width of the 95 % interval that sampling alone leaves to a numerical setting, the median one."""
        return {
            name: float(np.median([p.changes[name].half_width for p in self.numerical if name in p.changes]))
            for name in self.means
        }

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
        for name in QUANTITIES:
            change = point.changes.get(name)
            row |= {
                f"{name}_change": None if change is None else change.value,
                f"{name}_half_width_95": None if change is None else change.half_width,
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
        units = {"speed": "mean speed {} length/tu", "meetings": "{} meetings a pair and tu"}
        lines += [units[name].format(f"{m.value:.4g} ± {m.half_width:.2g}") for name, m in self.means.items()]
        heads = ("knob", "value", "CPU (ms/tu)", *(QUANTITIES[name] for name in self.means), "")
        for title, points in (("error against the reference", self.numerical), ("model sensitivity", self.model)):
            rows = [
                (
                    *(point.setting.curve, point.setting.label, f"{1e3 * point.cost:.1f}"),
                    *(_percent(point.changes.get(name)) for name in self.means),
                    point.stopped or "",
                )
                for point in points
            ]
            lines += ["", f"{title} (± half of the 95 % interval)", text_table(heads, rows)]
        lines += [f"refused: {r.curve} {r.label}: {r.reason}" for r in self.plan.refused]
        lines += [f"given up: {trial}" for trial in self.given_up]
        return "\n".join(lines)


def pilot(scene: Scene, cubes: int, seed: int) -> float:
    """CPU s of a step of this scene in a trial, from a short stretch. ValueError where the guard stops that."""
    from mechsim.world.world import Stopped, World

    book, derivation = book_of(scene.rules)
    start = [derivation.structures[s] for s, n in single_cubes(derivation, cubes).items() for _ in range(n)]
    with World(unbound(scene), book, cubes, np.random.SeedSequence(seed)) as world:
        count = counter(scene, world) or (lambda: 0)
        world.populate(start)
        for step in range(PILOT_STEPS + 20):
            if step == 20:  # compiled code is loaded by now
                begin = time.process_time()
            try:
                world.step()
            except Stopped as reason:
                raise ValueError(f"scene {scene.name} was stopped within {step + 1} steps: {reason}") from reason
            count()
        return (time.process_time() - begin) / PILOT_STEPS


def measure(
    scene: Scene,
    store: RunStore,
    *,
    cubes: int,
    duration: float,
    rounds: int,
    budget: float,
    seed: int,
    workers: int | Executor = 1,
    progress: bool | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> Accuracy:
    """Simulate every setting, round by round, until all rounds are made or the budget is used up.

    budget : CPU s that this call may spend; what is in the store already costs nothing
    tell : is given the predicted cost before anything is run
    The curve of steps, from which presets come, takes part in every round, all else in every other one. ValueError: not
    even the first round fits into the budget.
    """
    planned = plan(scene)
    per_step = pilot(scene, cubes, seed)
    composition = single_cubes(book_of(scene.rules)[1], cubes)
    trials = [
        [AccuracyTrial(s.scene, composition, duration, seed, run) for s in _settings(planned, run)]
        for run in range(rounds)
    ]
    missing = [[trial for trial in trials[run] if store.read(trial) is None] for run in range(rounds)]
    prices = [sum((t.duration + 1) / t.scene.numerics.step for t in due) * per_step for due in missing]
    tell(
        f"{scene.name}, {cubes} cubes: {len(trials[0])} settings, up to {rounds} runs of {duration:g} tu each; "
        f"predicted cost {sum(prices) / 60:.3g} CPU min ({1e6 * per_step:.0f} us a step), budget {budget / 60:.3g}"
    )
    if prices[0] > budget:
        raise ValueError(
            f"the first round alone is predicted to take {prices[0] / 60:.3g} CPU min, more than the budget of "
            f"{budget / 60:.3g}: raise the budget, or take shorter runs or fewer cubes"
        )
    spent, done = 0.0, 0
    given_up: list[str] = []
    for price, due in zip(prices, missing, strict=True):
        if due and spent + price > budget:
            tell(f"the budget ends after {done} of {rounds} rounds; the same call again goes on")
            break
        outcome = run_all(due, store, workers=workers, progress=progress, execute=execute_trial)
        given_up += [f"{lost.spec.title}: {lost.reasons[-1]}" for lost in outcome.quarantined]
        spent += sum(record.cost["cpu_seconds"] for record in outcome.records)
        done += 1
    found = collect(scene, planned, store, composition, duration, done, seed)
    return replace(found, given_up=tuple(given_up), cpu_seconds=spent)


def collect(
    scene: Scene,
    planned: AccuracyPlan,
    store: RunStore,
    composition: dict[str, int],
    duration: float,
    runs: int,
    seed: int,
) -> Accuracy:
    """Compare what the store holds of the first `runs` rounds."""

    def records(setting: Setting) -> dict[int, RunRecord]:
        found = {run: store.read(AccuracyTrial(setting.scene, composition, duration, seed, run)) for run in range(runs)}
        return {run: record for run, record in found.items() if record is not None}

    reference, base = records(planned.reference), records(planned.base)
    if not reference:
        raise ValueError(f"no run of the reference of scene {scene.name} was made: there is nothing to compare with")
    stops = [record.outcome for record in reference.values() if not record.completed]
    if stops:
        raise ValueError(f"the reference itself was {stops[0]}; there is nothing to compare with: choose a finer step")
    cubes = sum(composition.values())
    pairs = {"speed": 1.0, "meetings": cubes * (cubes - 1) / 2 * next(iter(reference.values())).facts["block"]}
    means = {name: _mean(_blocks(reference.values(), name) / pairs[name]) for name in QUANTITIES if _has(base, name)}
    return Accuracy(
        scene, cubes, seed, runs, duration, planned,
        SettingResult(planned.reference, len(reference), _cost(reference), {}),
        tuple(_point(setting, records(setting), reference) for setting in planned.numerical),
        tuple(_point(setting, records(setting), base) for setting in planned.model),
        means,
    )  # fmt: skip


def change_of(blocks: np.ndarray, reference: np.ndarray) -> RelativeChange:
    """Relative difference of two means from blocks (B,) that belong together one by one, with its 95 % interval.

    The ratio estimator sum(x) / sum(r) - 1, its error from the scatter of x - ratio r (Cochran, Sampling Techniques,
    1977, section 6.3); bias of order 1 / B. What both share within a block cancels; nothing is assumed of it.
    """
    ratio = blocks.sum() / reference.sum()
    scatter = np.std(blocks - ratio * reference, ddof=1) / np.sqrt(blocks.size) / reference.mean()
    return RelativeChange(float(ratio - 1), float(student_quantile(blocks.size - 1) * scatter))


def _mean(blocks: np.ndarray) -> RelativeChange:
    error = np.std(blocks, ddof=1) / np.sqrt(blocks.size)
    return RelativeChange(float(blocks.mean()), float(student_quantile(blocks.size - 1) * error))


def _point(setting: Setting, own: dict[int, RunRecord], other: dict[int, RunRecord]) -> SettingResult:
    """A setting against what it is compared with, over the runs that both have."""
    stopped = next((record.outcome for record in own.values() if not record.completed), None)
    changes = {}
    shared = sorted(set(own) & set(other))
    if stopped is None and all(other[run].completed for run in shared):
        # Blocks of another step are longer or shorter by less than a step: rates, not counts, are compared.
        for name in (name for name in QUANTITIES if shared and _has(own, name)):
            mine, theirs = (_rates([records[run] for run in shared], name) for records in (own, other))
            if theirs.sum() > 0:
                changes[name] = change_of(mine, theirs)
    return SettingResult(setting, len(own), _cost(own), changes, stopped)


def _rates(records: Sequence[RunRecord], name: str) -> np.ndarray:
    if name == "speed":
        return _blocks(records, name)
    return np.concatenate([record.arrays[name] / record.facts["block"] for record in records])


def _blocks(records: Iterable[RunRecord], name: str) -> np.ndarray:
    return np.concatenate([record.arrays[name] for record in records])


def _cost(records: dict[int, RunRecord]) -> float:
    """Of the whole runs; where all were stopped, of the one that went furthest: a few steps load the code above all."""
    whole = [record for record in records.values() if record.completed]
    whole = whole or sorted(records.values(), key=lambda record: record.facts["steps"])[-1:]
    return float(np.median([record.cost["cpu_per_tu"] for record in whole])) if whole else float("nan")


def _has(records: dict[int, RunRecord], name: str) -> bool:
    return any(name in record.arrays for record in records.values())


def _settings(planned: AccuracyPlan, run: int) -> tuple[Setting, ...]:
    """Settings that take part in a round."""
    if run % 2 == 0:
        return (planned.reference, *planned.numerical, *planned.model)
    return (planned.reference, *(setting for setting in planned.numerical if setting.curve == planned.base.curve))


def _percent(change: RelativeChange | None) -> str:
    return "-" if change is None else f"{100 * change.value:+.2f} ± {100 * change.half_width:.2f} %"
