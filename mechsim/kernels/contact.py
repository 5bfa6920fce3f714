"""Compiled geometry of pairs of cubes: faces that look at each other, now or since the last look, and overlaps."""

import math

import numpy as np

from kinetics.kernels.compiled import compiled


@compiled(nogil=False, error_model="python")
def facing_pairs(
    body,
    centre,
    axes,
    kind,
    allowed,
    edge,
    capture,
    cosine,
    sideways,
    born,
    since,
    last_centre,
    last_axes,
    finest,
    order,
    is_open,
    found,
):
    """Pairs of faces near enough to bond: writes (cube, face, cube, face) to `found` (K, 4), returns their number.

    Two faces capture each other when they look at each other (n1 . n2 < -cosine), their cubes' gap along the
    bisecting normal n is below `capture`, and each cube's centre lies within `sideways` of the line of sight.
    The gap is measured between the cubes' supports along n: zero when they touch there, however they are tilted.

    Bodies born before the time `since` of the last look are followed from their poses then to those of now, so that
    a pair that was within reach only in between is found, too: centres and axes are interpolated linearly. That is how
    a single cube's centre moves in a step; a turn by t shortens axes by at most t^2 / 8, and bends the path of a cube
    r from its body's centre by at most r t^2 / 8. A passage shorter than the share `finest` of the time between the
    looks may be missed. Looks until which a pair cannot have come within reach are skipped. A pair with a younger body
    is looked at as it is now; with since = -inf, all are.

    body (C,) : slot of each cube; cubes of one body are never a pair
    kind (C, 6) : what the rules distinguish in a face, -1 where it is covered; allowed (kinds, kinds) : may they bond
    born (B,) : time at which the body got its structure; last_centre (C, 3), last_axes (C, 3, 3) : at the last look
    order (C,) : all cubes; sorted here along z, from how they were last time, so that few pairs are looked at
    is_open (C,) : may any of its faces pair at all? Cubes that are not are passed over
    found.shape[0] is a limit: the caller checks for a full table. Rows come by i, j and faces.
    """
    count = 0
    # Supports are largest at the largest tilt of a face to the normal between the two, along a face's diagonal.
    along = capture + edge * (math.sqrt(0.5 + 0.5 * cosine) + math.sqrt(1.0 - cosine))
    reach = math.sqrt(along * along + sideways * sideways)
    furthest = 0.0
    for i in range(body.shape[0]):
        if is_open[i] and born[body[i]] < since:
            furthest = max(furthest, _distance2(centre, last_centre, i))
    wide = reach + 2.0 * math.sqrt(furthest)  # two cubes may both have come this far since the last look
    between = np.empty((2, 3, 3))
    # Sort and sweep: insertion sort along z, linear where the order has hardly changed.
    for k in range(1, order.shape[0]):
        cube = order[k]
        m = k - 1
        while m >= 0 and centre[order[m], 2] > centre[cube, 2]:
            order[m + 1] = order[m]
            m -= 1
        order[m + 1] = cube
    place = np.empty((order.shape[0], 3))  # of the open ones in that order, one after the other in memory
    who = np.empty(order.shape[0], np.int64)
    n = 0
    for cube in order:
        if is_open[cube]:
            who[n] = cube
            for axis in range(3):
                place[n, axis] = centre[cube, axis]
            n += 1
    for k in range(n):
        for m in range(k + 1, n):
            dz = place[m, 2] - place[k, 2]
            if dz > wide:
                break
            dx, dy = place[m, 0] - place[k, 0], place[m, 1] - place[k, 1]
            d2 = dx * dx + dy * dy + dz * dz
            if d2 > wide * wide:
                continue
            i, j = min(who[k], who[m]), max(who[k], who[m])
            if body[i] == body[j]:
                continue
            if i == who[m]:
                dx, dy, dz = -dx, -dy, -dz
            back_x = back_y = back_z = turn = 0.0
            is_followed = born[body[i]] < since and born[body[j]] < since
            if is_followed:
                back_x = last_centre[j, 0] - last_centre[i, 0] - dx
                back_y = last_centre[j, 1] - last_centre[i, 1] - dy
                back_z = last_centre[j, 2] - last_centre[i, 2] - dz
            move = math.sqrt(back_x * back_x + back_y * back_y + back_z * back_z)
            distance = math.sqrt(d2)
            if distance > reach + move:
                continue
            if is_followed:
                turn = _turn(axes, last_axes, i) + _turn(axes, last_axes, j)
            for f in range(6):
                kf = kind[i, f]
                if kf < 0:
                    continue
                sf = 1.0 - 2.0 * (f & 1)
                ahead = sf * (axes[i, 0, f >> 1] * dx + axes[i, 1, f >> 1] * dy + axes[i, 2, f >> 1] * dz)
                if ahead <= -(move + turn * (distance + move)):
                    continue
                for g in range(6):
                    kg = kind[j, g]
                    if kg < 0 or not allowed[kf, kg]:
                        continue
                    # Conservative advancement: back from now, by as much of the step as surely holds no meeting.
                    free = _out_of_reach(axes, i, j, f, g, dx, dy, dz, edge, capture, cosine, sideways, move, turn)
                    back = 0.0  # share of the way back to the last look
                    while free >= 0.0:
                        back += max(free, finest)
                        if back >= 1.0:
                            break
                        for p in range(3):
                            for q in range(3):
                                between[0, p, q] = axes[i, p, q] + back * (last_axes[i, p, q] - axes[i, p, q])
                                between[1, p, q] = axes[j, p, q] + back * (last_axes[j, p, q] - axes[j, p, q])
                        free = _out_of_reach(
                            between, 0, 1, f, g, dx + back * back_x, dy + back * back_y, dz + back * back_z,
                            edge, capture, cosine, sideways, move, turn,
                        )  # fmt: skip
                    if free < 0.0:
                        if count < found.shape[0]:
                            found[count, 0], found[count, 1], found[count, 2], found[count, 3] = i, f, j, g
                        count += 1
    if count <= found.shape[0]:
        _sort_pairs(found, count)
    return count


