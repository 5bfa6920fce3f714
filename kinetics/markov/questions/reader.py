"""The reader of questions: tokens, and a cursor by which each kind of question reads its form, by recursive descent.

    operator = LETTER [ [var] ] [ {"name"} ] =? [ ... ]     LETTER is P, R or S; with < <= >= > and a number for =?,
                                                            it is true or false, and may stand in a condition
    path     = X states | F bound states | G bound states | states U bound states
    bound    = nothing | <= time | >= time | [ time , time ]
    states   = a condition on counts and labels (`network.predicates`), with operators that are true or false in it

Nothing is filtered by a pattern: text is cut into tokens, and every token is taken by the form that is read.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any, NamedTuple, NoReturn

from kinetics.markov.questions.formula import Span, StateFormula
from kinetics.network.laws.reading import LONGEST, NUMBER, WORD, FormulaError, Token, shortened

PIECE = re.compile(
    rf"\s*(?:(?P<number>{NUMBER})|(?P<word>{WORD.pattern})|(?P<quoted>'(?:[^'\\]|\\.)*'|\"(?:[^\"\\]|\\.)*\")"
    r"|(?P<sign><=|>=|==|!=|=>|&&|\|\||\S))"
)
LETTERS = ("P", "R", "S")
LIMITS = ("<", "<=", ">", ">=")
OPENS, CLOSES = ("(", "[", "{"), (")", "]", "}")
DEEPEST = 20  # questions inside questions


class Operator(NamedTuple):
    """The head of a question: its letter, the name of a reward, what is asked of it, and where its brackets open.

    sign : = for a value, or that of a limit; limit : its number as text; measure : "var" for a variance, else "exp"
    """

    letter: str
    name: str | None
    measure: str
    sign: str
    limit: str
    inside: int


class PathFormula(NamedTuple):
    """What a run must do: a word X, F, G or U, the states behind it and before a U, and from when to when, tu."""

    word: str
    target: StateFormula
    through: StateFormula | None
    after: float
    by: float | None


class Cursor:
    """A place in the tokens of a question, from which forms are read; each read goes on behind what it took.

    kinds : classes with a method `read`, which takes a cursor
    """

    def __init__(self, text: str, kinds: Sequence[Any]) -> None:
        self.text, self.kinds, self.place, self.depth = text, kinds, 0, 0
        self.tokens, self._as_value = tokens_of(text), -1  # the place of a head that `value_of` has changed
        self._known: dict[Any, Any] = {}  # formulas and questions by their place: several kinds read the same ones

    def at(self, place: int, **changes: Any) -> Cursor:
        """A cursor at another place, with changes of what it is."""
        other = object.__new__(Cursor)
        other.__dict__ |= {**vars(self), "place": place, **changes}
        return other

    @property
    def here(self) -> Token:
        """The next token."""
        return self.tokens[self.place]

    def fail(self, why: str, place: int | None = None) -> NoReturn:
        """Raise the ValueError of a text that cannot be read here."""
        column = self.tokens[self.place if place is None else place].column
        raise ValueError(f"cannot read the question {shortened(self.text)!r}: {why} at column {column + 1}")

    def sees(self, *texts: str) -> bool:
        """Whether the next tokens are these words or signs."""
        coming = self.tokens[self.place : self.place + len(texts)]
        return tuple(each.text for each in coming if each.kind != "quoted") == texts

    def takes(self, *texts: str) -> bool:
        """Go on behind these words or signs if they come next; whether they do."""
        found = self.sees(*texts)
        self.place += len(texts) * found
        return found

    def expect(self, text: str, why: str = "") -> None:
        """Go on behind a word or sign; a ValueError if something else comes."""
        if not self.takes(text):
            came = f"{self.here.text!r} came" if self.here.text else "the text ends"
            self.fail(why or f"expected {text!r}, {came}")

    def operator(self, *letters: str) -> Operator | None:
        """Go into the brackets of an operator `=?` of one of these letters; None if none comes."""
        head = self.head()
        if head is None or head.letter not in letters or head.sign != "=":
            return None
        self.place = head.inside
        if self.sees("]"):
            self.fail("nothing is asked for")
        return head

    def head(self) -> Operator | None:
        """The head of an operator that begins here, of which nothing is taken; None if none does."""
        begin, letter, name, measure = self.place, self.here.text, None, "exp"
        try:
            if self.here.kind != "word" or letter not in LETTERS:
                return None
            self.place += 1
            if self.sees("[", "var", "]") or self.sees("[", "exp", "]"):
                measure = self.tokens[self.place + 1].text
                self.place += 3
            if self.sees("{") and self.tokens[self.place + 1].kind == "quoted":
                name = self.tokens[self.place + 1].text[1:-1]
                self.place += 2
                self.expect("}")
            sign, limit = self.here.text, self.tokens[self.place + 1].text if self.here.kind != "end" else ""
            is_head = self.takes("=", "?") or (sign in LIMITS and self.tokens[self.place + 1].kind == "number")
            self.place += 2 * (sign in LIMITS and is_head)
            if not is_head or not self.takes("["):
                return None
            if letter != "R" and (name is not None or measure != "exp"):
                self.fail("only R takes a reward's name, or [var]", begin)
            return Operator(letter, name, measure, sign, limit, self.place)
        finally:
            self.place = begin

    def question(self) -> Any:
        """The question that comes next, by the kind that reads it; None if no kind does."""
        if self.depth > DEEPEST:
            self.fail(f"more than {DEEPEST} questions inside each other")
        key = "question", self.place, self.place == self._as_value
        if key not in self._known:
            self._known[key] = None, self.place
            for kind in self.kinds:
                cursor = self.at(self.place)
                found = kind.read(cursor)
                if found is not None:
                    self._known[key] = found, cursor.place
                    break
        found, self.place = self._known[key]
        return found

    def path(self) -> PathFormula | None:
        """A path formula; None if what comes is none, of which nothing is taken then."""
        begin = self.place
        following = self.tokens[self.place + 1]
        # A species may be called X, but then a sign follows: X is the operator if a condition does.
        if self.sees("X") and (following.kind in ("word", "quoted", "number") or following.text in ("(", "!")):
            self.place += 1
            return PathFormula("X", self.states("||"), None, 0.0, None)
        for word in ("F", "G"):
            if self.takes(word):
                after, by = self.bound()
                return PathFormula(word, self.states("||"), None, after, by)
        through = self._scanned("U", "||")
        if not self.takes("U"):
            self.place = begin
            return None
        if not through.text:
            self.fail("nothing stands before U; write F psi, or true U psi")
        self.checked(through, begin)
        after, by = self.bound()
        return PathFormula("U", self.states("U", "||"), through, after, by)

    def bound(self) -> tuple[float, float | None]:
        """A time bound, <= t, >= t or [a, b], or none: from when and until when, tu; None for ever."""
        begin, sign = self.place, self.here.text
        if self.takes("["):
            after = self.time()
            self.expect(",", "expected a time bound [a, b]")
            by = self.time()
            self.expect("]", "expected a time bound [a, b]")
            if after > by:
                self.fail("a time bound [a, b] with a > b; expected a <= b", begin)
            return after, by
        if self.takes("<=") or self.takes("<"):
            return 0.0, self.time()
        if self.takes(">=") or self.takes(">"):
            return self.time(), None
        if sign in ("=", "=="):
            self.fail("a time bound =; only <= t, >= t and [a, b] are answered")
        return 0.0, None

    def time(self) -> float:
        """A time, tu: a finite number of at least 0."""
        begin, minus = self.place, "-" if self.takes("-") else ""
        text = minus + self.here.text
        try:
            value = float(text)
        except ValueError:
            self.fail(f"{text!r} is no time; expected a number of tu", begin)
        if not 0.0 <= value < math.inf:
            self.fail(f"time {text}; expected a finite number of at least 0", begin)
        self.place += 1
        return value

    def states(self, *ends: str) -> StateFormula:
        """A condition on states, up to a bracket that closes or one of the words or signs that end it."""
        begin = self.place
        return self.checked(self._scanned(*ends), begin)

    def checked(self, formula: StateFormula, begin: int) -> StateFormula:
        """A formula that begins at a token; a ValueError with its column if it is no condition."""
        if not formula.text:
            self.fail("a condition is missing", begin)
        try:
            formula.check_syntax()
        except FormulaError as error:
            column = self.tokens[begin].column + formula.place_of(error.place)
            told = f"cannot read the question {shortened(self.text)!r}: {error.fault} at column {column + 1}"
            raise ValueError(told) from None
        return formula

    def _scanned(self, *ends: str) -> StateFormula:
        """As `states`, of which only the nested questions are read."""
        begin, key = self.place, (self.place, ends)
        if key not in self._known:
            self._known[key] = self._scan(ends), self.place
        formula, self.place = self._known[key]
        return formula if self.place > begin else StateFormula("")

    def _scan(self, ends: Sequence[str]) -> StateFormula:
        begin, depth, spans = self.here.column, 0, []
        while self.here.kind != "end":
            token = self.here
            sign = "" if token.kind == "quoted" else token.text
            if not depth and (sign in ends or sign in CLOSES):
                break
            head = self.head()
            if head is not None:
                spans.append(self._nested(head, begin))
                continue
            depth += (sign in OPENS) - (sign in CLOSES)
            self.place += 1
        last = self.tokens[self.place - 1]
        return StateFormula(self.text[begin : last.column + len(last.text)], tuple(spans))

    def _nested(self, head: Operator, begin: int) -> Span:
        """The nested question that comes next, of which the head is known, in a formula that begins at a column."""
        if head.sign == "=":
            self.fail(f"{head.letter}=? [ ... ] is a number; in a condition, compare it, as in {head.letter}>0.5")
        column, inner = self.here.column, self.at(self.place, depth=self.depth + 1)
        question = inner.question()
        if question is None:
            self.fail("this question cannot be read")
        self.place = inner.place
        last = self.tokens[self.place - 1]
        return Span(column - begin, last.column + len(last.text) - begin, question)

    def value_of(self, head: Operator) -> Cursor:
        """A cursor that reads `=?` where this one has the sign and the limit of an operator."""
        tokens = list(self.tokens)
        for place, text in ((head.inside - 3, "="), (head.inside - 2, "?")):
            tokens[place] = Token("sign", text, tokens[place].column)
        return self.at(self.place, tokens=tokens, _as_value=self.place)

    def number_after(self, letter: str, end: str) -> float | None:
        """Go on behind a number that follows a letter without a blank, up to a sign; None if none does: q0.9 before [.

        The tokens are cut where a word ends, as q0 and .9, so the number is read from the text.
        """
        for place in range(self.place, min(self.place + 5, len(self.tokens))):
            if self.tokens[place].text == end and self.here.text.startswith(letter):
                try:
                    number = float(self.text[self.here.column + len(letter) : self.tokens[place].column])
                except ValueError:
                    return None
                self.place = place
                return number
        return None

    def name_at(self, form: str) -> tuple[str, float]:
        """The name and the time, tu, of `name] @ t`, behind the bracket that a form such as `E[name] @ t` opens."""
        expected = f"expected {form}, as in {form.replace('name', 'AB').replace(' t', ' 100')}"
        name = self.text_until("]").strip("\"'")
        self.expect("]", expected)
        self.expect("@", expected)
        if not name or self.here.kind == "end":
            self.fail(expected)
        return name, self.time()

    def text_until(self, *ends: str) -> str:
        """The text up to one of these signs, outside of brackets, whatever it is."""
        begin, depth = self.here.column, 0
        while self.here.kind != "end" and not (depth == 0 and self.here.text in ends):
            sign = "" if self.here.kind == "quoted" else self.here.text
            depth += (sign in OPENS) - (sign in CLOSES)
            self.place += 1
        return self.text[begin : self.here.column].strip()


def tokens_of(text: str) -> list[Token]:
    """The tokens of a question, and one that ends it; a ValueError for what is no text, or too long."""
    if not isinstance(text, str):
        raise ValueError(f"{text!r} is no question; expected text, as in 'P=? [ F<=100 A >= 1 ]'")
    if len(text) > LONGEST:
        raise ValueError(f"a question of {len(text)} characters; at most {LONGEST} are read")
    # Without blanks at the end every place begins a token: tried at each of many blanks, a match is quadratic in them.
    found = [(each.lastgroup or "", each) for each in PIECE.finditer(text.rstrip())]
    ends = [Token("end", "", len(text))] * 3  # one may look beyond the first
    return [*(Token(kind, each[kind], each.start(kind)) for kind, each in found), *ends]
