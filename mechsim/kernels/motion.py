"""Compiled motion of the bodies: drag, free flight, poses of the cubes, and checks of the state.

Indices: B body slots, C cubes, P drag points a cube. `live` lists the slots that hold a body. A quaternion is
(x, y, z, w), body frame to world. Vectors go by components: numba allocates nothing for scalars.
"""

import math

import numpy as np

from kinetics.kernels.compiled import compiled

# Named outcomes of `trouble`, in the order of their codes.
TROUBLES = (
    "",
    "a position or velocity is not a number",
    "a body escaped from the tank",
    "runaway speed",
    "tunnelling risk: a body moves more than half an edge in a step",
    "spin beyond what a step resolves",
)


@compiled(nogil=False, error_model="python")
def rotation_of(x, y, z, w):
    """Nine entries, row by row, of the rotation matrix of a unit quaternion."""
    return (
        1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),
        2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
        2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y),
    )  # fmt: skip


@compiled(nogil=False, error_model="python")
def spin_before(m0, m1, m2, i0, i1, i2, step):
    """The spin from which the explicit gyroscopic term of a step leads to (m0, m1, m2), by fixed-point iteration.

    In the body frame; i0, i1, i2 : principal moments
    """
    u0, u1, u2 = m0, m1, m2
    for _ in range(50):
        n0 = m0 - step * (i1 - i2) / i0 * u1 * u2
        n1 = m1 - step * (i2 - i0) / i1 * u2 * u0
        n2 = m2 - step * (i0 - i1) / i2 * u0 * u1
        change = abs(n0 - u0) + abs(n1 - u1) + abs(n2 - u2)
        u0, u1, u2 = n0, n1, n2
        if change <= 1e-15 * (abs(u0) + abs(u1) + abs(u2)):
            break
    return u0, u1, u2


@compiled(nogil=False, error_model="python")
def drag(live, first, members, points, areas, fluid, orientation, velocity, spin, mass, inertia, coefficient, step):
    """Quadratic drag of the fluid on every body over one step, semi-implicit: updates `velocity` and `spin`.

    Paper, eq. 4: a point of area A in fluid moving at u is pushed by f = c (u - v), c = 1/2 Cd rho A |u - v|. The
    factor c is frozen at the start of the step and v taken at its end, so each body solves one symmetric 6x6 system
    (M/step + K) dV = F with K = sum of c J'J: stable at any step, first order in it.

    first, members : cubes of slot b are members[first[b]:first[b + 1]]
    points (C, P, 3), areas (C, P) : drag points in the body frame and their areas (0 where covered)
    fluid (C, P, 3) : velocity of the fluid at the points, world frame
    coefficient : Cd rho / 2
    """
    a = np.empty((6, 6))
    b = np.empty(6)
    for slot in live:
        qx, qy, qz, qw = orientation[slot]
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_of(qx, qy, qz, qw)
        vx, vy, vz = velocity[slot]
        wx, wy, wz = spin[slot]
        # Moments of the drag factors c = coefficient A |u - v| over the body's points r: sum of c, c r, c r r', and the
        # force and torque at the start of the step, F = sum of c (u - v), T = sum of c r x (u - v).
        c0 = 0.0
        cx = cy = cz = 0.0
        cxx = cyy = czz = cxy = cxz = cyz = 0.0
        fx = fy = fz = tx = ty = tz = 0.0
        for m in range(first[slot], first[slot + 1]):
            cube = members[m]
            for k in range(points.shape[1]):
                area = areas[cube, k]
                if area == 0.0:
                    continue
                px, py, pz = points[cube, k, 0], points[cube, k, 1], points[cube, k, 2]
                x = r00 * px + r01 * py + r02 * pz
                y = r10 * px + r11 * py + r12 * pz
                z = r20 * px + r21 * py + r22 * pz
                ux = fluid[cube, k, 0] - (vx + wy * z - wz * y)
                uy = fluid[cube, k, 1] - (vy + wz * x - wx * z)
                uz = fluid[cube, k, 2] - (vz + wx * y - wy * x)
                c = coefficient * area * math.sqrt(ux * ux + uy * uy + uz * uz)
                c0 += c
                cx += c * x
                cy += c * y
                cz += c * z
                cxx += c * x * x
                cyy += c * y * y
                czz += c * z * z
                cxy += c * x * y
                cxz += c * x * z
                cyz += c * y * z
                fx += c * ux
                fy += c * uy
                fz += c * uz
                tx += c * (y * uz - z * uy)
                ty += c * (z * ux - x * uz)
                tz += c * (x * uy - y * ux)
        i0, i1, i2 = inertia[slot]
        # M / step: mass and world inertia tensor R diag(I) R', lower triangle.
        a[0, 0] = a[1, 1] = a[2, 2] = mass[slot] / step
        a[3, 3] = (r00 * r00 * i0 + r01 * r01 * i1 + r02 * r02 * i2) / step
        a[4, 4] = (r10 * r10 * i0 + r11 * r11 * i1 + r12 * r12 * i2) / step
        a[5, 5] = (r20 * r20 * i0 + r21 * r21 * i1 + r22 * r22 * i2) / step
        a[4, 3] = (r10 * r00 * i0 + r11 * r01 * i1 + r12 * r02 * i2) / step
        a[5, 3] = (r20 * r00 * i0 + r21 * r01 * i1 + r22 * r02 * i2) / step
        a[5, 4] = (r20 * r10 * i0 + r21 * r11 * i1 + r22 * r12 * i2) / step
        a[1, 0] = a[2, 0] = a[2, 1] = 0.0
        a[3:, :3] = 0.0
        # Lower triangle of sum c [[1, -[r]x], [[r]x, |r|^2 - r r']].
        a[0, 0] += c0
        a[1, 1] += c0
        a[2, 2] += c0
        a[3, 1] = -cz
        a[3, 2] = cy
        a[4, 0] = cz
        a[4, 2] = -cx
        a[5, 0] = -cy
        a[5, 1] = cx
        a[3, 3] += cyy + czz
        a[4, 4] += cxx + czz
        a[5, 5] += cxx + cyy
        a[4, 3] -= cxy
        a[5, 3] -= cxz
        a[5, 4] -= cyz
        # (M / step + K) dV = (F, T)
        b[0], b[1], b[2], b[3], b[4], b[5] = fx, fy, fz, tx, ty, tz
        _solve_spd(a, b)
        velocity[slot, 0] += b[0]
        velocity[slot, 1] += b[1]
        velocity[slot, 2] += b[2]
        spin[slot, 0] += b[3]
        spin[slot, 1] += b[4]
        spin[slot, 2] += b[5]


