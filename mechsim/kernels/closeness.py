"""Compiled search for the bodies that may touch something: those that less than a margin parts from it."""

import numpy as np

from kinetics.kernels.compiled import compiled


@compiled(nogil=False, error_model="python")
def mark_close(live, first, members, position, centre, axes, reach, margin, half, wall, is_colliding, close):
    """Mark the bodies that overlap a wall or another body, or that less than a margin parts from it; unmark the others.

    Returns the slots whose mark has changed.

    Cubes are tested as if each were larger by half of the margin, the smaller one of two bodies, all around: no pair
    within it is missed, and some that are up to 3^.5 of it apart are taken in.

    first, members : cubes of slot b are members[first[b]:first[b + 1]]; live : the slots that hold a body
    position (B, 3) : of the bodies; centre (C, 3), axes (C, 3, 3; columns) : of the cubes; half : half edge
    reach (B,) : from a body's position to its furthest corner; margin (B,) : by slot, length
    wall (3,) : half the space within the walls, inf where there are none
    is_colliding : whether bodies collide with each other, not with walls alone
    close (B,) bool : the marks, updated
    """
    count = live.shape[0]
    near = np.empty((5, count))  # by component, in the order of the search
    before, changed, n_changed = np.empty(count, np.bool_), np.empty(count, np.int64), 0
    r = np.empty((3, 3))
    for n in range(count):
        a = live[n]
        near[0, n], near[1, n], near[2, n] = position[a, 0], position[a, 1], position[a, 2]
        near[3, n], near[4, n] = reach[a] + 0.5 * margin[a], margin[a]
        before[n], close[a] = close[a], False
    for n in range(count):
        a = live[n]
        x, y, z, far = near[0, n], near[1, n], near[2, n], near[3, n]
        if (
            abs(x) + far + margin[a] > wall[0]
            or abs(y) + far + margin[a] > wall[1]
            or abs(z) + far + margin[a] > wall[2]
        ):
            for m in range(first[a], first[a + 1]):
                i = members[m]
                for k in range(3):
                    span = half * (abs(axes[i, k, 0]) + abs(axes[i, k, 1]) + abs(axes[i, k, 2]))
                    if abs(centre[i, k]) + span + margin[a] > wall[k]:
                        close[a] = True
        if not is_colliding:
            continue
        for o in range(n + 1, count):
            dx, dy, dz, both = near[0, o] - x, near[1, o] - y, near[2, o] - z, near[3, o] + far
            if dx * dx + dy * dy + dz * dz > both * both:
                continue
            b = live[o]
            if not (close[a] and close[b]):
                larger = half + 0.5 * min(near[4, n], near[4, o])
                if _any_overlap(first, members, centre, axes, a, b, larger, r):
                    close[a] = close[b] = True
    for n in range(count):
        if close[live[n]] != before[n]:
            changed[n_changed] = live[n]
            n_changed += 1
    return changed[:n_changed]


@compiled(nogil=False, error_model="python")
def _any_overlap(first, members, centre, axes, a, b, half, r):
    """Do any two cubes of bodies a and b overlap, were they of this half edge? r (3, 3) : room to work in."""
    for m in range(first[a], first[a + 1]):
        for q in range(first[b], first[b + 1]):
            if _overlap(centre, axes, members[m], members[q], half, r):
                return True
    return False


@compiled(nogil=False, error_model="python")
def _overlap(centre, axes, i, j, half, r):
    """Do cubes i and j of this half edge overlap? Separating-axis test, as in `contact.cubes_overlap`, without memory.

    r (3, 3) : room to work in
    """
    dx, dy, dz = centre[j, 0] - centre[i, 0], centre[j, 1] - centre[i, 1], centre[j, 2] - centre[i, 2]
    if dx * dx + dy * dy + dz * dz > 12.0 * half * half:
        return False
    for k in range(3):
        r[k, 0] = axes[i, 0, k] * axes[j, 0, 0] + axes[i, 1, k] * axes[j, 1, 0] + axes[i, 2, k] * axes[j, 2, 0]
        r[k, 1] = axes[i, 0, k] * axes[j, 0, 1] + axes[i, 1, k] * axes[j, 1, 1] + axes[i, 2, k] * axes[j, 2, 1]
        r[k, 2] = axes[i, 0, k] * axes[j, 0, 2] + axes[i, 1, k] * axes[j, 1, 2] + axes[i, 2, k] * axes[j, 2, 2]
        along = axes[i, 0, k] * dx + axes[i, 1, k] * dy + axes[i, 2, k] * dz
        if abs(along) > half * (1.0 + abs(r[k, 0]) + abs(r[k, 1]) + abs(r[k, 2])):
            return False
    for k in range(3):
        along = axes[j, 0, k] * dx + axes[j, 1, k] * dy + axes[j, 2, k] * dz
        if abs(along) > half * (1.0 + abs(r[0, k]) + abs(r[1, k]) + abs(r[2, k])):
            return False
    for k in range(3):
        ax, ay, az = axes[i, 0, k], axes[i, 1, k], axes[i, 2, k]
        k1, k2 = (k + 1) % 3, (k + 2) % 3
        for m in range(3):
            bx, by, bz = axes[j, 0, m], axes[j, 1, m], axes[j, 2, m]
            along = dx * (ay * bz - az * by) + dy * (az * bx - ax * bz) + dz * (ax * by - ay * bx)
            m1, m2 = (m + 1) % 3, (m + 2) % 3
            # A vanishing cross product of nearly parallel edges separates nothing; rounding must not say it does.
            if abs(along) > half * (abs(r[k1, m]) + abs(r[k2, m]) + abs(r[k, m1]) + abs(r[k, m2])) + 1e-12:
                return False
    return True
