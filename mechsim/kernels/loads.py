"""Compiled loads on the bonds of a rigid structure in a collision, and a bound of them that costs less."""

import math

import numpy as np

from kinetics.kernels.compiled import compiled
from mechsim.kernels.motion import rotation_of

SLACK = 1e-6  # covers rounding in loads and poses; of the impulse, and of a squared edge where it decides who was hit


@compiled(nogil=False, error_model="python")
def bond_loads(bonds, side, place, contact, impulse, cube_mass, edge, loads):
    """What each bridge bond of one rigid structure carries in a step: writes `loads` (bonds, 3).

    The contact impulses change the whole structure's motion rigidly. What one side of a bond needs for its share
    beyond what hit it directly came through the bond (Newton and Euler for that side). A load is (tension, shear,
    moment), impulses all: the pull along the bond (negative: a push), the pull across it, and the bending and twisting
    moment over half an edge, the arm of magnets at the face's rim.

    bonds (n, 2) : the two cubes, members' indices; side (n, k) bool : the cubes on the first cube's side
    place (k, 3) : centres of the cubes, world; contact (m, 3), impulse (m, 3) : contact points, impulses on the
        structure
    """
    k = place.shape[0]
    m = contact.shape[0]
    total = np.zeros(3)
    turn = np.zeros(3)
    centre = np.zeros(3)
    for c in range(k):
        centre += place[c] / k
    owner = np.empty(m, np.int64)
    for q in range(m):
        best = np.inf
        for c in range(k):
            distance = np.sum((contact[q] - place[c]) ** 2)
            if distance < best:
                best = distance
                owner[q] = c
        total += impulse[q]
        turn += np.cross(contact[q] - centre, impulse[q])
    # The whole moves rigidly: dv = J / m, dw = I^-1 (sum of r x J).
    dv = total / (cube_mass * k)
    dw = np.linalg.solve(_inertia(place, centre, np.ones(k, np.bool_), cube_mass, edge), turn)
    for n in range(bonds.shape[0]):
        mine = side[n]
        # One side of the bond: its centre, then what its share of the motion needs beyond the impulses on itself.
        count = 0
        own = np.zeros(3)
        for c in range(k):
            if mine[c]:
                own += place[c]
                count += 1
        own /= count
        push = cube_mass * count * (dv + np.cross(dw, own - centre))
        moment = _inertia(place, own, mine, cube_mass, edge) @ dw
        for q in range(m):
            if mine[owner[q]]:
                push -= impulse[q]
                moment -= np.cross(contact[q] - own, impulse[q])
        # That impulse and moment act at the middle of the bond; the pull is split along and across it.
        i, j = bonds[n]
        middle = 0.5 * (place[i] + place[j])
        normal = (place[j] - place[i]) / edge
        moment -= np.cross(middle - own, push)
        tension = np.sum(push * normal)
        loads[n, 0] = tension
        loads[n, 1] = math.sqrt(np.sum((push - tension * normal) ** 2))
        loads[n, 2] = math.sqrt(np.sum(moment**2)) / (0.5 * edge)


@compiled(nogil=False, error_model="python")
def hit_bound(
    levers, sides, cubes, position, orientation, slot, place, impulse, sign, edge, of_pull, of_moment, of_impulse
):
    """At least what one contact loads any bond of a rigid structure with, and hardly more; no memory is allocated.

    It is the largest over the bonds of of_pull times pull and shear + of_moment times the moment (`bond_loads`), plus
    of_impulse |impulse|. These are sublinear in the impulses, a norm of the moment and the distance of the push from
    those that only press, so that the sum over contacts is at least the load of all contacts together.

    levers (n, 2, 6, 6), sides (n, k) : `effects.bridges.Bridges`; cubes (k, 3) : in the body frame, edges
    position (B, 3), orientation (B, 4), slot : the body
    place, impulse : three numbers each, world; sign : 1.0, or -1.0 where the opposite impulse acts on the body
    """
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_of(
        orientation[slot, 0], orientation[slot, 1], orientation[slot, 2], orientation[slot, 3]
    )
    # Place and impulse in the body frame, R' v, in edges; torque x * J.
    wx, wy, wz = place[0] - position[slot, 0], place[1] - position[slot, 1], place[2] - position[slot, 2]
    x = (r00 * wx + r10 * wy + r20 * wz) / edge
    y = (r01 * wx + r11 * wy + r21 * wz) / edge
    z = (r02 * wx + r12 * wy + r22 * wz) / edge
    wx, wy, wz = sign * impulse[0], sign * impulse[1], sign * impulse[2]
    jx, jy, jz = r00 * wx + r10 * wy + r20 * wz, r01 * wx + r11 * wy + r21 * wz, r02 * wx + r12 * wy + r22 * wz
    tx, ty, tz = y * jz - z * jy, z * jx - x * jz, x * jy - y * jx
    nearest = math.inf
    for c in range(cubes.shape[0]):
        nearest = min(nearest, (x - cubes[c, 0]) ** 2 + (y - cubes[c, 1]) ** 2 + (z - cubes[c, 2]) ** 2)
    most = 0.0
    for c in range(cubes.shape[0]):
        if (x - cubes[c, 0]) ** 2 + (y - cubes[c, 1]) ** 2 + (z - cubes[c, 2]) ** 2 > nearest + SLACK:
            continue  # not the cube that was hit; of cubes equally near each counts, for rounding decides
        for n in range(levers.shape[0]):
            # (pull, moment) = levers (J, T). Rows 0 to 2: the pull; row 0, along the bond, counts if positive.
            w = levers[n, 1 if sides[n, c] else 0]
            pull = moment = 0.0
            for row in range(6):
                v = w[row, 0] * jx + w[row, 1] * jy + w[row, 2] * jz + w[row, 3] * tx + w[row, 4] * ty + w[row, 5] * tz
                if row > 2:
                    moment += v * v
                elif row > 0 or v > 0.0:
                    pull += v * v
            most = max(most, of_pull * math.sqrt(pull) + of_moment * math.sqrt(moment))
    rounding = SLACK * ((of_pull + of_moment) * (1.0 + math.sqrt(x * x + y * y + z * z)) + of_impulse)
    return most + (of_impulse + rounding) * math.sqrt(jx * jx + jy * jy + jz * jz)


@compiled(nogil=False, error_model="python")
def _inertia(place, centre, mine, cube_mass, edge):
    """Inertia tensor (3, 3) about `centre` of the cubes marked in `mine`."""
    tensor = np.zeros((3, 3))
    for c in range(place.shape[0]):
        if mine[c]:
            r = place[c] - centre
            own = edge * edge / 6.0 + np.sum(r * r)  # of a cube, a^2 / 6, and Steiner's r^2 - r r'
            for i in range(3):
                tensor[i, i] += cube_mass * own
                for j in range(3):
                    tensor[i, j] -= cube_mass * r[i] * r[j]
    return tensor
