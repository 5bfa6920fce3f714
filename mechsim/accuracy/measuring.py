"""The measurement behind an accuracy diagram: trials of every setting, round by round, within a budget."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mechsim.accuracy.changes import change_of, mean_of
from mechsim.accuracy.diagram import Accuracy, SettingResult
from mechsim.accuracy.plan import AccuracyPlan, Setting, plan
from mechsim.accuracy.quantities import QUANTITIES, Quantity
from mechsim.accuracy.trial import AccuracyTrial, compositions, execute_trial, pilot
from mechsim.runs.ensemble import run_all
from mechsim.runs.record import RunRecord
from mechsim.runs.store import RunStore
from mechsim.scene import Scene

if TYPE_CHECKING:
    from mechsim.runs.executors import Executor

Records = Mapping[int, RunRecord]  # of one setting and tank, by the number of the run


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
    starts = compositions(scene, cubes)
    per_step = [pilot(AccuracyTrial(scene, start, duration, seed, 0)) for start in starts]
    missing = [_missing(store, planned, starts, duration, seed, run) for run in range(rounds)]
    prices = [
        sum((t.duration + 1) / t.scene.numerics.step * per_step[t.has_structures] for t in due) for due in missing
    ]
    tanks = "single cubes" if len(starts) == 1 else "single cubes, and as many of structures"
    tell(
        f"{scene.name}, {cubes} cubes: {len(_settings(planned, 0))} settings, up to {rounds} runs of {duration:g} tu "
        f"each of {tanks}; predicted cost {sum(prices) / 60:.3g} CPU min "
        f"({', '.join(f'{1e6 * each:.0f}' for each in per_step)} us a step), budget {budget / 60:.3g}"
    )
    if prices[0] > budget:
        raise ValueError(
            f"the first round alone is predicted to take {prices[0] / 60:.3g} CPU min, more than the budget of "
            f"{budget / 60:.3g}: raise the budget, or use shorter runs or fewer cubes"
        )
    spent, done = 0.0, 0
    given_up: list[str] = []
    for price, due in zip(prices, missing, strict=True):
        if due and spent + price > budget:
            tell(f"the budget ends after {done} of {rounds} rounds; the same call again continues")
            break
        outcome = run_all(due, store, workers=workers, progress=progress, execute=execute_trial)
        given_up += [f"{lost.spec.title}: {lost.reasons[-1]}" for lost in outcome.quarantined]
        spent += sum(record.cost["cpu_seconds"] for record in outcome.records)
        done += 1
    found = collect(scene, planned, store, cubes, duration, done, seed)
    return replace(found, given_up=tuple(given_up), cpu_seconds=spent)


def collect(
    scene: Scene, planned: AccuracyPlan, store: RunStore, cubes: int, duration: float, runs: int, seed: int
) -> Accuracy:
    """Compare what the store holds of the first `runs` rounds."""

    def records(setting: Setting) -> list[Records]:
        """By tank."""
        return [
            {
                run: record
                for run in range(runs)
                if (record := store.read(AccuracyTrial(setting.scene, start, duration, seed, run))) is not None
            }
            for start in compositions(scene, cubes)
        ]

    reference, base = records(planned.reference), records(planned.base)
    if not all(reference):
        raise ValueError(f"no reference run of scene {scene.name} was made: there is nothing to compare with")
    stops = [record.outcome for tank in reference for record in tank.values() if not record.completed]
    if stops:
        raise ValueError(f"the reference itself was {stops[0]}; there is nothing to compare with: choose a finer step")
    numerical = tuple(_point(setting, records(setting), reference) for setting in planned.numerical)
    model = tuple(_point(setting, records(setting), base) for setting in planned.model)
    compared = {name for point in (*numerical, *model) for name in point.changes}
    means = {}
    for quantity in (quantity for quantity in QUANTITIES if quantity.name in compared):
        tank = next(list(tank.values()) for tank in reference if _has(tank, quantity))
        means[quantity.name] = mean_of(_rates(tank, quantity) / quantity.carriers(tank[0].spec))
    own = SettingResult(planned.reference, len(reference[0]), _cost(reference[0]), {})
    return Accuracy(scene, cubes, seed, runs, duration, planned, own, numerical, model, means)


def _missing(
    store: RunStore,
    planned: AccuracyPlan,
    starts: Sequence[dict[str, int]],
    duration: float,
    seed: int,
    run: int,
) -> list[AccuracyTrial]:
    """Trials of a round that are to be made; settings that move alike share one."""
    trials = [AccuracyTrial(s.scene, start, duration, seed, run) for start in starts for s in _settings(planned, run)]
    return [trial for trial in {trial.key: trial for trial in trials}.values() if store.read(trial) is None]


def _settings(planned: AccuracyPlan, run: int) -> tuple[Setting, ...]:
    """Settings that take part in a round."""
    if run % 2 == 0:
        return (planned.reference, *planned.numerical, *planned.model)
    return (planned.reference, *(setting for setting in planned.numerical if setting.curve == planned.base.curve))


def _point(setting: Setting, own: Sequence[Records], others: Sequence[Records]) -> SettingResult:
    """A setting against its base, over the runs that both have. A tank that was stopped shows nothing."""
    stopped = next((r.outcome for tank in own for r in tank.values() if not r.completed), None)
    changes = {}
    for mine, theirs in zip(own, others, strict=True):
        shared = sorted(set(mine) & set(theirs))
        if not shared or not all(record.completed for record in (*mine.values(), *(theirs[run] for run in shared))):
            continue
        for quantity in (quantity for quantity in QUANTITIES if _has(mine, quantity)):
            pair = [[records[run] for run in shared] for records in (mine, theirs)]
            if not quantity.is_count or min(_events(records, quantity) for records in pair) >= quantity.least:
                changes[quantity.name] = change_of(*(_rates(records, quantity) for records in pair))
    return SettingResult(setting, len(own[0]), _cost(own[0]), changes, stopped)


def _has(records: Records, quantity: Quantity) -> bool:
    return any(quantity.name in record.arrays for record in records.values())


def _events(records: Iterable[RunRecord], quantity: Quantity) -> int:
    return sum(int(record.arrays[quantity.name].sum()) for record in records)


def _rates(records: Iterable[RunRecord], quantity: Quantity) -> np.ndarray:
    """By block: means as they are, counts a tu, since blocks of another hold are longer or shorter."""
    return np.concatenate([r.arrays[quantity.name] / (r.facts["block"] if quantity.is_count else 1.0) for r in records])


def _cost(records: Records) -> float:
    """Cost of the whole runs; if all were stopped, of the longest, since a few steps mostly load code."""
    whole = [record for record in records.values() if record.completed]
    whole = whole or sorted(records.values(), key=lambda record: record.facts["steps"])[-1:]
    return float(np.median([record.cost["cpu_per_tu"] for record in whole])) if whole else float("nan")
