"""Compiled narrow phase: contacts of boxes with each other and with the walls of a tank, by separating axes.

Indices: R boxes, of which `order` lists those in use; M contacts at most. A contact is a point half-way between the two
surfaces, the normal along which they push the first body, and the depth of the overlap. Boxes touch by a face (all
corners of the part of a face that lies below the other one) or by two edges (one point, also where these are about 1e-5
of a size apart: such a depth is below 0).

Source: Gottschalk, Lin & Manocha (1996), doi:10.1145/237170.237244, for the axes; Sutherland & Hodgman (1974),
doi:10.1145/360767.360802, for the clipping.
"""

import math

import numpy as np

from kinetics.kernels.compiled import compiled
from mechsim.kernels.motion import rotation_of

FLAT = 1.05  # edges are chosen where a face would have to give way by so much more: a face has more points
NEARLY = 1e-5  # added to the cosines of edges: those that are nearly parallel count as deeper, and faces are chosen
PARALLEL = 1e-6  # squared sine of the angle below which two edges span no axis that their faces do not give


@compiled(nogil=False, error_model="python")
def place_boxes(order, slot, offset, turn, position, orientation, centre, axes):
    """World centres (R, 3) and axes (R, 3, 3; columns) of boxes, from their places and turns in the frames of their
    bodies."""
    for box in order:
        body = slot[box]
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_of(
            orientation[body, 0], orientation[body, 1], orientation[body, 2], orientation[body, 3]
        )
        x, y, z = offset[box, 0], offset[box, 1], offset[box, 2]
        centre[box, 0] = position[body, 0] + r00 * x + r01 * y + r02 * z
        centre[box, 1] = position[body, 1] + r10 * x + r11 * y + r12 * z
        centre[box, 2] = position[body, 2] + r20 * x + r21 * y + r22 * z
        for j in range(3):
            x, y, z = turn[box, 0, j], turn[box, 1, j], turn[box, 2, j]
            axes[box, 0, j] = r00 * x + r01 * y + r02 * z
            axes[box, 1, j] = r10 * x + r11 * y + r12 * z
            axes[box, 2, j] = r20 * x + r21 * y + r22 * z


@compiled(nogil=False, error_model="python")
def find_contacts(order, slot, half, radius, centre, axes, with_bodies, wall, who, contact):
    """Find all contacts.

    Writes the two bodies (-1: a wall) and their boxes (-1 - 2 axis - side for a wall) to `who` (M, 4), and point,
    normal and depth to `contact` (M, 7). Returns their number; if it is above M, only the first M are written.

    order : boxes in use; sorted here by their lower ends along z, from how they were last time
    half (R, 3), radius (R,) : of a box, and of the sphere around it
    wall (3,) : half the tank's size; infinite where it has no walls
    """
    n = len(order)
    # Broad phase, sort and sweep: insertion sort by the lower ends along z, linear where the order has hardly changed.
    for k in range(1, n):
        box = order[k]
        low = centre[box, 2] - radius[box]
        m = k - 1
        while m >= 0 and centre[order[m], 2] - radius[order[m]] > low:
            order[m + 1] = order[m]
            m -= 1
        order[m + 1] = box
    found = 0
    turned, far = np.empty((3, 3)), np.empty((3, 3))
    corners, clipped = np.empty((16, 2)), np.empty((16, 2))
    ball = np.empty((n, 4))  # in that order, one after the other in memory
    for k in range(n):
        box = order[k]
        ball[k, 0], ball[k, 1], ball[k, 2], ball[k, 3] = centre[box, 0], centre[box, 1], centre[box, 2], radius[box]
    for k in range(n):
        i = order[k]
        x, y, z, reach = ball[k]
        # Walls: the bounding sphere first, then the box's extent along the wall's axis, sum of half |axis component|.
        if abs(x) + reach > wall[0] or abs(y) + reach > wall[1] or abs(z) + reach > wall[2]:
            for axis in range(3):
                extent = 0.0
                for m in range(3):
                    extent += abs(axes[i, axis, m]) * half[i, m]
                if centre[i, axis] + extent > wall[axis]:
                    found = _touches_wall(i, axis, 1.0, slot, half, centre, axes, wall, who, contact, found)
                if extent - centre[i, axis] > wall[axis]:
                    found = _touches_wall(i, axis, -1.0, slot, half, centre, axes, wall, who, contact, found)
        if not with_bodies:
            continue
        for m in range(k + 1, n):
            dz, near = ball[m, 2] - z, reach + ball[m, 3]
            if dz > near:  # as the lower ends are in order, no later box is nearer
                break
            dx, dy = ball[m, 0] - x, ball[m, 1] - y
            if dx * dx + dy * dy + dz * dz >= near * near:
                continue
            j = order[m]
            if slot[i] == slot[j]:
                continue
            kind = _overlap(i, j, dx, dy, dz, half, axes, turned, far)
            # Edge against edge, face of j, face of i, by the axis of least overlap.
            if kind >= 6:
                found = _edges_touch(i, j, kind - 6, half, centre, axes, slot, who, contact, found)
            elif kind >= 3:
                found = _face_touches(
                    j, i, kind - 3, -1.0, half, centre, axes, corners, clipped, slot, who, contact, found
                )
            elif kind >= 0:
                found = _face_touches(i, j, kind, 1.0, half, centre, axes, corners, clipped, slot, who, contact, found)
    return found


