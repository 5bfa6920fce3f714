"""Compiled contact step of our own engine: narrow phase, contact manifolds, contact solver."""

from kinetics.kernels.compiled import compiled
from mechsim.kernels.contact_manifolds import MAX_POINTS, update_manifolds
from mechsim.kernels.contact_solver import solve_contacts
from mechsim.kernels.narrow_phase import find_contacts, place_boxes


@compiled(nogil=False, error_model="python")
def contact_step(
    order, slot, offset, turn, half, radius, centre, axes, with_bodies, wall, breaking, n, pair, count, point, first,
    after, position, orientation, velocity, spin, mass, inertia, restitution, friction, least_bounce, recovery, slop,
    step, iterations, who, contact, pushed, ready, rows, impulse,
):  # fmt: skip
    """Give all bodies the impulses of their contacts.

    Returns the number of manifolds and the number of contacts, which are described by `who`, `contact` and `impulse`.
    If these have too little room, it returns -1 and the room needed, and nothing has happened.

    One call a step: a call from Python costs as much as the contacts of some cubes. The arrays are those of
    `narrow_phase` (boxes), `contact_manifolds` (n, pair, count, point, first, after, breaking) and `contact_solver`
    (all others).
    """
    place_boxes(order, slot, offset, turn, position, orientation, centre, axes)
    found = find_contacts(order, slot, half, radius, centre, axes, with_bodies, wall, who, contact)
    if MAX_POINTS * (n + found) > len(who):
        return -1, MAX_POINTS * (n + found)
    n, found = update_manifolds(
        found, who, contact, slot, breaking, position, orientation, n, pair, count, point, first, after
    )
    if found:
        solve_contacts(
            found, who, contact, position, orientation, velocity, spin, mass, inertia, restitution, friction,
            least_bounce, recovery, slop, step, iterations, pushed, ready, rows, impulse,
        )  # fmt: skip
    return n, found
