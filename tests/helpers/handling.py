"""Worlds handled by hand: bodies put where a test wants them, their energy, and the events that happen to them."""

from itertools import takewhile

import numpy as np

from mechsim.world.bodies import quaternion_of

CONTACT = {"effect": "contact", "restitution": 0.3, "friction": 0.3}


def energy(world):
    b = world.bodies
    return sum(
        0.5 * b.mass[s] * b.velocity[s] @ b.velocity[s] + 0.5 * b.spin[s] @ b.world_inertia(s) @ b.spin[s]
        for s in b.live
    )


def run(world, duration):
    while world.time < duration - 1e-9:
        world.step()


def act(world):
    """What the effects of a scene with drag do before the engine's step, and nothing of that step."""
    for _, part in takewhile(lambda named: named[0] != "motions into the engine", world.parts):
        part()


def collide(world):
    """The engine's part of a step, the bodies' flight and their cubes; nothing of effects or the guard."""
    names = [name for name, _ in world.parts]
    for _, part in world.parts[names.index("motions into the engine") : names.index("reading back") + 1]:
        part()
    world.bodies.locate()


def put(world, slot, position, axes=None, velocity=(0, 0, 0), spin=(0, 0, 0)):
    b = world.bodies
    b.position[slot], b.velocity[slot], b.spin[slot] = position, velocity, spin
    b.orientation[slot] = [0, 0, 0, 1] if axes is None else quaternion_of(np.asarray(axes, float))
    world.engine.put(slot)
    b.locate()


def events_of(world):
    """A list that gets (sizes before, sizes after) of every join and break from now on."""
    seen = []
    world.listeners.append(lambda e: seen.append(([len(s) for s in e.before], [len(s) for s in e.after])))
    return seen
