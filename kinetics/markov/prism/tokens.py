"""Text of PRISM's language as tokens, each with its line and column; and the error of a text at a place.

https://www.prismmodelchecker.org/manual/ThePRISMLanguage. White space and comments, from // to the end of a line, mean
nothing.
"""

from __future__ import annotations

import re
from typing import NamedTuple

# Words that are no names: the list of the manual, under "Modules And Variables".
LANGUAGE = """
A bool clock const ctmc C double dtmc E endinit endinvariant endmodule endobservables endrewards endsystem false formula
filter func F global G init invariant I int label max mdp min module X nondeterministic observable observables of Pmax
Pmin P pomdp popta probabilistic prob pta rate rewards Rmax Rmin R S stochastic system true U W
"""
RESERVED = frozenset(LANGUAGE.split())
# What a writer avoids as well: functions, and words that other versions or readers of the language have.
OTHERS = "mod pow floor ceil round log smg ma csg ctmdp idtmc imdp ipomdp lts player endplayer sin cos tan deadlock"
TAKEN = RESERVED | frozenset(OTHERS.split())
NAME, NUMBER, TEXT, SIGN, END = "name", "number", "text", "sign", "end"
LEXEMES = re.compile(
    r"(?P<blank>[ \t\r\n\f]+|//[^\n]*)"
    r"|(?P<number>(?:[0-9]+(?:\.[0-9]+)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)"  # so that 0..3 is 0, .. and 3
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*)"
    r'|(?P<text>"[^"\n]*")'
    r"|(?P<sign><=>|<=|>=|!=|=>|->|\.\.|[-+*/&|!?:;,()\[\]{}=<>'])"
)
SHOWN = 40  # characters of a token in a message


class ModelTextError(ValueError):
    """What is wrong with a model, and where: line and column, from 1.

    fault : what is wrong
    """

    def __init__(self, fault: str, token: Lexeme) -> None:
        super().__init__(f"line {token.line}, column {token.column}: {fault}")
        self.fault, self.line, self.column = fault, token.line, token.column


class Lexeme(NamedTuple):
    """A piece of a text: its kind, its text (of quoted text what stands in the quotes), line and column from 1."""

    kind: str
    text: str
    line: int
    column: int

    @property
    def shown(self) -> str:
        """The token in a message."""
        if self.kind == END:
            return "the end of the text"
        return repr(self.text if len(self.text) <= SHOWN else f"{self.text[:SHOWN]}...")


def tokens_of(text: str) -> list[Lexeme]:
    """The tokens of a text, and a last one of the kind END. Work in proportion to the text.

    ModelTextError: a character that the language does not have

    >>> from kinetics.markov.prism.tokens import tokens_of
    >>> [token.text for token in tokens_of("x : [0..3]; // counts")]
    ['x', ':', '[', '0', '..', '3', ']', ';', '']
    """
    found: list[Lexeme] = []
    place, line, begin = 0, 1, 0  # begin: of the line
    while place < len(text):
        lexeme = LEXEMES.match(text, place)
        if lexeme is None:
            wrong = Lexeme(SIGN, text[place], line, place - begin + 1)
            why = "a quoted text does not end on its line" if text[place] == '"' else f"{wrong.shown} means nothing"
            raise ModelTextError(why, wrong)
        kind, words = str(lexeme.lastgroup), lexeme[0]
        if kind != "blank":
            found.append(Lexeme(kind, words[1:-1] if kind == TEXT else words, line, place - begin + 1))
        elif "\n" in words:
            line += words.count("\n")
            begin = place + words.rindex("\n") + 1
        place = lexeme.end()
    found.append(Lexeme(END, "", line, len(text) - begin + 1))
    return found


class TokenReader:
    """Tokens from left to right, for readers that look a few ahead."""

    def __init__(self, text: str) -> None:
        self._tokens = tokens_of(text)
        self._place = 0

    @property
    def next(self) -> Lexeme:
        """The next token, which stays."""
        return self._tokens[self._place]

    def ahead(self, n: int) -> Lexeme:
        """The token n places behind the next one, or the last."""
        return self._tokens[min(self._place + n, len(self._tokens) - 1)]

    def take(self) -> Lexeme:
        """The next token, which is then done."""
        token = self.next
        self._place += token.kind != END
        return token

    def is_next(self, *texts: str) -> bool:
        """Whether the next token is one of these signs or words."""
        return self.next.kind in (SIGN, NAME) and self.next.text in texts

    def takes(self, *texts: str) -> Lexeme | None:
        """The next token if it is one of these signs or words; else None, and nothing is done."""
        return self.take() if self.is_next(*texts) else None

    def expect(self, text: str, what: str = "") -> Lexeme:
        """The next token, which must be this sign or word."""
        if not self.is_next(text):
            raise ModelTextError(f"{self.next.shown} came; expected {text!r}{f' {what}' if what else ''}", self.next)
        return self.take()

    def name(self, what: str) -> Lexeme:
        """The next token, which must be a name."""
        token = self.next
        if token.kind != NAME:
            raise ModelTextError(f"{token.shown} came; expected the name of {what}", token)
        if token.text in RESERVED:
            raise ModelTextError(f"{token.text!r} is a word of the language; it cannot be the name of {what}", token)
        return self.take()

    def quoted(self, what: str) -> Lexeme:
        """The next token, which must be a name in quotes."""
        token = self.next
        if token.kind != TEXT:
            raise ModelTextError(f'{token.shown} came; expected the name of {what} in quotes, as in "down"', token)
        if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", token.text):
            raise ModelTextError(
                f"{token.shown} is no name of {what}; expected letters, digits and _, no digit first", token
            )
        return self.take()
