"""The exact side of a verification: distributions, conditional expectations, and how rarely two runs are equal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from kinetics.markov.transient import Distribution, SolvingMethod, Transient
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.uniformisation import DiscreteChain
from kinetics.network import Model, Network
from kinetics.support.arrays import Counts, Floats, Ints, rising_times
from kinetics.trust.verification.conditional import Expectations, chain_of, expected_after, transition_matrix
from kinetics.trust.verification.scores import STEP, RateScore, rate_scores

FINE = 32  # times, about, at which runs are compared with each other
MOST_GAPS = 12  # between times, of which all matrices are computed
WINDOW = 6.0  # standard deviations
MOST_RATES = 64  # of which scores are found


@dataclass(frozen=True, eq=False)
class Reference:
    """A network's exact answers at `times`, to which runs of any sampler are compared; each is computed once.

    solution : probabilities (T, N) at the times
    solver : which gave them

    >>> from kinetics import Network
    >>> from kinetics.trust.verification import Reference
    >>> reference = Reference.of(Network.from_text("A -> 0, 0.1"), {"A": 20}, [5.0, 10.0])
    >>> reference.start.tolist(), reference.is_bound, reference.error < 1e-12
    ([20], True, True)
    """

    solution: Distribution
    solver: SolvingMethod

    @classmethod
    def of(
        cls, model: Model | Network, initial: Counts | None, times: ArrayLike, solver: SolvingMethod | None = None
    ) -> Reference:
        """Solve at `times` (T,), tu, by Transient() unless another solver is given."""
        grid = rising_times(times)
        if grid.size and grid[0] == 0.0:
            raise ValueError("times begin at 0, where nothing is left to chance; give times above 0")
        given = Model.of(model, initial)
        chosen = Transient() if solver is None else solver
        return cls(chosen.solve(given.network, given.initial, grid), chosen)

    @property
    def network(self) -> Network:
        """The network that was solved."""
        return self.solution.network

    @property
    def start(self) -> Ints:
        """The initial counts (S,)."""
        return self.solution.space.states[0, :]

    @property
    def error(self) -> float:
        """Error of the probabilities, summed over all states."""
        return self.solution.error

    @cached_property
    def unbounded(self) -> tuple[str, ...]:
        """The channels whose rates have no bound on their errors, as by a rate law of which too little is known."""
        space = self.solution.space
        return tuple(self.network.channels[r] for r in np.flatnonzero(np.isinf(space.rate_errors)))

    @property
    def is_bound(self) -> bool:
        """Whether the errors are proven: that of the probabilities, and of all that follows from the rates."""
        return self.solution.is_bound and not self.unbounded

    @cached_property
    def states(self) -> Floats:
        """Counts (N, S) of all states."""
        return self.solution.space.states.astype(float)

    @cached_property
    def tops(self) -> Floats:
        """Largest count (S,) of each species, at least 1."""
        return np.asarray(self.states.max(axis=0, initial=1.0))

    @cached_property
    def gaps(self) -> Floats:
        """Times (T,) from each time, and from 0, to the next."""
        return np.diff(self.solution.times, prepend=0.0)

    @cached_property
    def parts(self) -> int:
        """Into how many parts the fine times cut each gap."""
        return max(1, FINE // self.gaps.size)

    @cached_property
    def fine_times(self) -> Floats:
        """Times (T * parts,) that hold those of the solution."""
        times = self.solution.times
        shares = np.arange(1, self.parts + 1) / self.parts
        grid = (times - self.gaps)[:, None] + self.gaps[:, None] * shares
        grid[:, -1] = times
        return grid.ravel()

    @cached_property
    def chain(self) -> DiscreteChain:
        """The uniformised chain of all states."""
        return chain_of(self.solution.space)

    @cached_property
    def shares(self) -> tuple[Floats, ...]:
        """Counts (N, S) of all states at each time as shares, 0 to 1, of a window about the mean, where most runs are.

        Counts beyond are cut off, so that bounds which know the range of a function are not weakened by counts that
        never occur.
        """
        mean, sd = self.solution.mean(), self.solution.sd()
        low = np.where(sd > 0.0, np.maximum(mean - WINDOW * sd, 0.0), 0.0)
        high = np.where(sd > 0.0, np.minimum(mean + WINDOW * sd, self.tops), self.tops)
        return tuple(np.clip((self.states - a) / (b - a), 0.0, 1.0) for a, b in zip(low, high, strict=True))

    @cached_property
    def conditional_moments(self) -> tuple[Expectations | None, ...]:
        """From each time to the next, by the state before: means (N, S) of the shares then, of their squares (N, S),
        and the probability (N, 1) to stay inside, side by side; None if it would take too long.
        """
        ones = np.ones((len(self.states), 1))
        return tuple(self._after(t, np.hstack([shares, shares**2, ones])) for t, shares in enumerate(self.shares[1:]))

    def _after(self, t: int, functions: Floats) -> Expectations | None:
        matrix = self.matrices[t]
        if matrix is not None:
            return Expectations(matrix.values @ functions, matrix.error + 2.0 * ROUNDOFF * len(functions))
        found = expected_after(self.chain, functions, float(self.gaps[t + 1]))
        return None if found is None else found._replace(error=found.error + self._of_the_times)

    @property
    def _of_the_times(self) -> float:
        """Bound on the effect of rounding in a difference of times."""
        return 4.0 * ROUNDOFF * self.chain.rate * float(self.solution.times[-1])

    @cached_property
    def matrices(self) -> tuple[Expectations | None, ...]:
        """Transition probabilities (N, N) from each time to the next; None if they are not computed."""
        return tuple(self._matrices(self.gaps[1:]))

    @cached_property
    def fine_matrices(self) -> tuple[Expectations | None, ...]:
        """Transition probabilities (N, N) to each fine time from the one before, or from 0."""
        return tuple(matrix for matrix in self._matrices(self.gaps / self.parts) for _ in range(self.parts))

    def _matrices(self, gaps: Iterable[float]) -> list[Expectations | None]:
        if not self.solution.is_complete:
            return [None for _ in gaps]
        made: dict[float, Expectations | None] = {}
        for gap in map(float, gaps):
            if gap not in made:
                matrix = transition_matrix(self.chain, gap) if len(made) < MOST_GAPS else None
                made[gap] = None if matrix is None else matrix._replace(error=matrix.error + self._of_the_times)
        return [made[float(gap)] for gap in gaps]

    @cached_property
    def repeat_at_times(self) -> float:
        """Bound on the probability that two independent runs agree at all times of the solution."""
        squares = self.solution.probabilities**2
        seldom = float(squares.sum(axis=1).min()) + 2.0 * self.error  # they agree at the time when they least do
        return min(seldom, self._repeat(self.matrices, squares[0], self.error))

    @cached_property
    def repeat_at_fine_times(self) -> float:
        """Bound on the probability that two independent runs agree at all fine times."""
        return min(self.repeat_at_times, self._repeat(self.fine_matrices, np.eye(1, len(self.states))[0], 0.0))

    def _repeat(self, steps: Sequence[Expectations | None], squares: Floats, error: float) -> float:
        together = np.ones(len(self.states))
        for step in reversed(steps):
            if step is None:
                return 1.0
            together = step.values**2 @ together
            error += step.error
        return float(squares @ together) * (1.0 + 1e-9) + 3.0 * error

    @cached_property
    def scores(self) -> tuple[RateScore, ...]:
        """Scores of all rate constants; none for more than 64 channels, or under rate laws."""
        network, constants = self.network, self.network.known_rates
        if len(constants) > MOST_RATES or network.laws:
            return ()
        raised = (network.with_rates(constants * (1.0 + STEP * row)) for row in np.eye(len(constants)))
        changed = [self.solver.solve(one, self.start, self.solution.times) for one in raised]
        return tuple(rate_scores(self.solution, changed, self.matrices, self.gaps))
