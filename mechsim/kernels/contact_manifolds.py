"""Compiled contact manifolds: two boxes that have touched keep their contact points as long as these stay close.

A point is kept as it lies on each of the two bodies, with the normal along which it pushed. In a later step it
is a contact again, overlap or none: two surfaces a gap apart may approach each other by the gap in a step, no further,
so that bodies that come back at once are stopped before they overlap. Two boxes keep four points at most, as does a box
at a wall.

These are the rules of PyBullet 3.2.7 (persistent manifolds, by E. Coumans), measured by what it tells of its contact
points, and read in its sources where it tells nothing. Without them a twentieth of all impulse comes later, by another
push.

Indices: P pairs of boxes, of which the first n are in use; M contacts at most. Of a pair, `pair` (P, 2) holds the two
boxes, the lower row first, or a box and -1 - 2 axis - side for a wall; `count` (P,), how many points it has; and
`point` (P, 4, 10), of each, its place on the first body and on the second in their frames (of a wall: in the world),
the normal that pushes the first, and the gap, below 0 for an overlap.
"""

from kinetics.kernels.compiled import compiled
from mechsim.kernels.motion import rotation_of

MAX_POINTS = 4  # points of a pair
ON_A, ON_B, NORMAL, GAP = 0, 3, 6, 9


@compiled(nogil=False, error_model="python")
def update_manifolds(found, who, contact, slot, breaking, position, orientation, n, pair, count, point, first, after):
    """Merge the contacts that a step has found into the manifolds, and write all their points over the contacts.

    Returns the number of pairs and the number of contacts. Both fit if P is at least n + found and M four times that.

    found : contacts; who (M, 4), contact (M, 7) : as `narrow_phase.find_contacts` writes them
    slot (R,) : the body of a box; breaking (B,) : by slot, how far apart, and how far aside, two points may come to lie
        and stay one contact; of two bodies, the lesser
    first (R,) : -1; after (P,) : room to work
    """
    # The manifolds of each box as a linked list: first[box], then after[manifold], until -1.
    for m in range(n):
        after[m], first[pair[m, 0]] = first[pair[m, 0]], m
    # Merge: each contact found goes to the manifold of its pair, which is made if there is none.
    for c in range(found):
        a, b, sign = who[c, 2], who[c, 3], 1.0
        if 0 <= b < a:
            a, b, sign = b, a, -1.0
        m = first[a]
        while m >= 0 and pair[m, 1] != b:
            m = after[m]
        if m < 0:
            m, n = n, n + 1
            pair[m, 0], pair[m, 1], count[m] = a, b, 0
            after[m], first[a] = first[a], m
        _insert(contact[c], sign, slot[a], slot[b] if b >= 0 else -1, breaking, position, orientation, count, point, m)
    # Refresh: gap and slide of each point by today's poses; a point beyond the limit in either is dropped.
    kept = written = 0
    for m in range(n):
        a, b = pair[m, 0], pair[m, 1]
        first[a] = -1
        body, other = slot[a], slot[b] if b >= 0 else -1
        limit = _limit(body, other, breaking)
        left = 0
        for k in range(count[m]):
            x, y, z = _placed(point[m, k], ON_A, body, position, orientation)
            u, v, w = _placed(point[m, k], ON_B, other, position, orientation)
            dx, dy, dz = x - u, y - v, z - w
            nx, ny, nz = point[m, k, NORMAL], point[m, k, NORMAL + 1], point[m, k, NORMAL + 2]
            gap = dx * nx + dy * ny + dz * nz
            ax, ay, az = dx - gap * nx, dy - gap * ny, dz - gap * nz
            if gap > limit or ax * ax + ay * ay + az * az > limit * limit:
                continue
            for i in range(GAP):
                point[kept, left, i] = point[m, k, i]
            point[kept, left, GAP] = gap
            left += 1
            who[written, 0], who[written, 1], who[written, 2], who[written, 3] = body, other, a, b
            contact[written, 0], contact[written, 1], contact[written, 2] = 0.5 * (x + u), 0.5 * (y + v), 0.5 * (z + w)
            contact[written, 3], contact[written, 4], contact[written, 5] = nx, ny, nz
            contact[written, 6] = -gap
            written += 1
        if left:
            pair[kept, 0], pair[kept, 1], count[kept] = a, b, left
            kept += 1
    return kept, written


