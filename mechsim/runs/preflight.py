"""Checks that need a built world, made before any run: do the bodies fit into the tank?"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from mechsim.runs.record import RunSpec, book_of


def check_starts(specs: Iterable[RunSpec]) -> None:
    """Build the world of the first run of each scene and composition, place its bodies, and take no step.

    ValueError: the bodies do not fit into the tank.
    """
    from mechsim.world.world import World

    kinds: dict[tuple[Any, ...], RunSpec] = {}
    for spec in specs:
        kinds.setdefault((spec.scene.fingerprint, *sorted(spec.composition.items())), spec)
    for spec in kinds.values():
        book, _ = book_of(spec.scene.rules)
        with World(spec.scene, book, spec.n_cubes, spec.streams) as world:
            world.populate(spec.start)