@compiled(nogil=False, error_model="python", inline="always")
def _overlap(a, b, dx, dy, dz, half, axes, turned, far):
    """The axis along which two boxes, b away from a by d, overlap least; -1 if an axis separates them.

    0 to 2 : the axes of a; 3 to 5 : those of b; from 6 on : 6 + 3 i + j, the product of axis i of a and axis j of b.
    turned, far (3, 3) : room for the axes of b in the frame of a, and their absolute values
    Along a unit axis u the gap is |d . u| - sum of half a_k |u . A_k| - sum of half b_k |u . B_k|, below 0 for an
    overlap (Gottschalk et al. 1996, table 1).
    """
    best, kind = -math.inf, 0
    # Faces of a: u = A_i, so that u . B_j is the entry (i, j) of R = A' B.
    for i in range(3):
        ux, uy, uz = axes[a, 0, i], axes[a, 1, i], axes[a, 2, i]
        away = abs(dx * ux + dy * uy + dz * uz) - half[a, i]
        for j in range(3):
            turned[i, j] = ux * axes[b, 0, j] + uy * axes[b, 1, j] + uz * axes[b, 2, j]
            far[i, j] = abs(turned[i, j])
            away -= half[b, j] * far[i, j]
        if away > 0.0:
            kind = -1
            break
        if away > best:
            best, kind = away, i
    if kind >= 0:
        # Faces of b: u = B_j.
        for j in range(3):
            away = abs(dx * axes[b, 0, j] + dy * axes[b, 1, j] + dz * axes[b, 2, j]) - half[b, j]
            for i in range(3):
                away -= half[a, i] * far[i, j]
            if away > 0.0:
                kind = -1
                break
            if away > best:
                best, kind = away, 3 + j
    if kind >= 0:
        # Pairs of edges: u = A_i x B_j, of length sin(angle), by which the gap is divided.
        for i in range(3):
            for j in range(3):
                far[i, j] += NEARLY
        for i in range(3):
            i1, i2 = (1, 2) if i == 0 else (2, 0) if i == 1 else (0, 1)
            p = dx * axes[a, 0, i1] + dy * axes[a, 1, i1] + dz * axes[a, 2, i1]
            q = dx * axes[a, 0, i2] + dy * axes[a, 1, i2] + dz * axes[a, 2, i2]
            for j in range(3):
                square = 1.0 - turned[i, j] * turned[i, j]
                if square < PARALLEL:
                    continue
                j1, j2 = (1, 2) if j == 0 else (2, 0) if j == 1 else (0, 1)
                away = abs(q * turned[i1, j] - p * turned[i2, j])
                away -= half[a, i1] * far[i2, j] + half[a, i2] * far[i1, j]
                away -= half[b, j1] * far[i, j2] + half[b, j2] * far[i, j1]
                if away > 0.0:
                    kind = -1
                    break
                away /= math.sqrt(square)
                if FLAT * away > best:
                    best, kind = away, 6 + 3 * i + j
            if kind < 0:
                break
    return kind


@compiled(nogil=False, error_model="python")
def _note(found, who, contact, slot, a, b, x, y, z, nx, ny, nz, depth):
    """Write a contact of box a with box or wall b, if there is room; one more."""
    if found < len(who):
        who[found, 0], who[found, 1], who[found, 2], who[found, 3] = slot[a], slot[b] if b >= 0 else -1, a, b
        contact[found, 0], contact[found, 1], contact[found, 2] = x, y, z
        contact[found, 3], contact[found, 4], contact[found, 5] = nx, ny, nz
        contact[found, 6] = depth
    return found + 1


