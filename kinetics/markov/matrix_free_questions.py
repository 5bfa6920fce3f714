"""The probability of reaching a target by given times on millions of states, of which no chain is listed."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from kinetics.markov.state_enumeration import Condition, held
from kinetics.markov.transient import MatrixFree
from kinetics.markov.transient.packed import FAILED, GOAL, LIVE, Verdicts
from kinetics.network import Model, Network
from kinetics.support.answer import Answer, kind_of
from kinetics.support.arrays import Counts, Ints, some_times
from kinetics.support.tables import counted


def reached_by(
    model: Model | Network,
    target: Condition,
    times: ArrayLike,
    through: Condition | None = None,
    initial: Counts | None = None,
    method: MatrixFree | None = None,
) -> list[Answer]:
    """The probability that a target has been reached by each of `times` (T,), tu, rising: a first-passage time's cdf.

    target, through : conditions on counts as text, or functions of states (n, S) with truths (n,); a run that is
        neither in the target nor in `through` has failed. None: all states may be passed
    initial : counts at time 0 that go before the model's; None for these
    method : with its tolerance, by which the bounds differ at most, but for rounding; None for `MatrixFree()`
    ValueError: what `MatrixFree` refuses

    Nothing happens any more in the states of the target, and what reaches them is counted; lost probability may have
    reached it or not (Munsky & Khammash 2006, doi:10.1063/1.2145882). Cost: that of `MatrixFree`. Choose it where
    `Chain.until` refuses the number of states; that has relative bounds for small probabilities, this absolute ones.

    >>> from kinetics import Network, reached_by
    >>> decay = Network.from_text("A -> B, 0.1")
    >>> answer, = reached_by(decay, "B >= 1", [10.0], initial={"A": 2})  # 1 - exp(-2)
    >>> round(answer.value, 6), answer.high - answer.low < 2e-9, answer.kind
    (0.864665, True, 'proven')
    """
    given, solver, began = Model.of(model, initial), method or MatrixFree(), time.process_time()
    network = given.network
    network.known_rates  # noqa: B018  # fails before any state is judged

    def judge(states: Ints) -> Verdicts:
        verdicts = np.full(len(states), LIVE, dtype=np.int8)
        if through is not None:
            verdicts[~held(through, network, states)] = FAILED
        verdicts[held(target, network, states)] = GOAL
        return verdicts

    windows = solver.followed(network, network.state(given.initial), some_times(times), judge)
    kind = kind_of(bool(np.isfinite(windows.chain.rate_error)))
    seconds, size = time.process_time() - began, counted(windows.most, "state")
    answers = []
    for found in windows.found:
        error = windows.error(found)
        more = error - max(1.0 - float(found.mass.sum()) - found.goal - found.failed, 0.0)  # all but what is lost
        low, high = max(found.goal - more, 0.0), min(found.goal + error, 1.0)
        answers.append(Answer(min(found.goal, 1.0), min(low, 1.0), high, kind, solver.name, why=size))
    return [replace(answer, cpu_seconds=seconds) for answer in answers]
