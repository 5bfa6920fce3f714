"""Compiled forces before a step: attraction of faces, gyroscopic torque.

Indices as in `motion`: B body slots, C cubes, P drag points a cube; a quaternion is (x, y, z, w), body frame to world.
"""

import math

import numpy as np

from kinetics.kernels.compiled import compiled
from mechsim.kernels.motion import spin_before


@compiled(nogil=False, error_model="python")
def rotated(qx, qy, qz, qw, x, y, z):
    """A vector turned by a unit quaternion; by its conjugate (-qx, -qy, -qz, qw) back into the body frame."""
    cx = 2.0 * (qy * z - qz * y)
    cy = 2.0 * (qz * x - qx * z)
    cz = 2.0 * (qx * y - qy * x)
    return (
        x + qw * cx + qy * cz - qz * cy,
        y + qw * cy + qz * cx - qx * cz,
        z + qw * cz + qx * cy - qy * cx,
    )


@compiled(nogil=False, error_model="python")
def weighted(qx, qy, qz, qw, f0, f1, f2, x, y, z):
    """R diag(f) R' v with R the rotation of a quaternion: by principal moments the angular momentum of a spin, by
    their inverses the spin of an angular momentum."""
    bx, by, bz = rotated(-qx, -qy, -qz, qw, x, y, z)
    return rotated(qx, qy, qz, qw, f0 * bx, f1 * by, f2 * bz)


@compiled(nogil=False, error_model="python")
def attract(
    pairs, body, centre, axes, edge, position, orientation, velocity, spin, mass, inertia, strength, decay, reach, step
):
    """Pull the centres of two faces at each other, a pair at a time: updates `velocity` and `spin`.

    The force at a distance d is strength / (1 + d / decay)^4, nothing beyond `reach`. Both bodies get the impulse
    force * step along the line between the two points, equal and opposite; it is cut down where the points would pass
    each other within the step. The force weakens with distance, so an impulse then hands over no more energy than
    force * d, which the well between here and contact still holds.

    pairs (K, 4) : cube, face, cube, face
    """
    arm = np.empty((2, 3))  # from each body's centre to its face's
    for q in range(pairs.shape[0]):
        gap = np.zeros(3)
        for side in range(2):
            cube, face = pairs[q, 2 * side], pairs[q, 2 * side + 1]
            out = 0.5 * edge * (1.0 - 2.0 * (face & 1))
            for k in range(3):
                place = centre[cube, k] + out * axes[cube, k, face >> 1]
                gap[k] += place if side else -place
                arm[side, k] = place - position[body[cube], k]
        d = math.sqrt(gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2])
        if d == 0.0 or d > reach:
            continue
        # Along n an impulse J changes the closing speed by J * give, give = sum of 1 / m + (r x n) . I^-1 (r x n).
        nx, ny, nz = gap[0] / d, gap[1] / d, gap[2] / d
        give = closing = 0.0  # change of the closing speed by a unit of impulse; closing speed
        turn = np.empty((2, 3))
        for side in range(2):
            slot = body[pairs[q, 2 * side]]
            sign = -1.0 if side else 1.0  # the first body is pulled along n
            ax, ay, az = arm[side]
            tx, ty, tz = ay * nz - az * ny, az * nx - ax * nz, ax * ny - ay * nx
            qx, qy, qz, qw = orientation[slot]
            i0, i1, i2 = inertia[slot]
            dx, dy, dz = weighted(qx, qy, qz, qw, 1.0 / i0, 1.0 / i1, 1.0 / i2, tx, ty, tz)
            turn[side, 0], turn[side, 1], turn[side, 2] = sign * dx, sign * dy, sign * dz
            give += 1.0 / mass[slot] + tx * dx + ty * dy + tz * dz
            along = velocity[slot, 0] * nx + velocity[slot, 1] * ny + velocity[slot, 2] * nz
            closing += sign * (along + spin[slot, 0] * tx + spin[slot, 1] * ty + spin[slot, 2] * tz)
        # Force * step, or less: the impulse after which the points would meet at the end of the step.
        impulse = min(strength / (1.0 + d / decay) ** 4 * step, (d / step - closing) / give)
        if impulse <= 0.0:
            continue
        for side in range(2):
            slot = body[pairs[q, 2 * side]]
            pull = (-impulse if side else impulse) / mass[slot]
            velocity[slot, 0] += pull * nx
            velocity[slot, 1] += pull * ny
            velocity[slot, 2] += pull * nz
            for k in range(3):
                spin[slot, k] += impulse * turn[side, k]