@compiled(nogil=False, error_model="python")
def _touches_wall(box, axis, side, slot, half, centre, axes, wall, who, contact, found):
    """Contacts of a box with the plane at side * wall along an axis: the corners beyond it, of the face towards it."""
    # The face that looks at the wall most: the largest component of the box's axes along the wall's.
    facing = 0
    for k in range(1, 3):
        if abs(axes[box, axis, k]) > abs(axes[box, axis, facing]):
            facing = k
    one, two = (facing + 1) % 3, (facing + 2) % 3
    up = half[box, facing] if side * axes[box, axis, facing] > 0.0 else -half[box, facing]
    plane = -1 - 2 * axis - (1 if side > 0.0 else 0)
    nx = -side if axis == 0 else 0.0
    ny = -side if axis == 1 else 0.0
    nz = -side if axis == 2 else 0.0
    for corner in range(4):
        p = half[box, one] if corner & 1 else -half[box, one]
        q = half[box, two] if corner & 2 else -half[box, two]
        x = centre[box, 0] + up * axes[box, 0, facing] + p * axes[box, 0, one] + q * axes[box, 0, two]
        y = centre[box, 1] + up * axes[box, 1, facing] + p * axes[box, 1, one] + q * axes[box, 1, two]
        z = centre[box, 2] + up * axes[box, 2, facing] + p * axes[box, 2, one] + q * axes[box, 2, two]
        depth = -(nx * x + ny * y + nz * z) - wall[axis]
        if depth > 0.0:
            h = 0.5 * depth
            found = _note(
                found, who, contact, slot, box, plane, x + h * nx, y + h * ny, z + h * nz, nx, ny, nz, depth
            )  # fmt: skip
    return found


@compiled(nogil=False, error_model="python")
def _edges_touch(a, b, pair, half, centre, axes, slot, who, contact, found):
    """The contact of an edge of a along its axis i with one of b along j, pair = 3 i + j."""
    # Normal: u x v of the two edges' directions, pointing from b to a.
    i, j = pair // 3, pair % 3
    ux, uy, uz = axes[a, 0, i], axes[a, 1, i], axes[a, 2, i]
    vx, vy, vz = axes[b, 0, j], axes[b, 1, j], axes[b, 2, j]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if (
        nx * (centre[b, 0] - centre[a, 0]) + ny * (centre[b, 1] - centre[a, 1]) + nz * (centre[b, 2] - centre[a, 2])
        > 0.0
    ):
        length = -length
    nx, ny, nz = nx / length, ny / length, nz / length
    # Middle of that edge of each box which lies furthest towards the other one.
    ax, ay, az = centre[a, 0], centre[a, 1], centre[a, 2]
    bx, by, bz = centre[b, 0], centre[b, 1], centre[b, 2]
    for k in range(3):
        if k != i:
            side = nx * axes[a, 0, k] + ny * axes[a, 1, k] + nz * axes[a, 2, k]
            h = half[a, k] if side < 0.0 else -half[a, k]
            ax, ay, az = ax + h * axes[a, 0, k], ay + h * axes[a, 1, k], az + h * axes[a, 2, k]
        if k != j:
            side = nx * axes[b, 0, k] + ny * axes[b, 1, k] + nz * axes[b, 2, k]
            h = half[b, k] if side > 0.0 else -half[b, k]
            bx, by, bz = bx + h * axes[b, 0, k], by + h * axes[b, 1, k], bz + h * axes[b, 2, k]
    # Nearest points of the two lines a + s u and b + t v: both remainders are at right angles to u and to v.
    px, py, pz = bx - ax, by - ay, bz - az
    uv = ux * vx + uy * vy + uz * vz
    pu, pv = px * ux + py * uy + pz * uz, px * vx + py * vy + pz * vz
    apart = 1.0 - uv * uv
    s, t = (pu - uv * pv) / apart, (uv * pu - pv) / apart
    ax, ay, az = ax + s * ux, ay + s * uy, az + s * uz
    bx, by, bz = bx + t * vx, by + t * vy, bz + t * vz
    x, y, z = 0.5 * (ax + bx), 0.5 * (ay + by), 0.5 * (az + bz)
    depth = (bx - ax) * nx + (by - ay) * ny + (bz - az) * nz
    return _note(found, who, contact, slot, a, b, x, y, z, nx, ny, nz, depth)


