"""Compiled velocity field of the fluid at the drag points."""

import math

import numpy as np

from kinetics.kernels.compiled import compiled

_PI2 = math.pi**2


@compiled(nogil=False, error_model="python")
def cosine_of_half_turns(t):
    """cos(pi t) to 1e-15 beyond the rounding of t itself, for |t| up to 2^50, in arithmetic alone.

    The library's cosine is called for one number at a time; this one the compiler spreads over several. cos(pi t) =
    sin(pi h), h = 1/2 - |t| for t within a half turn; Taylor's series up to h^21 leaves out 2e-18 at most.
    """
    h = 0.5 - abs(t - 2.0 * math.floor(0.5 * t + 0.5))
    y = _PI2 * h * h
    s = 1.0 - y * (1.0 / 420.0)
    s = 1.0 - y * (1.0 / 342.0) * s
    s = 1.0 - y * (1.0 / 272.0) * s
    s = 1.0 - y * (1.0 / 210.0) * s
    s = 1.0 - y * (1.0 / 156.0) * s
    s = 1.0 - y * (1.0 / 110.0) * s
    s = 1.0 - y * (1.0 / 72.0) * s
    s = 1.0 - y * (1.0 / 42.0) * s
    s = 1.0 - y * (1.0 / 20.0) * s
    s = 1.0 - y * (1.0 / 6.0) * s
    return math.pi * h * s


@compiled(nogil=False, error_model="python")
def renew(modes, chance, wave_spread, push_spread, rng):
    """Replace each mode with this chance by a new one: writes `modes` (M, 7) of wave vector, phase, amplitude.

    Wave vectors N(0, wave_spread) and amplitudes N(0, push_spread) a component, these without their part along the wave
    vector, so that the flow is incompressible; phases even over a turn.
    """
    for m in range(modes.shape[0]):
        if chance < 1.0 and rng.random() >= chance:
            continue
        kx, ky, kz = rng.standard_normal(), rng.standard_normal(), rng.standard_normal()
        ax, ay, az = rng.standard_normal(), rng.standard_normal(), rng.standard_normal()
        along = (ax * kx + ay * ky + az * kz) / (kx * kx + ky * ky + kz * kz)
        modes[m, 0], modes[m, 1], modes[m, 2] = wave_spread * kx, wave_spread * ky, wave_spread * kz
        modes[m, 3] = 2.0 * math.pi * rng.random()
        modes[m, 4] = push_spread * (ax - along * kx)
        modes[m, 5] = push_spread * (ay - along * ky)
        modes[m, 6] = push_spread * (az - along * kz)


@compiled(nogil=False, error_model="python")
def flow(centre, axes, points, modes, fluid):
    """Velocity of the fluid at all drag points: sum over modes of amplitude * cos(wave . x + phase); writes `fluid`.

    centre (C, 3), axes (C, 3, 3; columns) : of the cubes, world
    points (P, 3) : drag points from a cube's centre along its own axes
    modes (M, 7) : wave vector, phase, amplitude; fluid (C, P, 3)

    All places go through one mode after the other, by components: so the compiler takes several places at a time.
    """
    n_points = points.shape[0]
    n = centre.shape[0] * n_points
    x, y, z = np.empty(n), np.empty(n), np.empty(n)
    u, v, w = np.zeros(n), np.zeros(n), np.zeros(n)
    for cube in range(centre.shape[0]):
        for p in range(n_points):
            i = cube * n_points + p
            px, py, pz = points[p]
            x[i] = centre[cube, 0] + axes[cube, 0, 0] * px + axes[cube, 0, 1] * py + axes[cube, 0, 2] * pz
            y[i] = centre[cube, 1] + axes[cube, 1, 0] * px + axes[cube, 1, 1] * py + axes[cube, 1, 2] * pz
            z[i] = centre[cube, 2] + axes[cube, 2, 0] * px + axes[cube, 2, 1] * py + axes[cube, 2, 2] * pz
    for m in range(modes.shape[0]):
        kx, ky, kz, phase, ax, ay, az = modes[m]
        kx, ky, kz, phase = kx / math.pi, ky / math.pi, kz / math.pi, phase / math.pi  # in half turns
        for i in range(n):
            wave = cosine_of_half_turns(kx * x[i] + ky * y[i] + kz * z[i] + phase)
            u[i] += wave * ax
            v[i] += wave * ay
            w[i] += wave * az
    for cube in range(centre.shape[0]):
        for p in range(n_points):
            i = cube * n_points + p
            fluid[cube, p, 0], fluid[cube, p, 1], fluid[cube, p, 2] = u[i], v[i], w[i]
