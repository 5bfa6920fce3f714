"""Chains that answer questions, followed no further than to where the answer is settled.

Whether a target is reached through given states is settled in the target, and outside these states; a reward
until a target, in the target. A chain that stops there has the same answer and fewer states, perhaps finitely many
if the network is infinite.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.chain import Chain
from kinetics.markov.observing import observing
from kinetics.markov.questions.base import Question, Settled
from kinetics.markov.state_enumeration import Condition, held
from kinetics.markov.transient.search import MAX_STATES, TooManyStatesError
from kinetics.network import Model
from kinetics.network.predicates import DEADLOCK, INIT, state_names
from kinetics.support.arrays import Ints


def answering_chains(
    questions: Sequence[Question],
    model: Model,
    stop: Condition | None = None,
    truncate: Condition | int | None = None,
    max_states: int = MAX_STATES,
) -> Iterator[tuple[Chain, list[int]]]:
    """Chains of a model with its observables, each with the places of the questions that it answers.

    stop, truncate, max_states : as `Chain.of` has them
    All questions have one chain where their answers are settled in the same states, or where all states can be listed;
    else each kind has its own, which is made when the one before has answered.

    >>> from kinetics import Model, Network
    >>> from kinetics.markov.questions import parse
    >>> growth = Model(Network.from_text("0 -> A, 1"))
    >>> questions = [parse(f"P=? [ F<=2 A >= {n} ]") for n in (2, 5)]
    >>> [(len(chain), places) for chain, places in answering_chains(questions, growth, max_states=100)]
    [(3, [0]), (6, [1])]
    """
    # Where a chain starts and cannot go on is known of the whole chain: a state in which it was stopped has no way out.
    whole = [name for name in (INIT, DEADLOCK) if name not in (*model.network.species, *model.observables)]

    def chain_until(settled: Settled | None) -> Chain:
        def stops(states: Ints) -> NDArray[np.bool_]:
            found = np.zeros(len(states), dtype=bool)
            if stop is not None:
                found |= held(stop, model.network, states)
            if settled is not None:
                names = state_names(model, states)
                names.labels = dict.fromkeys(whole, np.zeros(len(states), dtype=bool))  # for errors, which list them
                found |= settled.holds(names)
            return found

        chain = Chain.of(model, stop=stop if settled is None else stops, truncate=truncate, max_states=max_states)
        return observing(chain, model)

    alike: dict[Settled | None, list[int]] = {}
    for place, question in enumerate(questions):
        settled = question.settled
        alike.setdefault(None if settled and settled.names.intersection(whole) else settled, []).append(place)
    if len(alike) != 1:
        try:
            chain = chain_until(None)
        except TooManyStatesError:
            if None in alike or not alike:  # which needs all of them
                raise
        else:
            yield chain, list(range(len(questions)))
            return
    for settled, places in alike.items():
        yield chain_until(settled), places
