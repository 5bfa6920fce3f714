"""Synthetic logs of hits in tanks of several densities, written from the law itself, without the code under test."""

from __future__ import annotations

import numpy as np
from synthetic_runs import line_network

from calibration.estimating.hits import RunHits
from kinetics.network import Tank
from kinetics.runs import BY_WALL, JumpPath
from kinetics.sampling import sample_path

EDGE = 0.15
CUBES = np.arange(1, 5)
RADIUS, SURFACE, VOLUME = (2 + CUBES) * EDGE / 4, (2 + 4 * CUBES) * EDGE**2, CUBES * EDGE**3
FLAT, TALL, USUAL = Tank((3.0, 3.0, 2.0)), Tank((2.0, 2.0, 6.0)), Tank((2.0, 2.0, 3.0))
# counts of the four species, and the tank: 40 to 240 cubes
TANKS = [
    *(((5, 4, 5, 3), USUAL), ((8, 7, 6, 5), USUAL), ((12, 11, 14, 11), USUAL), ((9, 12, 17, 19), USUAL)),
    *(((14, 19, 28, 26), USUAL), ((13, 12, 13, 11), TALL), ((10, 14, 18, 22), FLAT)),
]
RATES = np.array([0.0, 0.02, 0.03, 0.05])  # of hits by bodies of one cube, a struck species
ALPHA = 1.6
WALL_RATES = np.array([0.0, 0.1, 0.15, 0.2])


def surroundings(counts, tank: Tank) -> tuple[float, float]:
    """phi, and z = s / (1 - phi)."""
    phi = float(counts @ VOLUME) / tank.volume
    return phi, float(counts @ SURFACE) / tank.volume / (1 - phi)


def contact(radius: float, counts, tank: Tank) -> float:
    """Contact value of hard spheres in a mixture (Boublik 1970, Mansoori et al. 1971), written by z."""
    phi, z = surroundings(counts, tank)
    return (1 + radius * z + 2 / 9 * (radius * z) ** 2) / (1 - phi)


def hits(
    rng: np.random.Generator,
    time: float,
    third: float = 0.0,
    reach: float = 0.06,
    beyond: float = 0.3,
    hard: bool = True,
    room=lambda x, y, tank: 1.0,
    scatter: float = 0.0,
) -> list[RunHits]:
    """One run a tank, whose composition stays: Poisson hits by bodies and by walls, some of them shared.

    third : hits of three over those of two, for a unit of surface density; hard : contact values count
    room : factor for a pair of species; scatter : relative standard deviation of rates between runs
    """
    found = []
    for counts, tank in TANKS:
        n = np.array(counts)
        _, z = surroundings(n, tank)
        rows: list[tuple[int, int, int, int]] = []
        luck = 1 + scatter * rng.standard_normal()
        share = (reach + third) * (z + beyond) / (1 + third * (z + beyond))
        for x in (1, 2, 3):
            for y in range(4):
                radius = RADIUS[x] * RADIUS[y] / (RADIUS[x] + RADIUS[y])
                of_two = RATES[x] * CUBES[y] ** ALPHA * n[x] * (n[y] - (x == y)) / tank.volume * room(x, y, tank)
                of_two *= contact(radius, n, tank) if hard else 1.0
                rows.append((x, y, *split(rng, luck * of_two * (1 + third * (z + beyond)) * time, share)))
            of_two = WALL_RATES[x] * n[x] * tank.surface / tank.volume
            of_two *= contact(RADIUS[x], n, tank) if hard else 1.0
            rows.append((x, BY_WALL, *split(rng, luck * of_two * (1 + third * (z + beyond)) * time, share)))
        struck, partner, alone, shared = np.array(rows).T
        each = alone + shared
        is_shared = np.concatenate([np.arange(m) < k for m, k in zip(each, shared, strict=True)])
        found.append(
            RunHits(
                JumpPath(line_network(), n, [], [], time, tank=tank), np.repeat(struck, each), np.repeat(partner, each),
                np.full(int(each.sum()), 0.005), is_shared, 0.004, 0.004, f"{n @ CUBES} cubes in {tank}", "own",
            )
        )  # fmt: skip
    return found


def split(rng: np.random.Generator, mean: float, share: float) -> tuple[int, int]:
    """Poisson counts of hits alone and shared."""
    n = rng.poisson(mean)
    shared = rng.binomial(n, share)
    return n - shared, shared


def changing_run(tank: Tank, seed: int = 0) -> JumpPath:
    """A run whose composition changes all the time."""
    path = sample_path(line_network(), [40, 10, 4, 4], 20.0, seed=seed)
    return JumpPath(line_network(), path.initial, path.times, path.channels, 20.0, tank=tank)
