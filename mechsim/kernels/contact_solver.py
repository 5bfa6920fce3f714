"""Compiled contact solver: restitution, Coulomb friction and recovery of overlaps, by sequential impulses.

Sequential impulses (Catto 2005, "Iterative dynamics with temporal coherence"; projected Gauss-Seidel): contact after
contact, each gets the impulse along its normal that gives its surfaces the speed wanted, then the one across it that
stops their sliding, within the cone of friction; round after round. Every impulse acts at one point on both bodies, so
both momenta are kept to rounding.
"""

import math

from kinetics.kernels.compiled import compiled
from mechsim.kernels.motion import rotation_of, spin_before

# A row is what an impulse of 1 along d does at a contact: d, its levers about both bodies, the changes of their spins
# (3 numbers each), the impulse that changes the speed along d by 1, and the speed wanted.
LEVER_A, LEVER_B, TURN_A, TURN_B, EASE, WANTED = 3, 6, 9, 12, 15, 16
NEAR_ENOUGH = 1e-8  # length: less may be left of an overlap that is recovered
SETTLED = 1e-7  # length / tu: a contact whose speeds change by less is left until a body of it is pushed elsewhere


@compiled(nogil=False, error_model="python")
def solve_contacts(
    n, who, contact, position, orientation, velocity, spin, mass, inertia, restitution, friction, least_bounce,
    recovery, slop, step, iterations, pushed, ready, rows, impulse,
):  # fmt: skip
    """Solve the first n contacts: updates `velocity` and `spin` of the bodies, writes the impulse on the first body of
    each contact to `impulse` (M, 3).

    who (M, 4), contact (M, 7) : as `narrow_phase.find_contacts` writes them
    restitution, friction : of any two surfaces; least_bounce : speed below which approaches do not bounce
    recovery : share of an overlap beyond `slop` that a step takes back, by a speed, where there is no bounce
    iterations : rounds at most
    pushed (B,) : -1; ready (B, 5, 3), rows (M, 3, 17) : room to work
    Bodies of unequal moments take up Euler's gyroscopic term before they touch, and again in the free flight that
    follows: their spins are left such that this flight gives those that the contacts made.
    """
    # Bodies in contact: gyroscopic term and inverse inertia tensor, once each.
    for c in range(n):
        for side in range(2):
            body = who[c, side]
            if body >= 0 and pushed[body] < 0:
                pushed[body] = 0  # the last round that pushed it
                _prepare(body, orientation, spin, inertia, step, ready)
    # Normal rows. Speed wanted: -restitution * approach (Newton); of surfaces that do not bounce, recovery * overlap /
    # step (Baumgarte), which keeps bodies apart that are pressed together.
    for c in range(n):
        a, b = who[c, 0], who[c, 1]
        _row(rows[c, 0], contact[c], a, b, contact[c, 3], contact[c, 4], contact[c, 5], position, mass, ready)
        rows[c, 1, EASE] = 0.0  # the rows across it are filled once something pushes
        speed = _speed(rows[c, 0], a, b, velocity, spin)
        overlap = max(contact[c, 6] - slop, 0.0)
        rows[c, 0, WANTED] = -restitution * speed if -speed >= least_bounce else recovery * overlap / step
        impulse[c, 0] = impulse[c, 1] = impulse[c, 2] = 0.0
    # Projected Gauss-Seidel: first all normals, then all frictions of a round. A contact is skipped if neither of its
    # bodies was pushed in this round or the one before.
    for turn in range(1, iterations + 1):
        is_settled = True
        # Normal impulses: the accumulated one stays at 0 or above (Signorini).
        for c in range(n):
            a, b = who[c, 0], who[c, 1]
            if pushed[a] < turn - 1 and (b < 0 or pushed[b] < turn - 1):
                continue
            normal = rows[c, 0]
            push = max(impulse[c, 0] + (normal[WANTED] - _speed(normal, a, b, velocity, spin)) * normal[EASE], 0.0)
            change = push - impulse[c, 0]
            _push(normal, change, a, b, velocity, spin, mass)
            impulse[c, 0] = push
            if abs(change) > SETTLED * normal[EASE]:
                is_settled = False
                pushed[a] = turn
                if b >= 0:
                    pushed[b] = turn
        # Friction impulses: the accumulated vector is scaled back to the cone |p, q| <= friction * normal (Coulomb).
        for c in range(n):
            a, b = who[c, 0], who[c, 1]
            if pushed[a] < turn - 1 and (b < 0 or pushed[b] < turn - 1):
                continue
            one, two = rows[c, 1], rows[c, 2]
            if one[EASE] == 0.0:
                if impulse[c, 0] == 0.0:
                    continue
                _rows_across(one, two, contact[c], a, b, position, mass, ready)
            p = impulse[c, 1] - _speed(one, a, b, velocity, spin) * one[EASE]
            q = impulse[c, 2] - _speed(two, a, b, velocity, spin) * two[EASE]
            rub, most = math.sqrt(p * p + q * q), friction * impulse[c, 0]
            if rub > most:
                p, q = p * most / rub, q * most / rub
            change, other = p - impulse[c, 1], q - impulse[c, 2]
            _push(one, change, a, b, velocity, spin, mass)
            _push(two, other, a, b, velocity, spin, mass)
            impulse[c, 1], impulse[c, 2] = p, q
            if abs(change) > SETTLED * one[EASE] or abs(other) > SETTLED * two[EASE]:
                is_settled = False
                pushed[a] = turn
                if b >= 0:
                    pushed[b] = turn
        if is_settled:
            break
    # Impulses as vectors in the world; spins as the free flight that follows needs them.
    for c in range(n):
        push, one, two = impulse[c, 0], impulse[c, 1], impulse[c, 2]
        for k in range(3):
            impulse[c, k] = push * rows[c, 0, k] + one * rows[c, 1, k] + two * rows[c, 2, k]
        for side in range(2):
            body = who[c, side]
            if body >= 0 and pushed[body] >= 0:
                pushed[body] = -1
                _leave(body, orientation, spin, inertia, step, ready)


