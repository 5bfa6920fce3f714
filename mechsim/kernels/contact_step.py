"""Compiled contact step of our own engine: narrow phase, contact solver, recovery of overlaps."""

from kinetics.kernels.compiled import compiled
from mechsim.kernels.contact_solver import move_bodies, recover_overlaps, solve_contacts
from mechsim.kernels.narrow_phase import find_contacts, place_boxes


@compiled(nogil=False, error_model="python")
def contact_step(
    order, slot, offset, turn, half, radius, centre, axes, with_bodies, wall, position, orientation, velocity, spin,
    mass, inertia, restitution, friction, least_bounce, recovery, slop, step, iterations, who, contact, pushed, ready,
    rows, impulse, approach, moved,
):  # fmt: skip
    """Give all bodies the impulses of their contacts, and move those apart that overlap.

    Returns the number of contacts, described by `who`, `contact`, `approach` and `impulse`. If these have room for
    fewer, nothing has happened.

    One call a step: a call from Python costs as much as the contacts of some cubes. The arrays are those of
    `narrow_phase` (boxes) and `contact_solver` (all others).
    """
    place_boxes(order, slot, offset, turn, position, orientation, centre, axes)
    found = find_contacts(order, slot, half, radius, centre, axes, with_bodies, wall, who, contact)
    if 0 < found <= len(who):
        recover_overlaps(
            found, who, contact, position, velocity, spin, mass, least_bounce, slop, iterations, approach, moved
        )
        solve_contacts(
            found, who, contact, position, orientation, velocity, spin, mass, inertia, restitution, friction,
            least_bounce, recovery, slop, step, iterations, pushed, ready, rows, impulse,
        )  # fmt: skip
        move_bodies(found, who, position, moved)
    return found
