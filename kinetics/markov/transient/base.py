"""The base of all methods that solve the master equation; to add one, follow the steps in `SolvingMethod`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kinetics.markov.transient.distribution import Distribution
from kinetics.markov.transient.states import StateSpace, reachable
from kinetics.markov.transient.transitions import Transitions
from kinetics.network import Network
from kinetics.support.arrays import Counts, Floats, Ints, real_number, some_times, whole_number
from kinetics.support.memory import check_memory


class SolvingMethod(ABC):
    """A method that computes the probability of every state at given times, without sampling.

    To add a method:

    1. In a file of its own, write a frozen dataclass that inherits from this class. Its fields are its settings, each
       with a default; fields named `tolerance`, `max_states` and `max_seconds` are checked here. Its docstring says
       the source, the cost and when to choose it.
    2. Give it a `name`, which the command line uses, and `least_tolerance` if it has a tolerance.
    3. If it works on the list of all states, inherit from `ListingMethod` and write `probabilities`, from checked
       transitions: it then solves any Markov chain. Else write `distribution`, from a checked state and times. Refuse
       what would take too long or too much memory by a ValueError that says what to do instead.
    4. Return an `error` that covers the truncation and every rounding, those of the rates included. Set
       `is_bound=False` unless that is proven.
    5. Import it in `kinetics.markov.transient.methods`, which adds it to `SOLVING_METHODS`. Command line, hard cases,
       accuracy diagram and the contract in tests/contracts/test_solving.py read that tuple.

    >>> from kinetics.markov.transient import SOLVING_METHODS, Transient
    >>> [method.name for method in SOLVING_METHODS]
    ['transient', 'dense', 'collocation', 'fsp', 'matrix-free']
    >>> Transient(tolerance=2.0)
    Traceback (most recent call last):
        ...
    ValueError: tolerance = 2.0; expected between 1e-18 and 1
    """

    name: ClassVar[str]
    least_tolerance: ClassVar[float | None] = None  # None: the method has no tolerance
    tried_up_to: ClassVar[int | None] = None  # states, for a cost that rises steeply: who compares costs tries no more

    def __post_init__(self) -> None:
        for name in ("tolerance", "max_seconds"):
            if hasattr(self, name):
                real_number(name, getattr(self, name))
        tolerance = getattr(self, "tolerance", None)
        least = self.least_tolerance or 0.0
        if tolerance is not None and not (0 < tolerance < 1 and tolerance >= least):
            raise ValueError(f"tolerance = {tolerance}; expected between {least:.0e} and 1")
        max_seconds = getattr(self, "max_seconds", None)
        if max_seconds is not None and not max_seconds > 0:
            raise ValueError(f"max_seconds = {max_seconds}; expected a time above 0")
        max_states = getattr(self, "max_states", None)
        if max_states is not None:
            whole_number("max_states", max_states, 1)

    def solve(self, network: Network, initial: Counts, times: ArrayLike) -> Distribution:
        """Probability of every state at `times` (T,), tu, rising, starting from the state `initial` (S,) at time 0.

        ValueError: rates are missing, times do not rise, or the states are too many or the time too long to solve for.
        """
        network.known_rates  # noqa: B018  # fails before the states are explored
        grid = some_times(times)
        return self.distribution(network, network.state(initial), grid)

    @abstractmethod
    def distribution(self, network: Network, start: Ints, grid: Floats) -> Distribution:
        """The distribution from a checked state (S,) at checked times (T,), tu; what a solver implements."""


class ProbabilityTable(NamedTuple):
    """Probabilities (T, N), the bound on their error summed over all states at any time, and whether it is proven."""

    probabilities: Floats
    error: float
    is_bound: bool


class ListingMethod(SolvingMethod):
    """A method that works on the list of all states, and so solves any Markov chain, from a network or not.

    max_states : a field of the method; networks with more reachable states are refused

    >>> import numpy as np
    >>> from kinetics.markov.transient import Transient, Transitions
    >>> decay = Transitions(np.array([0]), np.array([1]), np.array([0.1]), leaks=np.zeros(2), rate_error=0.0)
    >>> found = Transient().probabilities(decay, np.array([1.0, 0.0]), np.array([10.0]))
    >>> found.probabilities.round(6).tolist(), found.is_bound
    ([[0.367879, 0.632121]], True)
    """

    max_states: int

    def distribution(self, network: Network, start: Ints, grid: Floats) -> Distribution:
        """Probabilities of all reachable states; `start` is row 0 of the space."""
        space = reachable(network, start, max_states=self.max_states)
        n = len(space)
        # the answer, and a transition a channel while these are listed
        numbers = n * (grid.size + len(network.species) + 6 * len(network.channels))
        advice = "ask for fewer times, or start from smaller counts"
        check_memory(f"{n} states at {grid.size} times", 8.0 * numbers, advice)
        return Distribution(space, grid, *self.probabilities(space.transitions(), np.eye(1, n)[0], grid, space))

    @abstractmethod
    def probabilities(
        self, transitions: Transitions, start: Floats, grid: Floats, space: StateSpace | None = None
    ) -> ProbabilityTable:
        """The solution from a start spread as `start` (N,), at checked times (T,).

        space : states of the network behind the transitions, which may give their rates without rounding; without it,
            the rates are what they are
        """