@compiled(nogil=False, error_model="python")
def recover_overlaps(
    n, who, contact, position, velocity, spin, mass, least_bounce, slop, iterations, approach, moved
):  # fmt: skip
    """Let the bodies of contacts that bounce part by position: their overlaps then add nothing to the bounce.

    Writes to `approach` (M,) how fast the surfaces of each contact approach, to `moved` (B, 3) how far each body is to
    be moved, which `move_bodies` does, and to the first n rows of `contact` the depths that are left: `slop`, at most,
    of those that approach at `least_bounce` or faster. Two bodies move about their centre of mass, and do not turn.
    Contact after contact adds what the others have not yet done. Bodies are moved after their impulses: before them,
    they could be put into others that they do not touch.

    who (M, 2 or 4), contact (M, 7) : as `narrow_phase.find_contacts` writes them
    velocity, spin : before any impulse; iterations : rounds at most; moved : 0 before
    """
    is_deep = False
    for c in range(n):
        approach[c] = _approach(contact[c], who[c, 0], who[c, 1], position, velocity, spin)
        if contact[c, 6] > slop and approach[c] >= least_bounce:
            contact[c, 6] = slop - contact[c, 6]  # below 0: to be recovered
            is_deep = True
    for _ in range(iterations):
        if not is_deep:
            break
        is_deep = False
        for c in range(n):
            a, b = who[c, 0], who[c, 1]
            need = -contact[c, 6]
            if need <= 0.0:
                continue
            for k in range(3):
                need -= (moved[a, k] - (moved[b, k] if b >= 0 else 0.0)) * contact[c, 3 + k]
            if need <= NEAR_ENOUGH:
                continue
            is_deep = True
            share = mass[b] / (mass[a] + mass[b]) if b >= 0 else 1.0
            for k in range(3):
                moved[a, k] += need * share * contact[c, 3 + k]
                if b >= 0:
                    moved[b, k] -= need * (1.0 - share) * contact[c, 3 + k]
    for c in range(n):
        if contact[c, 6] < 0.0:
            contact[c, 6] = slop


