"""Compiled loops of the fluid: a field of flow at the points where it drags on the cubes."""

import math

from numba import njit


@njit(cache=True)
def flow(centre, axes, points, modes, fluid):
    """Velocity of the fluid at all drag points: sum over modes of amplitude * cos(wave . x + phase); writes `fluid`.

    centre (C, 3), axes (C, 3, 3; columns) : of the cubes, world
    points (P, 3) : drag points from a cube's centre along its own axes
    modes (M, 7) : wave vector, phase, amplitude; fluid (C, P, 3)
    """
    for cube in range(centre.shape[0]):
        for p in range(points.shape[0]):
            x, y, z = centre[cube]
            for k in range(3):
                x += axes[cube, 0, k] * points[p, k]
                y += axes[cube, 1, k] * points[p, k]
                z += axes[cube, 2, k] * points[p, k]
            ux = uy = uz = 0.0
            for m in range(modes.shape[0]):
                wave = math.cos(modes[m, 0] * x + modes[m, 1] * y + modes[m, 2] * z + modes[m, 3])
                ux += wave * modes[m, 4]
                uy += wave * modes[m, 5]
                uz += wave * modes[m, 6]
            fluid[cube, p, 0], fluid[cube, p, 1], fluid[cube, p, 2] = ux, uy, uz