@compiled(nogil=False, error_model="python")
def turned_by(wx, wy, wz, time, x, y, z, w):
    """A quaternion turned by a spin for a time: the exponential map."""
    rate = math.sqrt(wx * wx + wy * wy + wz * wz)
    half = 0.5 * rate * time
    s = math.sin(half) / rate if half > 1e-8 else 0.5 * time
    ax, ay, az, aw = wx * s, wy * s, wz * s, math.cos(half)
    return (
        aw * x + ax * w + ay * z - az * y,
        aw * y - ax * z + ay * w + az * x,
        aw * z + ax * y - ay * x + az * w,
        aw * w - ax * x - ay * y - az * z,
    )


@compiled(nogil=False, error_model="python")
def begin_spin(live, orientation, spin, inertia, step, momentum, middle):
    """Spins to give the engine so that it turns every body by the implicit midpoint rule; overwrites `spin`.

    A body free of torque keeps its angular momentum L: it is turned for the step by the spin I^-1 L at the orientation
    half way, which depends on that spin (fixed-point iteration). The engine adds its own explicit gyroscopic term to
    what it is given, so it is given the spin from which that term leads to the wanted one (the same iteration).
    momentum, middle (B, 3) : L and the spin in the step, for `end_spin`; cubes, which have no such term, are left alone
    """
    for slot in live:
        i0, i1, i2 = inertia[slot]
        if i0 == i1 and i1 == i2:
            continue
        x, y, z, w = orientation[slot]
        mx, my, mz = spin[slot]
        lx, ly, lz = weighted(x, y, z, w, i0, i1, i2, mx, my, mz)
        # Implicit midpoint: w = R(h) I^-1 R(h)' L at the orientation h half a step on, which is turned by w itself.
        for _ in range(50):
            hx, hy, hz, hw = turned_by(mx, my, mz, 0.5 * step, x, y, z, w)
            nx, ny, nz = weighted(hx, hy, hz, hw, 1.0 / i0, 1.0 / i1, 1.0 / i2, lx, ly, lz)
            change = abs(nx - mx) + abs(ny - my) + abs(nz - mz)
            mx, my, mz = nx, ny, nz
            if change <= 1e-15 * (abs(mx) + abs(my) + abs(mz)):
                break
        # The spin that the engine's explicit gyroscopic term turns into w.
        m0, m1, m2 = rotated(-x, -y, -z, w, mx, my, mz)
        u0, u1, u2 = spin_before(m0, m1, m2, i0, i1, i2, step)
        momentum[slot, 0], momentum[slot, 1], momentum[slot, 2] = lx, ly, lz
        middle[slot, 0], middle[slot, 1], middle[slot, 2] = mx, my, mz
        spin[slot, 0], spin[slot, 1], spin[slot, 2] = rotated(x, y, z, w, u0, u1, u2)


@compiled(nogil=False, error_model="python")
def end_spin(live, before, orientation, spin, inertia, momentum, middle):
    """Spins after a step that `begin_spin` began: of the momentum, and what collisions added to it, as bodies lie now.

    before (B, 4) : orientations at the start of the step, by which the engine took the collisions' angular impulses
    """
    for slot in live:
        i0, i1, i2 = inertia[slot]
        if i0 == i1 and i1 == i2:
            continue
        dx, dy, dz = spin[slot, 0] - middle[slot, 0], spin[slot, 1] - middle[slot, 1], spin[slot, 2] - middle[slot, 2]
        # Angular impulses of collisions, I dw at the orientation before; added to L, and back to a spin at today's.
        x, y, z, w = before[slot]
        kx, ky, kz = weighted(x, y, z, w, i0, i1, i2, dx, dy, dz)
        x, y, z, w = orientation[slot]
        kx, ky, kz = kx + momentum[slot, 0], ky + momentum[slot, 1], kz + momentum[slot, 2]
        spin[slot, 0], spin[slot, 1], spin[slot, 2] = weighted(x, y, z, w, 1.0 / i0, 1.0 / i1, 1.0 / i2, kx, ky, kz)
