"""The rate equations of a network: mass action in the limit of infinite size, laws at real counts."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np

from kinetics.network import Network
from kinetics.network.laws.graph import Code
from kinetics.network.laws.program import evaluate, steps_of
from kinetics.sampling.mass_action import mass_action
from kinetics.support.arrays import Floats, Ints
from kinetics.support.packages import integrate, sparse
from kinetics.support.tables import in_unit

TOLERANCE = 1e-9  # of a step: relative, and in copies
LARGEST = 2.0**63  # copies, as for samplers
BELOW = 1e-6  # copies below 0, relative to the largest count but at least 1: more is no error of the integration
STUCK = 100  # steps in a row that do not advance the clock
JUMPS = frozenset(
    (
        *(Code.LESS, Code.LESS_EQUAL, Code.EQUAL, Code.NOT_EQUAL, Code.AND, Code.OR, Code.NOT),
        *(Code.SELECT, Code.FLOOR, Code.CEILING, Code.MODULO),
    )
)


class RateEquations:
    """dx/dt = sum over channels of change * k * N * h(x), at real counts x (S,), in copies per tu.

    h is the leading term of the combinations of reactants: x**m/m! for m like ones that are counted as distinct sets,
    x**m if counted as ordered or as a product. A rate law is evaluated at x, and so is the factor of a crowd. For
    channels of order one or less these are the equations of the exact means; for others they are their limit when
    volume and counts grow at fixed concentrations (Kurtz 1970, doi:10.2307/3212147).

    ValueError: rates are missing; events; a law that jumps, which has no derivative to follow

    >>> from kinetics import Network
    >>> from kinetics.predicting.rate_equations import RateEquations
    >>> RateEquations(Network.from_text("2 A -> AA, 0.1")).slope(0.0, [10.0, 0.0]).tolist()
    [-10.0, 5.0]
    """

    def __init__(self, network: Network) -> None:
        if network.events:
            raise ValueError(
                f"event {network.events[0].name!r} sets counts, which rate equations do not follow; sample the "
                f"network: method 'auto'"
            )
        self.network, bare = network, network.uncrowded
        table = mass_action(bare)
        self.coefficients, self.species = table.coefficients, table.factors[:, :, 0]
        self.laws = [(bare.channel_places[name], steps_of(law, bare.species_places)) for name, law in bare.laws.items()]
        for r, program in self.laws:
            if any(step.code in JUMPS for step in program):
                name = bare.channels[r]
                raise ValueError(
                    f"the law of channel {name!r}, {bare.laws[name]}, jumps; rate equations need a continuous one: "
                    f"sample the network by method 'auto'"
                )
        change = bare.sparse_stoichiometry
        self.gains = sparse.csr_array(
            (change.copies.astype(float), change.columns, change.starts), shape=change.shape
        ).T.tocsr()
        self.reads_time = any(law.reads_time for law in bare.laws.values())

    def rates(self, at: float, x: Floats) -> Floats:
        """Propensities (R,) at counts (S,), 1/tu; not finite if they are undefined or beyond double."""
        counts = np.maximum(x, 0.0)
        with np.errstate(all="ignore"):
            found: Floats = self.coefficients * np.append(counts, 1.0)[self.species].prod(axis=1)
            for r, program in self.laws:
                found[r] = self.network.ways[r] * self.network.known_rates[r] * evaluate(program, counts, at)
        crowding = self.network.crowding
        return found if crowding is None else found * crowding.factors(counts)

    def slope(self, at: float, x: Any) -> Floats:
        """dx/dt (S,) at counts (S,), copies per tu."""
        return np.asarray(self.gains @ self.rates(at, np.asarray(x, dtype=float)))

    def steps(self, start: Ints | Floats, end: float, max_seconds: float) -> Iterator[Any]:
        """Integrate from counts (S,) at time 0 until `end`, tu: the solver of scipy after each of its steps.

        LSODA (Petzold 1983, doi:10.1137/0904010) with tolerance 1e-9, which finds stiffness itself. A ValueError says
        when counts grow without bound or fall below 0, and when more than `max_seconds` of processor time are used.
        Cost: some 30 us an evaluation in small networks; a Jacobian takes S of them.
        """
        began, stuck, least = time.process_time(), 0, end / 100 if self.reads_time else np.inf
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # its failures are told below
            solver = integrate.LSODA(
                self.slope, 0.0, start.astype(float), end, max_step=least, rtol=TOLERANCE, atol=TOLERANCE
            )
            while solver.status == "running":
                before = solver.t
                solver.step()
                stuck = stuck + 1 if solver.t - before <= 4 * np.spacing(before) else 0
                self._check(solver, stuck)
                if time.process_time() - began > max_seconds:
                    at = in_unit(f"{solver.t:.4g}", self.network.time_unit)
                    raise ValueError(f"rate equations are at {at} after {max_seconds:g} s; ask for earlier times")
                yield solver

    def _check(self, solver: Any, stuck: int) -> None:
        """ValueError if the solution has left what counts can be."""
        x, unit = np.asarray(solver.y), self.network.time_unit
        at = in_unit(f"{solver.t:.4g}", unit)
        s = int(np.argmax(np.nan_to_num(x, nan=np.inf)))
        if solver.status == "failed" or stuck > STUCK or not x[s] < LARGEST:
            raise ValueError(
                f"rate equations cannot be followed beyond {at}, where {self.network.species[s]!r} is {x[s]:.3g}: "
                f"counts grow without bound, or a law is undefined; ask for earlier times"
            )
        s = int(np.argmin(x))
        if x[s] < -BELOW * max(1.0, float(x.max())):
            raise ValueError(
                f"rate equations take {self.network.species[s]!r} below 0 at {at}: a law is above 0 without its "
                f"reactants; sample the network by method 'auto'"
            )