@compiled(nogil=False, error_model="python")
def _insert(contact, sign, body, other, breaking, position, orientation, count, point, m):
    """Add a contact to pair m: in place of the nearest point, if that is near on the first body, or on the wall;
    otherwise as a further point, or in place of one if there are four."""
    # The contact's two places: half the depth along the normal to either side, each in its body's frame.
    h = -0.5 * contact[6]
    nx, ny, nz = sign * contact[3], sign * contact[4], sign * contact[5]
    x, y, z = contact[0] + h * nx, contact[1] + h * ny, contact[2] + h * nz
    u, v, w = _in_frame(x - 2.0 * h * nx, y - 2.0 * h * ny, z - 2.0 * h * nz, other, position, orientation)
    x, y, z = _in_frame(x, y, z, body, position, orientation)
    side = ON_B if other < 0 else ON_A
    p, q, r = (u, v, w) if other < 0 else (x, y, z)
    limit = _limit(body, other, breaking)
    # Does it continue a known point? The nearest within the limit is replaced.
    near, at = limit * limit, -1
    for k in range(count[m]):
        dx, dy, dz = point[m, k, side] - p, point[m, k, side + 1] - q, point[m, k, side + 2] - r
        square = dx * dx + dy * dy + dz * dz
        if square < near:
            near, at = square, k
    if at < 0:
        at = count[m]
        if at == MAX_POINTS:
            at = _replaced_point(point[m], side, p, q, r, -contact[6])
        else:
            count[m] = at + 1
    point[m, at, 0], point[m, at, 1], point[m, at, 2] = x, y, z
    point[m, at, 3], point[m, at, 4], point[m, at, 5] = u, v, w
    point[m, at, 6], point[m, at, 7], point[m, at, 8] = nx, ny, nz
    point[m, at, GAP] = -contact[6]


@compiled(nogil=False, error_model="python")
def _replaced_point(points, side, x, y, z, gap):
    """The one of four points that a fifth replaces: the one without which the others and the new one span most, never
    the deepest of all. The span is the area of the quadrilateral, half of |diagonal x diagonal|."""
    deepest = -1
    for k in range(MAX_POINTS):
        if points[k, GAP] < gap:
            gap, deepest = points[k, GAP], k
    most, chosen = -1.0, 0
    for k in range(MAX_POINTS):
        if k == deepest:
            continue
        i, j, o = 0 if k else 1, 1 if k > 1 else 2, 2 if k > 2 else 3  # the other three
        ax, ay, az = x - points[i, side], y - points[i, side + 1], z - points[i, side + 2]
        bx, by = points[o, side] - points[j, side], points[o, side + 1] - points[j, side + 1]
        bz = points[o, side + 2] - points[j, side + 2]
        cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        square = cx * cx + cy * cy + cz * cz
        if square > most:
            most, chosen = square, k
    return chosen


@compiled(nogil=False, error_model="python")
def _limit(body, other, breaking):
    """Largest distance that the two places of a contact point may reach: the lesser of the two bodies' thresholds."""
    return breaking[body] if other < 0 else min(breaking[body], breaking[other])


@compiled(nogil=False, error_model="python")
def _placed(point, at, body, position, orientation):
    """In the world, the place that begins at `at` in a point, in the frame of a body; -1: of a wall."""
    x, y, z = point[at], point[at + 1], point[at + 2]
    if body < 0:
        return x, y, z
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_of(
        orientation[body, 0], orientation[body, 1], orientation[body, 2], orientation[body, 3]
    )
    return (
        position[body, 0] + r00 * x + r01 * y + r02 * z,
        position[body, 1] + r10 * x + r11 * y + r12 * z,
        position[body, 2] + r20 * x + r21 * y + r22 * z,
    )


@compiled(nogil=False, error_model="python")
def _in_frame(x, y, z, body, position, orientation):
    """A place in the world in the frame of a body; -1: of a wall."""
    if body < 0:
        return x, y, z
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_of(
        orientation[body, 0], orientation[body, 1], orientation[body, 2], orientation[body, 3]
    )
    x, y, z = x - position[body, 0], y - position[body, 1], z - position[body, 2]
    return r00 * x + r10 * y + r20 * z, r01 * x + r11 * y + r21 * z, r02 * x + r12 * y + r22 * z
