"""Methods for comparison: SciPy's action of the matrix exponential, and the rate equation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from kinetics.markov.transient import Distribution, SolvingMethod, reachable
from kinetics.network import Network
from kinetics.sampling.mass_action import mass_action
from kinetics.support.arrays import Floats, Ints, rising_times
from kinetics.support.memory import check_memory
from kinetics.support.packages import integrate, sparse

TOLERANCE = 1e-10  # relative, of the solver of the rate equation


@dataclass(frozen=True)
class ExpmMultiply(SolvingMethod):
    """`scipy.sparse.linalg.expm_multiply` (Al-Mohy & Higham 2011, doi:10.1137/100788860) on all reachable states.

    No bound, no tolerance. For times that begin at 0 and are evenly spaced: those it takes in one go.
    """

    name: ClassVar[str] = "expm_multiply"

    def distribution(self, network: Network, start: Ints, grid: Floats) -> Distribution:
        """Probabilities of all reachable states. What rounding takes below zero is set to zero."""
        if grid.size < 2 or grid[0] != 0 or not np.allclose(np.diff(grid), grid[1]):
            raise ValueError(f"times {grid[:3]}...; expected evenly spaced ones from 0")
        space = reachable(network, start)
        check_memory(f"{len(space)} states at {grid.size} times", 16.0 * len(space) * grid.size, "ask for fewer times")
        certain = np.eye(1, len(space))[0]
        forward = space.generator().T.tocsr()
        found = sparse.linalg.expm_multiply(
            forward, certain, start=0.0, stop=float(grid[-1]), num=grid.size, endpoint=True
        )
        return Distribution(space, grid, np.maximum(found, 0.0), float("nan"), is_bound=False)


def rate_equation(network: Network, initial: ArrayLike, times: ArrayLike) -> Floats:
    """Counts (T, S) at `times`, tu, of the deterministic rate equation: m like reactants react as x**m / m!.

    Exact in the limit of many copies; for few it is off, and says nothing of the spread.
    """
    grid = rising_times(times)
    start = network.state(initial).astype(float)
    coefficients = mass_action(network).coefficients
    needed, changes = network.reactants, network.stoichiometry

    def slope(_: float, x: Floats) -> Floats:
        return np.asarray((coefficients * np.prod(x**needed, axis=1)) @ changes)

    absolute = TOLERANCE * max(1.0, float(start.max()))
    solved = integrate.solve_ivp(
        slope, (0.0, float(grid[-1])), start, "LSODA", t_eval=grid, rtol=TOLERANCE, atol=absolute
    )
    if not solved.success:
        raise ValueError(f"the rate equation could not be solved until {grid[-1]:g} tu: {solved.message}")
    return solved.y.T
