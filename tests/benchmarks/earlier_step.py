"""The mechanics step of release 0.1.0, in a process of its own, for `bench_engines --against FOLDER`.

    python tests/benchmarks/earlier_step.py FOLDER SCENE     # FOLDER: its tree; SCENE: a scene file that it can read

It reads a line at a time: bodies by name, as JSON, for a new tank past its first steps; or a number of steps to make.
It answers each with a line: the CPU time of a step, us.
"""

import json
import sys
import time
from importlib import import_module

import numpy as np

sys.path.insert(0, sys.argv[1])

book_of = import_module("mechsim.record").book_of  # by name: of the tree that was asked for, not of this one
Scene = import_module("mechsim.scene").Scene
World = import_module("mechsim.world").World

WARM_UP = 300  # steps


def main() -> None:
    """Answer until the input ends."""
    scene = Scene.load(sys.argv[2])
    book, derivation = book_of(scene.rules)
    world = None
    for line in sys.stdin:
        asked = json.loads(line)
        if isinstance(asked, dict):
            start = [derivation.structures[name] for name, n in asked.items() for _ in range(n)]
            if world is not None:
                world.__exit__(None, None, None)
            world = World(scene, book, sum(map(len, start)), np.random.SeedSequence(1))
            world.populate(start)
        steps = WARM_UP if isinstance(asked, dict) else asked
        begin = time.process_time()
        for _ in range(steps):
            world.step()
        print((time.process_time() - begin) / steps * 1e6, flush=True)


if __name__ == "__main__":
    main()
