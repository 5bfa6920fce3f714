"""Replay of a stored run, with a close look at its last steps."""

from __future__ import annotations

import io
from collections import deque
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kinetics.support.limits import RUN_BYTES, bytes_in
from kinetics.support.output import write_whole
from kinetics.support.tables import text_table
from mechsim.runs import record as mechanics
from mechsim.runs.record import RunRecord, RunSpec, execute
from mechsim.runs.store import DamagedRunError, decode

if TYPE_CHECKING:
    from mechsim.world.world import World

SHOWN = 8  # moments of the table


@dataclass(frozen=True, eq=False)
class Replay:
    """A run made again.

    record : with the poses of all cubes before each of its last steps and at its end (as `poses` would record them)
    speed, spin : (K, C) of each cube's body at these moments, length / tu and rad / tu
    is_same : did the same happen, bit for bit, to the same outcome?
    """

    record: RunRecord
    speed: np.ndarray
    spin: np.ndarray
    is_same: bool

    @property
    def worst(self) -> int:
        """The cube to look at: whose body moves and turns most at the end, or is not a number."""
        spec = self.record.spec.scene
        bad = self.speed[-1] / spec.cubes.edge + self.spin[-1]
        return int(np.argmax(np.where(np.isfinite(bad), bad, np.inf)))

    def rows(self) -> list[dict[str, Any]]:
        """The last moments of the worst cube: time (tu), cubes of its body, speed, spin, distance to the next cube."""
        arrays, cube = self.record.arrays, self.worst
        rows = []
        for k in range(max(0, len(self.speed) - SHOWN), len(self.speed)):
            others = arrays["slots"][k] != arrays["slots"][k, cube]
            gaps = np.linalg.norm(arrays["centres"][k, others] - arrays["centres"][k, cube], axis=1)
            rows.append(
                {
                    "time": float(arrays["pose_times"][k]),
                    "cube": cube,
                    "cubes_in_body": int((~others).sum()),
                    "speed": float(self.speed[k, cube]),
                    "spin": float(self.spin[k, cube]),
                    "nearest": float(gaps.min()) if len(gaps) else None,
                }
            )
        return rows

    def as_dict(self) -> dict[str, Any]:
        """For programs."""
        spec, facts = self.record.spec, self.record.facts
        found = {"run": spec.title, "key": spec.key, "outcome": self.record.outcome, "is_same": self.is_same}
        return found | {"end": facts["end"], "steps": facts["steps"], "last": self.rows()}

    def save(self, file: str | Path) -> None:
        """Write the poses and motions of the last steps: pose_times, centres, axes, slots, speed, spin (npz)."""
        names = ("pose_times", "centres", "axes", "slots")
        content = io.BytesIO()
        arrays: dict[str, Any] = {name: self.record.arrays[name] for name in names}
        np.savez(content, **arrays, speed=self.speed, spin=self.spin)
        write_whole(file, content.getvalue())

    def __str__(self) -> str:
        rows = self.rows()
        cells = [tuple("-" if v is None else f"{v:.6g}" for v in row.values()) for row in rows]
        same = "identical, bit for bit" if self.is_same else "NOT identical: another machine or library?"
        ended = f"ended at {self.record.facts['end']:.6g} tu; {same}"
        head = f"{self.record.spec.title}\n{self.record.outcome}\n{ended}"
        return f"{head}\n{text_table(tuple(name.replace('_', ' ') for name in rows[0]), cells)}"


def replay(file: str | Path, last: int = 40) -> Replay:
    """Make a stored run again, from its own file alone.

    last : poses of so many steps before the end are kept
    ValueError: not a run file, altered, or made by versions that give other records than these.
    """
    if last < 1:
        raise ValueError(f"last = {last}; expected 1 step or more")
    try:
        manifest, _ = decode(bytes_in(Path(file), RUN_BYTES), Path(file))
    except DamagedRunError as error:
        raise ValueError(f"{file} is not a valid run file: {error}") from error
    spec = replace(RunSpec.of_inputs(manifest["inputs"], file), physics=mechanics.PHYSICS)
    if spec.key != manifest["key"]:
        differ = [name for name, value in spec.inputs.items() if manifest["inputs"].get(name) != value]
        raise ValueError(
            f"{file} cannot be made again here: {', '.join(differ) or 'an input'} differ; it was made with "
            f"{manifest['inputs']['physics']}, here are {spec.inputs['physics']}"
        )
    frames: deque[tuple[Any, ...]] = deque(maxlen=last + 1)
    record = execute(spec, look=lambda world: frames.append(_frame(world)))
    names = ("pose_times", "centres", "axes", "slots")
    *poses, speed, spin = (np.array(column) for column in zip(*frames, strict=True))
    shown = replace(record, arrays=record.arrays | dict(zip(names, poses, strict=True)))
    return Replay(shown, speed, spin, is_same=record.digest == manifest["digest"])


def _frame(world: World) -> tuple[Any, ...]:
    """Poses and motions of all cubes now."""
    b = world.bodies
    speed, spin = np.linalg.norm(b.velocity, axis=1), np.linalg.norm(b.spin, axis=1)
    return (*world.snapshot(), speed[b.body], spin[b.body])
