"""`Sensitivity`: what the rates do to the answers of a chain, exactly: all derivatives at once, with bounds."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from kinetics.markov.by_state import next_by_state
from kinetics.markov.chain import Chain, Target, impulse_reward, reward_asked
from kinetics.markov.checks import Reward, square
from kinetics.markov.derivatives import (
    LARGEST_ORDER,
    ChannelEntries,
    Density,
    Derivatives,
    Gradient,
    gradient_accumulated,
    gradient_always,
    gradient_at,
    gradient_by_squaring,
    gradient_moment,
    gradient_next,
    gradient_quantile,
    gradient_sd,
    gradient_steady,
    gradient_until,
    gradient_up_to,
)
from kinetics.markov.derivatives.squaring import MAX_SQUARED
from kinetics.markov.first_phase import FirstPhase
from kinetics.markov.network_questions import chain_to
from kinetics.markov.passage.backward import LOST, uniformised
from kinetics.markov.passage.until import Mask, rate_reward
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.transitions import totals
from kinetics.markov.transient.uniformisation import STEP_SECONDS
from kinetics.markov.transient_means import mean_at, one_time, steps_to, stopped_in
from kinetics.network import Model, Network
from kinetics.network.sums import Counted
from kinetics.support.answer import Answer, kind_of, weakest
from kinetics.support.arrays import Counts, Floats, real_number, whole_number
from kinetics.support.cli.progress import allowed, forecast, limit_in_words
from kinetics.support.tables import rough

ADJOINT, SQUARING = "adjoint uniformisation", "squaring, with its derivative"
EQUATIONS = "linear equations, adjoint"
MAX_SECONDS = 7200.0
FEW_STEPS = 200_000  # up to here a small chain is stepped through, with a proven bound


class Sensitivity:
    """The questions of a `Chain`, answered by the derivatives of its answer by the parameters of its rates.

    chain : of a network, whose parameters are the rate constants of its channels (of a rate law, a factor before it);
        any other, with `parameters`
    parameters : name -> (N, N) sparse: how the rates between states depend on it, d ln(rate) / d ln(parameter); 1
        where a rate is in proportion to it, as with a mask

    By `until` and `reward` at or up to a time: one pass forwards and one backwards, about three times the answer's
    time; for small and stiff chains three times the products of the dense method. Ever, until a target or in the end:
    one elimination and two substitutions, and up to four more where a target is remote. Limits are relative to the
    answer; of `always`, the end, `passage_sd` and higher moments, as much wider as rates fire often before. ValueError:
    a chain from elsewhere without parameters, and what the chain refuses.

    >>> from kinetics import Chain, Network, Sensitivity
    >>> steps = Network.from_text('''first: A -> B, 1
    ... second: B -> C, 4''')
    >>> gradient = Sensitivity(Chain.of(steps, {"A": 1})).passage("C == 1")  # of the mean, 1/1 + 1/4
    >>> dict(zip(gradient.parameters, gradient.value.round(9).tolist())), gradient.elasticity.round(9).tolist()
    ({'first': -1.0, 'second': -0.25}, [-0.8, -0.2])
    """

    def __init__(self, chain: Chain, parameters: Mapping[str, Any] | None = None) -> None:
        chain.check_complete("derivatives")
        transitions, space = chain.transitions, chain.space
        self.chain, self._start = chain, np.asarray(chain.initial)
        self._shares: Floats | None = None
        self._constants: Floats | None = None
        if parameters is None:
            if space is None:
                raise ValueError(
                    "this chain comes from no network, so its rates have no names; give parameters, as in "
                    "{'k': mask}, with the rates (N, N) that are in proportion to each"
                )
            self._names = space.network.channels
            self._constants = np.asarray(space.network.known_rates, dtype=float)
            self._entries = ChannelEntries(transitions, len(space.network.channels))
            return
        if not parameters:
            raise ValueError("no parameters; give at least one, as in {'k': mask}")
        n_entries = transitions.rates.size
        self._names = tuple(parameters)
        tables = [square(f"parameter {name!r}", given, len(chain)) for name, given in parameters.items()]
        self._shares = np.zeros((len(tables), n_entries))
        if n_entries:  # scipy gives no empty row for no places
            self._shares[:] = [each[transitions.rows, transitions.columns] for each in tables]
        self._entries = ChannelEntries(transitions._replace(channels=np.arange(n_entries)), n_entries)

    def until(
        self, target: Target, through: Target | None = None, by: float | None = None, after: float = 0.0
    ) -> Derivatives:
        """Derivatives of the answer of `Chain.until`."""
        goal = self.chain.states(target)
        ways = np.ones(len(goal), dtype=bool) if through is None else self.chain.states(through, "through")
        if after:
            answer = self.chain.until(target, through, by, after=after)
            return self._of_interval(answer, goal, goal | ~ways, ways, (after, by))
        if by is None:
            return self._answer(lambda: gradient_until(self._entries, self._start, ways, goal), EQUATIONS)
        return _probability(self._at(goal[None, :].astype(float), by, stops=goal | ~ways)[0])

    def always(self, states: Target, by: float | None = None, after: float = 0.0) -> Derivatives:
        """Derivatives of the answer of `Chain.always`."""
        kept = self.chain.states(states)
        if after:
            answer = self.chain.always(states, by, after=after)
            return self._of_interval(answer, kept, ~kept, np.ones_like(kept), (after, by))
        if by is None:
            return self._answer(lambda: gradient_always(self._entries, self._start, kept), EQUATIONS)
        return _probability(self._at(kept[None, :].astype(float), by, stops=~kept)[0])

    def steady_state(self, states: Target) -> Derivatives:
        """Derivatives of the answer of `Chain.steady_state`."""
        held = self.chain.states(states).astype(float)
        return _probability(self._answer(lambda: gradient_steady(self._entries, self._start, held), EQUATIONS))

    def next_jump(self, states: Target) -> Derivatives:
        """Derivatives of the answer of `next_by_state` from the start."""
        goal, transitions = self.chain.states(states), self._entries.transitions
        found = next_by_state(self.chain, goal)
        hits, answer = goal[transitions.columns].astype(float), found.mean(self._start)
        return self._answer(lambda: gradient_next(self._entries, self._start, found.value, hits, answer), found.method)

    def passage(self, target: Target) -> Derivatives:
        """Derivatives of the mean first-passage time to a target that is certain."""
        goal = self.chain.states(target)
        ones = np.ones(goal.size)
        return self._answer(lambda: gradient_accumulated(self._entries, self._start, ones, goal), EQUATIONS)

    def passage_moment(self, target: Target, order: int) -> Derivatives:
        """Derivatives of the mean of a power of the first-passage time, tu**order, to a target that is certain."""
        goal, power = self.chain.states(target), whole_number("order", order, 1)
        if power > LARGEST_ORDER:
            raise ValueError(f"order = {power}; moments are known up to {LARGEST_ORDER}")
        return self._answer(lambda: gradient_moment(self._entries, self._start, goal, power), EQUATIONS)

    def passage_sd(self, target: Target) -> Derivatives:
        """Derivatives of the standard deviation of the first-passage time to a target that is certain."""
        goal = self.chain.states(target)

        def gradient() -> Gradient:
            found = self.chain.passage(target)
            sd = Answer.within(found.sd, found.sd_error, found.is_bound)
            return gradient_sd(self._entries, self._start, goal, sd)

        return self._answer(gradient, EQUATIONS)

    def passage_quantile(self, target: Target, q: float) -> Derivatives:
        """Derivatives of the time by which the target has been reached with probability q, as good as that is known.

        ValueError: the target is reached with a smaller probability, or too many steps
        """
        began, goal = time.process_time(), self.chain.states(target)
        if not 0.0 < real_number("q", q) < 1.0:
            raise ValueError(f"q = {q}; expected a probability between 0 and 1")
        found = self.chain.passage(target)
        (low,), (high,) = found.quantile_bounds([q])
        if not np.isfinite(high):
            raise ValueError(
                f"the target is reached with probability {found.probability:.6g} only, so q = {q:g} is never reached; "
                f"ask for a smaller q"
            )
        quantile = Answer(float(found.quantile(q)), float(low), float(high), kind_of(found.is_bound))
        # the smaller of the probabilities of being there and of being on the way is known better
        held, sign = (goal, 1.0) if q <= 0.5 else (~goal, -1.0)
        cdf = self._at(held[None, :].astype(float), quantile.value, stops=goal)[0]
        wide = np.maximum(cdf.high - cdf.value, cdf.value - cdf.low)
        gradient = Gradient(quantile, sign * cdf.value, wide, cdf.is_bound)
        if quantile.value > 0.0:
            gradient = gradient_quantile(gradient, quantile, self._density(goal, quantile.value), self._largest_share)
        return self._derivatives(gradient, cdf.method, time.process_time() - began)

    def _density(self, goal: Mask, at: float) -> Density:
        """The density of the time to a target at a time, tu, with bounds on its change nearby."""
        chain = self.chain.transitions.stopped(goal)
        hits = goal[chain.columns]
        into = totals(chain.rows[hits], chain.rates[hits], goal.size)
        steep = into * chain.exits + totals(chain.rows, chain.rates * into[chain.columns], goal.size)
        space = stopped_in(self.chain.space, goal)
        found, bend = (mean_at(chain, self._start, values, at, space) for values in (into, steep))
        rounded = ROUNDOFF * (chain.roundings + np.bincount(chain.rows, minlength=1).max() + 2.0)
        density = replace(found, kind=weakest(found, bend)).inflated(rounded)
        return Density(density, 1.001 * bend.high, 1.001 * float(into.max()), 1.001 * float(chain.exits.max()))

    @property
    def _largest_share(self) -> float:
        return 1.0 if self._shares is None else float(np.abs(self._shares).max(initial=0.0))

    def reward(
        self,
        name: str | None = None,
        at: float | None = None,
        up_to: float | None = None,
        until: Target | None = None,
        stationary: bool = False,
    ) -> Derivatives:
        """Derivatives of the answer of `Chain.reward`."""
        given = reward_asked(self.chain, name, at, up_to, until, stationary)
        if given.error:
            found = self._of_reward(given, at, up_to, until)
            return replace(found, is_bound=False)  # the effect of rounding in a reward on differences has no bound
        return self._of_reward(given, at, up_to, until)

    def _of_reward(self, given: Reward, at: float | None, up_to: float | None, until: Target | None) -> Derivatives:
        rewards, impulses = np.asarray(given.rates), impulse_reward(self.chain, given)
        if at is not None:
            return self.means(rewards[None, :], at)[0]
        if up_to == np.inf:
            until = self.chain.exhausted(rate_reward(self.chain.transitions, rewards, impulses)[0])
        elif up_to is not None:
            end = one_time("up_to", up_to)
            return self._answer(lambda: gradient_up_to(self._entries, self._start, rewards, end, impulses), ADJOINT)
        if until is not None:
            goal = self.chain.states(until)
            return self._answer(
                lambda: gradient_accumulated(self._entries, self._start, rewards, goal, impulses), EQUATIONS
            )
        return self._answer(lambda: gradient_steady(self._entries, self._start, rewards, impulses), EQUATIONS)

    def means(self, values: Floats, at: float, max_seconds: float | None = None) -> list[Derivatives]:
        """Derivatives of the means of F functions (F, N) of the state, none negative, at a time, tu.

        Cost: one pass forwards for all, and one backwards for each.

        max_seconds : work roughly estimated to take longer is refused before it starts  [default: 7200, or the budget
            of the command at work]
        """
        return self._at(values, at, max_seconds)

    def _of_interval(
        self, answer: Answer, held: Mask, stops: Mask, ways: Mask, interval: tuple[float, float | None]
    ) -> Derivatives:
        """Derivatives of the probability p u that `held` holds at the end of an interval of times.

        p is the distribution at its beginning, u the probability from each state there: two adjoint passes, one each.
        """
        if interval[1] is None:
            raise ValueError("an interval without end has no derivatives here; ask for one up to a time, as in F[2,5]")
        began, chain = time.process_time(), self.chain
        truncated = np.zeros_like(ways)
        first = FirstPhase.of(chain.transitions, self._start, ways, truncated, interval, chain.space)
        stopped = chain.transitions.stopped(stops)
        (later,), wrong = uniformised(stopped, held.astype(float), [first.length], is_backwards=True)
        before = self._at(np.where(ways, later, 0.0)[None, :], interval[0], stops=~ways)[0]
        within = self._at(held[None, :].astype(float), first.length, stops=stops, start=first.start)[0]
        value = before.value + first.share * within.value
        exits, length = float(chain.transitions.exits.max(initial=0.0)), first.length
        missed = self._scores(interval[0], wrong, answer.high) + self._scores(length, first.error, 1.0)
        missed = missed + self._scores(1.0, first.slip * (1.0 + 2.0 * length * exits)) + 2.0 * LOST * before.value.size
        wide = before.high - before.value + first.share * (within.high - within.value) + missed
        wide = 1.001 * wide + 8.0 * ROUNDOFF * (np.abs(before.value) + np.abs(within.value))
        is_bound = answer.is_bound and before.is_bound and within.is_bound
        return self._derivatives(Gradient(answer, value, wide, is_bound), before.method, time.process_time() - began)

    def _scores(self, time: float, error: float, square: float | None = None) -> Floats:
        """Bounds (P,) on the error of each derivative that an error of values between 0 and 1 causes over a time."""
        # A firing changes the mean by at most twice the error. With `square`, the mean square of the values, the
        # Cauchy-Schwarz inequality gives the square root of the mean squared score of a path instead: see `at_a_time`.
        rows, channels = self._entries.transitions.rows, self._entries.channels
        places, inverse = np.unique(channels * len(self.chain) + rows, return_inverse=True)
        fastest = np.zeros(self._entries.n_channels)
        leaving = totals(inverse, self._entries.transitions.rates, places.size)
        np.maximum.at(fastest, places // len(self.chain), leaving)
        found = 2.0 * error * fastest * time
        if square is not None:
            found = np.minimum(found, error * np.sqrt(fastest * time * square))
        return found if self._shares is None else np.asarray(np.abs(self._shares) @ found)

    def _at(
        self,
        values: Floats,
        at: float,
        max_seconds: float | None = None,
        stops: Mask | None = None,
        start: Floats | None = None,
    ) -> list[Derivatives]:
        """Gradients of means at a time, of the stopped chain, from another start (N,) if one is given."""
        end, entries, space = one_time("time", at), self._entries, self.chain.space
        start = self._start if start is None else start
        if stops is not None:
            entries = entries._replace(transitions=entries.transitions.stopped(stops))
            space = stopped_in(space, stops)
        steps = steps_to(entries.transitions, start, values.sum(axis=0), end)
        if len(self.chain) <= MAX_SQUARED and steps > FEW_STEPS:
            return self._answers(lambda: gradient_by_squaring(entries, start, values, end, space), SQUARING)
        seconds = steps * STEP_SECONDS * (entries.transitions.rates.size + len(self.chain)) * (1 + 3 * len(values))
        most = allowed(MAX_SECONDS) if max_seconds is None else max_seconds
        if seconds > most:
            raise ValueError(
                f"derivatives of {len(values)} means would take {steps:.3g} steps until {end:g} tu, up to "
                f"{seconds:.3g} s; {limit_in_words(most)}; raise it, ask for an earlier time, or start from fewer "
                f"copies"
            )
        forecast(seconds, f"derivatives by {rough(steps)} steps over {len(self.chain)} states")
        return self._answers(lambda: gradient_at(entries, start, values, end), ADJOINT)

    def _answer(self, question: Callable[[], Gradient], method: str) -> Derivatives:
        return self._answers(lambda: [question()], method)[0]

    def _answers(self, question: Callable[[], list[Gradient]], method: str) -> list[Derivatives]:
        began = time.process_time()
        found = [self._by_parameter(each) for each in question()]
        seconds = time.process_time() - began
        return [self._derivatives(each, method, seconds) for each in found]

    def _derivatives(self, found: Gradient, method: str, seconds: float) -> Derivatives:
        """A gradient by channels as derivatives by parameters, with bounds."""
        answer, value, wide, is_bound = found
        low, high = value - wide, value + wide
        return Derivatives(self._names, answer, value, low, high, is_bound, self._constants, method, seconds)

    def _by_parameter(self, found: Gradient) -> Gradient:
        if self._shares is None:
            return found
        wide = found.wide + 2.0**-52 * found.value.size * np.abs(found.value)
        return found._replace(value=self._shares @ found.value, wide=np.abs(self._shares) @ wide)


def sensitivity_to(
    model: Model | Network, initial: Counts | None, species: Counted, copies: int = 1
) -> tuple[Sensitivity, Mask]:
    """The sensitivity of a chain that stops at copies of a species, and the states (N,) in which it stops.

    ValueError: unknown species, missing rates, or too many states

    >>> from kinetics import Network
    >>> from kinetics.markov import sensitivity_to
    >>> asked, goal = sensitivity_to(Network.from_text("A -> B, 2"), {"A": 1}, "B")
    >>> goal.tolist(), asked.passage_sd(goal).elasticity.round(9).tolist()
    ([False, True], [-1.0])
    """
    chain, goal = chain_to(model, initial, species, copies)
    return Sensitivity(chain), goal


def _probability(found: Derivatives) -> Derivatives:
    return replace(found, answer=found.answer.clipped())
