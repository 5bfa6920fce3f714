"""The text of a model in PRISM's language, read into its parts by recursive descent.

https://www.prismmodelchecker.org/manual/ThePRISMLanguage. Only Markov chains in continuous time are read; all other
types and parts of models are refused by name.
"""

from __future__ import annotations

from collections.abc import Iterator

from kinetics.markov.prism.expressions import ExpressionReader, Written
from kinetics.markov.prism.syntax import (
    CommandText,
    ConstantText,
    ModelText,
    ModuleText,
    RewardsText,
    RewardText,
    UpdateText,
    VariableText,
)
from kinetics.markov.prism.tokens import END, Lexeme, ModelTextError, TokenReader

CTMC = ("ctmc", "stochastic")
OTHER_TYPES = (
    *(
        "dtmc",
        "probabilistic",
        "mdp",
        "nondeterministic",
        "pta",
        "pomdp",
        "popta",
        "ma",
        "smg",
        "csg",
        "ctmdp",
        "idtmc",
    ),
    *("imdp", "ipomdp", "lts"),
)
PARTS = {  # that are refused, and what to do
    "system": "processes are composed by synchronising all actions that they share; leave it out, or rename actions",
    "observables": "there are no observations of a chain",
    "observable": "there are no observations of a chain",
    "player": "there are no players of a chain",
    "filter": "a filter belongs to a question",
}
KINDS = ("int", "double", "bool")


def model_text(text: str) -> ModelText:
    """The parts of a model; a ModelTextError, with line and column, if it is none.

    >>> from kinetics.markov.prism.parsing import model_text
    >>> model = model_text("ctmc module pump up : bool init true; [] up -> 0.1 : (up'=false); endmodule")
    >>> [(module.name.text, len(module.commands)) for module in model.modules]
    [('pump', 1)]
    """
    return _ModelReader(text).model()