@compiled(nogil=False, error_model="python")
def _sort_pairs(found, n):
    """Put the first n rows (i, face, j, face) in order of i, j, and the faces."""
    for k in range(1, n):
        i, f, j, g = found[k]
        m = k - 1
        while m >= 0 and (found[m, 0], found[m, 2], found[m, 1], found[m, 3]) > (i, j, f, g):
            found[m + 1] = found[m]
            m -= 1
        found[m + 1, 0], found[m + 1, 1], found[m + 1, 2], found[m + 1, 3] = i, f, j, g


@compiled(nogil=False, error_model="python")
def _out_of_reach(axes, i, j, f, g, dx, dy, dz, edge, capture, cosine, sideways, move, turn):
    """Share of the step for which face f of cube i and g of j surely stay out of reach, 1 for all of it; -1: they are
    within reach.

    In a step the distance vector d of the centres changes by `move` and each axis by no more than `turn`, both evenly.
    So n changes by at most 2 turn / (|u| + |u'|), where u, u' is the difference of the normals now and when they are
    within reach; the gap, the offset and what lies ahead change with d and n, the supports with n and the axes.
    """
    free = -1.0
    sf, sg = 1.0 - 2.0 * (f & 1), 1.0 - 2.0 * (g & 1)
    ax, ay, az = sf * axes[i, 0, f >> 1], sf * axes[i, 1, f >> 1], sf * axes[i, 2, f >> 1]
    bx, by, bz = sg * axes[j, 0, g >> 1], sg * axes[j, 1, g >> 1], sg * axes[j, 2, g >> 1]
    # Do the faces look at each other? n1 . n2 changes by at most `turn`.
    over = ax * bx + ay * by + az * bz + cosine
    if over > 0.0:
        if over >= turn:
            return 1.0
        free = over / turn
    nx, ny, nz = ax - bx, ay - by, az - bz
    norm = math.sqrt(nx * nx + ny * ny + nz * nz)
    if norm < 1e-9:
        return max(free, 0.0)
    nx, ny, nz = nx / norm, ny / norm, nz / norm
    d2 = dx * dx + dy * dy + dz * dz
    # Bounds of the change of n, and of projections of d on n.
    swing = 2.0 * turn / (norm + 1.3)  # 1.3: less than the least |u'|, 2^.5 of axes shortened by a turn of .7
    longest = math.sqrt(d2) + move
    shift = move + swing * longest
    along = nx * dx + ny * dy + nz * dz
    # Is the other cube in front of the face?
    behind = -min(ax * dx + ay * dy + az * dz, along)
    if behind >= 0.0:
        pass_by = move + max(turn, swing) * longest
        if behind >= pass_by:
            return 1.0
        free = max(free, behind / pass_by)
    # Offset across n
    aside = math.sqrt(max(d2 - along * along, 0.0)) - sideways
    if aside > 0.0:
        if aside >= shift:
            return 1.0
        free = max(free, aside / shift)
    # Gap along n: distance less both cubes' supports, half an edge times the sum of |n . axis|
    supports = 0.0
    for k in range(3):
        supports += abs(nx * axes[i, 0, k] + ny * axes[i, 1, k] + nz * axes[i, 2, k])
        supports += abs(nx * axes[j, 0, k] + ny * axes[j, 1, k] + nz * axes[j, 2, k])
    gap = along - 0.5 * edge * supports - capture
    if gap > 0.0:
        close = shift + 0.8661 * edge * (2.0 * swing + turn)  # 3^.5 / 2: from a vector's length to its sum
        if gap >= close:
            return 1.0
        free = max(free, gap / close)
    return free


