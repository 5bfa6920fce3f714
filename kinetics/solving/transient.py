"""The transient solution of dp/dt = p Q over all reachable states, by uniformisation, with a bound on its error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kinetics.solving.base import ListingMethod, ProbabilityTable
from kinetics.solving.dense import MAX_DENSE, Dense
from kinetics.solving.states import MAX_STATES, StateSpace
from kinetics.solving.transitions import Transitions
from kinetics.solving.uniformisation import BLOCK, BLOCK_BYTES, MAX_STEPS, DiscreteChain, mixtures
from kinetics.support.arrays import Floats
from kinetics.support.memory import check_memory

MANY_STEPS = 200_000  # up to here the proven bound of uniformisation stays small


@dataclass(frozen=True)
class Transient(ListingMethod):
    """The transient solution over all reachable states by uniformisation, without sampling or truncation of states.

    tolerance : largest probability that uniformisation may leave out at any time
    max_states : networks with more reachable states are refused
    max_seconds : work roughly estimated to take longer is refused before it starts

    Source: Jensen (1953), doi:10.1080/03461238.1953.10419459; weights after Fox & Glynn (1988),
    doi:10.1145/42404.42409. Cost: about (largest exit rate) * (last time) steps over all transitions, for any number of
    times. Choose it wherever all reachable states fit into memory. Where it would take more than 200 000 steps, chains
    of up to 2000 states are solved by `Dense`, whose error is proven up to 500 states and an estimate above. Where
    rates come from rate laws, whose own rounding is not known, the error is an estimate.
    """

    name: ClassVar[str] = "exact"
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
        advice = "ask for fewer times, or start from fewer copies"
        check_memory(
            f"{n} states at {grid.size} times", 8.0 * n * grid.size + min(8.0 * n * BLOCK, BLOCK_BYTES), advice
        )
        chain = DiscreteChain.of(transitions.generator())
        events = chain.rate * float(grid[-1])
        steps = chain.steps_until(grid[-1], self.tolerance) if events < np.inf else np.inf
        if steps > MANY_STEPS and n <= MAX_DENSE:
            return Dense().probabilities(transitions, start, grid, space)
        if steps > MAX_STEPS:
            raise ValueError(
                f"the chain is too stiff for uniformisation: {steps:.3g} steps until {grid[-1]:g} tu, at most "
                f"{MAX_STEPS}, and its {n} states are too many for the dense method, at most {MAX_DENSE}; ask for "
                f"earlier times, start from fewer copies, or sample with the direct method"
            )
        seconds = steps * chain.step_seconds
        if seconds > self.max_seconds:
            raise ValueError(
                f"{n} states would take {steps:.3g} steps until {grid[-1]:g} tu, up to {seconds:.3g} s; "
                f"max_seconds = {self.max_seconds:g}; raise it, ask for earlier times, start from fewer copies, or "
                f"sample with the direct method"
            )
        found, _, error = mixtures(chain, start, grid, self.tolerance)
        return ProbabilityTable(found, error, transitions.is_certified)
