"""Random initial poses without overlap, by random sequential addition."""

from __future__ import annotations

import numpy as np

from mechsim.kernels.contact import blocked
from mechsim.world.bodies import Bodies, matrix_of, quaternion_of

# For one body. At the densest of the paper's settings, 120 cubes of edge 0.25, a single cube needs about ten; where
# they are lines of three and four already, 2,000 are not enough for the last ones.
TRIES = 20_000
JAMMED = 0.5  # share of the volume that randomly placed bodies never fill: there is no use in trying


def scatter(bodies: Bodies, low: np.ndarray, high: np.ndarray, rng: np.random.Generator) -> None:
    """Put every body at rest at a uniformly random pose inside the box, none overlapping: random sequential addition.

    Overlap is tested exactly, cube by cube (separating axes); rejecting circumspheres would fail at 120 cubes
    of edge 0.25. The largest bodies go first, while there is room.
    Raises ValueError when a body finds no place in 20,000 tries.
    """
    unplaced = np.ones(bodies.n_cubes, bool)
    order = sorted(bodies.live.tolist(), key=lambda s: -len(bodies.members[s]))
    share = bodies.n_cubes * bodies.edge**3 / float(np.prod(high - low))
    hopeless = share > JAMMED
    for done, slot in enumerate(order):
        structure, cubes = bodies.held(slot), list(bodies.members[slot])
        for _ in range(0 if hopeless else TRIES):
            position = rng.uniform(low, high)
            q = rng.standard_normal(4)
            q /= np.sqrt(q @ q)
            orientation = quaternion_of(matrix_of(q))
            centre, axes = bodies.cubes_at(position, orientation, structure)
            if not blocked(centre, axes, bodies.centre, bodies.axes, unplaced, bodies.edge / 2, 1.0, low, high):
                break
        else:
            found = "" if hopeless else f" and only {done} of {len(order)} bodies found a place"
            raise ValueError(
                f"{bodies.n_cubes} cubes of edge {bodies.edge} do not fit at random into the tank "
                f"{' x '.join(f'{side:g}' for side in high - low)}: they are {share:.0%} of its volume{found}; "
                "take fewer or smaller cubes, or a larger tank"
            )
        bodies.position[slot], bodies.orientation[slot] = position, orientation
        bodies.velocity[slot] = bodies.spin[slot] = 0.0
        bodies.centre[cubes], bodies.axes[cubes] = centre, axes
        unplaced[cubes] = False
