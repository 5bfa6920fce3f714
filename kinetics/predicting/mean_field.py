"""The method `mean-field`: rate equations in place of the means, an approximation without a bound."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from kinetics.network import Network
from kinetics.predicting.job import Job
from kinetics.predicting.rate_equations import RateEquations
from kinetics.support import plots
from kinetics.support.arrays import Floats
from kinetics.support.shown import on_axes
from kinetics.support.tables import in_unit

if TYPE_CHECKING:
    from kinetics.markov.transient import Distribution

APPROXIMATE = "rate equations in place of the means, an approximation without a bound"
MEAN_FIELD = "mean field (approximate)"  # in legends
FEW_STATES, SECONDS = 5000, 2.0  # of the exact solution that it is compared with
MOST_TIMES = 101  # at which they are compared


@dataclass(frozen=True, eq=False)
class MeanFieldSolution:
    """Solution of the rate equations of V species or sums of counts, and the exact one if that is cheap.

    times : (T,) tu, rising
    values : (T, V) counts, real numbers
    exact : the master equation solved, at all times or some of them; None if that was not cheap
    refusal : why it was not; "" if it was
    """

    network: Network
    times: Floats
    values: Floats
    exact: Distribution | None
    refusal: str = ""
    error: ClassVar[float] = float("nan")  # no bound is known
    runs: ClassVar[None] = None
    is_interrupted: ClassVar[bool] = False
    truncated: ClassVar[None] = None
    meaning: ClassVar[str] = APPROXIMATE
    no_interval: ClassVar[str] = "the mean field is that at the posterior mean of each rate constant"
    notes: ClassVar[tuple[str, ...]] = ()

    def mean(self) -> Floats:
        """The counts (T, V) that stand in place of the means."""
        return self.values

    def sd(self) -> Floats:
        """Not known: (T, V) of nan, as rate equations have no noise."""
        return np.full(self.values.shape, np.nan)

    def standard_error(self) -> Floats:
        """Zeros (T, V): it was not sampled."""
        return np.zeros(self.values.shape)

    def away(self) -> tuple[float, str, float] | None:
        """Largest distance from an exact mean, in copies, of which species and at what time; None if not known.

        It is that of the times of `exact`; the sign is that of mean field minus exact mean.
        """
        if self.exact is None:
            return None
        off = self.values[np.isin(self.times, self.exact.times)] - self.exact.mean()
        size = np.abs(off)
        t, s = np.unravel_index(int((size >= size.max() * (1.0 - 1e-9)).argmax()), off.shape)  # ties: the first
        return float(off[t, s]), self.network.species[s], float(self.exact.times[t])

    @property
    def comparison(self) -> str:
        """The distance from the exact mean, in words."""
        away = self.away()
        if away is None:
            return f"not compared with the exact mean: {self.refusal}"
        off, name, at = away
        when = in_unit(f"{at:g}", self.network.time_unit)
        return f"largest difference from the exact mean {off:+.3g} copies, of {name} at {when}"

    @property
    def approximation(self) -> dict[str, Any]:
        """For JSON: what it is, and how far from the exact mean it is."""
        away = self.away()
        off, name, at = (None, None, None) if away is None else away
        found = {"approximation": APPROXIMATE, "difference": off, "species": name, "time": at}
        return found | {"not_compared": self.refusal or None}

    def precision(self, _standard_error: Floats) -> str:
        """The distance from the exact mean, in words."""
        return self.comparison

    def columns(self, _standard_error: Floats) -> dict[str, Floats]:
        """The values (T, V), which tables call a mean field and not a mean."""
        return {"mean_field": self.values}

    def bands(self) -> plots.Bands | None:
        """The exact means and the middle 95 % of runs, at the times of `exact`; None if that was not solved."""
        return None if self.exact is None else self.exact.bands()

    def approximate(self) -> Floats:
        """The values (T, V)."""
        return self.values

    @on_axes
    def plot(self, ax: Any) -> Any:
        """Dotted curves, over the exact means and bands if these are known; returns `ax`."""
        if self.exact is not None:
            self.exact.plot(ax)
        names, unit = self.network.species, self.network.time_unit
        return plots.approximate(ax, self.times, self.values, names, MEAN_FIELD, unit)


@dataclass(frozen=True)
class MeanField:
    """The method that integrates the rate equations, see `RateEquations`: no noise, and no bound on its error.

    max_seconds : of processor time, s, after which it gives up

    It costs milliseconds for any counts. Its values are the exact means if no channel has two reactants and all laws
    are linear; else they are off by about a copy where counts are large, and by anything where they are small or where
    runs go separate ways. If up to 5000 states are reachable and the master equation is solved in about two seconds,
    the result holds that solution too, and says how far off the mean field is.

    >>> from kinetics import Model, Network, predict
    >>> pairs = Model(Network.from_text("A + A -> 0, 0.1"), {"A": 10})
    >>> found = predict(pairs, times=[0.0, 1.0], method="mean-field")
    >>> found.mean[:, 0].round(4).tolist(), found.result.exact.mean()[:, 0].round(4).tolist()  # 10 / (1 + t)
    ([10.0, 5.0], [10.0, 5.2154])
    """

    max_seconds: float = 7200.0
    name: ClassVar[str] = "mean-field"

    def solve(self, job: Job) -> MeanFieldSolution:
        """The solution at the times of a job. ValueError: as of `RateEquations`, or over `max_seconds`."""
        network, start, grid = job.model.network, job.model.initial, job.grid
        equations = RateEquations(network)
        values = np.empty((grid.size, start.size))
        done = int(np.searchsorted(grid, 0.0, side="right"))
        values[:done] = start
        for solver in equations.steps(start, float(grid[-1]), self.max_seconds) if done < grid.size else ():
            upto = int(np.searchsorted(grid, solver.t, side="right"))
            if upto > done:
                values[done:upto] = solver.dense_output()(grid[done:upto]).T
                done = upto
                job.report(f"rate equations at {solver.t:.4g} of {grid[-1]:g}")
        values = np.maximum(values, 0.0)
        exact, refusal = self._exact(job)
        if job.observables is not None:
            values = values @ job.observables.weights
        return MeanFieldSolution(job.shown, grid, values, exact, refusal)

    def _exact(self, job: Job) -> tuple[Distribution | None, str]:
        """The master equation solved at some of the times, or why that is not cheap."""
        from kinetics.markov.transient import Transient

        some = np.unique(np.linspace(0, job.grid.size - 1, min(job.grid.size, MOST_TIMES)).astype(int))
        job.report("comparing with the exact means")
        try:
            method = Transient(max_states=FEW_STATES, max_seconds=SECONDS)
            found = method.solve(job.model.network, job.model.initial, job.grid[some])
        except ValueError as error:
            came = getattr(error, "came", "").split(": ")[0]  # of too many states, without the advice
            return None, came or str(error).split("; ")[0].split(". ")[0]
        return job.distribution(found), ""
