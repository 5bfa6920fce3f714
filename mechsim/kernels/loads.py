"""Compiled loads on the bonds of a rigid structure in a collision."""

import math

import numpy as np

from kinetics.kernels.compiled import compiled


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
    dv = total / (cube_mass * k)
    dw = np.linalg.solve(_inertia(place, centre, np.ones(k, np.bool_), cube_mass, edge), turn)
    for n in range(bonds.shape[0]):
        mine = side[n]
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
        i, j = bonds[n]
        middle = 0.5 * (place[i] + place[j])
        normal = (place[j] - place[i]) / edge
        moment -= np.cross(middle - own, push)
        tension = np.sum(push * normal)
        loads[n, 0] = tension
        loads[n, 1] = math.sqrt(np.sum((push - tension * normal) ** 2))
        loads[n, 2] = math.sqrt(np.sum(moment**2)) / (0.5 * edge)


@compiled(nogil=False, error_model="python")
def _inertia(place, centre, mine, cube_mass, edge):
    """Inertia tensor (3, 3) about `centre` of the cubes marked in `mine`."""
    tensor = np.zeros((3, 3))
    for c in range(place.shape[0]):
        if mine[c]:
            r = place[c] - centre
            own = edge * edge / 6.0 + np.sum(r * r)
            for i in range(3):
                tensor[i, i] += cube_mass * own
                for j in range(3):
                    tensor[i, j] -= cube_mass * r[i] * r[j]
    return tensor
