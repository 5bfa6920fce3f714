"""Answers from every state of a chain at once, each with its bounds: one pass backwards, or one linear system.

`Chain` answers from its start alone, and follows only the states that this reaches. What a filter asks, and a question
inside a condition, needs the answer from every state: the vector that the same solvers go through on the way
(Baier et al. 2003, doi:10.1109/TSE.2003.1205180). Errors of a vector are bounded state by state, because all of these
operators are positive.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from kinetics.markov.chain import EQUATIONS, Chain, Target, impulse_reward, reward_asked
from kinetics.markov.passage.backward import BACKWARD_LOST, steps_until, uniformised
from kinetics.markov.passage.certified import BoundedSolution
from kinetics.markov.passage.stationary import stationary_of
from kinetics.markov.passage.until import UNDERFLOW, Mask, Solved, rate_reward
from kinetics.markov.transient import Transitions
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.transitions import totals
from kinetics.markov.transient_means import BACKWARD, MANY_STEPS, mean_at, one_time
from kinetics.support.answer import Answer, kind_of
from kinetics.support.arrays import Floats
from kinetics.support.tables import counted

FEW = 300  # states from each of which a stiff chain is followed on its own


class StateAnswers(NamedTuple):
    """The answers from N states: values (N,) and bounds (N,) as of `Answer`, all of one kind; inf if there is no mean.

    >>> from kinetics import Chain
    >>> from kinetics.markov.by_state import until_by_state
    >>> found = until_by_state(Chain([[0, 1, 3], [0, 0, 0], [0, 0, 0]], 0), [False, True, False])
    >>> found.value.tolist(), found.is_bound
    ([0.25, 1.0, 0.0], True)
    """

    value: Floats
    low: Floats
    high: Floats
    is_bound: bool
    method: str = ""
    cpu_seconds: float = 0.0

    @classmethod
    def within(cls, found: BoundedSolution, is_bound: bool, most: float = np.inf) -> StateAnswers:
        """Values of at least 0 and at most `most`, with bounds from their errors."""
        value = np.minimum(found.values, most)
        with np.errstate(invalid="ignore"):
            low, high = np.maximum(value - 1.001 * found.errors, 0.0), np.minimum(value + 1.001 * found.errors, most)
        return cls(value, np.where(np.isinf(value), value, low), np.where(np.isinf(value), value, high), is_bound)

    @property
    def solution(self) -> BoundedSolution:
        """The values, and how far their bounds reach."""
        return BoundedSolution(self.value, np.maximum(self.high - self.value, self.value - self.low))

    def mean(self, start: Floats) -> Answer:
        """The mean over a start (N,)."""
        held = np.flatnonzero(start)
        value, low, high = (float(start[held] @ each[held]) for each in (self.value, self.low, self.high))
        why = counted(start.size, "state")
        found = Answer(value, low, high, kind_of(self.is_bound), self.method, self.cpu_seconds, why)
        return found if held.size == 1 else found.inflated(ROUNDOFF * (held.size + 1))


def until_by_state(
    chain: Chain, target: Target, through: Target | None = None, by: float | None = None, after: float = 0.0
) -> StateAnswers:
    """The answers of `Chain.until` from every state."""
    goal = chain.states(target)
    ways = np.ones(len(chain), dtype=bool) if through is None else chain.states(through, "through")
    stops = chain.transitions.stopped

    def reached(goals: Mask) -> StateAnswers:
        if by is None:
            later = _ever(chain.transitions, ways, goals)
            within = _before(chain, ways, after, later) if after else later
            return StateAnswers.within(within, chain.transitions.is_certified, 1.0)
        return _in_time(chain, goals.astype(float), stops(goals | ~ways), ways, after, by)

    return _timed(lambda: _either_way(reached, goal, chain.truncated & ways & ~goal), by)


def always_by_state(chain: Chain, states: Target, by: float | None = None, after: float = 0.0) -> StateAnswers:
    """The answers of `Chain.always` from every state."""
    wanted, every = chain.states(states), np.ones(len(chain), dtype=bool)

    def stays(kept: Mask) -> StateAnswers:
        stopped = chain.transitions.stopped(~kept)
        if by is None:
            later = _ever(chain.transitions, kept, kept & ~stopped.leading_to(~kept))
            within = _before(chain, every, after, later) if after else later
            return StateAnswers.within(within, chain.transitions.is_certified, 1.0)
        return _in_time(chain, kept.astype(float), stopped, every, after, by)

    edge = chain.truncated & wanted
    return _timed(lambda: _either_way(stays, wanted & ~chain.truncated, edge), by)


def steady_by_state(chain: Chain, values: Floats) -> StateAnswers:
    """The means of values (N,), none negative, after infinite time from every state: `Chain.steady_state`."""
    chain.check_complete("a steady state", is_from_start=False)

    def found() -> StateAnswers:
        n, transitions = len(chain), chain.transitions
        rest = stationary_of(transitions, np.full(n, 1.0 / n))
        known, is_closed = np.zeros(n), np.zeros(n, dtype=bool)
        for members, weight in zip(rest.classes, rest.weights, strict=True):
            # of a class that holds such a value throughout, no rounding of probabilities matters
            held = values[members]
            together = float(rest.probabilities[members] @ held) / float(weight)
            known[members], is_closed[members] = held[0] if (held == held[0]).all() else together, True
        wrong = known * (2.0 * rest.error + ROUNDOFF * (n + 8.0)) + n * UNDERFLOW * float(values.sum())
        for members in rest.classes:
            if (values[members] == values[members][0]).all():
                wrong[members] = 0.0
        mean = _ending(transitions.stopped(is_closed), is_closed, BoundedSolution(known, wrong))
        return StateAnswers.within(mean, transitions.is_certified, float(values.max(initial=0.0)))

    return _timed(found, None)


def reward_by_state(
    chain: Chain,
    name: str | None = None,
    at: float | None = None,
    up_to: float | None = None,
    until: Target | None = None,
    stationary: bool = False,
) -> StateAnswers:
    """The answers of `Chain.reward` from every state; inf where no finite mean exists."""
    given, n = reward_asked(chain, name, at, up_to, until, stationary), len(chain)
    chain.check_complete("a reward from every state", is_from_start=False)
    transitions, is_bound = chain.transitions, chain.transitions.is_certified

    def wider(found: BoundedSolution, relative: float, is_bound: bool = is_bound) -> StateAnswers:
        more = relative * np.where(np.isinf(found.values), 0.0, found.values)
        return StateAnswers.within(found._replace(errors=found.errors + more), is_bound)

    if at is not None:
        begun, now = BoundedSolution(np.asarray(given.rates), np.zeros(n)), one_time("at", at)
        if _is_stiff(transitions, now):
            each = _each(chain, begun.values, transitions, now)
            return wider(each.solution, given.error, each.is_bound)._replace(method=each.method)
        return _timed(lambda: wider(_back(transitions, begun, now), given.error), now)
    rates, rounded = rate_reward(transitions, np.asarray(given.rates), impulse_reward(chain, given))
    rounded += given.error
    if up_to is not None and up_to < np.inf:
        end = one_time("up_to", up_to)
        begun = BoundedSolution(rates, np.zeros(n))
        return _timed(lambda: wider(_back(transitions, begun, end, integrates=True), rounded), end)
    if stationary:
        return wider(steady_by_state(chain, rates).solution, rounded)
    never = ~transitions.leading_to(rates > 0.0)
    goal = never if until is None else chain.states(until)
    return _timed(lambda: wider(_until_there(transitions, rates, goal), rounded), None)


def next_by_state(chain: Chain, states: Target) -> StateAnswers:
    """The probability that the next jump leads to given states, from every state; one without jumps is its own next."""
    goal, transitions = chain.states(states), chain.transitions
    began, hits = time.process_time(), goal[transitions.columns]
    n, exits = len(chain), totals(transitions.rows, transitions.rates, len(chain))
    into, moves = totals(transitions.rows[hits], transitions.rates[hits], n), exits > 0.0
    missed = totals(transitions.rows[~hits], transitions.rates[~hits], n) > 0.0
    is_sure = moves & ~missed
    value = np.where(moves, np.divide(into, exits, out=np.zeros(n), where=moves), goal.astype(float))
    value[is_sure] = 1.0
    terms = 2.0 * (transitions.roundings + np.bincount(transitions.rows, minlength=n)) + 2.0
    errors = np.where(moves & ~is_sure & (into > 0.0), 1.01 * ROUNDOFF * terms * value, 0.0)
    found = StateAnswers.within(BoundedSolution(value, errors), transitions.is_certified, 1.0)
    low, high = np.where(chain.truncated, 0.0, found.low), np.where(chain.truncated, 1.0, found.high)
    seconds = time.process_time() - began
    return found._replace(
        value=np.where(chain.truncated, 0.0, value), low=low, high=high, method="next jump", cpu_seconds=seconds
    )


def _timed(found: Callable[[], StateAnswers], by: float | None) -> StateAnswers:
    began = time.process_time()
    answers = found()
    method = answers.method or (EQUATIONS if by is None else BACKWARD)
    return answers._replace(method=method, cpu_seconds=time.process_time() - began)


def _either_way(question: Callable[[Mask], StateAnswers], certain: Mask, unsure: Mask) -> StateAnswers:
    """The answers for the certain states, with upper bounds for the unsure ones as well."""
    low = question(certain)
    return low._replace(high=question(certain | unsure).high) if unsure.any() else low


def _ever(transitions: Transitions, ways: Mask, goal: Mask) -> BoundedSolution:
    """The probability of reaching a goal (N,) through given states (N,) at some time, from every state."""
    chain = transitions.stopped(goal | ~ways)
    coreachable = chain.leading_to(goal)
    found = _ending(chain, goal | ~coreachable, BoundedSolution(goal.astype(float), np.zeros(goal.size)))
    is_sure = ~chain.leading_to(~coreachable)  # none of the states that miss the goal can be reached: exactly 1
    values, errors = np.where(is_sure, 1.0, found.values), np.where(is_sure, 0.0, found.errors)
    return BoundedSolution(values, errors)


def _ending(chain: Transitions, ends: Mask, known: BoundedSolution) -> BoundedSolution:
    """The mean of what is `known` where a chain ends, from every state; from each some end is reached."""
    transient, n = ~ends, ends.size
    if not transient.any():
        return known
    start = np.full(n, 1.0 / n)
    solved = Solved.of(chain, start, transient, known.values, np.zeros(n))
    values, errors = solved.solution
    values = np.minimum(values, known.values.max())  # a mean is at most the largest, which rounding may miss
    wrong = np.where(transient, errors + UNDERFLOW, known.errors)
    if known.errors.any():
        passed = Solved.of(chain, start, transient, known.errors, np.zeros(n)).solution
        wrong = wrong + np.where(transient, passed.values + passed.errors, 0.0)
    return BoundedSolution(values, wrong)


def _until_there(transitions: Transitions, rates: Floats, goal: Mask) -> BoundedSolution:
    """The mean of a reward until a goal (N,), from every state; inf where that is not certain to be reached."""
    chain, n = transitions.stopped(goal), goal.size
    is_sure = ~chain.leading_to(~chain.leading_to(goal))
    transient = is_sure & ~goal
    values, errors = np.where(is_sure, 0.0, np.inf), np.zeros(n)
    if transient.any():
        solved = Solved.of(chain, np.full(n, 1.0 / n), transient, np.zeros(n), rates)
        values[transient], errors[transient] = (each[transient] for each in solved.solution)
    return BoundedSolution(values, errors)


def _in_time(chain: Chain, held: Floats, stopped: Transitions, ways: Mask, after: float, by: float) -> StateAnswers:
    """The probability of `held` (N,) at a time of the stopped chain, after a first phase in which `ways` are kept."""
    begins, ends = one_time("after", after), one_time("by", by)
    if ends < begins:
        raise ValueError(f"a target after {begins:g} tu also needs a time by which, no earlier; by = {by}")
    length, is_bound = ends - begins, chain.transitions.is_certified
    slip = 0.0 if Fraction(ends) - Fraction(begins) == Fraction(length) else 2.0 * ROUNDOFF * length
    if _is_stiff(stopped, length):
        each = _each(chain, held, stopped, length)
        later, is_bound = each.solution, each.is_bound
    else:
        later = _back(stopped, BoundedSolution(held, np.zeros(held.size)), length)
    if slip:
        later = later._replace(errors=later.errors + 2.0 * slip * float(stopped.exits.max(initial=0.0)))
    found = _before(chain, ways, after, later) if after else later
    # what is settled at once is exact, in whatever time
    at_once = (stopped.exits == 0.0) & (after == 0.0)
    never = ~stopped.leading_to(held > 0.0) & (after == 0.0)
    values = np.where(at_once, held, np.where(never, 0.0, found.values))
    return StateAnswers.within(BoundedSolution(values, np.where(at_once | never, 0.0, found.errors)), is_bound, 1.0)


def _before(chain: Chain, ways: Mask, length: float, later: BoundedSolution) -> BoundedSolution:
    """What is known (N,) of a time from which on it counts, as it is seen `length` tu before, if `ways` are kept."""
    stopped = chain.transitions.stopped(~ways)
    if _is_stiff(stopped, length):
        raise ValueError(f"the chain is too stiff for an interval that begins after {length:g} tu, from every state")
    return _back(stopped, BoundedSolution(*(np.where(ways, each, 0.0) for each in later)), one_time("after", length))


def _back(chain: Transitions, later: BoundedSolution, length: float, integrates: bool = False) -> BoundedSolution:
    """The mean of values (N,) at a time, or of their integral until then, from every state, errors included."""
    found = []
    for vector in later if later.errors.any() else (later.values,):
        scale = float(vector.max(initial=0.0)) or 1.0
        (means,), relative = uniformised(chain, vector / scale, [length], is_backwards=True, integrates=integrates)
        missed = BACKWARD_LOST * (length if integrates else 1.0)
        found.append(scale * np.array([means, (relative + 4.0 * ROUNDOFF) * means + missed]))
    (values, errors), *more = found
    return BoundedSolution(values, errors + sum(each.sum(axis=0) for each in more))


def _is_stiff(chain: Transitions, length: float) -> bool:
    return steps_until(chain, length) > MANY_STEPS


def _each(chain: Chain, values: Floats, stopped: Transitions, length: float) -> StateAnswers:
    """The mean of values (N,) at a time from one state after the other, for few states."""
    n = len(chain)
    if n > FEW:
        raise ValueError(
            f"the chain is too stiff for answers from every state: {steps_until(stopped, length):.3g} steps until "
            f"{length:g} tu, at most {MANY_STEPS:.3g} for more than {FEW} states ({counted(n, 'state')}); ask for an "
            f"earlier time"
        )
    found = [mean_at(stopped, np.eye(1, n, row)[0], values, length) for row in range(n)]
    value, low, high = np.array([(each.value, each.low, each.high) for each in found]).T
    return StateAnswers(value, low, high, all(each.is_bound for each in found), found[0].method)


def from_each(chain: Chain, rows: Mask, value: Callable[[Chain], Answer]) -> StateAnswers:
    """The answers from some states (N,), each asked on its own; nan elsewhere. The cost is that of so many answers."""
    found = np.full((3, len(chain)), np.nan)
    own = {name: mask for name, mask in chain.built_in.items() if name not in chain.variables}
    fixed = replace(chain, labels={**own, **chain.labels})  # "init" stays where the chain starts
    answers = {int(row): value(replace(fixed, initial=int(row))) for row in np.flatnonzero(rows)}
    for row, each in answers.items():
        found[:, row] = each.value, each.low, each.high
    seconds = float(sum(each.cpu_seconds for each in answers.values()))
    method, is_bound = next(iter(answers.values())).method, all(each.is_bound for each in answers.values())
    return StateAnswers(found[0], found[1], found[2], is_bound, method, seconds)
