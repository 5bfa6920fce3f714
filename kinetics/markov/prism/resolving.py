"""Every name of a model in its place: from its text to a system that can be explored, or to what is wrong with it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from kinetics.markov.prism.constants import Constants
from kinetics.markov.prism.expressions import Written
from kinetics.markov.prism.renaming import Copied, copied_modules
from kinetics.markov.prism.syntax import CommandText, ModelText, RewardsText, VariableText
from kinetics.markov.prism.system import Branch, Command, RewardTerm, SharedAction, System
from kinetics.markov.prism.terms import BOOL, DOUBLE, INT, LARGEST_INT, Scope, Term
from kinetics.markov.prism.tokens import Lexeme, ModelTextError
from kinetics.markov.prism.values import NOWHERE, values_of
from kinetics.network.checks import nearest
from kinetics.network.predicates import DEADLOCK, INIT


def system_of(text: ModelText, given: Mapping[str, Any]) -> System:
    """The system of a model; a ModelTextError, with line and column, for whatever is wrong with its text.

    given : values of constants without one

    >>> from kinetics.markov.prism.parsing import model_text
    >>> from kinetics.markov.prism.resolving import system_of
    >>> pump = model_text("ctmc const int n; module pump up : [0..n] init n; [] up > 0 -> 0.1 : (up'=0); endmodule")
    >>> system_of(pump, {"n": 3}).ranges.tolist()
    [[0, 3]]
    """
    return _Resolving(text, given).system()


class _Resolving:
    def __init__(self, text: ModelText, given: Mapping[str, Any]) -> None:
        self.text = text
        self.modules = copied_modules(text.modules)
        for old, new in (pair for module in text.modules for pair in module.renaming):
            if old.text in {name.text for name, _ in text.formulas}:
                raise ModelTextError(
                    f"{old.shown} is a formula, which is replaced by what it stands for before names are; name "
                    f"what it uses instead of it, or give {new.shown} a module of its own",
                    old,
                )
        self._check_names()
        declared = [*self._declared()]
        places = {token.text: (place, _kind(text)) for place, (token, text, _, _) in enumerate(declared)}
        self.places = places
        self.owners = {token.text: module for token, _, _, module in declared}
        self.constants = Constants(text.constants, given)
        self.formulas = {name.text: (name, value) for name, value in text.formulas}
        self.constant_names = [constant.name.text for constant in text.constants]
        self.scope = Scope(places, self.constants.term, self.formulas, (), self.constant_names)
        self.constants.read_in(self.scope)
        for name, _ in text.formulas:  # those that are not used are checked, too
            self.scope.term(Written("name", (), name))
        self.declared = [(token, text, self._scope_of(module)) for token, text, module, _ in declared]

    def system(self) -> System:
        """The whole system."""
        ranges = np.array([self._range(*each) for each in self.declared], dtype=np.int64).reshape(-1, 2)
        if self.text.initial:
            for token, variable, _ in self.declared:
                if variable.initial is not None:
                    raise ModelTextError(
                        f"{token.shown} has a start of its own, and there is init ... endinit in line "
                        f"{self.text.initial[0].line}; leave one out",
                        token,
                    )
        starts = [self._start(*each, *bounds) for each, bounds in zip(self.declared, ranges.tolist(), strict=True)]
        actions = tuple(self._actions())
        known = {action.name for action in actions}
        start = self.text.initial and self.scope.of_kind(self.text.initial[1], BOOL, "what init asks for")
        return System(
            tuple(token.text for token, _, _ in self.declared),
            tuple(_kind(text) for _, text, _ in self.declared),
            ranges,
            np.array(starts, dtype=np.int64),
            start,
            actions,
            dict(self._labels()),
            {
                self._reward_name(k, given): tuple(self._reward(given, known))
                for k, given in enumerate(self.text.rewards)
            },
        )

    def _declared(self) -> Iterator[tuple[Lexeme, VariableText, Copied | None, str]]:
        """Name here, text, module and its name, of the global variables and those of the modules."""
        for variable in self.text.variables:
            yield variable.name, variable, None, ""
        for module in self.modules:
            for variable in module.text.variables:
                yield module.renamed(variable.name), variable, module, module.name.text

    def _check_names(self) -> None:
        """A ModelTextError for a name that two things have."""
        seen: dict[str, tuple[str, Lexeme]] = {}
        things = [("constant", constant.name) for constant in self.text.constants]
        things += [("formula", name) for name, _ in self.text.formulas]
        things += [("variable", name) for name, _, _, _ in self._declared()]
        for what, token in things:
            if token.text in seen:
                other, first = seen[token.text]
                raise ModelTextError(
                    f"the {what} {token.shown} has the name of the {other} in line {first.line}; rename one (a copy of "
                    f"a module must rename all of its variables)",
                    token,
                )
            seen[token.text] = what, token
        for kind, tokens in (
            ("modules", [module.name for module in self.text.modules]),
            ("labels", [name for name, _ in self.text.labels]),
            ("rewards", [rewards.name for rewards in self.text.rewards if rewards.name]),
        ):
            lines: dict[str, int] = {}
            for token in tokens:
                if lines.setdefault(token.text, token.line) != token.line or tokens.count(token) > 1:
                    raise ModelTextError(
                        f"two {kind} are called {token.shown}, here and in line {lines[token.text]}; rename one", token
                    )

    def _scope_of(self, module: Copied | None) -> Scope:
        if module is None or not module.renamings:
            return self.scope
        return Scope(self.places, self.constants.term, self.formulas, module.renamings, self.constant_names)

    def _range(self, token: Lexeme, variable: VariableText, scope: Scope) -> tuple[int, int]:
        if variable.low is None or variable.high is None:
            return 0, 1
        low, high = (
            int(self._known(scope.of_kind(bound, INT, f"a bound of {token.shown}"), f"a bound of {token.shown}"))
            for bound in (variable.low, variable.high)
        )
        if low > high or max(-low, high) > LARGEST_INT:
            raise ModelTextError(
                f"{token.shown} goes from {low} to {high}; expected a range that is not empty, within {LARGEST_INT}",
                variable.low.token,
            )
        return low, high

    def _start(self, token: Lexeme, variable: VariableText, scope: Scope, low: int, high: int) -> int:
        if variable.initial is None:
            return low
        what = f"the start of {token.shown}"
        found = int(self._known(scope.of_kind(variable.initial, _kind(variable), what), what))
        if not low <= found <= high:
            raise ModelTextError(f"{token.shown} starts at {found}; expected {low} to {high}", variable.initial.token)
        return found

    def _known(self, term: Term, what: str) -> Any:
        if not term.is_known:
            raise ModelTextError(f"{what} depends on a variable; expected a number", term.token)
        return values_of(term, NOWHERE)

    def _actions(self) -> Iterator[SharedAction]:
        """All actions, that of commands without one first."""
        parts: dict[str, list[tuple[Command, ...]]] = {"": []}
        alone: list[Command] = []
        for module in self.modules:
            scope = self._scope_of(module)
            own: dict[str, list[Command]] = {}
            for text in module.text.commands:
                command = self._command(text, module, scope)
                if text.action is None:
                    alone.append(command)
                else:
                    own.setdefault(scope.renamed(text.action.text), []).append(command)
            for name, commands in own.items():
                parts.setdefault(name, []).append(tuple(commands))
        parts[""] = [tuple(alone)]
        for name, each in parts.items():
            yield SharedAction(name, tuple(each))

    def _command(self, text: CommandText, module: Copied, scope: Scope) -> Command:
        guard = scope.of_kind(text.guard, BOOL, "a guard")
        branches = []
        for update in text.updates:
            rate = None if update.rate is None else scope.of_kind(update.rate, DOUBLE, "a rate")
            changes: dict[int, Term] = {}
            for token, value in update.assignments:
                here = module.renamed(token)
                place = self._changed(here, module, text.action)
                if place in changes:
                    raise ModelTextError(f"{here.shown} is assigned twice in one update", token)
                changes[place] = scope.of_kind(value, self.places[here.text][1], f"the new value of {here.shown}")
            branches.append(Branch(rate, tuple(changes.items()), update.token))
        return Command(guard, tuple(branches))

    def _changed(self, token: Lexeme, module: Copied, action: Lexeme | None) -> int:
        """The place of a variable that a command of a module changes."""
        if token.text not in self.places:
            is_there = token.text in self.formulas or self.constants.term(token)
            fault = "is no variable, and cannot be assigned" if is_there else "is unknown"
            raise ModelTextError(f"{token.shown} {fault}; {nearest(token.text, self.places)}", token)
        owner = self.owners[token.text]
        if owner not in ("", module.name.text):
            raise ModelTextError(
                f"the module {module.name.shown} assigns {token.shown}, which belongs to the module {owner!r}; make it "
                f"global, or let that module change it",
                token,
            )
        if not owner and action:
            raise ModelTextError(
                f"a command with an action, [{action.text}], assigns the global variable {token.shown}; only commands "
                f"without one may, since others happen together",
                token,
            )
        return self.places[token.text][0]

    def _labels(self) -> Iterator[tuple[str, Term]]:
        for name, condition in self.text.labels:
            if name.text in (INIT, DEADLOCK):
                raise ModelTextError(f"the label {name.shown} is there already, of every chain; rename this one", name)
            term = self.scope.of_kind(condition, BOOL, f"the label {name.shown}")
            place, _ = self.places.get(name.text, (-1, BOOL))
            is_same = term.operation == "variable" and term.value == place
            if place >= 0 and not is_same:
                raise ModelTextError(
                    f"the label {name.shown} has the name of a variable, and questions could not tell them apart; "
                    f"rename one",
                    name,
                )
            if not is_same:  # a variable that is true or false is a label in any case
                yield name.text, term

    def _reward_name(self, k: int, given: RewardsText) -> str:
        return given.name.text if given.name else f"r{k + 1}"

    def _reward(self, given: RewardsText, known: set[str]) -> Iterator[RewardTerm]:
        for item in given.items:
            if item.action is not None and item.action not in known:
                actions = sorted(known - {""})
                hint = nearest(item.action, actions) if actions else "there are no actions"
                raise ModelTextError(f"no command has the action {item.action!r}; {hint}", item.token)
            guard = self.scope.of_kind(item.guard, BOOL, "the condition of a reward")
            yield RewardTerm(item.action, guard, self.scope.number(item.value, "a reward"))


def _kind(variable: VariableText) -> str:
    return BOOL if variable.low is None else INT
