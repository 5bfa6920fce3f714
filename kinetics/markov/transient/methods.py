"""The tuple of all solving methods, and `solve`, the master equation by any of them."""

# ruff: noqa: F401, I001 - the imports are the list, in this order

from __future__ import annotations

from numpy.typing import ArrayLike

from kinetics.network import Model, Network
from kinetics.markov.transient.base import SolvingMethod
from kinetics.markov.transient.distribution import Distribution
from kinetics.support.arrays import Counts
from kinetics.support.families import members

from kinetics.markov.transient.transient import Transient
from kinetics.markov.transient.dense import Dense
from kinetics.markov.transient.collocation import Collocation
from kinetics.markov.transient.projection import FiniteStateProjection
from kinetics.markov.transient.matrix_free import MatrixFree

SOLVING_METHODS: tuple[type[SolvingMethod], ...] = members(globals(), SolvingMethod)
BY_NAME = {method.name: method for method in SOLVING_METHODS}


def solve(
    model: Model | Network, method: SolvingMethod | str, initial: Counts | None = None, times: ArrayLike = ()
) -> Distribution:
    """Probability of every state at `times` (T,), tu, without sampling.

    method : one with its settings, or its name: "transient" and the others of `SOLVING_METHODS`
    initial : counts at time 0, as in {"A": 100}, that go before the model's; None for these
    ValueError: no such name, missing rates, or more states or work than the method allows
    TypeError: neither a name nor a solving method

    >>> from kinetics import Network, solve
    >>> binding = Network.from_text("A + B <-> AB, 0.01, 0.1")
    >>> found = solve(binding, "transient", {"A": 20, "B": 10}, [5.0, 500.0])
    >>> found.mean()[:, binding.index("AB")].round(4).tolist()
    [4.6731, 5.9322]
    """
    if not isinstance(method, SolvingMethod | str):
        raise TypeError(f"method = {method!r}; expected a solving method such as Transient(), or its name")
    if isinstance(method, str):
        if method not in BY_NAME:
            raise ValueError(f"unknown solving method {method!r}; they are {', '.join(BY_NAME)}")
        method = BY_NAME[method]()
    given = Model.of(model, initial)
    return method.solve(given.network, given.initial, times)
