"""Expressions of PRISM's language as they are written, read by precedence climbing.

https://www.prismmodelchecker.org/manual/ThePRISMLanguage/Expressions lists operators and their precedence. Names are
not looked up here, and nothing has a type yet: `terms` does both.
"""

from __future__ import annotations

from typing import NamedTuple

from kinetics.markov.prism.tokens import NAME, NUMBER, SIGN, Lexeme, ModelTextError, TokenReader

# How tightly an operator binds. Those of COMMON may have many parts: a long sum is one node, not a deep one.
BINARY = {
    "=>": 1,
    "<=>": 2,
    "|": 3,
    "&": 4,
    "=": 6,
    "!=": 6,
    "<": 7,
    "<=": 7,
    ">": 7,
    ">=": 7,
    "+": 8,
    "-": 8,
    "*": 9,
    "/": 9,
}
DENYING, NEGATING = 5, 10  # ! is looser than a comparison, a minus before its operand is the tightest
COMMON = ("|", "&", "+", "*")
IMPLIES = 1
FUNCTIONS = {"min": None, "max": None, "floor": 1, "ceil": 1, "round": 1, "pow": 2, "mod": 2, "log": 2}  # arguments
MOST_DEPTH = 100  # of brackets in each other


class Written(NamedTuple):
    """An expression as it is written.

    operation : an operator, a function, or one of `number`, `truth`, `name`, whose text the token has
    token : where it stands
    """

    operation: str
    parts: tuple[Written, ...]
    token: Lexeme


class ExpressionReader:
    """Reads expressions off a sequence of tokens."""

    def __init__(self, tokens: TokenReader) -> None:
        self._tokens = tokens
        self._depth = 0

    def expression(self) -> Written:
        """The expression that comes next; a ModelTextError if there is none.

        >>> from kinetics.markov.prism.expressions import ExpressionReader
        >>> from kinetics.markov.prism.tokens import TokenReader
        >>> read = ExpressionReader(TokenReader("!x = 1 & y < 2")).expression()
        >>> read.operation, [part.operation for part in read.parts]
        ('&', ['!', '<'])
        """
        self._enter()
        found = self._binary(IMPLIES)
        question = self._tokens.takes("?")
        if question:
            chosen = self.expression()
            self._tokens.expect(":", "of the other case, as in a ? b : c")
            found = Written("?", (found, chosen, self.expression()), question)
        self._depth -= 1
        return found

    def _enter(self) -> None:
        self._depth += 1
        if self._depth > MOST_DEPTH:
            raise ModelTextError(
                f"over {MOST_DEPTH} expressions stand inside each other; name parts of them by formulas",
                self._tokens.next,
            )

    def _binary(self, least: int) -> Written:
        """An operand, and the operators behind it that bind at least so tightly, with their operands."""
        left = self._operand()
        while self._tokens.next.kind == SIGN and BINARY.get(self._tokens.next.text, 0) >= least:
            token = self._tokens.next
            level, sign = BINARY[token.text], "+" if token.text == "-" else token.text
            parts = [left]
            while self._tokens.is_next(*(("+", "-") if sign == "+" else (token.text,))):
                sign_here = self._tokens.take()
                right = self._binary(level + 1)
                # a - b is a + (-b), to the last bit
                parts.append(Written("negate", (right,), sign_here) if sign_here.text == "-" else right)
                if sign not in COMMON:
                    break
            left = Written(sign, tuple(parts), token)
            if level == IMPLIES and self._tokens.is_next("=>"):
                raise ModelTextError(
                    "a => b => c is read in one way by some programs and in another by others; write brackets",
                    self._tokens.next,
                )
        return left

    def _operand(self) -> Written:
        """What stands before or between operators: with ! or a minus before it, or alone."""
        before = self._tokens.takes("!", "-")
        if not before:
            return self._alone()
        self._enter()
        inner = self._binary(DENYING if before.text == "!" else NEGATING)
        self._depth -= 1
        return Written("!" if before.text == "!" else "negate", (inner,), before)

    def _alone(self) -> Written:
        token = self._tokens.next
        if token.kind == NUMBER:
            return Written("number", (), self._tokens.take())
        if self._tokens.is_next("true", "false"):
            return Written("truth", (), self._tokens.take())
        if self._tokens.takes("("):
            found = self.expression()
            self._tokens.expect(")", f"to close the bracket of line {token.line}, column {token.column}")
            return found
        if token.kind == NAME and self._tokens.ahead(1).text == "(":
            return self._call(self._tokens.take())
        if token.kind == NAME and token.text not in ("min", "max"):
            return Written("name", (), self._tokens.name("something to calculate with"))
        raise ModelTextError(f"{token.shown} came; expected an expression", token)

    def _call(self, function: Lexeme) -> Written:
        self._tokens.expect("(")
        if function.text == "func":  # func(floor, x), as the language once was
            function = self._tokens.take()
            self._tokens.expect(",", "behind the name of a function")
        if function.text not in FUNCTIONS:
            raise ModelTextError(f"unknown function {function.shown}; there are {', '.join(FUNCTIONS)}", function)
        parts = [self.expression()]
        while self._tokens.takes(","):
            parts.append(self.expression())
        self._tokens.expect(")", f"behind the arguments of {function.text}")
        wanted = FUNCTIONS[function.text]
        if len(parts) != (wanted or max(2, len(parts))):
            raise ModelTextError(
                f"{function.text} of {len(parts)} arguments; expected {wanted or 'two or more'}", function
            )
        return Written(function.text, tuple(parts), function)
