"""The cost of runs, from similar stored runs or from a short timed trial."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from kinetics.support.cli.progress import stage
from mechsim.runs.record import RunSpec
from mechsim.runs.store import RunStore
from mechsim.studies.cost import timed

Cost = Callable[[RunSpec], float]  # CPU seconds of a run


class RunCosts:
    """CPU seconds of runs on this machine, in proportion to their length.

    The guide are runs of the same scene and composition in a folder, which need not exist; if there is none, a trial
    of 5 tu.
    """

    def __init__(self, folder: str | Path):
        spent: dict[str, tuple[float, float]] = {}
        if (Path(folder) / "format").is_file():
            for manifest, _ in RunStore(folder).contents():
                inputs, end = manifest["inputs"], manifest["facts"]["end"]
                kind = _kind(inputs["scene"], inputs["composition"])
                seconds, tu = spent.get(kind, (0.0, 0.0))
                spent[kind] = (seconds + manifest["cost"]["cpu_seconds"], tu + end)
        self._per_tu = {kind: seconds / tu for kind, (seconds, tu) in spent.items() if tu > 0}

    def __call__(self, spec: RunSpec) -> float:
        """The CPU time of one run, s."""
        kind = _kind(spec.scene.content, spec.composition)
        if kind not in self._per_tu:
            stage(f"a short trial for the cost of a run: {spec.title}")
            self._per_tu[kind] = timed(spec).cpu_per_tu
        return self._per_tu[kind] * spec.duration


def _kind(scene: object, composition: object) -> str:
    return json.dumps([scene, composition], sort_keys=True)
