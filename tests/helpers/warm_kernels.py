"""The kernels compiled once, before several workers of the test runner would each compile them."""

from concurrent.futures import ProcessPoolExecutor
from importlib.util import find_spec
from multiprocessing import get_context

SIDE_BY_SIDE = 2  # processes; the methods share few kernels, and more would wait for the slowest


def compile_kernels() -> None:
    """Ask every method for a small network, and step every engine; the workers find what is compiled on disk."""
    from kinetics.markov.transient import SOLVING_METHODS
    from kinetics.sampling import SAMPLING_METHODS
    from mechsim.world.engines import ENGINES

    slowest_first = sorted(SAMPLING_METHODS, key=lambda method: method.name not in ("leaping", "general"))
    with ProcessPoolExecutor(SIDE_BY_SIDE, get_context("spawn")) as pool:
        asked = [pool.submit(_ask, method) for method in [*slowest_first, *SOLVING_METHODS]]
        asked += [pool.submit(_step, engine.name) for engine in ENGINES if all(map(find_spec, engine.packages))]
        for each in asked:
            each.result()


def _ask(method: type) -> None:
    from kinetics import Network, simulate, solve
    from kinetics.sampling import SAMPLING_METHODS

    reactions = {"there": ({"A": 1}, {"B": 1}), "back": ({"B": 1}, {"A": 1})}
    network = Network.from_reactions(reactions, [1.0, 1.0])
    if method in SAMPLING_METHODS:
        simulate(network, method(), {"A": 3}, [0.0, 1.0], runs=64, threads=1)
        method().sample_path(network, {"A": 3}, 1.0)
    else:
        solve(network, method(), {"A": 3}, [0.0, 1.0])


def _step(engine: str) -> None:
    from mechsim.runs.record import RunSpec, execute
    from mechsim.scene import Scene

    scene = Scene.load("line4")
    scene = scene.by(engine)
    execute(RunSpec(scene, {"monomer": 10, "dimer": 5, "trimer": 4, "quadmer": 4}, 0.5, seed=0, run=0))
