"""Hits on structures and exposure to them, pooled over the logs of runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinetics.network import Tank
from kinetics.support.arrays import Floats, Ints
from mechsim.effects.breaking import Breaking
from mechsim.runs.record import RunRecord, book_of, kinds


@dataclass(frozen=True, eq=False)
class Loads:
    """Hits and exposure, pooled over runs of one physics.

    species (S,), sizes (S,) : names, and cubes of each
    struck, partner (H,) : species; a partner of BY_WALL is a wall. value (H,) : load
    alone (S,) : integral of x_X dt, tu
    pairs (S, S) : integral of x_X (x_Y - [X = Y]) / volume dt; walls (S,) : of x_X surface / volume dt
    breaks (S,) : breaks counted in the runs
    log_above, threshold : in the unit of the criterion
    """

    species: tuple[str, ...]
    sizes: Ints
    struck: Ints
    partner: Ints
    value: Floats
    alone: Floats
    pairs: Floats
    walls: Floats
    breaks: Ints
    log_above: float
    threshold: float

    @property
    def can_break(self) -> list[int]:
        """Species that were hit, or that hits would be logged of: those there at all, with a bond."""
        return [int(s) for s in np.flatnonzero((self.alone > 0) & (self.sizes > 1))]

    def above(self, level: float) -> Loads:
        """Only the hits above a level."""
        kept = self.value > level
        return replace(self, struck=self.struck[kept], partner=self.partner[kept], value=self.value[kept])

    def __add__(self, other: Loads) -> Loads:
        if (self.species, self.log_above, self.threshold) != (other.species, other.log_above, other.threshold):
            raise ValueError(
                f"logs above {self.log_above:g} with threshold {self.threshold:g} and above {other.log_above:g} with "
                f"{other.threshold:g}, or of different rules; expected runs of one kind: analyse them separately"
            )
        return replace(
            self,
            struck=np.concatenate([self.struck, other.struck]),
            partner=np.concatenate([self.partner, other.partner]),
            value=np.concatenate([self.value, other.value]),
            alone=self.alone + other.alone,
            pairs=self.pairs + other.pairs,
            walls=self.walls + other.walls,
            breaks=self.breaks + other.breaks,
        )


def loads_of(records: Sequence[RunRecord]) -> Loads:
    """Pool the logs of runs; tanks and compositions may differ. ValueError: no log, or runs of another physics."""
    return pooled(logs_of(records))


def logs_of(records: Sequence[RunRecord]) -> list[Loads]:
    """The log of each run; errors as in `loads_of`."""
    if not records:
        raise ValueError("no runs; expected at least one finished run with a log (log_above of the effect breaking)")
    physics = {_physics(record) for record in records}
    if len(physics) > 1:
        raise ValueError("the runs differ in effects, cubes or rules; expected one physics: analyse them separately")
    return [_loads_of(record) for record in records]


def pooled(runs: Sequence[Loads]) -> Loads:
    """All hits and exposures together; at least one run."""
    total, *others = runs
    for run in others:
        total += run
    return total


def _physics(record: RunRecord) -> str:
    scene = record.spec.scene
    return str((scene.rules, scene.cubes, scene.numerics, scene.effects))


def _loads_of(record: RunRecord) -> Loads:
    scene = record.spec.scene
    breaking = scene.provider("breaking")
    if not record.completed or "load_value" not in record.arrays or not isinstance(breaking, Breaking):
        why = record.outcome if not record.completed else "its scene's effect breaking has no log_above"
        raise ValueError(f"{record.spec.title} has no whole log of hits ({why}): leave it out, or make it with a log")
    derivation = book_of(scene.rules)[1]
    path, arrays = record.path, record.arrays
    from_species = np.array([before[0] for before, _ in derivation.events], np.int64)
    length = np.diff(np.concatenate([[0.0], path.times, [path.end]]))
    states = path.states.astype(float)
    alone = length @ states
    tank = Tank(scene.tank.size)
    has_walls = scene.provider("walls") is not None
    is_break = np.array([kind == "break" for kind in kinds(derivation)])
    fired = path.channels[path.channels >= 0]
    fired = fired[is_break[fired]]
    return Loads(
        species=path.network.species,
        sizes=np.array([len(structure) for structure in derivation.structures.values()], np.int64),
        struck=from_species[arrays["load_channel"]],
        partner=arrays["load_partner"].astype(np.int64),
        value=arrays["load_value"].astype(float),
        alone=alone,
        pairs=((states * length[:, None]).T @ states - np.diag(alone)) / tank.volume,
        walls=alone * tank.surface / tank.volume * has_walls,
        breaks=np.bincount(from_species[fired], minlength=len(path.network.species)),
        log_above=float(breaking.log_above or 0),
        threshold=breaking.threshold,
    )
