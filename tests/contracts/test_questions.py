"""What every kind of question to a chain must do, so that a new one is tested by its line in `QUESTIONS`."""

import re

import numpy as np
import pytest

from kinetics import Chain, Model, Network, Sensitivity
from kinetics.markov import questions
from kinetics.markov.observing import observing
from kinetics.markov.questions import QUESTIONS, Question, ask, parse
from kinetics.markov.questions.always import AlwaysQuestion
from kinetics.markov.questions.filter import FilterQuestion
from kinetics.markov.questions.formula import StateFormula
from kinetics.markov.questions.next import NextQuestion
from kinetics.markov.questions.reader import Cursor
from kinetics.markov.questions.reward import RewardQuestion
from kinetics.markov.questions.steady_state import SteadyStateQuestion
from kinetics.markov.questions.until import UntilQuestion
from kinetics.markov.settling import answering_chains
from kinetics.predicting.scanning import sampled, scan

RATES, RUNS, FALSE_ALARM = (2.0, 3.0), 1500, 1e-6
EXAMPLES = [(kind, text) for kind in QUESTIONS for text in kind.examples]
each = pytest.mark.parametrize(("kind", "text"), EXAMPLES, ids=[text for _, text in EXAMPLES])


def model_of(rates=RATES):
    return Model(Network.from_text("A <-> B, {}, {}".format(*rates)), {"A": 3}, {"both": {"A": 1, "B": 1}})


def chain_of(rates=RATES):
    model = model_of(rates)
    return observing(Chain.of(model), model)


@each
def test_a_text_is_read_by_its_kind_alone(kind, text):
    found = parse(text)
    assert type(found) is kind
    assert found == parse(f"  {text} ")
    assert len({found, parse(text)}) == 1
    assert sum(other.read(Cursor(text, QUESTIONS)) is not None for other in QUESTIONS) == 1
    with pytest.raises(ValueError, match=re.escape(kind.forms[0])):
        parse("Z=? [ A ]")


@each
def test_the_value_has_proven_bounds_and_names_are_checked(kind, text):
    answer = ask(chain_of(), text)
    assert answer.is_bound
    assert answer.low <= answer.value <= answer.high
    assert answer.high - answer.low <= 1e-9 * max(answer.value, 1e-3)
    parse(text).check(model_of())
    other = Model(Network.from_text("X <-> Y, 2, 3"), {"X": 3})
    with pytest.raises(ValueError, match=r"unknown|no reward"):
        parse(text.replace('"time"', '"tim"')).check(other)


@each
def test_derivatives_are_those_of_differences(kind, text):
    try:
        found = parse(text).derivatives(Sensitivity(chain_of()))
    except ValueError as refusal:
        assert "no derivatives" in str(refusal)  # noqa: PT017 - some kinds have them, and say so if not
        assert kind not in (UntilQuestion, AlwaysQuestion, SteadyStateQuestion, RewardQuestion, NextQuestion)
        return
    assert found.answer.value == pytest.approx(ask(chain_of(), text).value, rel=1e-9)
    step = 1e-4
    for i in range(2):
        ends = [ask(chain_of(np.array(RATES) * np.exp(step * sign * np.eye(2)[i])), text).value for sign in (1, -1)]
        assert found.value[i] == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-5, abs=1e-7)
        assert found.low[i] <= found.value[i] <= found.high[i]


@each
def test_the_answers_from_every_state_are_those_of_each(kind, text):
    """One solution for all, against the default, which asks each state alone."""
    question, chain = parse(text), chain_of()
    every = np.ones(len(chain), dtype=bool)
    if kind is FilterQuestion or question.is_truth:
        return
    fast, slow = question.by_state(chain, every), Question.by_state(question, chain, every)
    assert fast.is_bound
    assert np.isfinite(fast.value).all()
    assert (fast.low <= slow.high).all()
    assert (slow.low <= fast.high).all()
    assert (fast.high - fast.low <= 1e-9 * np.maximum(fast.value, 1e-3)).all()
    assert not (fast.low + 1e-3 <= slow.high).any()  # the control


@each
def test_a_chain_that_stops_where_the_answer_is_settled_has_the_same(kind, text):
    (pair,) = answering_chains([parse(text)], model_of())
    assert parse(text).value(pair[0]).value == pytest.approx(ask(chain_of(), text).value, rel=1e-12)


@each
def test_runs_agree(kind, text, monkeypatch):
    question = parse(text)
    monkeypatch.setattr(sampled, "LEVEL", 1 - FALSE_ALARM)
    (found,) = sampled.sampled_answers(model_of(), [(text, question)], RUNS, seed=1)
    if question.sampling is None:
        assert "cannot be sampled" in found.why
        return

    def covers(value):
        if np.isnan(found.low):  # all runs are alike
            return abs(value - found.value) <= 1e-12
        return found.low - 1e-12 <= value <= found.high + 1e-12  # runs may be alike but for rounding

    if question.is_truth:
        assert found.holds in (ask(chain_of(), text).holds, None)
        return
    assert covers(ask(chain_of(), text).value)
    other = ask(chain_of((8.0, 3.0)), text).value
    assert other == pytest.approx(ask(chain_of(), text).value) or not covers(other)  # the control


def test_a_new_kind_takes_a_class_and_a_place_in_the_tuple(monkeypatch):
    class Never(AlwaysQuestion):
        forms = ("P=? [ N<=t phi ]",)

        @classmethod
        def read(cls, text):
            if not text.operator("P") or not text.takes("N"):
                return None
            (_, by), states = text.bound(), text.states()
            text.expect("]")
            return cls(StateFormula(f"!({states.text})"), by)

    with pytest.raises(ValueError, match="cannot read"):
        parse("P=? [ N<=0.2 B >= 2 ]")
    monkeypatch.setattr(questions, "QUESTIONS", (*QUESTIONS, Never))
    text = "P=? [ N<=.2 B >= 2 ]"
    exact = ask(chain_of(), "P=? [ G<=0.2 B < 2 ]").value
    assert ask(chain_of(), text).value == exact
    assert scan(model_of(), {"A": [3]}, text).answers[0][0].value == exact
    (by_runs,) = scan(model_of(), {"A": [3]}, text, max_states=0, runs=500).answers[0]
    assert by_runs.low < exact < by_runs.high
    with pytest.raises(ValueError, match="N<=t phi"):
        parse("Z=? [ A ]")
