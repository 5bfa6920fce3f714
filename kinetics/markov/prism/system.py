"""A model with every name in its place: variables with ranges, and commands by action, of modules that synchronise.

https://www.prismmodelchecker.org/manual/ThePRISMLanguage/Synchronisation. Modules that use an action in some command do
it together: each combination of their commands is a transition, at the product of the rates.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.prism.terms import Term
from kinetics.markov.prism.tokens import Lexeme
from kinetics.markov.prism.values import States
from kinetics.support.arrays import Ints


class Branch(NamedTuple):
    """What a command does at a rate. rate : None for 1; changes : places of variables and their new values"""

    rate: Term | None
    changes: tuple[tuple[int, Term], ...]
    token: Lexeme


class Command(NamedTuple):
    """A command: where its guard holds, one of its branches happens."""

    guard: Term
    branches: tuple[Branch, ...]


class SharedAction(NamedTuple):
    """An action, and the commands with it of each module that takes part.

    name : "" for no action: then all such commands are of one part
    """

    name: str
    parts: tuple[tuple[Command, ...], ...]


class RewardTerm(NamedTuple):
    """A reward in states where the guard holds: of an action, or with None a rate of the state."""

    action: str | None
    guard: Term
    value: Term


@dataclass(frozen=True, eq=False)
class System:
    """A model that can be explored.

    names, kinds : of the V variables, int or bool; those of the text come first
    ranges : (V, 2) least and largest values
    starts : (V,) values at time 0; what `init ... endinit` asks for stands in `start`
    rewards : name -> its parts
    """

    names: tuple[str, ...]
    kinds: tuple[str, ...]
    ranges: Ints
    starts: Ints
    start: Term | None
    actions: tuple[SharedAction, ...]
    labels: Mapping[str, Term]
    rewards: Mapping[str, tuple[RewardTerm, ...]]

    def states(self, table: Ints, failed: NDArray[np.bool_] | None = None) -> States:
        """States (n, V) in which terms have values; `failed` as `States` has it."""
        return States(self.names, self.kinds, table, failed)
