"""Questions to a network, answered by its chain: first passage, committors and the stationary distribution."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinetics.markov.chain import Chain
from kinetics.markov.passage.committor import Committor, check_targets
from kinetics.markov.passage.first_passage import Passage
from kinetics.markov.passage.stationary import Stationary
from kinetics.markov.passage.until import Mask
from kinetics.markov.state_enumeration import Condition, held
from kinetics.markov.transient.search import MAX_STATES
from kinetics.network import Model, Network
from kinetics.network.sums import Counted, in_words, summed
from kinetics.support.arrays import Counts, Ints, whole_number


def chain_to(
    model: Model | Network,
    initial: Counts | None,
    species: Counted,
    copies: int,
    max_states: int = MAX_STATES,
    truncate: Condition | int | None = None,
) -> tuple[Chain, Mask]:
    """The chain that stops at `copies` of a species, and the states (N,) in which it does.

    ValueError: unknown species, missing rates, or too many states

    >>> from kinetics import Network
    >>> chain, goal = chain_to(Network.from_text("A -> B, 2"), {"A": 1}, "B", 1)
    >>> chain.counts.tolist(), goal.tolist()
    ([[1, 0], [0, 1]], [False, True])
    """
    given = Model.of(model, initial)
    (weights, _), wanted = summed(given.network, species), whole_number("copies", copies, 0)
    chain = Chain.of(given, stop=lambda states: states @ weights >= wanted, max_states=max_states, truncate=truncate)
    return chain, chain.counts @ weights >= wanted


def first_passage(
    model: Model | Network,
    initial: Counts | None,
    species: Counted,
    copies: int = 1,
    max_states: int = MAX_STATES,
) -> Passage:
    """The first-passage time to at least `copies` of a species.

    initial : counts at time 0 that go before the model's; None for these
    species : one, or a sum of several, as a mapping from species to weight
    max_states : networks with more states before the target are refused
    ValueError: unknown species, missing rates, too many states, or a target so remote that it cannot be solved for

    Mean and variance come from linear equations on the states before the target (Norris 1997, Markov Chains, ch. 3,
    doi:10.1017/CBO9780511810633), the distribution from uniformisation when it is first used. If the chain may miss
    the target for good, the mean is inf and `probability` below 1. Cost: some tens of passes over the rates, or where
    that does not converge the number of states times the square of the band's width; for the distribution one step per
    uniformised event. Choose it where the states can be listed; sample otherwise.

    >>> from kinetics import Network, first_passage
    >>> decay = Network.from_text("A -> B, 0.1")
    >>> found = first_passage(decay, {"A": 3}, "B", copies=2)
    >>> round(found.mean, 6), round(found.sd, 6)  # 10/3 + 10/2, and the root of the sum of squares
    (8.333333, 6.009252)
    """
    given = Model.of(model, initial)
    chain, goal = chain_to(given, None, species, copies, max_states)
    return chain.passage(goal, in_words(summed(given.network, species)[1], copies))


def committor(
    model: Model | Network, initial: Counts | None, targets: Mapping[str, Condition], max_states: int = MAX_STATES
) -> Committor:
    """Committors of `targets`: the probability that each is reached first, from the start and from every state.

    initial : counts at time 0 that go before the model's; None for these
    targets : name -> condition on counts as text, or function of states (n, S) with truths (n,)
    max_states : networks with more reachable states are refused
    ValueError: no targets, a state in two of them, missing rates, or too many states

    The equations of first-step analysis (Norris 1997, doi:10.1017/CBO9780511810633, section 3.3) are solved as
    `equations` chooses, with bounds relative to each figure, so that even a probability of 1e-30 has digits. The cost
    is some tens of passes over the rates for each target, or where that does not converge an elimination, states times
    the square of the band's width. Choose it where the states can be listed, and `rare_event` where they cannot.

    >>> from kinetics import Network, committor
    >>> turnover = Network.from_text("0 <-> A, 1, 1")
    >>> found = committor(turnover, {"A": 1}, {"extinct": "A == 0", "full": "A == 3"})
    >>> found.probabilities.round(9).tolist(), found.error < 1e-12
    ([0.75, 0.25], True)
    """
    check_targets(targets)
    given = Model.of(model, initial)
    chain = Chain.of(given, stop=lambda states: _any(targets, given.network, states), max_states=max_states)
    return chain.committor({name: held(target, given.network, chain.counts) for name, target in targets.items()})


def stationary(model: Model | Network, initial: Counts | None = None, max_states: int = MAX_STATES) -> Stationary:
    """The stationary distribution to which the chain of a model converges.

    initial : counts at time 0 that go before the model's; None for these
    max_states : networks with more reachable states, or infinitely many, are refused
    ValueError: missing rates, too many states, or a spread beyond sparse factors with a band too wide to eliminate

    Each closed class is solved by iteration, as time between visits to a likely state; if it is small or narrow, or
    that proves no error, by elimination without subtractions (Grassmann, Taksar & Heyman 1985,
    doi:10.1287/opre.33.5.1107) or sparse factors. If the chain may end up in several, they are weighted by the
    probability of ending up in each. Cost: some tens of passes over the rates, else of the factors, or the number of
    states times the square of the band's width.

    >>> from kinetics import Network, stationary
    >>> found = stationary(Network.from_text("A <-> B, 2, 3"), {"A": 2})
    >>> found.marginal("B").round(9).tolist(), found.error < 1e-12  # binomial, with probability 0.4
    ([0.36, 0.48, 0.16], True)
    """
    return Chain.of(model, initial, max_states=max_states).stationary()


def _any(targets: Mapping[str, Condition], network: Network, states: Ints) -> Mask:
    """Whether states (n, S) belong to some target (n,)."""
    found = [held(target, network, states) for target in targets.values()]
    return np.asarray(np.logical_or.reduce(found))
