"""Stored runs as a camera sees them: counts at times 0, T, 2T, ...; nothing of what happened in between."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kinetics.runs import JumpPath
from kinetics.runs.count_tables import count_table
from kinetics.support.packages import pd
from mechsim.runs.record import COMPLETED, RunRecord, RunSpec, book_of


def counts_every(
    every: float,
    contents: Iterable[tuple[dict[str, Any], dict[str, np.ndarray]]],
    folder: Path,
    rules: str | None = None,
) -> pd.DataFrame:
    """Counts of the completed runs at times 0, T, 2T, ..., as `kinetics.runs.count_tables` describes the table.

    every : T, tu; at least a step of the mechanics
    contents : manifest and arrays of each run
    folder : that holds the runs, near which a rule book of one's own is looked for
    rules : only runs of the rule book that their scenes call so; None: all

    ValueError: as of `count_table`; or what decided when a run ends, or starts again, was an event
    """
    paths: dict[str, JumpPath] = {}
    for manifest, arrays in contents:
        inputs, key = manifest["inputs"], manifest["key"]
        if manifest["outcome"] != COMPLETED or rules not in (None, inputs["scene"]["rules"]):
            continue
        spec = RunSpec.of_inputs(inputs, folder / f"{key}.run")
        if book_of(spec.scene.rules)[0].fingerprint != inputs["rules"]:
            raise ValueError(
                f"run {key}: rule book {inputs['scene']['rules']} is no longer the one that the run was made with; "
                f"restore it, or leave --every out"
            )
        if spec.restart or spec.until is not None:
            # The run, or a stretch of it, ends with an event, just before the look that would have shown it. A run in
            # which none came is one of those that were to stop at it: to keep only such runs would be a choice too.
            why = "is put back to its start after each event" if spec.restart else f"ends at its first {spec.until}"
            raise ValueError(
                f"run {key} {why}: looks at fixed times miss the event, and rates from such counts are too low; leave "
                f"--every out and take events, or make runs without {'restarts' if spec.restart else 'such an end'}"
            )
        path = RunRecord(spec, manifest["outcome"], arrays, manifest["facts"]).path
        paths[key] = replace(path, resolution=spec.scene.numerics.step)
    return count_table(paths, every)
