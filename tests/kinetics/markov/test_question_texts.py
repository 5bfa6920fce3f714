"""Questions as text: what they mean, and that nothing else is read."""

import numpy as np
import pytest

from kinetics import Chain, Network
from kinetics.markov import ask
from kinetics.markov.questions import parse
from kinetics.markov.questions.always import AlwaysQuestion
from kinetics.markov.questions.reward import RewardQuestion
from kinetics.markov.questions.steady_state import SteadyStateQuestion
from kinetics.markov.questions.until import UntilQuestion


@pytest.mark.parametrize(
    ("text", "query"),
    [
        ("P=? [ F<=100 quadmer >= 1 ]", UntilQuestion("quadmer >= 1", None, 100.0)),
        ("P=?[F quadmer>=1]", UntilQuestion("quadmer>=1")),
        ("P = ? [ F<1e-3 a = 1 ]", UntilQuestion("a = 1", None, 1e-3)),
        ("P=? [ F[2,5] a = 1 ]", UntilQuestion("a = 1", None, 5.0, 2.0)),
        ("P=? [ a > 0 U [ 2 , 5 ] b = 3 ]", UntilQuestion("b = 3", "a > 0", 5.0, 2.0)),
        ("P=? [ G[0,5] a = 1 ]", AlwaysQuestion("a = 1", 5.0)),
        ("P=? [ a > 0 U b = 3 ]", UntilQuestion("b = 3", "a > 0")),
        ("P=? [ (a > 0 | b < 2) U<=2.5 b = 3 ]", UntilQuestion("b = 3", "(a > 0 | b < 2)", 2.5)),
        ('P=? [ true U "U" ]', UntilQuestion('"U"', "true")),
        ("P=? [ G<=7 Up < 3 ]", AlwaysQuestion("Up < 3", 7.0)),
        ("P=? [ G x = 0 ]", AlwaysQuestion("x = 0")),
        ("S=? [ x = 0 ]", SteadyStateQuestion("x = 0")),
        ('R{"dimer"}=? [ I=50 ]', RewardQuestion("dimer", at=50.0)),
        ("R=? [ C<=50 ]", RewardQuestion(up_to=50.0)),
        ('R{"a b"}=? [ F x = 0 ]', RewardQuestion("a b", until="x = 0")),
        ('R{"r"}=? [ S ]', RewardQuestion("r")),
        ("E[AB] @ 100", RewardQuestion("AB", at=100.0)),
        ('E [ "a b" ]@1e-3', RewardQuestion("a b", at=1e-3)),
        ("E[A(x,y)] @ 0", RewardQuestion("A(x,y)", at=0.0)),
        ("P=? [ Fish >= 1 U Good ]", UntilQuestion("Good", "Fish >= 1")),
    ],
)
def test_what_is_read(text, query):
    assert parse(text) == query


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "cannot read the question"),
        ("P>0.5 [ F x = 0 ]", "cannot read the question"),
        ("P=? [ ]", "nothing is asked for"),
        ("P=? [ F x = 0", "cannot read the question"),
        ("P=? [ x = 0 ]", "; expected P="),
        ("P=? [ x = 0 U y = 0 U z = 0 ]", "2 times U"),
        ("P=? [ U x = 0 ]", "nothing stands before U"),
        ("P=? [ x = 0 U<=3 ]", "a condition is missing"),
        ("P=? [ F<=-1 x = 0 ]", "time -1; expected a finite number of at least 0"),
        ("P=? [ F<=nan x = 0 ]", "time nan"),
        ("P=? [ F<=soon x = 0 ]", "'soon' is no time"),
        ("P=? [ F>=3 x = 0 ]", "only <= t and [a, b] are answered"),
        ("P=? [ F[2,1] x = 0 ]", "with a <= b"),
        ("P=? [ F[1,2 x = 0 ]", "only <= t and [a, b] are answered"),
        ('P{"r"}=? [ F x = 0 ]', "only R takes a reward's name"),
        ("R=? [ x = 0 ]", "; expected P="),
        ("R=? [ I<=3 ]", "expected I=t"),
        ("R=? [ C=3 ]", "expected C<=t"),
        ("R=? [ C<=3 x ]", "expected C<=t"),
        ("R=? [ F<=3 x = 0 ]", "no time bound"),
        ("E[AB]", "or E[name] @ t"),
        ("E[AB] @", "expected E[name] @ t, as in E[AB] @ 100"),
        ("E[] @ 3", "expected E[name] @ t"),
        ("E[AB] @ soon", "cannot read the question 'E[AB] @ soon': 'soon' is no time"),
        ("E[AB] @ -1", "time -1; expected a finite number of at least 0"),
    ],
)
def test_what_is_not_read(text, message):
    with pytest.raises(ValueError, match=message.replace("[", r"\[")):
        parse(text)


