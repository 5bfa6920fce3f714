"""The hits that mechanics runs have logged, as the estimates read them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from calibration.estimating.hits import RunHits
from mechsim.runs.load_log import SHARED
from mechsim.runs.record import RunRecord, book_of

if TYPE_CHECKING:
    from mechsim.effects.breaking import Breaking


def logged_hits(records: Sequence[RunRecord]) -> list[RunHits]:
    """The hits of all finished runs that have a log; none without any. Tanks, compositions and engines may differ.

    ValueError: runs that differ in rules, cubes, effects or the step.
    """
    found = [record for record in records if record.completed and "load_value" in record.arrays]
    if len({_physics(record) for record in found}) > 1:
        raise ValueError(
            "the runs differ in rules, cubes, effects or the step; expected one physics: analyse them separately"
        )
    return [_hits_of(record) for record in found]


def _physics(record: RunRecord) -> str:
    scene = record.spec.scene
    return str((scene.rules, scene.cubes, scene.effects, scene.numerics.step))


def _hits_of(record: RunRecord) -> RunHits:
    spec, arrays = record.spec, record.arrays
    scene, derivation = spec.scene, book_of(spec.scene.rules)[1]
    breaking: Breaking = scene.provider("breaking")  # there is one, because there is a log
    whole = np.array([before[0] for before, _ in derivation.events], np.int64)
    return RunHits(
        path=record.path,
        struck=whole[arrays["load_channel"]],
        partner=arrays["load_partner"].astype(np.int64),
        load=arrays["load_value"].astype(float),
        shared=(arrays["load_flags"] & SHARED) > 0,
        log_above=float(breaking.log_above or breaking.threshold),
        threshold=breaking.threshold,
        tank=f"{spec.n_cubes} cubes in {record.path.tank}",
        engine=scene.numerics.engine,
    )
