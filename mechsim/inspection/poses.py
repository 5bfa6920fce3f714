"""Recorded poses of a run, validated before use; reading of runs from their files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from kinetics.assembly.faces import scheme_of
from kinetics.support.limits import RUN_BYTES, bytes_in
from mechsim.runs.record import RunRecord, RunSpec, book_of
from mechsim.runs.store import DamagedRunError, RunStore, decode

NOT_THERE = "no poses were recorded; repeat the run with an interval between poses (simulate --poses)"


@dataclass(frozen=True, eq=False)
class Poses:
    """Where all cubes were, frame by frame.

    times (K,) : tu, ascending
    centres (K, C, 3), axes (K, C, 3, 3; columns) : of the cubes, within and along the tank
    slots (K, C) : cubes of equal slot are one structure
    tank (3,), edge : lengths
    face_types : of a cube's six faces, in the order of FACE_NORMALS
    name : of the scene
    """

    times: np.ndarray
    centres: np.ndarray
    axes: np.ndarray
    slots: np.ndarray
    tank: np.ndarray
    edge: float
    face_types: tuple[str, ...]
    name: str

    def __post_init__(self) -> None:
        frames, cubes = len(self.times), self.centres.shape[1] if self.centres.ndim > 1 else 0
        expected = {
            "times": (frames,),
            "centres": (frames, cubes, 3),
            "axes": (frames, cubes, 3, 3),
            "slots": (frames, cubes),
        }
        for name, shape in expected.items():
            array = getattr(self, name)
            if array.shape != shape or not array.size:
                self._fail(f"{name} has shape {array.shape}; expected {shape}, with at least one frame and cube")
            if array.dtype.kind not in "iuf" or not np.isfinite(array).all():
                self._fail(f"{name} holds a value that is not finite")
        if (np.diff(self.times) < 0).any():
            self._fail("the times do not ascend")
        if self.slots.dtype.kind == "f" or self.slots.min() < 0 or self.slots.max() >= cubes:
            self._fail(f"slots are not whole numbers from 0 to {cubes - 1}")
        if np.abs(np.swapaxes(self.axes, 2, 3) @ self.axes - np.eye(3)).max() > 1e-6:
            self._fail("the axes of some cube are not of length one, at right angles")

    @staticmethod
    def _fail(what: str) -> NoReturn:
        raise ValueError(f"the pose record is damaged: {what}; make the run again")

    @classmethod
    def of(cls, record: RunRecord) -> Poses:
        """The poses of a run; ValueError where none were recorded, or they are damaged."""
        names = ("pose_times", "centres", "axes", "slots")
        if not set(names) & set(record.arrays):
            raise ValueError(f"{record.spec.title}: {NOT_THERE}")
        missing = [name for name in names if name not in record.arrays]
        if missing:
            cls._fail(f"it lacks {', '.join(missing)}")
        scene, cubes = record.spec.scene, record.spec.n_cubes
        times, centres, axes, slots = (np.asarray(record.arrays[name]) for name in names)
        if centres.shape[1:2] != (cubes,):
            cls._fail(f"centres has shape {centres.shape}; expected (frames, {cubes}, 3)")
        types = scheme_of(book_of(scene.rules)[0].scheme).types
        return cls(times, centres, axes, slots, np.asarray(scene.tank.size), scene.cubes.edge, types, scene.name)

    def sizes(self, frame: int) -> np.ndarray:
        """Cubes (C,) in the structure of each cube."""
        sizes: np.ndarray = np.bincount(self.slots[frame])[self.slots[frame]]
        return sizes

    def spread(self, most: int) -> np.ndarray:
        """At most so many frames, evenly spread, the first and the last among them."""
        return np.unique(np.linspace(0, len(self.times) - 1, min(most, len(self.times))).round().astype(int))


def record_at(run: str, folder: str | Path) -> RunRecord:
    """A stored run: the path of its file, or the beginning of its key in a folder of runs.

    ValueError: there is no such run, or more than one; it is damaged; its rule book has changed since.
    """
    path = Path(run)
    if not path.is_file():
        found = sorted(Path(folder).glob(f"{run}*.run")) if run.isalnum() else []
        if len(found) != 1:
            raise ValueError(
                f"{run} is no file, and {folder} holds {len(found) or 'no'} runs whose key begins with it; give the "
                "path of a .run file, or a key that `wellmixed simulate --json` prints, with its folder"
            )
        path = found[0]
    try:
        manifest, arrays = decode(bytes_in(path, RUN_BYTES), path)
    except DamagedRunError as error:
        raise ValueError(f"{path} is damaged: {error}; make the run again") from error
    spec = RunSpec.of_inputs(manifest["inputs"], path)
    if book_of(spec.scene.rules)[0].fingerprint != manifest["inputs"]["rules"]:
        raise ValueError(f"{path}: rule book {spec.scene.rules} is no longer the one that the run was made with")
    return RunRecord(spec, manifest["outcome"], arrays, manifest["facts"], manifest["cost"])


def records_at(names: Sequence[str]) -> list[RunRecord]:
    """The stored runs in folders and files of these names, each once; errors as in `record_at`."""
    files: list[Path] = []
    for name in map(Path, names):
        files += sorted(RunStore.found(name).folder.glob("*.run")) if name.is_dir() else [name]
    return [record_at(str(file), file.parent) for file in dict.fromkeys(files)]
