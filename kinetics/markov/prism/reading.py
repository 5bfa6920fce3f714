"""`read_prism`: a model in PRISM's language as a chain."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.chain import Chain
from kinetics.markov.checks import Reward
from kinetics.markov.prism.exploration import Explored, explored
from kinetics.markov.prism.moves import ROUNDING, rates_of
from kinetics.markov.prism.parsing import model_text
from kinetics.markov.prism.resolving import system_of
from kinetics.markov.prism.starting import start_of
from kinetics.markov.prism.system import RewardTerm, System
from kinetics.markov.prism.terms import BOOL, Term
from kinetics.markov.prism.tokens import ModelTextError
from kinetics.markov.prism.values import values_of
from kinetics.markov.transient.search import MAX_STATES
from kinetics.markov.transient.transitions import Transitions, totals
from kinetics.network.predicates import DEADLOCK, INIT
from kinetics.support.arrays import Floats, whole_number
from kinetics.support.limits import text_in
from kinetics.support.packages import sparse

Mask = NDArray[np.bool_]
MOST_BYTES = 2**24  # of the text of a model
PIECE = 2**18  # states at a time


def read_prism(path: str | Path, constants: Mapping[str, Any] | None = None, max_states: int = MAX_STATES) -> Chain:
    """The chain of a model (ctmc) in PRISM's language, a file that usually ends in .sm or .prism.

    constants : values of those that have none in the text, by name: numbers, or truths for those of the type bool
    max_states : a model that reaches more is refused

    Its variables, labels and rewards are those of the model. Variables of the type bool count 0 or 1, and are labels
    too. A reward without a name is r1, r2, ... by its place. The chain starts in one state. A state without transitions
    has the label "deadlock"; nothing is added to it. Decimal numbers are the doubles nearest to them, and rounding in
    rates is bounded. Cost: linear in states times commands; 100,000 states of a dozen commands take a second or two.
    Source: https://www.prismmodelchecker.org/manual/ThePRISMLanguage
    ValueError: what is no such model, with line and column; more states than `max_states`

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from kinetics.markov import ask, read_prism
    >>> with TemporaryDirectory() as folder:
    ...     _ = Path(folder, "pump.sm").write_text('''ctmc
    ... const double wear;
    ... module pump
    ...   up : bool init true;
    ...   [] up -> wear : (up'=false);
    ...   [] !up -> 2 : (up'=true);
    ... endmodule''')
    ...     pump = read_prism(f"{folder}/pump.sm", {"wear": 0.1})
    >>> round(ask(pump, "S=? [ !up ]").value, 6)
    0.047619
    """
    file, most = Path(path), whole_number("max_states", max_states, 1)
    text = text_in(file, MOST_BYTES)
    try:
        system = system_of(model_text(text), constants or {})
        return _chain(system, explored(system, start_of(system), most))
    except ModelTextError as error:
        raise ValueError(f"{file}, {error}") from None


def _chain(system: System, found: Explored) -> Chain:
    n, moves = len(found.states), found.rows != found.columns
    transitions = Transitions(
        found.rows[moves], found.columns[moves], found.rates[moves], np.zeros(n), rate_error=found.roundings
    )
    leads_on = np.zeros(n, dtype=bool)
    leads_on[found.rows] = True  # perhaps to itself: that is no deadlock
    labels = {name: _mask(system, term, found) for name, term in system.labels.items()}
    truths = [place for place, kind in enumerate(system.kinds) if kind == BOOL]
    labels |= {system.names[place]: found.states[:, place].astype(bool) for place in truths}
    built_in = {INIT: np.arange(n) == 0, DEADLOCK: ~leads_on}
    labels |= {name: mask for name, mask in built_in.items() if name not in system.names}
    rewards = {name: _reward(system, parts, found) for name, parts in system.rewards.items()}
    return Chain(transitions, 0, labels, rewards, system.names, found.states)


def _mask(system: System, term: Term, found: Explored) -> Mask:
    """The states (N,) in which a condition holds."""
    pieces = (found.states[k : k + PIECE] for k in range(0, len(found.states), PIECE))
    return np.concatenate(
        [np.broadcast_to(values_of(term, system.states(piece)), (len(piece),)).astype(bool) for piece in pieces]
    )


def _reward(system: System, parts: tuple[RewardTerm, ...], found: Explored) -> Reward:
    """Rates of states, and impulses of transitions: of several between two states, their mean by rates.

    What a transition from a state to itself brings is a rate of the state.
    """
    n = len(found.states)
    rates, impulses, roundings = np.zeros(n), np.zeros(found.rows.size), 0.0
    numbers = {action.name: number for number, action in enumerate(system.actions)}
    has_impulses = False
    for part in parts:
        values, lost = _where(system, part, found)
        roundings = max(roundings, lost)
        if part.action is None:
            rates += values
        else:
            has_impulses = True
            impulses += np.where(found.actions == numbers[part.action], values[found.rows], 0.0)
    stays = found.rows == found.columns
    rates += totals(found.rows[stays], impulses[stays] * found.rates[stays], n)
    # every sum and product is of numbers that are not negative: each rounds once, and so do the rates of the mean
    terms = len(parts) + 4 + int(np.bincount(found.rows, minlength=n).max(initial=0))
    error = 1.01 * (roundings + terms + 2 * found.roundings) * ROUNDING
    return Reward(rates, _means(found, impulses) if has_impulses else None, error=error)


def _where(system: System, part: RewardTerm, found: Explored) -> tuple[Floats, float]:
    """Values (N,) of a reward, 0 in states where its guard does not hold; bound on their rounding, in 2**-53.

    The value of a reward of an action is asked for only where the action happens.
    """
    holds = _mask(system, part.guard, found)
    if part.action is not None:
        numbers = [number for number, action in enumerate(system.actions) if action.name == part.action]
        happens = np.zeros(len(found.states), dtype=bool)
        happens[found.rows[np.isin(found.actions, numbers)]] = True
        holds &= happens
    values, worst = np.zeros(len(found.states)), 0.0
    for rows in np.array_split(np.flatnonzero(holds), 1 + len(found.states) // PIECE):
        if rows.size:
            values[rows], lost = rates_of(part.value, system.states(found.states[rows]), "a reward")
            worst = max(worst, lost)
    return values, worst


def _means(found: Explored, impulses: Floats) -> Any:
    """Impulses (N, N) of jumps; of several transitions between two states the mean, weighted by their rates."""
    moves, n = found.rows != found.columns, len(found.states)
    ends = found.rows[moves] * n + found.columns[moves]
    pairs, which = np.unique(ends, return_inverse=True)
    rates, values = found.rates[moves], impulses[moves]
    means = totals(which, rates * values, pairs.size) / totals(which, rates, pairs.size)
    least, most = np.full(pairs.size, np.inf), np.zeros(pairs.size)
    np.minimum.at(least, which, values)
    np.maximum.at(most, which, values)
    means = np.where(least == most, most, means)  # alike: nothing is rounded
    return sparse.csr_array((means, (pairs // n, pairs % n)), shape=(n, n))
