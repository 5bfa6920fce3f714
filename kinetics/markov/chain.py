"""`Chain`: a Markov chain in continuous time as one object, and questions to it with limits."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.markov.answers import ChainDistribution, ChainPath
from kinetics.markov.checks import (
    Reward,
    checked_mask,
    checked_names,
    checked_rates,
    checked_reward,
    checked_start,
)
from kinetics.markov.in_time import BACKWARD, mean_at, one_time, stopped_in
from kinetics.markov.listing import StateCondition, listed
from kinetics.markov.passage.backward import expected_integral
from kinetics.markov.passage.committor import ChainCommittor, committor_of
from kinetics.markov.passage.first_passage import Passage, passage_to
from kinetics.markov.passage.projected import ProjectedPassage
from kinetics.markov.passage.stationary import ChainStationary, mean_in_the_end, stationary_of
from kinetics.markov.passage.until import always, earned_until, earning_with, until
from kinetics.markov.paths import drawn_path
from kinetics.markov.rewards import earned, named_reward
from kinetics.markov.transient import ListingMethod, StateSpace, Transient, Transitions
from kinetics.markov.transient.search import MAX_STATES
from kinetics.network import Network
from kinetics.network.predicates import StateNames
from kinetics.support.answer import Answer, weakest
from kinetics.support.arrays import Floats, integers, read_only, some_times
from kinetics.support.tables import counted

Mask = NDArray[np.bool_]
INIT, DEADLOCK = "init", "deadlock"  # as PRISM calls them
Target = str | ArrayLike  # a condition on counts and labels as text, or truths (N,)
EQUATIONS = "linear equations"


@dataclass(frozen=True, eq=False)
class Chain:
    """A Markov chain on N states in continuous time.

    generator : (N, N) sparse or dense, 1/tu: rates from row to column off the diagonal, exact as given; where the
        diagonal holds anything, rows must sum to zero
    initial : (N,) probabilities at time 0, or the number of one state
    labels : name -> truths (N,), or a condition as text
    rewards : name -> `Reward`; rates (N,) alone, or a formula in counts as text, for one without impulses
    variables, counts : V names, and their values (N, V) in every state, for conditions such as "A >= 1 and B == 0"
    lost : states at the edge of a part of a larger chain: entered truly, but what happens from there is not known.
        Limits then hold whatever that is, and `value` counts nothing of it

    Targets are conditions as text, labels by name, or truths (N,). Methods answer by a `Answer`, with limits that
    are proven unless it says otherwise; small probabilities come with a relative error. ValueError: what is no chain,
    label, reward or target, or a question without a finite answer.

    >>> from kinetics import Chain
    >>> pump = Chain([[0.0, 0.1], [2.0, 0.0]], initial=0, labels={"down": [False, True]})
    >>> round(pump.in_the_end("down").value, 6), round(pump.until("down", by=10.0).value, 6)  # 1/21, 1 - 1/e
    (0.047619, 0.632121)
    """

    generator: Any
    initial: ArrayLike
    labels: Mapping[str, Target] = field(default_factory=dict)
    rewards: Mapping[str, Reward | ArrayLike | str] = field(default_factory=dict)
    variables: Sequence[str] = ()
    counts: ArrayLike | None = None
    lost: Target | None = None
    _transitions: Transitions = field(init=False, repr=False)
    _space: StateSpace | None = field(init=False, repr=False)

    def __post_init__(self) -> None:
        rates = checked_rates(self.generator)
        entries = rates.tocoo()
        n = rates.shape[0]
        ends = entries.row.astype(np.int64), entries.col.astype(np.int64)
        known = Transitions(*ends, entries.data, np.zeros(n), rate_error=0.0)
        self._set(_transitions=known, _space=None, initial=checked_start(self.initial, n))
        self._describe(n)
        lost = np.zeros(n, dtype=bool) if self.lost is None else self.states(self.lost, "lost")
        self._set(_transitions=known.stopped(lost), lost=lost)

    def _describe(self, n: int) -> None:
        """Check the names of states and what they earn."""
        variables = tuple(self.variables)
        counts = None if self.counts is None else integers("counts", self.counts, (n, len(variables)))
        if counts is None and variables:
            raise ValueError(f"variables {', '.join(variables)} came without counts; give their values in every state")
        self._set(variables=variables, counts=counts)
        self._relabel(self.labels)
        self._reward(self.rewards)

    def _relabel(self, labels: Mapping[str, Target]) -> None:
        checked_names(labels, "label", dict.fromkeys(self.variables))
        self._set(labels={})
        masks = {name: self.states(given, f"label {name!r}") for name, given in labels.items()}
        self._set(labels=masks)

    def _reward(self, rewards: Mapping[str, Reward | ArrayLike | str]) -> None:
        checked_names(rewards, "reward", {})
        found: dict[str, Reward] = {}
        for name, given in rewards.items():
            rates, error = self._names.values(given) if isinstance(given, str) else (given, 0.0)
            reward = rates if isinstance(rates, Reward) else Reward(rates, error=error)
            found[name] = checked_reward(name, reward, len(self))
        self._set(rewards=found)

    def _set(self, **values: Any) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @classmethod
    def of(
        cls,
        network: Network,
        initial: Mapping[str, int] | ArrayLike,
        labels: Mapping[str, Target] | None = None,
        rewards: Mapping[str, Reward | ArrayLike | str] | None = None,
        stop: StateCondition | None = None,
        max_states: int = MAX_STATES,
        within: StateCondition | int | None = None,
    ) -> Chain:
        """The chain of a network from given counts; its variables are the species, its first state is where it starts.

        stop : condition in which the chain stops, as text or as a function of states (n, S) with truths (n,); what
            lies beyond is not explored, so that the others may be finitely many
        within : condition within which it is followed, likewise, or the least number of states, those that the fewest
            events lead to; beyond, it is `lost`, and answers have limits for all that may happen then
        ValueError: more states than `max_states` can be reached

        >>> from kinetics import Chain, Network
        >>> chain = Chain.of(Network.from_text("0 <-> A, 5, 1"), {"A": 0}, within="A < 40", labels={"many": "A >= 12"})
        >>> answer = chain.until("many", by=10.0)
        >>> round(answer.value, 6), answer.high - answer.low < 1e-9  # the states beyond 39 hardly count
        (0.155954, True)
        """
        space, lost = listed(network, initial, stop, within, max_states)
        chain = cls.__new__(cls)
        start = np.eye(1, len(space))[0]
        chain._set(_transitions=space.transitions(), _space=space, initial=checked_start(start, len(space)))
        chain._set(labels=labels or {}, rewards=rewards or {}, variables=network.species, counts=space.states)
        chain._set(generator=chain._transitions.generator(), lost=read_only(lost))
        chain._describe(len(space))
        return chain

    def __len__(self) -> int:
        return self._transitions.size

    def __repr__(self) -> str:
        labels, rewards = (", ".join(names) or "none" for names in (self.labels, self.rewards))
        lost = f", lost in {int(self._lost.sum())}" if self._lost.any() else ""
        rates = self.transitions.rates.size
        return f"<Chain: {len(self)} states{lost}, {rates} rates; labels {labels}; rewards {rewards}>"

    @property
    def transitions(self) -> Transitions:
        """The rates; of a network, one entry a state and channel."""
        return self._transitions

    @property
    def space(self) -> StateSpace | None:
        """The states of the network behind the chain, if any."""
        return self._space

    @property
    def _lost(self) -> Mask:
        return np.asarray(self.lost)

    def check_whole(self, question: str) -> None:
        """A ValueError where only a part of the states is followed."""
        if self._lost.any():
            raise ValueError(
                f"{question} cannot be told of a part of a chain, which is lost beyond: list all of its states, or ask "
                f"for a probability, a committor, passage_limits or a reward"
            )

    @property
    def _names(self) -> StateNames:
        counts: Any = self.counts
        labels: Any = self.labels
        return StateNames(len(self), self.variables, counts, {**labels, **self._unnamed()})

    def _unnamed(self) -> dict[str, Mask]:
        return {name: mask for name, mask in self.built_in.items() if name not in (*self.labels, *self.variables)}

    @property
    def built_in(self) -> dict[str, Mask]:
        """The labels that conditions may use on every chain: where it starts, and where no rate leads on.

        Labels and variables of the same names go before them.
        """
        stuck = np.bincount(self._transitions.rows[self._transitions.rates > 0], minlength=len(self)) == 0
        if isinstance(self.lost, np.ndarray):
            stuck &= ~self.lost  # what lies beyond is not known
        return {INIT: np.asarray(self.initial) > 0, DEADLOCK: stuck}

    def with_labels(self, labels: Mapping[str, Target]) -> Chain:
        """The same chain with these labels, and no others."""
        other = copy(self)
        other._relabel(labels)
        return other

    def with_rewards(self, rewards: Mapping[str, Reward | ArrayLike | str]) -> Chain:
        """The same chain with these rewards, and no others."""
        other = copy(self)
        other._reward(rewards)
        return other

    def with_variables(self, more: Mapping[str, ArrayLike]) -> Chain:
        """The same chain with further variables for conditions: whole numbers (N,) by name."""
        other = copy(self)
        counts = np.column_stack([np.empty((len(self), 0)) if self.counts is None else self.counts, *more.values()])
        other._set(variables=(*self.variables, *more), counts=integers("counts", counts, counts.shape))
        return other

    def states(self, target: Target, what: str = "target") -> Mask:
        """The states (N,) of a target: those in which a condition holds."""
        if isinstance(target, str):
            return self._names.holds(target)
        return checked_mask(what, target, len(self))

    def transient(self, times: ArrayLike, method: ListingMethod | None = None) -> ChainDistribution:
        """Probabilities of all states at `times` (T,), tu, rising, by a solving method (by default `Transient`)."""
        self.check_whole("the distribution")
        began, grid = time.process_time(), some_times(times)
        chosen = method or Transient()
        found = chosen.probabilities(*self._begun, grid, self._space)
        return ChainDistribution(grid, *found, chosen.name, time.process_time() - began)

    def until(
        self,
        target: Target,
        through: Target | None = None,
        by: float | None = None,
        method: ListingMethod | None = None,
    ) -> Answer:
        """Probability of reaching the target on the way through given states alone (by default any), by a time or ever.

        by : tu; None for ever, by linear equations, solved by iteration, elimination or sparse LU
        method : a solving method for the pass, forwards; by default it is backwards, with a relative error, or by
            `Transient` where that would take too many steps
        """
        goal = self.states(target)
        ways = np.ones(len(self), dtype=bool) if through is None else self.states(through, "through")

        def reached(goals: Mask) -> Answer:
            if by is None:
                return self._answer(lambda: until(*self._begun, ways, goals).limited, EQUATIONS)
            return self._in_time(goals, goals | ~ways, by, method)

        return self._either_way(reached, goal, self._lost & ways & ~goal)

    def always(self, states: Target, by: float | None = None, method: ListingMethod | None = None) -> Answer:
        """Probability of not leaving the states, until a time or ever."""
        wanted = self.states(states)

        def stays(kept: Mask) -> Answer:
            if by is None:
                return self._answer(lambda: always(*self._begun, kept).limited, EQUATIONS)
            return self._in_time(kept, ~kept, by, method)

        return self._either_way(stays, wanted & ~self._lost, self._lost & wanted)

    def _either_way(self, question: Callable[[Mask], Answer], certain: Mask, unsure: Mask) -> Answer:
        """The answer for the certain states, with an upper limit for the unsure ones as well."""
        low = question(certain)
        if not unsure.any():
            return low
        high = question(certain | unsure)
        seconds = low.cpu_seconds + high.cpu_seconds
        return replace(low, high=high.high, kind=weakest(low, high), cpu_seconds=seconds)

    @property
    def _begun(self) -> tuple[Transitions, Floats]:
        return self.transitions, np.asarray(self.initial)

    def _in_time(self, held: Mask, stops: Mask, by: float, method: ListingMethod | None) -> Answer:
        """The probability of `held` at a time, of the chain that is stopped."""
        chain, space = self.transitions.stopped(stops), stopped_in(self._space, stops)
        return mean_at(chain, self._begun[1], held.astype(float), one_time("by", by), space, method).clipped()

    def reward(
        self,
        name: str | None = None,
        at: float | None = None,
        up_to: float | None = None,
        until: Target | None = None,
        stationary: bool = False,
    ) -> Answer:
        """Mean of a reward: its rate `at` a time, its total `up_to` a time or `until` a target, or its rate in the end.

        name : of the reward; of a variable, for its value; None for the only one
        ValueError: not one of the four is asked for; or the target may never be reached, so that there is no finite
            mean

        >>> from kinetics import Chain, Network
        >>> chain = Chain.of(Network.from_text("A <-> B, 2, 3"), {"A": 1}, rewards={"heat": "10 * A"})
        >>> round(chain.reward("heat", until="B == 1").value, 9), round(chain.reward("heat", stationary=True).value, 9)
        (5.0, 6.0)
        """
        given = self.reward_asked(name, at, up_to, until, stationary)
        if at is not None:
            now = one_time("at", at)
            return earned(
                lambda values: mean_at(*self._begun, values, now, self._space).inflated(given.error),
                np.asarray(given.rates),
                self._lost,
                given.most,
            )
        earning, rounded = earning_with(self.transitions, np.asarray(given.rates), self.worth(given))
        rounded += given.error
        if up_to is not None:
            end = one_time("up_to", up_to)

            def total(values: Floats) -> Answer:
                return self._answer(lambda: expected_integral(*self._begun, values, end).inflated(rounded), BACKWARD)

            return earned(total, earning, self._lost, given.most)
        if until is not None:
            goal = self.states(until)
            unsure = self._lost & ~goal
            way = (*self._begun, earning, goal | unsure)
            found = self._answer(lambda: earned_until(*way).limited.inflated(rounded), EQUATIONS)
            return replace(found, high=np.inf) if unsure.any() else found
        return self._answer(lambda: mean_in_the_end(self.stationary(), earning).inflated(rounded), EQUATIONS)

    def reward_asked(
        self, name: str | None, at: float | None, up_to: float | None, until: Target | None, stationary: bool
    ) -> Reward:
        """The reward of a question that `reward` takes."""
        if sum([at is not None, up_to is not None, until is not None, stationary]) != 1:
            raise ValueError("give one of at, up_to, until and stationary")
        given = named_reward(name, self.rewards, self.variables, self.counts, len(self))  # type: ignore[arg-type]
        if at is not None and given.impulses is not None:
            raise ValueError(f"reward {name!r} has impulses, which have no rate at one time; ask for it up to a time")
        return given

    def worth(self, reward: Reward) -> Floats | None:
        """What a reward gives for each entry (K,) of the transitions; None where it has no impulses."""
        if reward.impulses is None:
            return None
        return np.asarray(reward.impulses[self.transitions.rows, self.transitions.columns]).ravel()

    def in_the_end(self, states: Target) -> Answer:
        """Probability of the states after infinite time."""
        held = self.states(states)
        found = self._answer(lambda: mean_in_the_end(self.stationary(), held.astype(float)), EQUATIONS)
        return found.clipped()

    def stationary(self) -> ChainStationary:
        """The distribution after infinite time, with a relative error a state."""
        self.check_whole("what holds after infinite time")
        return stationary_of(*self._begun)

    def passage(self, target: Target) -> Passage:
        """The first-passage time to the target: moments, distribution and quantiles."""
        self.check_whole("a passage time")
        return self.passage_limits(target).latest

    def passage_limits(self, target: Target, name: str = "") -> ProjectedPassage:
        """Limits of the first-passage time to the target, which `name` states in words, also where it may be lost."""
        goal, words = self.states(target), name or (target if isinstance(target, str) else "the target")
        unsure = self._lost & ~goal
        unit = self._space.network.time_unit if self._space else ""
        latest = passage_to(*self._begun, goal, words, unit)
        return ProjectedPassage(
            passage_to(*self._begun, goal | unsure, words, unit) if unsure.any() else latest, latest
        )

    def committor(self, targets: Mapping[str, Target]) -> ChainCommittor:
        """The probabilities that each of several targets, which exclude each other, is reached first.

        >>> from kinetics import Chain, Network
        >>> chain = Chain.of(Network.from_text("0 <-> A, 1, 1"), {"A": 1}, stop="A == 3")
        >>> chain.committor({"extinct": "A == 0", "full": "A == 3"}).probabilities.round(9).tolist()
        [0.75, 0.25]
        """
        masks = {name: self.states(given, f"target {name!r}") for name, given in targets.items()}
        if not masks:
            raise ValueError("no targets; give at least one, as in {'extinct': 'A == 0'}")
        twice = np.sum(list(masks.values()), axis=0)
        if twice.max() > 1:
            raise ValueError(f"state {int(np.argmax(twice))} belongs to two targets; make them exclude each other")
        return committor_of(*self._begun, masks, self._lost & (twice == 0))

    def sample_path(self, end: float, seed: int = 0, run: int = 0) -> ChainPath:
        """One run until `end`, tu; (seed, run) name it."""
        self.check_whole("a run")
        return drawn_path(*self._begun, one_time("end", end), seed, run)

    def sample_path_to(self, target: Target, seed: int = 0, run: int = 0) -> ChainPath:
        """One run until the target, drawn from the runs that reach it, however few (Doob's h-transform)."""
        self.check_whole("a run")
        found = self.committor({"target": target})
        chances = found.committors[0]
        weights = self._begun[1] * chances
        if not weights.any():
            raise ValueError("the target is never reached; there are no such runs")
        return drawn_path(found.transitions, weights / weights.sum(), np.inf, seed, run, chances)

    def _answer(self, question: Callable[[], Answer], method: str) -> Answer:
        began = time.process_time()
        found = question()
        return replace(found, method=method, cpu_seconds=time.process_time() - began, why=counted(len(self), "state"))
