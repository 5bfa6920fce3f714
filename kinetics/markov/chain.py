"""`Chain`: a Markov chain in continuous time as one object, and questions to it with bounds."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kinetics.markov.chain_distribution import ChainDistribution
from kinetics.markov.checks import Reward, built_in, checked_parts, states_of
from kinetics.markov.first_phase import FirstPhase
from kinetics.markov.passage.backward import expected_integral
from kinetics.markov.passage.committor import Committor, check_targets, committor_of
from kinetics.markov.passage.first_passage import Passage
from kinetics.markov.passage.moments import passage_to
from kinetics.markov.passage.stationary import Stationary, stationary_of, steady_mean
from kinetics.markov.passage.until import InfiniteMeanError, Mask, accumulated_until, always, rate_reward, until
from kinetics.markov.rewards import named_reward, truncation_bounds
from kinetics.markov.state_enumeration import Condition, enumerated
from kinetics.markov.transient import ListingMethod, StateSpace, Transient, Transitions
from kinetics.markov.transient.search import MAX_STATES
from kinetics.markov.transient_means import BACKWARD, mean_at, one_time, stopped_in
from kinetics.network import Model, Network
from kinetics.network.predicates import StateNames
from kinetics.support.answer import Answer, weakest
from kinetics.support.arrays import Counts, Floats, some_times
from kinetics.support.frozen import set_fields
from kinetics.support.tables import counted

Target = str | ArrayLike  # a condition on counts and labels as text, or truths (N,)
EQUATIONS = "linear equations"


@dataclass(frozen=True, eq=False)
class Chain:
    """A Markov chain on N states in continuous time.

    transitions : (N, N) sparse or dense, 1/tu: rates from row to column off the diagonal, exact as given; if the
        diagonal holds anything, rows must sum to zero. Also `Transitions`, which the chain has in any case
    initial : (N,) probabilities at time 0, or the number of one state
    labels : name -> truths (N,), or a condition as text
    rewards : name -> `Reward`; rates (N,) alone, or a formula in counts as text, for one without impulses
    variables, counts : V names, and their values (N, V) in every state, for conditions such as "A >= 1 and B == 0"
    truncated : states at the edge of a part of a larger chain: entered truly, but what happens from there is not known.
        The bounds hold for any behaviour outside, and `value` counts nothing of it
    space : the states of the network behind the chain, if there is one

    Targets are conditions as text, labels by name, or truths (N,). Methods return an `Answer`, whose bounds are proven
    unless it says otherwise; small probabilities come with a relative error. `dataclasses.replace` gives a chain with
    other labels, rewards or variables. ValueError: what is no chain, label, reward or target, or a question without a
    finite answer.

    >>> from kinetics import Chain
    >>> pump = Chain([[0.0, 0.1], [2.0, 0.0]], initial=0, labels={"down": [False, True]})
    >>> round(pump.steady_state("down").value, 6), round(pump.until("down", by=10.0).value, 6)  # 1/21, 1 - 1/e
    (0.047619, 0.632121)
    """

    transitions: Any
    initial: Any
    labels: Mapping[str, Any] = field(default_factory=dict)
    rewards: Mapping[str, Any] = field(default_factory=dict)
    variables: Sequence[str] = ()
    counts: Any = None
    truncated: Any = None
    space: StateSpace | None = None

    def __post_init__(self) -> None:
        set_fields(self, **checked_parts(vars(self)))

    @classmethod
    def of(
        cls,
        model: Model | Network,
        initial: Counts | None = None,
        labels: Mapping[str, Target] | None = None,
        rewards: Mapping[str, Reward | ArrayLike | str] | None = None,
        stop: Condition | None = None,
        max_states: int = MAX_STATES,
        truncate: Condition | int | None = None,
    ) -> Chain:
        """The chain of a model; its variables are the species, its first state is where it starts.

        initial : counts at time 0 that go before the model's; None for these
        stop : condition in which the chain stops, as text or as a function of states (n, S) with truths (n,); what
            lies beyond is not explored, so that the others may be finitely many
        truncate : condition of the states that are kept, likewise, or their least number, those that the fewest
            events lead to; states beyond are `truncated`
        ValueError: more states than `max_states` can be reached

        >>> from kinetics import Chain, Network
        >>> births = Network.from_text("0 <-> A, 5, 1")
        >>> chain = Chain.of(births, {"A": 0}, truncate="A < 40", labels={"many": "A >= 12"})
        >>> answer = chain.until("many", by=10.0)
        >>> round(answer.value, 6), answer.high - answer.low < 1e-9  # the states beyond 39 are negligible
        (0.155954, True)
        """
        given = Model.of(model, initial)
        space, truncated = enumerated(given.network, given.initial, stop, truncate, max_states)
        named = labels or {}, rewards or {}, given.network.species, space.states
        return cls(space.transitions(), 0, *named, truncated, space)

    def __len__(self) -> int:
        return int(self.transitions.size)

    def __repr__(self) -> str:
        labels, rewards = (", ".join(names) or "none" for names in (self.labels, self.rewards))
        edge = f", truncated in {int(self.truncated.sum())}" if self.truncated.any() else ""
        rates = self.transitions.rates.size
        return f"<Chain: {len(self)} states{edge}, {rates} rates; labels {labels}; rewards {rewards}>"

    @property
    def built_in(self) -> dict[str, Mask]:
        """The labels that conditions may use on every chain: where it starts, and where no rate leads on.

        Labels and variables of the same names go before them.
        """
        return built_in(self.transitions, self.initial, self.truncated)

    def truncated_before(self, stops: Mask) -> Mask:
        """The truncated states (N,) that a run may enter before any in which it stops (N,): all that it may lose.

        Where there are none, the answer for these stops is that of the whole chain, with bounds on both sides.
        """
        edge = np.asarray(self.truncated & ~stops)
        if not edge.any():
            return edge
        return np.asarray(edge & self.transitions.stopped(stops).reached_from(self.initial > 0))

    def check_complete(self, question: str, is_from_start: bool = True) -> None:
        """A ValueError if the chain is truncated, in states that are reached from the start or in any."""
        nowhere = np.zeros(len(self), dtype=bool)
        if (self.truncated_before(nowhere) if is_from_start else self.truncated).any():
            raise ValueError(
                f"{question} needs the whole state space, and this chain is truncated: enumerate all states, or ask "
                f"for a probability, a committor, a passage time or a reward"
            )

    def states(self, target: Target, what: str = "target", labels: Mapping[str, Mask] | None = None) -> Mask:
        """The states (N,) of a target: those in which a condition holds, which may name more `labels`."""
        taken = (*self.labels, *self.variables)
        labels = {**self.labels, **built_in(self.transitions, self.initial, self.truncated, taken), **(labels or {})}
        return states_of(StateNames(len(self), self.variables, self.counts, labels), target, what)

    def transient(self, times: ArrayLike, method: ListingMethod | None = None) -> ChainDistribution:
        """Probabilities of all states at `times` (T,), tu, rising, by a solving method (by default `Transient`)."""
        self.check_complete("the distribution")
        began, grid = time.process_time(), some_times(times)
        chosen = method or Transient()
        found = chosen.probabilities(*self._begun, grid, self.space)
        return ChainDistribution(grid, *found, chosen.name, time.process_time() - began)

    def until(
        self,
        target: Target,
        through: Target | None = None,
        by: float | None = None,
        method: ListingMethod | None = None,
        after: float = 0.0,
    ) -> Answer:
        """Probability of reaching the target on the way through given states alone (by default any), by a time or ever.

        by : tu; None for ever, by linear equations, solved by iteration, elimination or sparse LU
        after : the target counts from this time on, tu, and the way must not be left before; the error is then absolute
        method : a solving method for the pass, forwards; by default it is backwards, with a relative error, or by
            `Transient` where that would take too many steps
        """
        goal = self.states(target)
        ways = np.ones(len(self), dtype=bool) if through is None else self.states(through, "through")
        first = self._first_phase(ways, after, by, method) if after else None

        def reached(goals: Mask) -> Answer:
            if by is None:
                return self._ever(lambda start: until(self.transitions, start, ways, goals).found, first)
            return self._by(goals, goals | ~ways, by, method, first)

        return self._either_way(reached, goal, self.truncated & ways & ~goal)

    def always(
        self, states: Target, by: float | None = None, method: ListingMethod | None = None, after: float = 0.0
    ) -> Answer:
        """Probability of being in the states all the time, from `after` on, tu, until a time or ever."""
        wanted = self.states(states)
        first = self._first_phase(np.ones(len(self), dtype=bool), after, by, method) if after else None

        def stays(kept: Mask) -> Answer:
            if by is None:
                return self._ever(lambda start: always(self.transitions, start, kept).found, first)
            return self._by(kept, ~kept, by, method, first)

        return self._either_way(stays, wanted & ~self.truncated, self.truncated & wanted)

    def reward(
        self,
        name: str | None = None,
        at: float | None = None,
        up_to: float | None = None,
        until: Target | None = None,
        stationary: bool = False,
    ) -> Answer:
        """Mean of a reward: its rate `at` a time or in the steady state, its total `up_to` a time or `until` a target.

        up_to : tu; inf for the total of all time
        name : of the reward; of a variable, for its value; None for the only one
        ValueError: not one of the four is asked for; or the target may never be reached, so that there is no finite
            mean

        >>> from kinetics import Chain, Network
        >>> chain = Chain.of(Network.from_text("A <-> B, 2, 3"), {"A": 1}, rewards={"heat": "10 * A"})
        >>> round(chain.reward("heat", until="B == 1").value, 9), round(chain.reward("heat", stationary=True).value, 9)
        (5.0, 6.0)
        """
        given, edge = reward_asked(self, name, at, up_to, until, stationary), self.truncated
        if at is not None:
            now, rates = one_time("at", at), np.asarray(given.rates)
            by_values = lambda values: mean_at(*self._begun, values, now, self.space).inflated(given.error)  # noqa: E731
            return truncation_bounds(by_values, rates, edge, given.most)
        rates, rounded = rate_reward(self.transitions, np.asarray(given.rates), impulse_reward(self, given))
        rounded += given.error
        if up_to == np.inf:
            return self.reward(name, until=self.exhausted(rates))
        if up_to is not None:
            end = one_time("up_to", up_to)

            def total(values: Floats) -> Answer:
                return self._answer(lambda: expected_integral(*self._begun, values, end).inflated(rounded), BACKWARD)

            return truncation_bounds(total, rates, edge, given.most)
        if until is not None:
            goal = self.states(until)
            unsure = self.truncated_before(goal)
            asked = (*self._begun, rates, goal | unsure)
            found = self._answer(lambda: accumulated_until(*asked).found.inflated(rounded), EQUATIONS)
            return replace(found, high=np.inf) if unsure.any() else found
        return self._answer(lambda: steady_mean(self.stationary(), rates).inflated(rounded), EQUATIONS)

    def exhausted(self, rates: Floats) -> Mask:
        """The states (N,) from which none with a reward rate (N,) above 0 is reached any more.

        ValueError: the chain may go on for ever without coming to one, so that the total reward is infinite
        """
        later = self.transitions.leading_to((rates > 0.0) | self.truncated)
        if not self.transitions.leading_to(~later | self.truncated)[
            self.transitions.reached_from(self.initial > 0)
        ].all():
            raise InfiniteMeanError(
                "the total reward is infinite, because it never ends; ask for it up to a time, C<=t"
            )
        return np.asarray(~later)

    def steady_state(self, states: Target) -> Answer:
        """Probability of the states after infinite time."""
        held = self.states(states).astype(float)
        return self._answer(lambda: steady_mean(self.stationary(), held).clipped(), EQUATIONS)

    def stationary(self) -> Stationary:
        """The stationary distribution, with a relative error bound for every state."""
        self.check_complete("a steady state")
        return replace(stationary_of(*self._begun), space=self.space)

    def passage(self, target: Target, name: str = "") -> Passage:
        """The first-passage time to the target (`name` in tables): moments, distribution and quantiles."""
        began, goal = time.process_time(), self.states(target)
        unsure = self.truncated_before(goal)
        words = name or (target if isinstance(target, str) else "the target")
        unit = self.space.network.time_unit if self.space else ""
        found = passage_to(*self._begun, goal, words, unit)
        if unsure.any():
            found = replace(found, earliest=passage_to(*self._begun, goal | unsure, words, unit))
        return replace(found, cpu_seconds=time.process_time() - began)

    def committor(self, targets: Mapping[str, Target]) -> Committor:
        """The probabilities that each of several targets, which exclude each other, is reached first.

        >>> from kinetics import Chain, Network
        >>> chain = Chain.of(Network.from_text("0 <-> A, 1, 1"), {"A": 1}, stop="A == 3")
        >>> chain.committor({"extinct": "A == 0", "full": "A == 3"}).probabilities.round(9).tolist()
        [0.75, 0.25]
        """
        check_targets(targets)
        masks = {name: self.states(given, f"target {name!r}") for name, given in targets.items()}
        twice = np.sum(list(masks.values()), axis=0)
        if twice.max() > 1:
            row = int(np.argmax(twice))
            state = row if self.counts is None else self.counts[row].tolist()
            raise ValueError(f"state {state} belongs to two targets; make them disjoint")
        return replace(committor_of(*self._begun, masks, self.truncated & (twice == 0)), space=self.space)

    @property
    def _begun(self) -> tuple[Transitions, Floats]:
        return self.transitions, self.initial

    def _ever(self, found: Callable[[Floats], Answer], first: FirstPhase | None) -> Answer:
        """The answer to an unbounded question, from the initial distribution or after a first phase."""
        if first is None:
            return self._answer(lambda: found(self.initial), EQUATIONS)
        return first.then(lambda start, _: self._answer(lambda: found(start), EQUATIONS), 0.0).clipped()

    def _first_phase(self, ways: Mask, after: float, by: float | None, method: ListingMethod | None) -> FirstPhase:
        return FirstPhase.of(*self._begun, ways, self.truncated, (after, by), self.space, method)

    def _by(self, held: Mask, stops: Mask, by: float, method: ListingMethod | None, first: FirstPhase | None) -> Answer:
        """The probability of `held` at a time, of the chain that is stopped, from a first phase on if there is one."""
        chain, space = self.transitions.stopped(stops), stopped_in(self.space, stops)

        def ends(start: Floats, time: float) -> Answer:
            return mean_at(chain, start, held.astype(float), time, space, method)

        if first is None:
            return ends(self.initial, one_time("by", by)).clipped()
        return first.then(ends, float(chain.exits.max(initial=0.0))).clipped()

    def _either_way(self, question: Callable[[Mask], Answer], certain: Mask, unsure: Mask) -> Answer:
        """The answer for the certain states, with an upper bound for the unsure ones as well."""
        low = question(certain)
        if not unsure.any():
            return low
        high = question(certain | unsure)
        seconds = low.cpu_seconds + high.cpu_seconds
        return replace(low, high=high.high, kind=weakest(low, high), cpu_seconds=seconds)

    def _answer(self, question: Callable[[], Answer], method: str) -> Answer:
        began = time.process_time()
        found = question()
        seconds = time.process_time() - began
        return replace(found, method=method, cpu_seconds=seconds, why=counted(len(self), "state"))


def reward_asked(
    chain: Chain, name: str | None, at: float | None, up_to: float | None, until: Target | None, stationary: bool
) -> Reward:
    """The reward of a question that `Chain.reward` takes."""
    if sum([at is not None, up_to is not None, until is not None, stationary]) != 1:
        raise ValueError("give one of at, up_to, until and stationary")
    given = named_reward(name, chain.rewards, chain.variables, chain.counts, len(chain))
    if at is not None and given.impulses is not None:
        raise ValueError(f"reward {name!r} has impulses, which have no rate at one time; ask for it up to a time")
    return given


def impulse_reward(chain: Chain, reward: Reward) -> Floats | None:
    """The impulse reward (K,) of each entry of the transitions; None if the reward has no impulses."""
    if reward.impulses is None:
        return None
    return np.asarray(reward.impulses[chain.transitions.rows, chain.transitions.columns]).ravel()