class _ModelReader:
    def __init__(self, text: str) -> None:
        self._tokens = TokenReader(text)
        self._expression = ExpressionReader(self._tokens).expression

    def model(self) -> ModelText:
        """The whole text."""
        found, kind = ModelText(), None
        while self._tokens.next.kind != END:
            token = self._tokens.next
            if self._tokens.takes(*CTMC, *OTHER_TYPES):
                if token.text in OTHER_TYPES:
                    raise ModelTextError(
                        f"a model of the type {token.text}; only Markov chains in continuous time (ctmc) are read",
                        token,
                    )
                if kind:
                    raise ModelTextError(f"a second type of the model; the first is in line {kind.line}", token)
                kind = token
            else:
                self._part(found)
        if not kind:
            raise ModelTextError(
                "the model states no type, and is then a Markov decision process; only Markov chains in continuous "
                "time are read, which begin with ctmc",
                self._tokens.next,
            )
        if not found.modules:
            raise ModelTextError("there is no module; expected one at least", self._tokens.next)
        return found

    def _part(self, found: ModelText) -> None:
        token = self._tokens.take()
        match token.text:
            case "const":
                found.constants.append(self._constant())
            case "formula":
                found.formulas.append(self._named(self._tokens.name("a formula")))
            case "label":
                found.labels.append(self._named(self._tokens.quoted("a label")))
            case "global":
                found.variables.append(self._variable())
            case "module":
                found.modules.append(self._module())
            case "rewards":
                found.rewards.append(self._rewards(token))
            case "init":
                if found.initial:
                    raise ModelTextError(f"a second init; the first is in line {found.initial[0].line}", token)
                found.initial = token, self._expression()
                self._tokens.expect("endinit")
            case other if other in PARTS:
                raise ModelTextError(f"{other!r} is not read: {PARTS[other]}", token)
            case _:
                raise ModelTextError(
                    f"{token.shown} came; expected const, formula, label, global, module, rewards or init", token
                )

    def _constant(self) -> ConstantText:
        kind = self._tokens.takes(*KINDS)
        name = self._tokens.name("a constant")
        value = self._expression() if self._tokens.takes("=") else None
        self._tokens.expect(";", "behind a constant")
        return ConstantText(name, kind.text if kind else "int", value)

    def _named(self, name: Lexeme) -> tuple[Lexeme, Written]:
        self._tokens.expect("=")
        value = self._expression()
        self._tokens.expect(";", f"behind {name.shown}")
        return name, value

    def _variable(self) -> VariableText:
        name = self._tokens.name("a variable")
        self._tokens.expect(":", "and the values of a variable, as in x : [0..3];")
        unbounded = self._tokens.takes("int", "double", "clock")
        if unbounded:
            raise ModelTextError(
                f"the variable {name.shown} has no bounds ({unbounded.text}); give it a range, as in [0..100]",
                unbounded,
            )
        low = high = None
        if not self._tokens.takes("bool"):
            self._tokens.expect("[", "or bool, the values of a variable, as in x : [0..3];")
            low = self._expression()
            self._tokens.expect("..", "between the bounds of a variable")
            high = self._expression()
            self._tokens.expect("]", "behind the bounds of a variable")
        initial = self._expression() if self._tokens.takes("init") else None
        self._tokens.expect(";", f"behind the variable {name.shown}")
        return VariableText(name, low, high, initial)

    def _module(self) -> ModuleText:
        name = self._tokens.name("a module")
        if self._tokens.takes("="):
            base = self._tokens.name("the module to copy")
            self._tokens.expect("[", "before the names to replace")
            pairs = [self._replaced()]
            while self._tokens.takes(","):
                pairs.append(self._replaced())
            self._tokens.expect("]", "behind the names to replace")
            self._tokens.expect("endmodule")
            return ModuleText(name, base=base, renaming=tuple(pairs))
        variables: list[VariableText] = []
        commands: list[CommandText] = []
        while not self._tokens.takes("endmodule"):
            token = self._tokens.next
            if self._tokens.is_next("["):
                commands.append(self._command())
            elif self._tokens.is_next("invariant"):
                raise ModelTextError("an invariant belongs to timed automata; chains have none", token)
            elif self._tokens.ahead(1).text == ":":
                variables.append(self._variable())
            else:
                raise ModelTextError(
                    f"{token.shown} came; expected a variable, a command, which begins with [, or endmodule", token
                )
        return ModuleText(name, tuple(variables), tuple(commands))

    def _replaced(self) -> tuple[Lexeme, Lexeme]:
        old = self._tokens.name("what is replaced")
        self._tokens.expect("=", "between a name and its replacement")
        return old, self._tokens.name("a replacement")

    def _command(self) -> CommandText:
        self._tokens.expect("[")
        action = None if self._tokens.is_next("]") else self._tokens.name("an action")
        self._tokens.expect("]", "behind an action")
        guard = self._expression()
        self._tokens.expect("->", "between the guard of a command and its updates")
        updates = [self._update()]
        while self._tokens.takes("+"):
            updates.append(self._update())
        self._tokens.expect(";", "behind a command")
        return CommandText(action, guard, tuple(updates))

    def _update(self) -> UpdateText:
        token, rate = self._tokens.next, None
        if not self._is_assignment() and not (self._tokens.is_next("true") and self._tokens.ahead(1).text in "+;"):
            rate = self._expression()
            self._tokens.expect(":", "between the rate of an update and what it does")
        if self._tokens.takes("true"):
            return UpdateText(rate, (), token)
        return UpdateText(rate, tuple(self._assignments()), token)

    def _is_assignment(self) -> bool:
        return self._tokens.is_next("(") and self._tokens.ahead(2).text == "'"

    def _assignments(self) -> Iterator[tuple[Lexeme, Written]]:
        while True:
            if not self._is_assignment():
                raise ModelTextError(
                    f"{self._tokens.next.shown} came; expected an assignment, as in (x'=x+1), or true",
                    self._tokens.next,
                )
            self._tokens.expect("(")
            name = self._tokens.name("a variable")
            self._tokens.expect("'")
            self._tokens.expect("=", f"and the new value of {name.text}")
            yield name, self._expression()
            self._tokens.expect(")", f"behind the new value of {name.text}")
            if not self._tokens.takes("&"):
                return

    def _rewards(self, token: Lexeme) -> RewardsText:
        name = None if self._tokens.next.kind != "text" else self._tokens.quoted("a reward")
        items: list[RewardText] = []
        while not self._tokens.takes("endrewards"):
            begin, action = self._tokens.next, None
            if self._tokens.takes("["):
                action = "" if self._tokens.is_next("]") else self._tokens.name("an action").text
                self._tokens.expect("]", "behind an action")
            guard = self._expression()
            self._tokens.expect(":", "between the condition of a reward and its value")
            value = self._expression()
            self._tokens.expect(";", "behind a reward")
            items.append(RewardText(action, guard, value, begin))
        return RewardsText(name, tuple(items), token)