@compiled(nogil=False, error_model="python")
def _face_touches(a, b, axis, sign, half, centre, axes, corners, clipped, slot, who, contact, found):
    """Contacts of a face of box a, across its `axis`, with the face of b that looks at it most; sign -1.0: b is the
    first of the two bodies."""
    dx, dy, dz = centre[b, 0] - centre[a, 0], centre[b, 1] - centre[a, 1], centre[b, 2] - centre[a, 2]
    nx, ny, nz = axes[a, 0, axis], axes[a, 1, axis], axes[a, 2, axis]
    if dx * nx + dy * ny + dz * nz < 0.0:
        nx, ny, nz = -nx, -ny, -nz
    # The incident face: the one of b whose normal is most opposed to the reference face's.
    facing, most = 0, -1.0
    for k in range(3):
        look = abs(nx * axes[b, 0, k] + ny * axes[b, 1, k] + nz * axes[b, 2, k])
        if look > most:
            most, facing = look, k
    look = nx * axes[b, 0, facing] + ny * axes[b, 1, facing] + nz * axes[b, 2, facing]
    h = -half[b, facing] if look > 0.0 else half[b, facing]
    # The face of b, its middle and its two sides, in the frame of the face of a: along u, along v, and outwards.
    u, v = (axis + 1) % 3, (axis + 2) % 3
    p, q = (facing + 1) % 3, (facing + 2) % 3
    dx, dy, dz = dx + h * axes[b, 0, facing], dy + h * axes[b, 1, facing], dz + h * axes[b, 2, facing]
    mu = dx * axes[a, 0, u] + dy * axes[a, 1, u] + dz * axes[a, 2, u]
    mv = dx * axes[a, 0, v] + dy * axes[a, 1, v] + dz * axes[a, 2, v]
    mn = dx * nx + dy * ny + dz * nz
    pu = axes[b, 0, p] * axes[a, 0, u] + axes[b, 1, p] * axes[a, 1, u] + axes[b, 2, p] * axes[a, 2, u]
    pv = axes[b, 0, p] * axes[a, 0, v] + axes[b, 1, p] * axes[a, 1, v] + axes[b, 2, p] * axes[a, 2, v]
    qu = axes[b, 0, q] * axes[a, 0, u] + axes[b, 1, q] * axes[a, 1, u] + axes[b, 2, q] * axes[a, 2, u]
    qv = axes[b, 0, q] * axes[a, 0, v] + axes[b, 1, q] * axes[a, 1, v] + axes[b, 2, q] * axes[a, 2, v]
    pn = axes[b, 0, p] * nx + axes[b, 1, p] * ny + axes[b, 2, p] * nz
    qn = axes[b, 0, q] * nx + axes[b, 1, q] * ny + axes[b, 2, q] * nz
    for k in range(4):
        f = half[b, p] if k in {1, 2} else -half[b, p]
        g = half[b, q] if k > 1 else -half[b, q]
        corners[k, 0], corners[k, 1] = mu + f * pu + g * qu, mv + f * pv + g * qv
    # Sutherland-Hodgman: the incident face, projected along n, clipped by the four sides of the reference face.
    n = _clipped(corners, 4, 0, half[a, u], clipped)
    n = _clipped(clipped, n, 1, half[a, v], corners)
    apart = pu * qv - pv * qu  # not 0: of the three faces of b, this one looks at a most
    # Height of the incident face's plane over each corner left; those below the reference face are contacts.
    for k in range(n):
        cu, cv = corners[k, 0], corners[k, 1]
        f = (qv * (cu - mu) - qu * (cv - mv)) / apart
        g = (pu * (cv - mv) - pv * (cu - mu)) / apart
        height = mn + f * pn + g * qn
        depth = half[a, axis] - height
        if depth >= 0.0:
            w = height + 0.5 * depth
            found = _note(
                found, who, contact, slot, a if sign > 0.0 else b, b if sign > 0.0 else a,
                centre[a, 0] + cu * axes[a, 0, u] + cv * axes[a, 0, v] + w * nx,
                centre[a, 1] + cu * axes[a, 1, u] + cv * axes[a, 1, v] + w * ny,
                centre[a, 2] + cu * axes[a, 2, u] + cv * axes[a, 2, v] + w * nz,
                -sign * nx, -sign * ny, -sign * nz, depth,
            )  # fmt: skip
    return found


@compiled(nogil=False, error_model="python")
def _clipped(corners, n, axis, limit, out):
    """Clip a convex polygon to -limit..limit along one axis: writes its corners to `out`, returns their number, at most
    two more than n. `corners` is overwritten."""
    for side in (1.0, -1.0):
        m = 0
        for k in range(n):
            this, after = corners[k], corners[(k + 1) % n]
            inside, follows = side * this[axis] <= limit, side * after[axis] <= limit
            if inside:
                out[m, 0], out[m, 1] = this[0], this[1]
                m += 1
            if inside != follows:
                share = (side * limit - this[axis]) / (after[axis] - this[axis])
                out[m, 1 - axis] = this[1 - axis] + share * (after[1 - axis] - this[1 - axis])
                out[m, axis] = side * limit
                m += 1
        n = m
        if side > 0.0:
            for k in range(n):
                corners[k, 0], corners[k, 1] = out[k, 0], out[k, 1]
    return n