def test_random_text_is_refused_or_read():
    rng = np.random.default_rng(0)
    pieces = ["x", ">=", "0", "=", "(", ")", "!", "&", "U", "x >= 1", "x = 0", "<=1", '"', "[", "1e9", "F"]
    refused = 0
    chain = Chain([[0, 1.0], [1.0, 0]], 0, variables=("x",), counts=[[0], [1]])
    for _ in range(600):
        inner = " ".join(rng.choice(pieces, rng.integers(1, 6)))
        text = rng.choice(["P=? [ F {} ]", "P=? [ {} ]", "S=? [ {} ]", "{}"]).format(inner)
        try:
            ask(chain, text)
        except ValueError:
            refused += 1
    assert 500 < refused < 600  # some are read: x >= 0


def test_questions_ask_the_methods():
    rates = np.array([[0, 2.0, 0], [1.0, 0, 0.5], [0, 0.1, 0]])
    chain = Chain(rates, 0, {"end": [False, False, True]}, {"r": [0, 1.0, 5.0]}, ("x",), [[0], [1], [2]])
    same = [
        ("P=? [ F<=2 x >= 2 ]", chain.until("end", by=2.0)),
        ('P=? [ !"end" U<=2 x = 1 & true ]', chain.until("x == 1", '!"end"', by=2.0)),
        ("P=? [ true U end ]", chain.until("end")),
        ("P=? [ G<=3 x != 2 ]", chain.always('!"end"', by=3.0)),
        ("S=? [ x <= 1 | false ]", chain.steady_state("x <= 1")),
        ("R=? [ I=2 ]", chain.reward("r", at=2.0)),
        ('R{"x"}=? [ C<=2 ]', chain.reward("x", up_to=2.0)),
        ('R{"r"}=? [ F "end" ]', chain.reward("r", until="end")),
        ('R{"r"}=? [ S ]', chain.reward("r", stationary=True)),
    ]
    for text, answer in same:
        found = ask(chain, text)
        assert (found.value, found.low, found.high, found.method) == (
            answer.value,
            answer.low,
            answer.high,
            answer.method,
        )
    assert len({answer.value for _, answer in same}) >= len(same) - 1  # the control: they ask different things


def test_time_is_earned_until_a_target():
    network = Network.from_text("A -> 0, 0.5")
    chain = Chain.of(network, {"A": 3})
    answer = ask(chain, 'R{"time"}=? [ F A = 0 ]')
    truth = 2.0 * (1 + 1 / 2 + 1 / 3)
    assert answer.low <= truth <= answer.high
    assert answer.is_bound
    assert answer.value == pytest.approx(chain.passage("A == 0").mean, rel=1e-12)
    assert ask(chain, 'R{"time"}=? [ C<=7 ]').value == pytest.approx(7.0, rel=1e-12)
    named = Chain.of(Network.from_text("time -> 0, 0.5"), {"time": 3})  # a species of that name comes first
    assert ask(named, 'R{"time"}=? [ I=0 ]').value == 3.0
    with pytest.raises(ValueError, match="unknown reward 'tim'"):
        ask(chain, 'R{"tim"}=? [ F A = 0 ]')
