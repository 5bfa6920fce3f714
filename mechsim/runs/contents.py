"""What a run file must hold beyond its checksum, which anybody can compute: entries, types, shapes and ranges.

Readers of runs (tables, poses, replay, tail extrapolation) take them as they are; so what would harm them is refused
here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from kinetics.runs import BY_SEVERAL, BY_UNKNOWN, BY_WALL, NO_BREAK, RESTART
from kinetics.support.settings import NotNegative, Settings, validated

# Array -> kinds of its numbers and its shape, in which a letter is one number for all arrays of its line.
NEEDED = {"initial": ("iu", "S"), "times": ("f", "E"), "channels": ("i", "E")}
OTHERS = {
    "bonds": ("i", "E2"),
    "partners": ("i", "E"),
    "load_time": ("f", "H"),
    "load_channel": ("i", "H"),
    "load_partner": ("i", "H"),
    "load_value": ("f", "H"),
    "load_flags": ("iu", "H"),
    "pose_times": ("f", "K"),
    "centres": ("f", "KC3"),
    "axes": ("f", "KC33"),
    "slots": ("i", "KC"),
}
LARGEST = 2**62  # of a count that a table is to hold

Count = Annotated[int, Meta(ge=0, le=LARGEST)]


class _PartlyRead(Settings, forbid_unknown_fields=False):
    """Settings of which only some are read by all who read runs."""


class _Tank(_PartlyRead):
    size: tuple[float, float, float]


class _Numerics(_PartlyRead):
    step: float


class _Scene(_PartlyRead):
    rules: str
    tank: _Tank
    numerics: _Numerics


class _Inputs(_PartlyRead):
    scene: _Scene
    composition: dict[str, Count]


class _Physics(_PartlyRead):
    wellmixed: int


class RunInputs(_PartlyRead):
    """The inputs of a run as its file holds them: enough to make the run again."""

    scene: dict[str, Any]
    rules: str
    physics: _Physics
    composition: dict[str, Count]
    duration: float
    seed: int
    run: int
    restart: bool = False
    poses: float | None = None
    until: str | None = None


class _Facts(_PartlyRead):
    end: NotNegative
    steps: Count
    species: tuple[str, ...]
    channels: tuple[str, ...]
    open_channels: tuple[bool, ...]


class _Manifest(Settings):
    key: str
    title: str
    outcome: str
    cost: dict[str, float]
    digest: str


class _RunManifest(_Manifest):
    inputs: _Inputs
    facts: _Facts


class _TrialFacts(_PartlyRead):
    steps: Count
    block: NotNegative


class _TrialManifest(_Manifest):
    inputs: dict[str, Any]
    facts: _TrialFacts


def is_trial(inputs: Any) -> bool:
    """Whether these inputs are those of a trial of accuracy, see `mechsim.accuracy.trial`, and of no run."""
    return isinstance(inputs, dict) and "trial" in inputs


def check_contents(manifest: Any, arrays: Mapping[str, np.ndarray]) -> None:
    """ValueError: the manifest or an array is not what a run leaves, or a trial, of which nothing more is read."""
    if isinstance(manifest, dict) and is_trial(manifest.get("inputs")):
        validated(_TrialManifest, manifest, "its manifest")
        for name, array in arrays.items():
            if array.dtype.kind not in "iuf" or not array.dtype.isnative:
                raise ValueError(f"its array {name} is of type {array.dtype}; expected numbers")
        return
    found = validated(_RunManifest, manifest, "its manifest").facts
    lengths = {"S": len(found.species), "2": 2, "3": 3}
    for name, (kinds, shape) in (NEEDED | OTHERS).items():
        if name not in arrays:
            if name in NEEDED:
                raise ValueError(f"it has no array {name}")
            continue
        array = arrays[name]
        fits = array.dtype.kind in kinds and array.dtype.isnative and array.ndim == len(shape)
        if not fits or any(lengths.setdefault(axis, n) != n for axis, n in zip(shape, array.shape, strict=True)):
            raise ValueError(f"its array {name} is of type {array.dtype} and shape {array.shape}; expected another")
    if len(found.open_channels) != len(found.channels):
        raise ValueError(f"{len(found.open_channels)} of its {len(found.channels)} channels are open or closed")
    if ("bonds" in arrays) != ("partners" in arrays):
        raise ValueError("its events have bonds without partners, or partners without bonds")
    _check_within("channels", arrays["channels"], RESTART, len(found.channels))
    if "partners" in arrays:
        least = min(BY_WALL, BY_SEVERAL, BY_UNKNOWN, NO_BREAK)
        _check_within("partners", arrays["partners"], least, len(found.species))


def _check_within(name: str, values: np.ndarray, least: int, end: int) -> None:
    if values.size and not (least <= values.min() and values.max() < end):
        raise ValueError(f"its array {name} goes from {values.min()} to {values.max()}; expected {least} to {end - 1}")
