"""Questions inside conditions, limits and filters: what is certain, what is refused, and where they may be asked."""

import json
import re
from math import exp

import numpy as np
import pytest
from click.testing import CliRunner

from kinetics import Chain, Model, Network, Sensitivity, scan
from kinetics.markov import ask
from kinetics.markov.by_state import until_by_state
from kinetics.markov.questions import parse
from kinetics.support.answer import NONE, PROVEN, Answer, TruthValue
from wellmixed import main

STEPS = Chain(
    [[0, 1, 0], [1, 0, 1], [0, 0, 0]], 1, {"done": [False, False, True]}, {"r": [1.0, 2.0, 0.0]}, ("x",),
    [[0], [1], [2]],
)  # fmt: skip


def in_the_middle():
    """A limit that lies between the bounds from state 1."""
    found = until_by_state(STEPS, "done", by=1.0)
    assert found.low[1] < found.value[1] < found.high[1]
    return repr(float(found.value[1]))


def test_implication_binds_least():
    """a => b is !a | b, on every state, with nested questions too."""
    for text, same in (
        ("x > 0 => done", "!(x > 0) | done"),
        ("x = 0 | done => x > 1 & done", "!(x = 0 | done) | (x > 1 & done)"),
        ("(x > 0 => done) & x < 2", "(!(x > 0) | done) & x < 2"),
        ("x > 0 => (x > 1 => done)", "!(x > 0) | (!(x > 1) | done)"),
        ("P>0.3 [ F<=1 done ] => x = 2", "!P>0.3 [ F<=1 done ] | x = 2"),
        ("x = 2 => P>0.3 [ F<=1 done => x > 1 ]", "!(x = 2) | P>0.3 [ F<=1 (!done | x > 1) ]"),
    ):
        found, expected = (
            STEPS.states(parse(f"P=? [ F {each} ]").target.states(STEPS)).tolist() for each in (text, same)
        )
        assert found == expected
    assert STEPS.states("x > 0 => done").tolist() == [True, False, True]


def test_closed_forms():
    decay = Chain.of(Network.from_text("A -> 0, 0.5"), {"A": 3})
    # P(F<=1 A = 0) from n copies is (1 - exp(-0.5))**n: 0.393, 0.155, 0.061
    assert decay.states(parse("P=? [ F P>0.15 [ F<=1 A = 0 ] ]").target.states(decay)).tolist() == [
        n <= 2 for n in np.asarray(decay.counts)[:, 0]
    ]
    died = 1 - exp(-0.5 * 2.0)
    nested = ask(decay, "P=? [ F<=2 P>0.15 [ F<=1 A = 0 ] ]")  # one of three has died
    assert nested.low <= 1 - (1 - died) ** 3 <= nested.high
    given = ask(decay, "P=? [ F<=2 A = 0 || F<=2 A <= 1 ]")
    assert given.low <= died**3 / (died**3 + 3 * died**2 * (1 - died)) <= given.high
    assert given.high - given.low < 1e-12
    spread = ask(decay, 'R[var]{"A"}=? [ I=2 ]')
    assert spread.low <= 3 * died * (1 - died) <= spread.high
    time = ask(decay, 'R[var]{"time"}=? [ F A = 0 ]')
    assert time.low <= 4 * (1 + 1 / 4 + 1 / 9) <= time.high
    assert ask(decay, 'R{"A"}=? [ C ]').value == pytest.approx(6.0, rel=1e-14)
    after = ask(decay, "P=? [ F>=2 A = 3 ]")
    assert after.low <= (1 - died) ** 3 <= after.high
    late = ask(decay, "quantile(min T, P>=0.5 [ F<=T A <= 2 ])")
    assert late.low <= np.log(2) / 1.5 <= late.high
    assert late.low > np.log(2) / 1.5 * (1 - 1e-9)  # the control: the bounds are tight
    fork = Chain.of(Network.from_text("A -> B, 1\nA -> C, 3"), {"A": 1})
    assert ask(fork, "P=? [ X B = 1 ]").value == 0.25
    assert ask(fork, "filter(max, P=? [ X B = 1 ], A = 0)").value == 1.0  # nothing leads on: its own next state


