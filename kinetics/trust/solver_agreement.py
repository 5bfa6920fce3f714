"""Solvers against each other, and each against itself: distributions apart by no more than their stated errors.

Nothing here is left to chance: two proven bounds that contradict each other refute one of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kinetics.markov.transient import SOLVING_METHODS, Distribution, SolvingMethod
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.transient import MANY_STEPS
from kinetics.markov.transient.uniformisation import mixtures
from kinetics.network import Model, Network
from kinetics.support.arrays import Counts, rising_times
from kinetics.support.tables import text_table
from kinetics.trust.verification.conditional import chain_of

TOLERANCE = 1e-13  # of the steps from one time to the next


@dataclass(frozen=True)
class SolverPair:
    """Two answers: the largest distance at any time, summed over states, and the sum of their errors.

    is_bound : whether both errors are proven; otherwise they are compared as estimates
    """

    first: str
    second: str
    distance: float
    allowed: float
    is_bound: bool

    @property
    def agrees(self) -> bool:
        """Whether the distance is within the errors."""
        return self.distance <= self.allowed


@dataclass(frozen=True)
class SolverAgreement:
    """All pairs of answers, and why a solver gave none.

    >>> from kinetics import Dense, Network, Transient
    >>> from kinetics.trust import compare_solvers
    >>> found = compare_solvers(Network.from_text("A -> 0, 1"), {"A": 9}, [1.0], [Transient(), Dense()])
    >>> [(pair.first, pair.second, pair.agrees) for pair in found.pairs], found.refusals
    ([('transient', 'dense', True)], ())
    """

    pairs: tuple[SolverPair, ...]
    refusals: tuple[tuple[str, str], ...]

    @property
    def failures(self) -> tuple[SolverPair, ...]:
        """The pairs that disagree."""
        return tuple(pair for pair in self.pairs if not pair.agrees)

    def __str__(self) -> str:
        rows = [
            (
                pair.first,
                pair.second,
                f"{pair.distance:.1e}",
                f"{pair.allowed:.1e} ({'proven' if pair.is_bound else 'estimate'})",
                "ok" if pair.agrees else "WRONG",
            )
            for pair in self.pairs
        ]
        lines = [text_table(("solver", "against", "apart by", "stated errors", ""), rows)] if rows else []
        return "\n".join([*lines, *(f"{name} gave no answer: {reason}" for name, reason in self.refusals)])

    def to_json(self) -> dict[str, Any]:
        """All pairs and refusals as plain values."""
        return {
            "pairs": [{**asdict(pair), "agrees": pair.agrees} for pair in self.pairs],
            "refusals": dict(self.refusals),
        }


def compare_solvers(
    model: Model | Network, initial: Counts | None, times: ArrayLike, solvers: Sequence[SolvingMethod] | None = None
) -> SolverAgreement:
    """Compare all pairs of `solvers`, all solving methods by default, at `times` (T,), tu.

    initial : counts at time 0 that go before the model's; None for these
    Each is also compared with itself: what it gives at a time, led on by uniformisation, with what it gives at the
    next. A solver that refuses the network is left out with its reason. Cost: that of all solvers, and of
    uniformisation once more.

    >>> from kinetics import Network
    >>> from kinetics.trust import compare_solvers
    >>> found = compare_solvers(Network.from_text("A <-> B, 1, 2"), {"A": 9}, [0.5, 1.0])
    >>> len(found.pairs), found.failures
    (15, ())
    """
    grid, given = rising_times(times), Model.of(model, initial)
    chosen = [_limited(kind) for kind in SOLVING_METHODS] if solvers is None else solvers
    answers: list[tuple[str, Distribution]] = []
    refusals: list[tuple[str, str]] = []
    for solver in chosen:
        try:
            answers.append((solver.name, solver.solve(given.network, given.initial, grid)))
        except ValueError as error:
            refusals.append((solver.name, str(error)))
    if not answers:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in refusals)
        raise ValueError(
            f"no solver supports the network ({reasons}); ask for earlier times or start from smaller counts"
        )
    pairs = [_pair(a, b) for a, b in combinations(answers, 2)]
    return SolverAgreement((*pairs, *(pair for answer in answers for pair in _onward(*answer))), tuple(refusals))


def _limited(kind: Any) -> SolvingMethod:
    """A solver of a family; if its cost rises steeply, for no more states than it is compared at."""
    solver: SolvingMethod = kind() if kind.tried_up_to is None else kind(max_states=kind.tried_up_to)
    return solver


def _pair(first: tuple[str, Distribution], second: tuple[str, Distribution]) -> SolverPair:
    (name, a), (other_name, b) = first, second
    rows = b.space.index_of(a.space.states)
    shared = rows >= 0
    alone = np.ones(len(b.space), dtype=bool)
    alone[rows[shared]] = False
    distances = (
        np.abs(a.probabilities[:, shared] - b.probabilities[:, rows[shared]]).sum(axis=1)
        + a.probabilities[:, ~shared].sum(axis=1)
        + b.probabilities[:, alone].sum(axis=1)
    )
    rounding = ROUNDOFF * 2.0 * (len(a.space) + len(b.space))  # of the sums
    return SolverPair(name, other_name, float(distances.max()), a.error + b.error + rounding, a.is_bound and b.is_bound)


def _onward(name: str, solution: Distribution) -> Iterator[SolverPair]:
    """One step from each time to the next, the worst of them; none if it would take too many."""
    chain, gaps = chain_of(solution.space), np.diff(solution.times)
    if not gaps.size or chain.rate * float(gaps.max()) > MANY_STEPS:
        return
    worst: SolverPair | None = None
    for t, gap in enumerate(gaps.tolist()):
        start = solution.probabilities[t]
        later, _, error = mixtures(chain, start / max(start.sum(), 1.0), [gap], TOLERANCE)
        # What leaves a projection may come back: as much may be missing once more.
        lost = max(float(start.sum() - later[0].sum()), 0.0) if not solution.is_complete else 0.0
        distance = float(np.abs(later[0] - solution.probabilities[t + 1]).sum())
        moved = 4.0 * ROUNDOFF * chain.rate * float(solution.times[-1])  # the difference of two times rounds
        allowed = 2.0 * solution.error + error + lost + moved + ROUNDOFF * 4.0 * len(solution.space)
        pair = SolverPair(name, "itself, from time to time", distance, allowed, solution.is_bound)
        if worst is None or pair.distance / pair.allowed > worst.distance / worst.allowed:
            worst = pair
    if worst is not None:
        yield worst
