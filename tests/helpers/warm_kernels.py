"""The kernels compiled once, before several workers of the test runner would each compile them."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

SIDE_BY_SIDE = 2  # processes; the methods share few kernels, and more would wait for the slowest


def compile_kernels() -> None:
    """Ask every method for a small network; what is compiled is cached on disk, where the workers find it."""
    from kinetics.markov.transient import SOLVING_METHODS
    from kinetics.sampling import SAMPLING_METHODS

    slowest_first = sorted(SAMPLING_METHODS, key=lambda method: method.name != "leaping")
    with ProcessPoolExecutor(SIDE_BY_SIDE, get_context("spawn")) as pool:
        list(pool.map(_ask, [*slowest_first, *SOLVING_METHODS]))


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
