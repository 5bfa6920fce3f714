"""Questions to a chain as text, in the notation of PRISM and Storm: `P=? [ F<=100 quadmer >= 1 ]`.

    P=? [ F phi ]  P=? [ G phi ]  P=? [ phi U psi ]    each also with a time bound: F<=100, F[20,100]
    S=? [ phi ]                                         after infinite time
    R{"name"}=? [ I=t ]  [ C<=t ]  [ F phi ]  [ S ]     rate at a time, total up to t or until phi, steady rate
    E[name] @ t                                         the first of these for short: the mean of a count at a time
    R{"time"}=? [ F phi ]                               mean time until phi

phi and psi are conditions on counts and labels: see `network.predicates`. The words F, G, U, I, C and S stand for
themselves only if these forms have them; a species with such a name is quoted: F "S" >= 1. A kind of question is a
file, imported here: see `Question`.
"""

# ruff: noqa: I001 - the imports of questions are the list, in the order in which they read a text

from __future__ import annotations

from kinetics.markov.chain import Chain
from kinetics.markov.questions.base import Question
from kinetics.markov.questions.reader import framed
from kinetics.network.laws.reading import shortened
from kinetics.support.answer import Answer
from kinetics.support.families import members

# To add one, see `Question`.
from kinetics.markov.questions.until import UntilQuestion as UntilQuestion
from kinetics.markov.questions.always import AlwaysQuestion as AlwaysQuestion
from kinetics.markov.questions.steady_state import SteadyStateQuestion as SteadyStateQuestion
from kinetics.markov.questions.reward import RewardQuestion as RewardQuestion

QUESTIONS: tuple[type[Question], ...] = members(globals(), Question)

__all__ = ["QUESTIONS", "Question", "ask", "parse"]


def ask(chain: Chain, question: str) -> Answer:
    """The answer of a chain to a question as text; a ValueError if it cannot be read or has no finite answer.

    question : in the notation of PRISM and Storm, such as `P=? [ F<=100 A >= 1 ]`, with `U`, `G`, `S=?` and `R=?` too

    >>> from kinetics import Chain, Network
    >>> from kinetics.markov import ask
    >>> chain = Chain.of(Network.from_text("A <-> B, 2, 3"), {"A": 1})
    >>> round(ask(chain, "S=? [ B == 1 ]").value, 9), round(ask(chain, 'R{"A"}=? [ F B == 1 ]').value, 9)  # 2/5, 1/2
    (0.4, 0.5)
    >>> round(ask(chain, "P=? [ F<=0.5 B == 1 ]").value, 6)  # 1 - 1/e
    0.632121
    """
    return parse(question).value(chain)


def parse(question: str) -> Question:
    """The question that a text asks; conditions in it are read when they meet a chain, which has their names.

    >>> from kinetics.markov.questions import parse
    >>> parse("P=? [ G<=7 A < 3 ]").conditions
    ('A < 3',)
    """
    forms = [form for kind in QUESTIONS for form in kind.forms]
    expected = f"expected {', '.join(forms[:-1])} or {forms[-1]}"
    asked = framed(question, expected)
    try:
        for kind in QUESTIONS:
            found = kind.read(asked)
            if found is not None:
                return found
    except ValueError as error:
        raise ValueError(f"cannot read the question {shortened(question)!r}: {error}") from None
    raise ValueError(f"cannot read the question {shortened(question)!r}; {expected}")
