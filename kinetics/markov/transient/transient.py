"""The transient solution of dp/dt = p Q over all reachable states, by uniformisation, with a bound on its error."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from kinetics.markov.transient.base import ListingMethod, ProbabilityTable
from kinetics.markov.transient.collocation import Collocation, CollocationPlan
from kinetics.markov.transient.dense import CERTIFIED, MAX_DENSE, Dense
from kinetics.markov.transient.search import MAX_STATES
from kinetics.markov.transient.states import StateSpace
from kinetics.markov.transient.transitions import Transitions
from kinetics.markov.transient.uniformisation import BLOCK, BLOCK_BYTES, MAX_STEPS, DiscreteChain, mixtures
from kinetics.support.arrays import Floats
from kinetics.support.cli.progress import forecast, limit_in_words
from kinetics.support.memory import check_memory
from kinetics.support.tables import rough

if TYPE_CHECKING:
    from scipy.sparse import csr_array

MANY_STEPS = 200_000  # up to here the proven bound of uniformisation stays small
DENSE_SECONDS = 2e-8  # of the dense method, for the cube of the number of states, on a common machine
PROOF_SECONDS = 5e-8  # likewise, with its proof


@dataclass(frozen=True)
class Transient(ListingMethod):
    """The transient solution over all reachable states by uniformisation, without sampling or truncation of states.

    tolerance : largest probability that uniformisation may leave out at any time
    max_states : networks with more reachable states are refused
    max_seconds : work roughly estimated to take longer is refused before it starts

    Source: Jensen (1953), doi:10.1080/03461238.1953.10419459; weights after Fox & Glynn (1988),
    doi:10.1145/42404.42409. Cost: about (largest exit rate) * (last time) steps over all transitions, for any number of
    times. Choose it wherever all reachable states fit into memory. If it would take more than 200 000 steps, chains
    of up to 500 states are solved by `Dense`, with a proven error, and larger ones by whichever of uniformisation,
    `Collocation` and up to 2000 states `Dense`, whose error is an estimate there, is forecast to be quickest. It is an
    estimate too where a rate law cannot be bounded.

    >>> from kinetics import Network, Transient, solve
    >>> decay = Network.from_text("A -> 0, 0.1")
    >>> found = solve(decay, Transient(), {"A": 100}, [0.0, 10.0])
    >>> found.mean().round(6).tolist(), found.error < 1e-12, found.is_bound
    ([[100.0], [36.787944]], True, True)
    """

    name: ClassVar[str] = "transient"
    least_tolerance: ClassVar[float | None] = 1e-18  # below, the error is rounding anyway

    tolerance: float = 1e-13
    max_states: int = MAX_STATES
    max_seconds: float = 7200.0

    def probabilities(
        self, transitions: Transitions, start: Floats, grid: Floats, space: StateSpace | None = None
    ) -> ProbabilityTable:
        """Probabilities of all states, by one pass of steps for all times."""
        n = transitions.size
        # the answer, and the vectors that are mixed
        advice = "ask for fewer times, or start from smaller counts"
        check_memory(
            f"{n} states at {grid.size} times", 8.0 * n * grid.size + min(8.0 * n * BLOCK, BLOCK_BYTES), advice
        )
        chain = DiscreteChain.of(transitions)
        steps, seconds, other = self._forecast(transitions, chain, float(grid[-1]))
        if other:
            return other.probabilities(transitions, start, grid, space)
        if steps > MAX_STEPS:
            raise ValueError(
                f"the chain is too stiff for uniformisation: {steps:.3g} steps until {grid[-1]:g}, at most "
                f"{MAX_STEPS}, and its {n} states are too many for collocation and the dense method; ask for earlier "
                f"times, start from smaller counts, or sample with the direct method"
            )
        if seconds > self.max_seconds:
            raise ValueError(
                f"{n} states would take {steps:.3g} steps until {grid[-1]:g}, up to {seconds:.3g} s; "
                f"{limit_in_words(self.max_seconds)}; raise it, ask for earlier times, "
                f"start from smaller counts, or sample with the direct method"
            )
        forecast(seconds, f"{rough(steps)} steps over {n} states")
        found, _, error = mixtures(chain, start, grid, self.tolerance)
        return ProbabilityTable(found, error, transitions.is_certified)

    def forecast(self, transitions: Transitions, last: float) -> tuple[float, bool]:
        """Processor time that `probabilities` is forecast to take until the time `last`, s, and whether it will prove.

        inf if it would refuse. Cost: linear in the transitions, but for a stiff chain, whose elimination is planned.
        """
        steps, seconds, other = self._forecast(transitions, DiscreteChain.of(transitions), last)
        if other is None and (steps > MAX_STEPS or seconds > self.max_seconds):
            return np.inf, False
        return seconds, transitions.is_certified and not (isinstance(other, Dense) and transitions.size > CERTIFIED)

    def _forecast(
        self, transitions: Transitions, chain: DiscreteChain, last: float
    ) -> tuple[float, float, ListingMethod | None]:
        """Steps of uniformisation, seconds of what will be done, and the method that does it instead, if one does."""
        events = chain.rate * last
        steps = chain.steps_until(last, self.tolerance) if events < np.inf else np.inf
        seconds = steps * chain.step_seconds
        if steps <= MANY_STEPS:
            return steps, seconds, None
        found, other = self._quicker(transitions.generator(), last, seconds if steps <= MAX_STEPS else np.inf)
        return steps, found if other else seconds, other

    def _quicker(self, generator: csr_array, last: float, seconds: float) -> tuple[float, ListingMethod | None]:
        """The quickest method for many steps, and what it is forecast to take; none if uniformisation's `seconds` is
        less.
        """
        n = generator.shape[0]
        if n <= CERTIFIED:
            return PROOF_SECONDS * n**3, Dense()
        others: list[tuple[float, ListingMethod]] = [(DENSE_SECONDS * n**3, Dense())] if n <= MAX_DENSE else []
        tolerance = max(self.tolerance, Collocation.least_tolerance or 0.0)
        with suppress(ValueError):  # too stiff, or too large to factorise
            plan = CollocationPlan.of(generator, last, tolerance, min(self.max_seconds, seconds))
            others.append((plan.seconds, Collocation(tolerance, self.max_states, self.max_seconds)))
        quickest, other = min(others, key=lambda each: each[0], default=(np.inf, None))
        return (quickest, other) if quickest < seconds else (seconds, None)
