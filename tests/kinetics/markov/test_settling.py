"""Chains that are followed no further than to where an answer is settled."""

import numpy as np
import pytest

from kinetics import Chain, Model, Network
from kinetics.markov.observing import observing
from kinetics.markov.questions import parse
from kinetics.markov.settling import answering_chains
from kinetics.markov.transient.search import TooManyStatesError

QUEUE = "arrive: 0 -> Job, 0.9\nserve: Job -> 0, 1.0 * (Job > 0)"
DIMERS = "2 A <-> D, 0.01, 0.5\nD -> E, 0.2\nA = 24"
QUESTIONS = [
    "P=? [ F<=3 D >= 5 ]",
    "P=? [ F E >= 2 ]",
    "P=? [ F[1,3] D >= 5 ]",
    "P=? [ D < 4 U[1,5] E >= 1 ]",
    "P=? [ G[1,2] A > 10 ]",
    "P=? [ D < 4 U<=5 E >= 1 ]",
    "P=? [ bodies > 14 U E = 3 ]",
    "P=? [ G<=2 A > 10 ]",
    "P=? [ G A > 30 ]",
    'R{"time"}=? [ F E >= 2 ]',
    'R{"bodies"}=? [ F E >= 2 ]',
    'R{"D"}=? [ C<=4 ]',
    'R{"A"}=? [ I=4 ]',
    "S=? [ E = 12 ]",
    'P=? [ F<=9 "deadlock" ]',  # a state in which a chain was stopped would be one
    'P=? [ F<=9 (E >= 2 & !"deadlock") ]',
    'P=? [ !"init" | A = 24 U<=9 E >= 2 ]',
]
BODIES = {"bodies": {"A": 1, "D": 1, "E": 1}}


def answered(questions, model, **more):
    queries = [parse(question) for question in questions]
    found = {}
    for chain, places in answering_chains(queries, model, **more):
        found |= {place: (queries[place].value(chain), len(chain)) for place in places}
    return [found[place] for place in range(len(queries))]


@pytest.mark.parametrize("truncate", [None, "E <= 6", 60])
@pytest.mark.parametrize("question", QUESTIONS)
def test_the_answer_is_that_of_the_whole_chain(question, truncate):
    model = Model(Network.from_text(DIMERS), observables=BODIES)
    whole = observing(Chain.of(model, truncate=truncate), model)
    try:
        expected = parse(question).value(whole)
    except ValueError as refusal:
        with pytest.raises(ValueError, match=str(refusal)[:30]):
            answered([question], model, truncate=truncate)
        return
    ((found, size),) = answered([question], model, truncate=truncate)
    if truncate is None:
        assert found.value == pytest.approx(expected.value, rel=1e-11)
    assert found.low <= expected.high * (1 + 1e-12)
    assert expected.low <= found.high * (1 + 1e-12)
    assert size <= len(whole)
    if truncate is None and ("F " in question or "F<" in question) and '"deadlock"' not in question:
        assert size < len(whole)


def test_questions_to_one_chain_share_it_and_do_not_spoil_each_other():
    model = Model(Network.from_text(DIMERS), observables=BODIES)
    together = answered(QUESTIONS, model)
    whole = observing(Chain.of(model), model)
    for question, (found, size) in zip(QUESTIONS, together, strict=True):
        expected = parse(question).value(whole)
        assert (found.value, found.low, found.high, size) == (expected.value, expected.low, expected.high, len(whole))


def test_where_all_states_cannot_be_listed_each_question_has_its_own_chain():
    net = Model(Network.from_text(QUEUE), [0])
    few, many = answered(["P=? [ F<=60 Job >= 20 ]", "P=? [ F<=60 Job = 5 ]"], net)
    assert (few[1], many[1]) == (21, 6)
    assert few[0].value == pytest.approx(0.0423456633328, abs=1e-12)
    assert many[0].value > few[0].value
    twice = answered(["P=? [ F<=60 Job >= 20 ]", "P=? [ F Job >= 20 ]"], net)
    assert [size for _, size in twice] == [21, 21]
    assert twice[0][0].value == few[0].value
    with pytest.raises(TooManyStatesError, match="'arrive'"):
        answered(["P=? [ F<=60 Job >= 20 ]", "E[Job] @ 60"], net)


def test_the_chain_also_stops_where_it_is_told_to():
    net = Model(Network.from_text("0 <-> A, 1, 1\n0 <-> B, 1, 1"))
    ((found, _),) = answered(["P=? [ F<=2 A >= 3 ]"], net, stop="B >= 2")
    expected = parse("P=? [ F<=2 A >= 3 ]").value(Chain.of(net, stop=lambda s: (s[:, 1] >= 2) | (s[:, 0] >= 3)))
    assert found.value == expected.value
    assert 0 < found.value < 1
    assert np.isfinite(found.high)