@compiled(nogil=False, error_model="python")
def _solve_spd(a, b):
    """Solve a x = b in place for a 6x6 symmetric positive definite `a` (lower triangle), by Cholesky's
    factorisation."""
    # a = L L', column by column
    for j in range(6):
        d = a[j, j]
        for k in range(j):
            d -= a[j, k] * a[j, k]
        d = math.sqrt(d)
        a[j, j] = d
        for i in range(j + 1, 6):
            s = a[i, j]
            for k in range(j):
                s -= a[i, k] * a[j, k]
            a[i, j] = s / d
    # L y = b, forwards; then L' x = y, backwards
    for i in range(6):
        s = b[i]
        for k in range(i):
            s -= a[i, k] * b[k]
        b[i] = s / a[i, i]
    for i in range(5, -1, -1):
        s = b[i]
        for k in range(i + 1, 6):
            s -= a[k, i] * b[k]
        b[i] = s / a[i, i]


@compiled(nogil=False, error_model="python")
def coast(live, position, orientation, velocity, spin, inertia, step):
    """Free flight of every body over one step, in place; equal to the engine's own integration to rounding.

    Euler's gyroscopic term first (explicitly, as the engine does: inertia w' = -w x (inertia w) in the body frame;
    nothing for a cube), then positions by step * velocity and orientations by the exponential map of the spin, with
    the engine's cap of pi/4 a step.
    """
    for slot in live:
        for k in range(3):
            position[slot, k] += step * velocity[slot, k]
        wx, wy, wz = spin[slot]
        bx, by, bz, bw = orientation[slot]
        i0, i1, i2 = inertia[slot]
        # Euler's equations in the body frame, one explicit step: I0 du0 = (I1 - I2) u1 u2 step, and so on.
        if i0 != i1 or i1 != i2:
            r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_of(bx, by, bz, bw)
            u0 = r00 * wx + r10 * wy + r20 * wz
            u1 = r01 * wx + r11 * wy + r21 * wz
            u2 = r02 * wx + r12 * wy + r22 * wz
            g0 = step * (i1 - i2) / i0 * u1 * u2
            g1 = step * (i2 - i0) / i1 * u2 * u0
            g2 = step * (i0 - i1) / i2 * u0 * u1
            wx += r00 * g0 + r01 * g1 + r02 * g2
            wy += r10 * g0 + r11 * g1 + r12 * g2
            wz += r20 * g0 + r21 * g1 + r22 * g2
            spin[slot, 0], spin[slot, 1], spin[slot, 2] = wx, wy, wz
        rate = math.sqrt(wx * wx + wy * wy + wz * wz)
        # Exponential map: the quaternion (w / |w| sin(|w| step / 2), cos(|w| step / 2)); a series where |w| is small.
        if rate * step > 0.25 * math.pi:
            rate = 0.25 * math.pi / step
        if rate < 0.001:
            s = 0.5 * step - step * step * step * 0.020833333333 * rate * rate
        else:
            s = math.sin(0.5 * rate * step) / rate
        ax, ay, az, aw = wx * s, wy * s, wz * s, math.cos(0.5 * rate * step)
        # Product of quaternions, turn * orientation; its rounding is taken out by the norm.
        x = aw * bx + ax * bw + ay * bz - az * by
        y = aw * by - ax * bz + ay * bw + az * bx
        z = aw * bz + ax * by - ay * bx + az * bw
        w = aw * bw - ax * bx - ay * by - az * bz
        norm = math.sqrt(x * x + y * y + z * z + w * w)
        orientation[slot, 0] = x / norm
        orientation[slot, 1] = y / norm
        orientation[slot, 2] = z / norm
        orientation[slot, 3] = w / norm


