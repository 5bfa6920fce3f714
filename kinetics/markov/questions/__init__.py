"""Questions to a chain as text, in the notation of PRISM and Storm: `P=? [ F<=100 quadmer >= 1 ]`.

    P=? [ F phi ]  P=? [ G phi ]  P=? [ phi U psi ]    each also with a time bound: F<=100, F>=20, F[20,100]
    P=? [ X phi ]                                       the next jump leads to phi
    P=? [ F phi || F psi ]                              phi, given psi; each also up to a time
    S=? [ phi ]                                         after infinite time
    R{"name"}=? [ I=t ]  [ S ]                          rate at a time, steady rate
    R{"name"}=? [ C<=t ]  [ C ]  [ F phi ]              total up to a time, of all time, until phi
    R[var]{"name"}=? [ I=t ]  [ F phi ]                 variance of a rate at a time, or of a total until phi
    E[name] @ t  var[name] @ t  sd[name] @ t            mean, variance and standard deviation of a count at a time
    q0.9[name] @ t                                      the least count not exceeded at a time with a probability
    R{"time"}=? [ F phi ]                               mean time until phi
    quantile(min T, P>=0.9 [ F<=T phi ])                the time by which phi is reached with a probability
    P>=p [ ... ]  S>=p [ ... ]  R{"name"}>=x [ ... ]    true, false, or not decided within the bound; also <, <=, >
    filter(op, question, phi)                           min, max, avg, sum, argmin, argmax, count, forall, exists,
                                                        state or first of the answers from the states in phi

phi and psi are conditions on counts and labels (see `network.predicates`), and may hold questions that are true or
false: `P=? [ F<=5 x > 1 & R{"time"}<3 [ F "done" ] ]`. The words F, U, G, I, C and S stand for themselves only if these
forms have them; a species with such a name is quoted: F "S" >= 1. X is a species if a sign follows. A kind of question
is a file, imported here: see `Question`.
"""

# ruff: noqa: I001 - the imports of questions are the list, in the order in which they read a text

from __future__ import annotations

from kinetics.markov.chain import Chain
from kinetics.markov.questions.base import Question
from kinetics.markov.questions.reader import Cursor
from kinetics.network.laws.reading import shortened
from kinetics.support.answer import Answer
from kinetics.support.families import members

# To add one, see `Question`.
from kinetics.markov.questions.until import UntilQuestion as UntilQuestion
from kinetics.markov.questions.always import AlwaysQuestion as AlwaysQuestion
from kinetics.markov.questions.steady_state import SteadyStateQuestion as SteadyStateQuestion
from kinetics.markov.questions.reward import RewardQuestion as RewardQuestion
from kinetics.markov.questions.next import NextQuestion as NextQuestion
from kinetics.markov.questions.conditional import ConditionalQuestion as ConditionalQuestion
from kinetics.markov.questions.variance import VarianceQuestion as VarianceQuestion
from kinetics.markov.questions.deviation import DeviationQuestion as DeviationQuestion
from kinetics.markov.questions.count_quantile import CountQuantileQuestion as CountQuantileQuestion
from kinetics.markov.questions.quantile import QuantileQuestion as QuantileQuestion
from kinetics.markov.questions.comparison import ComparisonQuestion as ComparisonQuestion
from kinetics.markov.questions.filter import FilterQuestion as FilterQuestion

QUESTIONS: tuple[type[Question], ...] = members(globals(), Question)

__all__ = ["QUESTIONS", "Question", "ask", "parse"]


def ask(chain: Chain, question: str) -> Answer:
    """The answer of a chain to a question as text; a ValueError if it cannot be read or has no finite answer.

    question : in the notation of PRISM and Storm, such as `P=? [ F<=100 A >= 1 ]`; the forms are listed in
        `kinetics.markov.questions`. One that is true or false gives a `TruthValue`

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
    """The question that a text asks; conditions in it are held against names when they meet a chain, which has these.

    ValueError: it cannot be read, with the column at which it goes wrong

    >>> from kinetics.markov.questions import parse
    >>> parse("P=? [ G<=7 A < 3 ]").conditions
    ('A < 3',)
    """
    text = Cursor(question, QUESTIONS)
    found: Question | None = text.question()
    if found is None:
        forms = [form for kind in QUESTIONS for form in kind.forms]
        expected = f"expected {', '.join(forms[:-1])} or {forms[-1]}"
        raise ValueError(f"cannot read the question {shortened(question)!r}; {expected}")
    if text.here.kind != "end":
        text.fail(f"{text.here.text!r} comes behind the question")
    return found
