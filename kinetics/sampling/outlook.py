"""How many events a run has still before it, by its rate equations (Kurtz 1970, doi:10.2307/3212147)."""

from __future__ import annotations

import numpy as np

from kinetics.network import Network
from kinetics.sampling.mass_action import mass_action
from kinetics.support.arrays import Floats, Ints
from kinetics.support.packages import integrate, sparse

MOST_SPECIES = 300  # whose equations are integrated; their Jacobian takes as many evaluations of the propensities
MOST_TERMS = 400  # factors of propensities that are multiplied as plain numbers; arrays begin to pay beyond
FEW_STEPS, MOST_STEPS = 150, 2000  # of the integration: as long as it is quick, it goes on for a better answer
LARGEST = 1e30  # times the events in question: so many are too many by any measure
ACCURACY = 1e-3


class Outlook:
    """The propensities of a network at real counts, and its rate equations integrated from there."""

    def __init__(self, network: Network) -> None:
        laws = mass_action(network)
        self.network = network
        self.coefficients = laws.coefficients
        self.species, self.taken = laws.factors[:, :, 0], laws.factors[:, :, 1].astype(float)
        names = {name: r for r, name in enumerate(network.channels)}
        self.laws = [(names[name], network.channel_laws[name].program) for name in network.laws]
        self.terms: list[tuple[float, list[tuple[int, float]]]] | None = None
        if not self.laws and self.taken.size <= MOST_TERMS:
            factors = (zip(*row, strict=True) for row in zip(self.species.tolist(), self.taken.tolist(), strict=True))
            self.terms = list(zip(self.coefficients.tolist(), map(list, factors), strict=True))

    def total(self, counts: Ints, time: float) -> float:
        """Sum of the propensities at counts (S,), 1/tu; inf or nan if it is beyond double."""
        if self.terms is None:
            return float(self.rates(counts[None].astype(float), time).sum())
        copies, total = [*map(float, counts.tolist()), 1.0], 0.0
        for propensity, factors in self.terms:
            for species, taken in factors:
                propensity *= max(copies[species] - taken, 0.0)  # noqa: PLW2901
            total += propensity
        return total

    def rates(self, counts: Floats, time: float) -> Floats:
        """Propensities (n, R) at counts (n, S), 1/tu; inf or nan if they are beyond double."""
        from kinetics.network.laws.program import evaluate

        padded = np.column_stack([counts, np.ones(len(counts))])
        with np.errstate(all="ignore"):
            found: Floats = self.coefficients * np.maximum(padded[:, self.species] - self.taken, 0.0).prod(axis=2)
            for r, program in self.laws:
                found[:, r] = self.network.ways[r] * self.network.known_rates[r] * evaluate(program, counts, time)
        return found

    def largest(self, counts: Ints, time: float) -> tuple[str, float]:
        """The channel with the largest propensity at counts (S,), and that; "" if there is no channel."""
        if not self.network.channels:
            return "", 0.0
        rates = np.nan_to_num(self.rates(counts[None].astype(float), time)[0], nan=np.inf, posinf=np.inf)
        return self.network.channels[int(rates.argmax())], float(rates.max())

    def events(self, counts: Ints, time: float, end: float, most: float) -> float:
        """A lower estimate of the events from counts (S,) at `time` until `end`, tu; nan if the equations give none.

        most : the number of events allowed; integration stops far beyond it
        """
        if counts.size > MOST_SPECIES or self.network.events:
            return np.nan

        table = self.network.sparse_stoichiometry
        gains = sparse.csr_array((table.copies.astype(float), table.columns, table.starts), shape=table.shape).T
        rate = scale = float(self.rates(counts[None].astype(float), time).sum())
        if not 0.0 < scale < np.inf:
            return np.inf if scale > 0.0 else np.nan

        def slope(at: float, x: Floats) -> Floats:  # the clock in events at the rate of the start, so in plain numbers
            return np.asarray(gains @ (self.rates(np.maximum(x[None], 0.0), time + at / scale)[0] / scale))

        events = 0.0
        with np.errstate(all="ignore"):
            try:
                span = (end - time) * scale
                solver = integrate.BDF(slope, 0.0, counts.astype(float), span, rtol=ACCURACY, atol=ACCURACY)
                for step in range(MOST_STEPS):
                    begin, before = solver.t, rate
                    solver.step()
                    rate = float(self.rates(np.maximum(solver.y[None], 0.0), time + solver.t / scale).sum())
                    if solver.status == "failed" or not rate < np.inf:
                        break
                    events += 0.5 * (before + rate) / scale * (solver.t - begin)
                    if solver.status == "finished" or events > (LARGEST if step < FEW_STEPS else 10.0) * most:
                        return events
            except (ArithmeticError, ValueError, np.linalg.LinAlgError):
                pass
        return events if events > 10.0 * most else np.nan  # on the way to where the equations cannot be followed
