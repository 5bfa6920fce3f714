"""Compiled loops of forces that change motions before a step: explicit drag, attraction of faces.

Indices as in `motion`: B body slots, C cubes, P drag points a cube; a quaternion is (x, y, z, w), body frame to world.
"""

import math

import numpy as np
from numba import njit


@njit(cache=True)
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


@njit(cache=True)
def spun(qx, qy, qz, qw, i0, i1, i2, x, y, z):
    """Change of spin by an angular impulse: (inertia tensor in the world)^-1 times it; i0, i1, i2 principal moments."""
    bx, by, bz = rotated(-qx, -qy, -qz, qw, x, y, z)
    return rotated(qx, qy, qz, qw, bx / i0, by / i1, bz / i2)


@njit(cache=True)
def explicit_drag(
    live, first, members, points, areas, fluid, orientation, velocity, spin, mass, inertia, coefficient, step
):
    """Quadratic drag by explicit Euler: force and torque at the start of the step, updates `velocity` and `spin`.

    Arguments as `motion.drag`. Returns the largest product of the step and sum c / m or sum c r^2 / (least moment) of
    a body, c = coefficient A |u - v| at its points, and its slot: an error grows where twice the product exceeds 2.
    """
    stiffest, worst = 0.0, -1
    for slot in live:
        qx, qy, qz, qw = orientation[slot]
        vx, vy, vz = velocity[slot]
        wx, wy, wz = spin[slot]
        c0 = c2 = fx = fy = fz = tx = ty = tz = 0.0
        for m in range(first[slot], first[slot + 1]):
            cube = members[m]
            for k in range(points.shape[1]):
                x, y, z = rotated(qx, qy, qz, qw, points[cube, k, 0], points[cube, k, 1], points[cube, k, 2])
                ux = fluid[cube, k, 0] - (vx + wy * z - wz * y)
                uy = fluid[cube, k, 1] - (vy + wz * x - wx * z)
                uz = fluid[cube, k, 2] - (vz + wx * y - wy * x)
                c = coefficient * areas[cube, k] * math.sqrt(ux * ux + uy * uy + uz * uz)
                c0 += c
                c2 += c * (x * x + y * y + z * z)
                fx += c * ux
                fy += c * uy
                fz += c * uz
                tx += c * (y * uz - z * uy)
                ty += c * (z * ux - x * uz)
                tz += c * (x * uy - y * ux)
        i0, i1, i2 = inertia[slot]
        stiff = step * max(c0 / mass[slot], c2 / min(i0, i1, i2))
        if not stiff <= stiffest:  # not a number is the worst of all
            stiffest, worst = stiff, slot
        dx, dy, dz = spun(qx, qy, qz, qw, i0, i1, i2, tx, ty, tz)
        velocity[slot, 0] += step * fx / mass[slot]
        velocity[slot, 1] += step * fy / mass[slot]
        velocity[slot, 2] += step * fz / mass[slot]
        spin[slot, 0] += step * dx
        spin[slot, 1] += step * dy
        spin[slot, 2] += step * dz
    return stiffest, worst


@njit(cache=True)
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
    arm = np.empty((2, 3))
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
            dx, dy, dz = spun(qx, qy, qz, qw, i0, i1, i2, tx, ty, tz)
            turn[side, 0], turn[side, 1], turn[side, 2] = sign * dx, sign * dy, sign * dz
            give += 1.0 / mass[slot] + tx * dx + ty * dy + tz * dz
            along = velocity[slot, 0] * nx + velocity[slot, 1] * ny + velocity[slot, 2] * nz
            closing += sign * (along + spin[slot, 0] * tx + spin[slot, 1] * ty + spin[slot, 2] * tz)
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