@compiled(nogil=False, error_model="python")
def place_cubes(live, first, members, offset, turn, position, orientation, centre, axes):
    """World centres (C, 3) and own axes (C, 3, 3; columns) of all cubes, from the poses of their bodies.

    offset (C, 3), turn (C, 3, 3) : place and rotation of a cube in its body's frame
    """
    r = np.empty((3, 3))
    for slot in live:
        qx, qy, qz, qw = orientation[slot]
        r[0, 0], r[0, 1], r[0, 2], r[1, 0], r[1, 1], r[1, 2], r[2, 0], r[2, 1], r[2, 2] = rotation_of(qx, qy, qz, qw)
        for m in range(first[slot], first[slot + 1]):
            cube = members[m]
            for i in range(3):
                centre[cube, i] = (
                    position[slot, i]
                    + r[i, 0] * offset[cube, 0] + r[i, 1] * offset[cube, 1] + r[i, 2] * offset[cube, 2]
                )  # fmt: skip
                for j in range(3):
                    axes[cube, i, j] = (
                        r[i, 0] * turn[cube, 0, j] + r[i, 1] * turn[cube, 1, j] + r[i, 2] * turn[cube, 2, j]
                    )


@compiled(nogil=False, error_model="python")
def trouble(live, position, velocity, spin, low, high, edge, step, max_speed, max_turn):
    """Index into TROUBLES of the first thing wrong with the state, and the slot it happened to (0 and -1: all is
    well)."""
    for slot in live:
        v2 = w2 = 0.0
        for k in range(3):
            v2 += velocity[slot, k] ** 2
            w2 += spin[slot, k] ** 2
        x, y, z = position[slot]
        if not (math.isfinite(v2) and math.isfinite(w2) and math.isfinite(x + y + z)):
            return 1, slot
        for k in range(3):
            if position[slot, k] < low[k] or position[slot, k] > high[k]:
                return 2, slot
        if v2 > max_speed * max_speed:
            return 3, slot
        if math.sqrt(v2) * step > 0.5 * edge:
            return 4, slot
        if math.sqrt(w2) * step > max_turn:
            return 5, slot
    return 0, -1


@compiled(nogil=False, error_model="python")
def not_finite(live, velocity, spin):
    """First slot whose motion is not a number or infinite, or -1."""
    for slot in live:
        for k in range(3):
            if not (math.isfinite(velocity[slot, k]) and math.isfinite(spin[slot, k])):
                return slot
    return -1
