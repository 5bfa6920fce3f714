"""The master equation dp/dt = p Q, solved for the probability of every state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from kinetics.arrays import Floats, read_only, rising_times
from kinetics.methods.uniformisation import EPSILON, MAX_STEPS, DiscreteChain, mixtures
from kinetics.network import Network
from kinetics.states import MAX_STATES, StateSpace, reachable

if TYPE_CHECKING:
    import pandas as pd
    from scipy.sparse import csr_array

MAX_BYTES = 4 * 2**30  # of probabilities in one distribution
MAX_DENSE = 1000  # states up to which a stiff chain still goes to the matrix exponential
DENSE_TRUST = 1e-6  # a matrix exponential whose estimated error is larger than this is not handed out


@dataclass(frozen=True, eq=False)
class Distribution:
    """Probability of every reachable state at each time.

    times : (T,) tu
    probabilities : (T, N), none negative
    error : bound on (uniformisation) or estimate of (matrix exponential) the summed absolute error at any time
    """

    space: StateSpace
    times: Floats
    probabilities: Floats
    error: float

    def __post_init__(self) -> None:
        expected = (self.times.size, len(self.space))
        if self.probabilities.shape != expected:
            raise ValueError(f"probabilities have shape {self.probabilities.shape}; expected {expected}")
        read_only(self.probabilities)

    @property
    def network(self) -> Network:
        """The network whose states these are."""
        return self.space.network

    def mean(self) -> Floats:
        """Mean counts (T, S)."""
        return self.probabilities @ self.space.states

    def sd(self) -> Floats:
        """Standard deviations (T, S) of the counts."""
        columns = zip(self.space.states.T, self.mean().T, strict=True)
        # About the mean: the difference of two large squares would lose the small variances.
        variances = [((x - mean[:, None]) ** 2 * self.probabilities).sum(axis=1) for x, mean in columns]
        return np.sqrt(np.stack(variances, axis=1))

    def marginal(self, species: str) -> Floats:
        """Probabilities (T, M + 1) of 0, 1, ..., M copies of one species."""
        copies = self.space.states[:, self.network.index(species)]
        table = np.zeros((self.times.size, int(copies.max()) + 1))
        for row, weights in zip(table, self.probabilities, strict=True):
            row[:] = np.bincount(copies, weights, minlength=row.size)
        return table

    def probability(self, state: ArrayLike) -> Floats:
        """Probability (T,) of one state; 0 for a state that cannot be reached."""
        row = int(self.space.index_of(self.network.state(state)))
        return self.probabilities[:, row] if row >= 0 else np.zeros(self.times.size)

    def quantile(self, q: float) -> Floats:
        """Smallest counts (T, S) with at least probability q at or below them."""
        if not 0 <= q <= 1:
            raise ValueError(f"q = {q}; expected a probability")
        columns = []
        for species in self.network.species:
            below = np.cumsum(self.marginal(species), axis=1)
            columns.append((below < q - self.error - EPSILON).sum(axis=1))
        return np.minimum(np.stack(columns, axis=1), self.space.states.max(axis=0)).astype(float)

    def to_dataframe(self) -> pd.DataFrame:
        """One row a time and species: mean and standard deviation of the counts."""
        import pandas as pd

        names = self.network.species
        return pd.DataFrame(
            {
                "time": np.repeat(self.times, len(names)),
                "species": list(names) * self.times.size,
                "mean": self.mean().ravel(),
                "sd": self.sd().ravel(),
            }
        )

    def plot(self, ax: Any) -> Any:
        """Means with the band that holds the middle 95 %; returns `ax`."""
        from kinetics import plots

        low, high = self.quantile(0.025), self.quantile(0.975)
        return plots.bands(ax, self.times, self.mean(), low, high, self.network.species)


@dataclass(frozen=True)
class Transient:
    """Exact transient solution over all reachable states; no sampling, no truncated states.

    tolerance : largest probability that uniformisation may leave out at a time
    dense_below : with fewer states than this, scipy's matrix exponential; else uniformisation by sparse steps
    max_states : more reachable states are refused

    Uniformisation makes about (largest exit rate) * (last time) steps. Where that is too many the matrix exponential
    takes over, up to 1000 states, and says by `error` how far it can be trusted.
    """

    name: ClassVar[str] = "exact"

    tolerance: float = 1e-13
    dense_below: int = 100
    max_states: int = MAX_STATES

    def __post_init__(self) -> None:
        if not EPSILON / 1000 <= self.tolerance < 1:
            raise ValueError(f"tolerance = {self.tolerance}; expected between {EPSILON / 1000:.0e} and 1")

    def solve(self, network: Network, initial: ArrayLike, times: ArrayLike) -> Distribution:
        """Probabilities of all states at `times`, tu, rising, starting from one state at time 0."""
        network.known_rates  # noqa: B018  # fails early, before the states are explored
        grid = rising_times(times)
        if not grid.size:
            raise ValueError("times is empty; give at least one time")
        space = reachable(network, initial, max_states=self.max_states)
        if grid.size * len(space) * 8 > MAX_BYTES:
            raise ValueError(
                f"{len(space)} states at {grid.size} times need over {MAX_BYTES / 2**30:.0f} GB; ask for fewer times"
            )
        generator = space.generator()
        start = np.zeros(len(space))
        start[0] = 1.0
        chain = DiscreteChain.of(generator)
        steps = chain.steps_until(grid[-1], self.tolerance)
        if len(space) < self.dense_below or (steps > MAX_STEPS and len(space) <= MAX_DENSE):
            return Distribution(space, grid, *_by_matrix_exponential(generator, start, grid))
        if steps > MAX_STEPS:
            raise ValueError(
                f"the chain is too stiff for uniformisation: {steps:.3g} steps until {grid[-1]:g} tu, at most "
                f"{MAX_STEPS}; ask for earlier times, start from fewer copies, or sample with the direct method"
            )
        error = self.tolerance + chain.rounding(steps)
        return Distribution(space, grid, mixtures(chain, start, grid, self.tolerance), error)


def _by_matrix_exponential(generator: csr_array, start: Floats, times: Floats) -> tuple[Floats, float]:
    """Probabilities (T, N) from time to time, and the estimate of their error."""
    from scipy.linalg import expm

    Q = generator.toarray()
    size = np.abs(Q).sum(axis=1).max()
    rows, error, steps = [], 0.0, {}
    vector, now = start, 0.0
    for time in times:
        gap = float(time - now)
        if gap not in steps:
            steps[gap] = expm(Q * gap)
        vector, now = np.maximum(vector @ steps[gap], 0.0), time
        # Squaring carries rounding on in proportion to |Q| t: on stiff chains the mass drifts by just that.
        error = EPSILON * (len(start) + size * time) + abs(vector.sum() - 1.0)
        rows.append(vector)
    if not error <= DENSE_TRUST:  # nan included
        raise ValueError(
            f"the chain is too stiff: rates up to {size / 2:.3g} 1/tu over {times[-1]:g} tu leave an error of about "
            f"{error:.1g}; ask for earlier times or lower the fastest rates"
        )
    return np.array(rows), float(error)