def test_limits_are_taken_exactly():
    """0.1 is no double: what lies between the doubles next to it is on a side of it all the same."""
    below, above = 0.09999999999999999, 0.1  # the double above 1/10 by 5e-18
    for sign, holds in ((">=", [False, True]), (">", [False, True]), ("<", [True, False]), ("<=", [True, False])):
        for value, expected in zip((below, above), holds, strict=True):
            assert TruthValue.of(Answer(value, value, value), sign, "0.1").holds is expected
    half = Answer(0.5, 0.5, 0.5)
    assert [TruthValue.of(half, sign, "0.5").holds for sign in (">=", ">", "<", "<=")] == [True, False, False, True]
    assert TruthValue.of(Answer(0.5, 0.5, 0.6), ">", "0.5").holds is None
    assert TruthValue.of(Answer(0.5, 0.5, 0.6), ">=", "0.5").holds is True
    assert TruthValue.of(Answer.none("no runs"), ">=", "0.5").why == "not decided within the bound: no runs"


def test_a_verdict_that_is_not_decided_is_no_truth():
    found = ask(STEPS, f"P>{in_the_middle()} [ F<=1 done ]")
    assert (found.holds, found.kind, found.low, found.high) == (None, NONE, 0.0, 1.0)
    assert re.match("not decided within the bound: 0.48596333[0-9]* lies between 0.485963338", str(found))
    with pytest.raises(ValueError, match="not decided within the bound"):
        bool(found)
    assert bool(ask(STEPS, "P>0.4 [ F<=1 done ]")) is True
    assert bool(ask(STEPS, "P>0.5 [ F<=1 done ]")) is False


def test_a_state_that_is_not_decided_is_an_error_if_it_matters():
    limit = in_the_middle()
    told = r"in 1 of 3 states: in state 1 \(x=1\), the answer lies between 0.4859633383[0-9]* and 0.4859633383[0-9]*, "
    with pytest.raises(ValueError, match=told + f"which does not decide > {limit}; ask for another limit"):
        ask(STEPS, f"P=? [ F P>{limit} [ F<=1 done ] ]")
    # Whatever it is, these come out alike; in the second only if both questions are taken together with the variable.
    assert ask(STEPS, f"P=? [ F<=1 x = 2 & P>{limit} [ F<=1 done ] ]").value == ask(STEPS, "P=? [ F<=1 done ]").value
    assert ask(STEPS, f"P=? [ F<=1 x = 1 | P>{limit} [ F<=1 done ] ]").value == 1.0
    assert ask(STEPS, f"filter(forall, P>{limit} [ F<=1 done ])").holds is False  # in state 0 certainly not
    undecided = ask(STEPS, f"filter(forall, P>{limit} [ F<=1 done ], x > 0)")
    assert undecided.holds is None
    assert "in state 1 (x=1), the answer lies between" in str(undecided)
    counted = ask(STEPS, f"filter(count, P>{limit} [ F<=1 done ])")
    assert (counted.low, counted.high, counted.kind) == (1.0, 2.0, PROVEN)
    assert ask(STEPS, f"filter(exists, P>{limit} [ F<=1 done ])").holds is True


def test_bounds_that_are_not_proven_decide_no_state():
    network = Network.from_text("A -> B, k * A * floor(1.5 + sin(A))", k=0.3)
    chain = Chain.of(network, {"A": 3})
    if chain.transitions.is_certified:  # a law that cannot be bounded
        chain = Chain(chain.transitions._replace(rate_error=np.inf), 0, variables=("A", "B"), counts=chain.counts)
    with pytest.raises(ValueError, match="are not proven, so that no state is certain"):
        ask(chain, "P=? [ F P>0.5 [ F<=1 A <= 2 ] ]")
    assert ask(chain, "P>0.5 [ F<=1 A <= 2 ]").kind == "estimate"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("filter(state, P=? [ F done ], x < 2)", "is of one state, and its condition holds in 2"),
        ("filter(min, P=? [ F done ], x > 5)", "the states of the filter are none"),
        ('P=? [ F R{"q"}>1 [ C<=2 ] ]', "no reward|unknown reward"),
        ("P=? [ F P>0.5 [ F<=1 y = 1 ] ]", "unknown name 'y'"),
        ("P=? [ F done || F x > 5 ]", "what is given has probability 0"),
        ("R=? [ F x = 0 ]", "no finite mean"),
        ("R[var]=? [ F x = 0 ]", "no finite variance"),
        ("quantile(min T, P>=0.9 [ F<=T z ])", "unknown name 'z'"),
    ],
)
def test_what_has_no_answer(text, message):
    with pytest.raises(ValueError, match=message):
        ask(STEPS, text)


