"""Compiled geometry of pairs of cubes: faces that look at each other, and overlaps."""

import math

import numpy as np

from kinetics.kernels.compiled import compiled


@compiled(nogil=False, error_model="python")
def facing_pairs(body, centre, axes, kind, allowed, edge, capture, cosine, sideways, found):
    """Pairs of faces near enough to bond: writes (cube, face, cube, face) to `found` (K, 4), returns their number.

    Two faces capture each other when they look at each other (n1 . n2 < -cosine), their cubes' gap along the
    bisecting normal n is below `capture`, and each cube's centre lies within `sideways` of the line of sight.
    The gap is measured between the cubes' supports along n: zero when they touch there, however they are tilted.

    body (C,) : slot of each cube; cubes of one body are never a pair
    kind (C, 6) : what the rules distinguish in a face, -1 where it is covered; allowed (kinds, kinds) : may they bond
    found.shape[0] is a limit: the caller checks for a full table.
    """
    count = 0
    # Furthest centres: each support is at most edge/2 (cos + sqrt 2 sin) of 22.5 degrees for any admissible angle
    # up to 90.
    reach = capture + 1.74 * edge
    reach2 = reach * reach + sideways * sideways
    for i in range(body.shape[0]):
        for j in range(i + 1, body.shape[0]):
            if body[i] == body[j]:
                continue
            dx = centre[j, 0] - centre[i, 0]
            dy = centre[j, 1] - centre[i, 1]
            dz = centre[j, 2] - centre[i, 2]
            d2 = dx * dx + dy * dy + dz * dz
            if d2 > reach2:
                continue
            for f in range(6):
                kf = kind[i, f]
                if kf < 0:
                    continue
                sf = 1.0 - 2.0 * (f & 1)
                ax, ay, az = sf * axes[i, 0, f >> 1], sf * axes[i, 1, f >> 1], sf * axes[i, 2, f >> 1]
                if ax * dx + ay * dy + az * dz <= 0.0:
                    continue
                for g in range(6):
                    kg = kind[j, g]
                    if kg < 0 or not allowed[kf, kg]:
                        continue
                    sg = 1.0 - 2.0 * (g & 1)
                    bx, by, bz = sg * axes[j, 0, g >> 1], sg * axes[j, 1, g >> 1], sg * axes[j, 2, g >> 1]
                    if ax * bx + ay * by + az * bz > -cosine:
                        continue
                    nx, ny, nz = ax - bx, ay - by, az - bz
                    norm = math.sqrt(nx * nx + ny * ny + nz * nz)
                    nx, ny, nz = nx / norm, ny / norm, nz / norm
                    along = nx * dx + ny * dy + nz * dz
                    if along <= 0.0 or d2 - along * along > sideways * sideways:
                        continue
                    reach_i = reach_j = 0.0
                    for k in range(3):
                        reach_i += abs(nx * axes[i, 0, k] + ny * axes[i, 1, k] + nz * axes[i, 2, k])
                        reach_j += abs(nx * axes[j, 0, k] + ny * axes[j, 1, k] + nz * axes[j, 2, k])
                    if along - 0.5 * edge * (reach_i + reach_j) > capture:
                        continue
                    if count < found.shape[0]:
                        found[count, 0], found[count, 1], found[count, 2], found[count, 3] = i, f, j, g
                    count += 1
    return count


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
