"""The parts of a model in PRISM's language as they are written, before any name is looked up."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from kinetics.markov.prism.expressions import Written
from kinetics.markov.prism.tokens import Lexeme


class ConstantText(NamedTuple):
    """`const int n = 3;` kind : int, double or bool; value : None if it is to be given"""

    name: Lexeme
    kind: str
    value: Written | None


class VariableText(NamedTuple):
    """`x : [low..high] init initial;`, or `x : bool init initial;`, which has no bounds."""

    name: Lexeme
    low: Written | None
    high: Written | None
    initial: Written | None


class UpdateText(NamedTuple):
    """`rate : (x'=value) & (y'=value)`; rate : None for 1"""

    rate: Written | None
    assignments: tuple[tuple[Lexeme, Written], ...]
    token: Lexeme


class CommandText(NamedTuple):
    """`[action] guard -> update + update;` action : None if the brackets are empty"""

    action: Lexeme | None
    guard: Written
    updates: tuple[UpdateText, ...]


class ModuleText(NamedTuple):
    """A module, or with a `base` the copy of one in which names are replaced."""

    name: Lexeme
    variables: tuple[VariableText, ...] = ()
    commands: tuple[CommandText, ...] = ()
    base: Lexeme | None = None
    renaming: tuple[tuple[Lexeme, Lexeme], ...] = ()


class RewardText(NamedTuple):
    """`guard : value;` or `[action] guard : value;`. action : None for a reward of states, "" for `[]`"""

    action: str | None
    guard: Written
    value: Written
    token: Lexeme


class RewardsText(NamedTuple):
    """`rewards "name" ... endrewards`. name : None if there is none"""

    name: Lexeme | None
    items: tuple[RewardText, ...]
    token: Lexeme


@dataclass
class ModelText:
    """All parts of a model, in the order of the text; initial : what `init ... endinit` asks for."""

    constants: list[ConstantText] = field(default_factory=list)
    formulas: list[tuple[Lexeme, Written]] = field(default_factory=list)
    variables: list[VariableText] = field(default_factory=list)
    modules: list[ModuleText] = field(default_factory=list)
    labels: list[tuple[Lexeme, Written]] = field(default_factory=list)
    rewards: list[RewardsText] = field(default_factory=list)
    initial: tuple[Lexeme, Written] | None = None