def test_infinite_means_are_above_every_limit():
    assert ask(STEPS, 'R{"time"}>=1e300 [ F x = 0 ]').holds is True
    forever = Chain([[0, 1], [1, 0]], 0, rewards={"r": [1, 0]})
    with pytest.raises(ValueError, match="the total reward is infinite"):
        ask(forever, "R=? [ C ]")
    assert ask(forever, "R<5 [ C ]").holds is False
    assert ask(STEPS, 'filter(max, R{"time"}=? [ F x = 0 ])').value == np.inf
    assert ask(STEPS, 'filter(count, R{"time"}<3 [ F x = 0 ])').value == 1.0


def test_smallest_and_largest_states():
    assert ask(STEPS, "filter(argmin, P=? [ F<=1 done ])").value == 0.0
    assert ask(STEPS, 'filter(argmax, R{"time"}=? [ F done ])').why == "state 0 (x=0)"
    tied = ask(STEPS, "filter(argmax, P=? [ F done ])")
    assert tied.kind == NONE
    assert tied.why == "3 states are equal within the bound: state 0 (x=0), state 1 (x=1), state 2 (x=2)"


def test_the_bounds_of_a_truncated_chain_hold_from_every_state():
    network = Network.from_text("0 <-> A, 2, 0.5")
    whole = Chain.of(network, {"A": 0}, truncate="A < 60")
    part = Chain.of(network, {"A": 0}, truncate="A < 12")
    for text in ("P=? [ F<=3 A = 5 ]", "P=? [ A < 9 U[1,3] A = 5 ]", "P=? [ G<=2 A >= 2 ]", "P=? [ G[1,2] A >= 2 ]",
                 "P=? [ F A = 7 ]", "P=? [ X A = 5 ]"):  # fmt: skip
        truth, found = (parse(text).by_state(chain, np.ones(len(chain), dtype=bool)) for chain in (whole, part))
        assert (found.low <= truth.high[: len(part)]).all()
        assert (truth.low[: len(part)] <= found.high).all()
    assert (found.high - found.low)[part.truncated].tolist() == [1.0]  # of X at the edge, nothing is known
    for text in ("P=? [ F P>0.5 [ F<=1 A <= 3 ] ]", "filter(max, E[A] @ 3)", "P=? [ F A = 3 || F A = 5 ]"):
        with pytest.raises(ValueError, match=r"not decided within the bound in|chain is truncated"):
            ask(part, text)
    nested = "P=? [ F<=1 P>0.9 [ F<=1 A >= 10 ] ]"
    assert ask(part, nested).low <= ask(whole, nested).high
    assert ask(whole, nested).low <= ask(part, nested).high


def test_stiff_chains_are_followed_from_one_state_after_the_other():
    stiff = Chain([[0, 1e7, 0], [1e7, 0, 1e-3], [0, 0, 0]], 0, {"end": [False, False, True]})
    found = until_by_state(stiff, "end", by=1000.0)
    truth = -np.expm1(-0.5e-3 * 1000.0)
    assert found.value[:2] == pytest.approx(truth, rel=1e-6)
    assert (found.low <= found.value).all()
    big = Chain.of(Network.from_text("0 <-> A, 1e7, 1e6"), {"A": 0}, truncate="A < 400")
    with pytest.raises(ValueError, match="too stiff for answers from every state"):
        until_by_state(big, "A == 30", by=1.0)