@compiled(nogil=False, error_model="python")
def move_bodies(n, who, position, moved):
    """Move the bodies of the first n contacts by `moved` (B, 3), which is 0 afterwards."""
    for c in range(n):
        for side in range(2):
            body = who[c, side]
            if body >= 0:
                for k in range(3):
                    position[body, k] += moved[body, k]
                    moved[body, k] = 0.0


@compiled(nogil=False, error_model="python")
def _approach(contact, a, b, position, velocity, spin):
    """Speed at which the surfaces of a and b approach each other at a contact, along its normal."""
    speed = 0.0
    for side in range(2):
        body, sign = (b, 1.0) if side else (a, -1.0)
        if body < 0:
            continue
        x, y, z = contact[0] - position[body, 0], contact[1] - position[body, 1], contact[2] - position[body, 2]
        speed += sign * (
            (velocity[body, 0] + spin[body, 1] * z - spin[body, 2] * y) * contact[3]
            + (velocity[body, 1] + spin[body, 2] * x - spin[body, 0] * z) * contact[4]
            + (velocity[body, 2] + spin[body, 0] * y - spin[body, 1] * x) * contact[5]
        )
    return speed


@compiled(nogil=False, error_model="python")
def _prepare(body, orientation, spin, inertia, step, ready):
    """Give a body Euler's gyroscopic term, as its free flight would; write to `ready` its inverse inertia tensor in the
    world, and its spins before and after (a row each)."""
    x, y, z, w = orientation[body]
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_of(x, y, z, w)
    i0, i1, i2 = inertia[body]
    j0, j1, j2 = 1.0 / i0, 1.0 / i1, 1.0 / i2
    # R diag(1 / principal moments) R'
    ready[body, 0, 0] = r00 * r00 * j0 + r01 * r01 * j1 + r02 * r02 * j2
    ready[body, 1, 1] = r10 * r10 * j0 + r11 * r11 * j1 + r12 * r12 * j2
    ready[body, 2, 2] = r20 * r20 * j0 + r21 * r21 * j1 + r22 * r22 * j2
    ready[body, 0, 1] = ready[body, 1, 0] = r00 * r10 * j0 + r01 * r11 * j1 + r02 * r12 * j2
    ready[body, 0, 2] = ready[body, 2, 0] = r00 * r20 * j0 + r01 * r21 * j1 + r02 * r22 * j2
    ready[body, 1, 2] = ready[body, 2, 1] = r10 * r20 * j0 + r11 * r21 * j1 + r12 * r22 * j2
    wx, wy, wz = spin[body]
    ready[body, 3, 0], ready[body, 3, 1], ready[body, 3, 2] = wx, wy, wz
    if i0 != i1 or i1 != i2:
        # Euler's equations in the body frame, one explicit step: I0 du0 = (I1 - I2) u1 u2 step, and so on.
        u0, u1, u2 = r00 * wx + r10 * wy + r20 * wz, r01 * wx + r11 * wy + r21 * wz, r02 * wx + r12 * wy + r22 * wz
        g0 = step * (i1 - i2) / i0 * u1 * u2
        g1 = step * (i2 - i0) / i1 * u2 * u0
        g2 = step * (i0 - i1) / i2 * u0 * u1
        spin[body, 0] = wx + r00 * g0 + r01 * g1 + r02 * g2
        spin[body, 1] = wy + r10 * g0 + r11 * g1 + r12 * g2
        spin[body, 2] = wz + r20 * g0 + r21 * g1 + r22 * g2
    for k in range(3):
        ready[body, 4, k] = spin[body, k]


