"""The kernels compiled once, before several workers of the test runner would each compile them."""

from kinetics import Network, sample_path, simulate, solve
from kinetics.sampling import SAMPLING_METHODS
from kinetics.solving import SOLVING_METHODS


def compile_kernels() -> None:
    """Ask every method for a small network; what is compiled is cached on disk, where the workers find it."""
    reactions = {"there": ({"A": 1}, {"B": 1}), "back": ({"B": 1}, {"A": 1})}
    network = Network.from_reactions(reactions, [1.0, 1.0])
    for method in SAMPLING_METHODS:
        simulate(network, method(), {"A": 3}, [0.0, 1.0], runs=64, threads=1)
    for method in SOLVING_METHODS:
        solve(network, method(), {"A": 3}, [0.0, 1.0])
    sample_path(network, {"A": 3}, 1.0)
