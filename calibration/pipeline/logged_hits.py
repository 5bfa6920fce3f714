"""The hits that mechanics runs have logged, as the estimates read them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from calibration.estimating.hits import RunHits
from kinetics.rates.crowding import ConvexBodies
from kinetics.runs import BY_SEVERAL, JumpPath
from mechsim.runs.load_log import BROKE, SHARED
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


def bodies_in(record: RunRecord) -> ConvexBodies:
    """The geometry of all species of a run."""
    scene = record.spec.scene
    return ConvexBodies.of(book_of(scene.rules)[1].structures.values(), scene.cubes.edge)


def path_of(record: RunRecord) -> JumpPath:
    """The run as a path; where its hits were logged, the partner of a break is that of the largest impulse.

    A record names no partner if several bodies or walls touched at once, though it is the one that struck hardest whose
    hits are counted.
    """
    path, arrays = record.path, record.arrays
    if path.partners is None or "load_value" not in arrays:
        return path
    struck: dict[tuple[float, int], list[int]] = {}
    for row in np.flatnonzero(arrays["load_flags"] & BROKE).tolist():
        when = float(arrays["load_time"][row]), int(arrays["load_channel"][row])
        struck.setdefault(when, []).append(int(arrays["load_partner"][row]))
    partners = path.partners.copy()
    for event in np.flatnonzero(partners == BY_SEVERAL).tolist():
        found = struck.get((float(path.times[event]), int(path.channels[event])), [])
        if len(set(found)) == 1:
            partners[event] = found[0]
    return replace(path, partners=partners)


def _physics(record: RunRecord) -> str:
    scene = record.spec.scene
    return str((scene.rules, scene.cubes, scene.effects, scene.numerics.step))


def _hits_of(record: RunRecord) -> RunHits:
    spec, arrays = record.spec, record.arrays
    scene, derivation = spec.scene, book_of(spec.scene.rules)[1]
    breaking: Breaking | None = scene.provider("breaking")
    if breaking is None:
        raise ValueError(f"{spec.title} has a log of hits, and no effect breaking: the file was altered")
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
