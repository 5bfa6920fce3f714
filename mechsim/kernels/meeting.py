"""Compiled step of our own engine: where boxes touch now, where they have touched before, and the impulses of both."""

from kinetics.kernels.compiled import compiled
from mechsim.kernels.impulses import exchange
from mechsim.kernels.remembered import MOST, remember
from mechsim.kernels.touching import find_contacts, place_boxes


@compiled(nogil=False, error_model="python")
def meet(
    order, slot, offset, turn, half, radius, centre, axes, with_bodies, wall, breaking, n, pair, count, point, first,
    after, position, orientation, velocity, spin, mass, inertia, restitution, friction, least_bounce, recovery, slop,
    step, iterations, who, contact, pushed, ready, rows, impulse,
):  # fmt: skip
    """Give all bodies the impulses of their contacts. Returns how many pairs of boxes are remembered, and how many
    contacts there are, of which `who`, `contact` and `impulse` tell; where these have too little room, -1 and how much
    they need, and nothing has happened.

    One call a step: a call from Python costs as much as the contacts of some cubes. For what the arrays are see
    `touching` (boxes), `remembered` (n, pair, count, point, first, after, breaking) and `impulses` (the others).
    """
    place_boxes(order, slot, offset, turn, position, orientation, centre, axes)
    found = find_contacts(order, slot, half, radius, centre, axes, with_bodies, wall, who, contact)
    if MOST * (n + found) > len(who):
        return -1, MOST * (n + found)
    n, found = remember(found, who, contact, slot, breaking, position, orientation, n, pair, count, point, first, after)
    if found:
        exchange(
            found, who, contact, position, orientation, velocity, spin, mass, inertia, restitution, friction,
            least_bounce, recovery, slop, step, iterations, pushed, ready, rows, impulse,
        )  # fmt: skip
    return n, found