@compiled(nogil=False, error_model="python", inline="always")
def _distance2(a, b, i):
    """Square of the distance of two points."""
    return (a[i, 0] - b[i, 0]) ** 2 + (a[i, 1] - b[i, 1]) ** 2 + (a[i, 2] - b[i, 2]) ** 2


@compiled(nogil=False, error_model="python", inline="always")
def _turn(a, b, i):
    """Largest change of a unit vector between two rotations: 2 sin(t / 2) for the angle t between them."""
    total = 0.0
    for k in range(3):
        for m in range(3):
            total += (a[i, k, m] - b[i, k, m]) ** 2
    return math.sqrt(0.5 * total)


@compiled(nogil=False, error_model="python")
def cubes_overlap(centre_a, axes_a, centre_b, axes_b, half_a, half_b):
    """Do two cubes overlap? Separating-axis test of oriented boxes (Gottschalk, Lin & Manocha 1996): exact, 15
    axes."""
    d = np.empty(3)
    r = np.empty((3, 3))
    for i in range(3):
        d[i] = 0.0
        for k in range(3):
            d[i] += (centre_b[k] - centre_a[k]) * axes_a[k, i]
        for j in range(3):
            r[i, j] = 0.0
            for k in range(3):
                r[i, j] += axes_a[k, i] * axes_b[k, j]
    # Axes of a, of b, and products of both; d and R = A' B in the frame of a.
    for i in range(3):
        if abs(d[i]) > half_a + half_b * (abs(r[i, 0]) + abs(r[i, 1]) + abs(r[i, 2])):
            return False
    for j in range(3):
        along = d[0] * r[0, j] + d[1] * r[1, j] + d[2] * r[2, j]
        if abs(along) > half_b + half_a * (abs(r[0, j]) + abs(r[1, j]) + abs(r[2, j])):
            return False
    for i in range(3):
        i1, i2 = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            j1, j2 = (j + 1) % 3, (j + 2) % 3
            along = d[i2] * r[i1, j] - d[i1] * r[i2, j]
            limit = half_a * (abs(r[i1, j]) + abs(r[i2, j])) + half_b * (abs(r[i, j1]) + abs(r[i, j2]))
            # A vanishing cross product of nearly parallel edges separates nothing; rounding must not say it does.
            if abs(along) > limit + 1e-12:
                return False
    return True


@compiled(nogil=False, error_model="python")
def blocked(centre, axes, others, other_axes, skip, half, shrink, low, high):
    """Would cubes at these places overlap another cube, or leave the box low..high?

    centre (k, 3), axes (k, 3, 3) : the cubes to be placed; others (C, 3), other_axes : cubes that stand there
    skip (C,) bool : cubes not to be tested (not yet placed, or the moving ones themselves)
    half : half edge; shrink : factor on it for the pair test, so that a touch is no overlap
    """
    reach2 = 12.0 * half * half
    for a in range(centre.shape[0]):
        for k in range(3):
            span = half * (abs(axes[a, k, 0]) + abs(axes[a, k, 1]) + abs(axes[a, k, 2])) * shrink
            if centre[a, k] - span < low[k] or centre[a, k] + span > high[k]:
                return True
        for c in range(others.shape[0]):
            if skip[c]:
                continue
            dx = centre[a, 0] - others[c, 0]
            dy = centre[a, 1] - others[c, 1]
            dz = centre[a, 2] - others[c, 2]
            if dx * dx + dy * dy + dz * dz > reach2:
                continue
            if cubes_overlap(centre[a], axes[a], others[c], other_axes[c], half * shrink, half * shrink):
                return True
    return False