@compiled(nogil=False, error_model="python")
def _leave(body, orientation, spin, inertia, step, ready):
    """Take back the gyroscopic term of the free flight that follows, by the fixed point of its explicit step; exactly,
    where the contacts made nothing of it."""
    i0, i1, i2 = inertia[body]
    if i0 == i1 and i1 == i2:
        return
    if spin[body, 0] == ready[body, 4, 0] and spin[body, 1] == ready[body, 4, 1] and spin[body, 2] == ready[body, 4, 2]:
        for k in range(3):
            spin[body, k] = ready[body, 3, k]
        return
    x, y, z, w = orientation[body]
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_of(x, y, z, w)
    wx, wy, wz = spin[body]
    m0, m1, m2 = r00 * wx + r10 * wy + r20 * wz, r01 * wx + r11 * wy + r21 * wz, r02 * wx + r12 * wy + r22 * wz
    u0, u1, u2 = spin_before(m0, m1, m2, i0, i1, i2, step)
    spin[body, 0] = r00 * u0 + r01 * u1 + r02 * u2
    spin[body, 1] = r10 * u0 + r11 * u1 + r12 * u2
    spin[body, 2] = r20 * u0 + r21 * u1 + r22 * u2


@compiled(nogil=False, error_model="python")
def _row(row, contact, a, b, dx, dy, dz, position, mass, ready):
    """Fill a row, but for the speed wanted."""
    row[0], row[1], row[2] = dx, dy, dz
    # Effective mass along d: 1 / (sum over both bodies of 1 / m + (r x d) . I^-1 (r x d)).
    against = 0.0
    for side in range(2):
        body = b if side else a
        lever, turn = (LEVER_B, TURN_B) if side else (LEVER_A, TURN_A)
        if body < 0:
            continue
        sign = -1.0 if side else 1.0
        x, y, z = contact[0] - position[body, 0], contact[1] - position[body, 1], contact[2] - position[body, 2]
        row[lever], row[lever + 1], row[lever + 2] = (
            sign * (y * dz - z * dy), sign * (z * dx - x * dz), sign * (x * dy - y * dx),
        )  # fmt: skip
        against += 1.0 / mass[body]
        for k in range(3):
            row[turn + k] = (
                ready[body, k, 0] * row[lever] + ready[body, k, 1] * row[lever + 1] + ready[body, k, 2] * row[lever + 2]
            )
            against += row[turn + k] * row[lever + k]
    row[EASE] = 1.0 / against


@compiled(nogil=False, error_model="python")
def _rows_across(one, two, contact, a, b, position, mass, ready):
    """Fill the rows of two directions across a contact's normal and each other."""
    nx, ny, nz = contact[3], contact[4], contact[5]
    if abs(nx) < 0.6:
        length = math.sqrt(ny * ny + nz * nz)
        tx, ty, tz = 0.0, nz / length, -ny / length
    else:
        length = math.sqrt(nx * nx + ny * ny)
        tx, ty, tz = ny / length, -nx / length, 0.0
    _row(one, contact, a, b, tx, ty, tz, position, mass, ready)
    _row(two, contact, a, b, ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx, position, mass, ready)


@compiled(nogil=False, error_model="python")
def _speed(row, a, b, velocity, spin):
    """Speed of the surface of a relative to that of b, along the row's direction."""
    speed = 0.0
    for k in range(3):
        speed += row[k] * velocity[a, k] + row[LEVER_A + k] * spin[a, k]
    if b >= 0:
        for k in range(3):
            speed += row[LEVER_B + k] * spin[b, k] - row[k] * velocity[b, k]
    return speed


@compiled(nogil=False, error_model="python")
def _push(row, size, a, b, velocity, spin, mass):
    """Give a an impulse of this size along the row's direction, and b the opposite one."""
    for k in range(3):
        velocity[a, k] += size / mass[a] * row[k]
        spin[a, k] += size * row[TURN_A + k]
    if b >= 0:
        for k in range(3):
            velocity[b, k] -= size / mass[b] * row[k]
            spin[b, k] += size * row[TURN_B + k]