def test_derivatives_of_questions_with_questions_inside():
    text = "P=? [ F<=0.4 P>0.5 [ F<=0.5 B >= 2 ] & B >= 1 ]"
    values, step = [], 1e-4
    for shift in (step, -step):
        chain = Chain.of(Network.from_text("A -> B, k", k=2.0 * np.exp(shift)), {"A": 3})
        values.append(ask(chain, text).value)
    chain = Chain.of(Network.from_text("A -> B, 2"), {"A": 3})
    found = parse(text).derivatives(Sensitivity(chain))
    assert found.value[0] == pytest.approx((values[0] - values[1]) / (2 * step), rel=1e-6)
    for none in ("P>0.5 [ F<=1 A = 0 ]", "P=? [ F A = 0 || F A = 1 ]", "filter(max, P=? [ F<=1 A = 0 ])",
                 "P=? [ F>=1 A = 0 ]", 'R[var]{"A"}=? [ F A = 0 ]'):  # fmt: skip
        with pytest.raises(ValueError, match="no derivatives"):
            parse(none).derivatives(Sensitivity(chain))


def test_the_command_says_true_false_or_not_decided(tmp_path):
    (tmp_path / "decay.rxn").write_text("A -> B, 0.3\nA = 7\n", encoding="utf-8")
    path = str(tmp_path / "decay.rxn")
    value = json.loads(CliRunner().invoke(main, ["ask", path, "P=? [ F<=2 B >= 3 ]", "--json"]).stdout)["answers"][0]
    asked = ["P>0.5 [ F<=2 B >= 3 ]", "P<0.5 [ F<=2 B >= 3 ]", f"P>={value['value']!r} [ F<=2 B >= 3 ]"]
    done = CliRunner().invoke(main, ["ask", path, *asked])
    assert done.exit_code == 0
    said = [line.split("  ")[1] for line in done.output.splitlines()]
    assert [word.split(" (")[0].split(":")[0] for word in said] == ["true", "false", "not decided within the bound"]
    answers = json.loads(CliRunner().invoke(main, ["ask", path, *asked, "--json"]).stdout)["answers"]
    assert [each["holds"] for each in answers] == [True, False, None]
    assert [each["value"] for each in answers] == [1.0, 0.0, None]
    assert "holds" not in value
    refused = CliRunner().invoke(main, ["ask", path, asked[0], "--sensitivity"])
    assert refused.exit_code == 2
    assert "there are no derivatives of P>=p" in refused.output
    wrong = CliRunner().invoke(main, ["ask", path, "P>0.5 [ F<=2 B >= ]"])
    assert wrong.exit_code == 2
    assert "a value is missing at column 18" in wrong.output


def test_scans_ask_for_truths_solved_and_sampled(tmp_path):
    model = Model(Network.from_text("A -> B, k", k=0.3), {"A": 7})
    asked = ["P>0.5 [ F<=2 B >= 3 ]", "filter(max, P=? [ F<=2 B >= 3 ], A >= 6)", "P=? [ F<=2 P>0.2 [ F<=1 B >= 3 ] ]"]
    found = scan(model, {"k": [0.1, 0.3]}, asked, folder=tmp_path)
    assert found.numbers("value")[:, 0].tolist() == [0.0, 1.0]
    again = scan(model, {"k": [0.1, 0.3]}, asked, folder=tmp_path)  # from the folder
    assert again.numbers("value").tolist() == found.numbers("value").tolist()
    (few,) = scan(model, {"k": [0.3]}, asked[0], max_states=0, runs=500).answers[0]
    assert (few.value, few.kind) == (1.0, "95 % confidence")
    with pytest.raises(ValueError, match="cannot be sampled: the question inside it has no answer by runs"):
        scan(model, {"k": [0.3]}, asked[2], max_states=0, runs=500)
    with pytest.raises(ValueError, match="cannot be sampled: a filter is of many starts"):
        scan(model, {"k": [0.3]}, asked[1], max_states=0, runs=500)
