"""Models in PRISM's language as chains: against closed forms, matrices made by hand, and the project's own writer."""

import time
from pathlib import Path

import numpy as np
import pytest
from known_systems import line, switch
from scipy.linalg import expm

from kinetics import Chain, Model
from kinetics.markov import ask, prism_text, read_explicit, read_prism, write_explicit
from kinetics.markov.prism.writing import prism_names

MODELS = Path(__file__).parent / "models"


@pytest.fixture
def read(tmp_path):
    """Reads a model given as text."""

    def reading(text, constants=None, **more):
        file = tmp_path / "model.sm"
        file.write_text(text, encoding="utf-8")
        return read_prism(file, constants, **more)

    return reading


def matrix(chain):
    """Rates by the values of both states, as an exact table."""
    entries = chain.transitions.generator().tocoo()
    states = [tuple(row) for row in np.asarray(chain.counts).tolist()]
    return {
        (states[i], states[j]): rate
        for i, j, rate in zip(entries.row.tolist(), entries.col.tolist(), entries.data.tolist(), strict=True)
        if i != j
    }


def rewarded(chain, name, end):
    """The mean total reward up to a time, by the exponential of a matrix with one more column."""
    generator = chain.transitions.generator().toarray()
    reward = chain.rewards[name]
    jumps = generator - np.diag(np.diag(generator))
    rates = reward.rates + (0 if reward.impulses is None else (jumps * reward.impulses.toarray()).sum(axis=1))
    wide = np.zeros((len(chain) + 1, len(chain) + 1))
    wide[:-1, :-1], wide[:-1, -1] = generator, rates
    return expm(wide * end)[0, -1]


def test_a_queue_has_its_closed_form():
    """M/M/1/n: shares rho^k, from a start in the middle that `init` asks for."""
    queue = read_prism(MODELS / "birth.sm", {"n": 10})
    assert len(queue) == 11
    shares = 0.5 ** np.arange(11)
    for jobs in (0, 3, 10):
        answer = ask(queue, f"S=? [ jobs={jobs} ]")
        exact = shares[jobs] / shares.sum()
        assert answer.low <= exact * (1 + 1e-15)
        assert exact * (1 - 1e-15) <= answer.high
        assert answer.is_bound
    assert queue.counts[0].tolist() == [5]


def test_blocks_that_are_shared_arrive_by_a_closed_form():
    """Each of three blocks reaches both clients in two steps of rate 4; the last one ends it."""
    sharing = read_prism(MODELS / "sharing.sm")
    assert len(sharing) == 64
    # a block: nobody -> one at 2 mu, then the other at 2 mu: Erlang(2, 4)
    block = 1 - np.exp(-4 * 0.5) * (1 + 4 * 0.5)
    assert ask(sharing, 'P=? [ F<=0.5 "done" ]').value == pytest.approx(block**3, rel=1e-13, abs=0.0)
    assert ask(sharing, 'P=? [ F<=0.5 "done" ]').value != pytest.approx(block**3 * (1 + 1e-12), rel=1e-13, abs=0.0)


@pytest.mark.parametrize(
    ("file", "constants", "states", "rates"),
    [
        ("tandem.sm", {"c": 5}, 66, 189),  # numbers of PRISM's benchmark suite, as those below but the last
        ("polling4.sm", None, 96, 272),
        ("workstations.sm", {"n": 2}, 276, 1120),
        ("workstations.sm", {"n": 4}, 820, 3616),
        ("birth.sm", {"n": 10}, 11, 20),
    ],
)
def test_numbers_of_states(file, constants, states, rates):
    chain = read_prism(MODELS / file, constants)
    assert (len(chain), len(matrix(chain))) == (states, rates)
    assert chain.transitions.is_certified


def test_the_start_and_what_never_ends(read):
    chain = read("ctmc module m x : [-2..3] init 1; b : bool; [] x < 3 -> 2 : (x'=x+1) & (b'=true); endmodule")
    assert chain.variables == ("x", "b")
    states = [tuple(row) for row in chain.counts.tolist()]
    assert set(states) == {(1, 0), (2, 1), (3, 1)}
    for condition, x in [
        ("init", {1}),
        ("deadlock", {3}),
        ("x = 2 & b", {2}),
        ("!b | x = 3", {1, 3}),
        ("b=true", {2, 3}),
    ]:
        assert {states[row][0] for row in np.flatnonzero(chain.states(condition))} == x
    assert ask(chain, "P=? [ F<=1 deadlock ]").value == pytest.approx(1 - 3 * np.exp(-2), rel=1e-13)


def test_a_state_that_leads_to_itself_is_no_deadlock(read):
    chain = read("ctmc module m x : [0..1]; [] x=0 -> 1 : (x'=1); [] x=1 -> 5 : (x'=1); endmodule")
    assert not chain.labels["deadlock"].any()
    assert matrix(chain) == {((0,), (1,)): 1.0}


def test_modules_synchronise_in_all_combinations(read):
    """Two commands with two updates beside one and a half: the products, in a table made by hand."""
    chain = read("""
    stochastic
    module a
      x : [0..2];
      [go] x = 0 -> 2 : (x'=1) + 3 : (x'=2);
      [go] x <= 1 -> 5 : (x'=2);
      [back] x > 0 -> 7 : (x'=0);
    endmodule
    module b
      y : [0..1];
      [go] true -> 0.5 : (y'=1-y) + 1.5 : true;
    endmodule
    module c
      [go] y = 0 -> 4 : true;
    endmodule
    """)
    expected = {}
    for x, ends in {0: {1: 2.0, 2: 3.0 + 5.0}, 1: {2: 5.0}}.items():
        for end, rate in ends.items():
            for y, share in ((1, 0.5), (0, 1.5)):
                expected[(x, 0), (end, y)] = rate * share * 4.0
    expected |= {((x, y), (0, y)): 7.0 for x in (1, 2) for y in (0, 1)}
    assert matrix(chain) == expected


def test_an_action_waits_for_all_that_have_it(read):
    """A module whose only command never holds blocks the action; another action of the same state goes on."""
    chain = read("""ctmc
    module a x : [0..1]; [go] x=0 -> 1 : (x'=1); [] x=0 -> 9 : (x'=1); endmodule
    module b [go] false -> 1 : true; endmodule""")
    assert matrix(chain) == {((0,), (1,)): 9.0}


def test_what_a_formula_names_is_renamed_in_a_copy(read):
    chain = read("""ctmc
    formula next = x + step;
    const int step = 1;
    const int leap = 2;
    module a x : [0..2]; [] x < 2 & y = 0 -> 1 : (x'=next); endmodule
    module b = a [ x = y, y = x, step = leap ] endmodule""")
    assert matrix(chain) == {((0, 0), (1, 0)): 1.0, ((0, 0), (0, 2)): 1.0, ((1, 0), (2, 0)): 1.0}


def test_a_copy_of_a_copy(read):
    chain = read("""ctmc
    module a x : [0..1]; [go] x=0 -> 2 : (x'=1); endmodule
    module c = b [ y=z, start=last ] endmodule
    module b = a [ x=y, go=start ] endmodule
    module d [last] x=1 -> 3 : true; endmodule""")
    assert chain.variables == ("x", "z", "y")
    assert matrix(chain)[(1, 0, 0), (1, 1, 0)] == 6.0
    assert ((0, 0, 0), (0, 1, 0)) not in matrix(chain)
    assert matrix(chain)[(0, 0, 0), (0, 0, 1)] == 2.0


def test_rewards_of_states_and_transitions(read):
    """Two transitions between the same states have their mean by rates; one that stays is a rate of its state."""
    chain = read("""ctmc
    module m
      x : [0..1];
      [a] x=0 -> 2 : (x'=1);
      [b] x=0 -> 6 : (x'=1);
      [a] x=1 -> 3 : true;
      [] x=1 -> 1 : (x'=0);
    endmodule
    rewards x=0 : 0.5; true : 0.25; [a] true : 1; [a] x=0 : 3; [b] true : 0.5; [] x=1 : 7; endrewards
    rewards "time_up" x=1 : 1; endrewards
    """)
    reward = chain.rewards["r1"]
    assert reward.rates.tolist() == [0.75, 0.25 + 3 * 1.0]
    assert reward.impulses.toarray().tolist() == [[0.0, (2 * 4.0 + 6 * 0.5) / 8], [7.0, 0.0]]
    assert 0 < reward.error < 1e-14
    # regenerative: a cycle takes 1/8 + 1
    cycle = (0.75 / 8 + 11 / 8 + 3.25 + 7.0) / (1 / 8 + 1)
    assert ask(chain, 'R{"r1"}=? [ S ]').value == pytest.approx(cycle, rel=1e-14)
    assert ask(chain, 'R{"time_up"}=? [ S ]').value == pytest.approx(8 / 9, rel=1e-14)
    assert ask(chain, 'R{"r1"}=? [ C<=2 ]').value == pytest.approx(rewarded(chain, "r1", 2), rel=1e-12)


@pytest.mark.parametrize("file", ["reservation.sm", "receptor.sm", "polling4.sm"])
def test_totals_of_rewards(file):
    chain = read_prism(MODELS / file)
    for name in chain.rewards:
        answer = ask(chain, f'R{{"{name}"}}=? [ C<=3 ]')
        assert answer.value == pytest.approx(rewarded(chain, name, 3.0), rel=1e-11)


def test_constants_are_given_and_depend_on_each_other(read):
    text = """ctmc
    const double pace = 2 * half; const int n; const bool fast; const double half = fast ? n / 4 : 0.01;
    const m = max(n, 3) - 1;
    module q x : [0..m]; [] x < m -> pace : (x'=m); endmodule"""
    assert matrix(read(text, {"n": 5, "fast": True})) == {((0,), (4,)): 2.5}
    assert matrix(read(text, {"n": 5.0, "fast": 0})) == {((0,), (4,)): 0.02}


def test_names_that_questions_cannot_know_are_refused(read):
    chain = read("ctmc const int n = 2; module m x : [0..n]; [] x<n -> 1 : (x'=x+1); endmodule")
    with pytest.raises(ValueError, match="unknown name 'n'"):
        ask(chain, "P=? [ F x = n ]")


def test_a_start_among_many_is_found_by_its_conditions(read):
    """Of 10^40 states one fits, which no list of all of them would find."""
    names = [f"x{k}" for k in range(40)]
    text = "ctmc module m " + " ".join(f"{name} : [0..9];" for name in names)
    text += " [] x0=7 -> 1 : (x0'=0); endmodule init x0 = 7 & x1 = x0 + 2 & x39 > 8"
    text += "".join(f" & {name} = 0" for name in names[2:39]) + " endinit"
    chain = read(text)
    assert chain.counts[0].tolist() == [7, 9, *[0] * 37, 9]
    assert len(chain) == 2


@pytest.mark.parametrize(("network", "start"), [(switch(0.5, 0.25), (3, 0)), (line(), (8, 0, 0, 0))])
def test_what_we_write_is_read_back(read, network, start):
    chain = Chain.of(network, list(start))
    model = Model(network, list(start))
    again = read(prism_text(model, np.asarray(chain.counts).max(axis=0)))
    assert len(again) == len(chain)
    mine, theirs = matrix(chain), matrix(again)
    assert mine.keys() == theirs.keys()
    assert all(abs(theirs[step] - rate) <= 1e-15 * rate for step, rate in mine.items())
    name = network.species[0]
    for question in ("P=? [ F<=2 {0} <= 1 ]", "S=? [ {0} = 1 ]", 'R{{"{0}"}}=? [ I=3 ]'):
        one, other = ask(chain, question.format(name)), ask(again, question.format(prism_names([name])[name]))
        assert other.value == pytest.approx(one.value, rel=1e-12)
        assert one.is_bound == other.is_bound


def test_explicit_files_of_a_model_say_the_same(tmp_path):
    chain = read_prism(MODELS / "reservation.sm")
    write_explicit(chain, tmp_path / "model.tra")
    again = read_explicit(tmp_path / "model.tra")
    assert len(again) == len(chain)
    for question in ('P=? [ F<=20 "alarm" ]', "P=? [ F<=2 !ok ]", 'R{"work"}=? [ C<=3 ]'):
        assert ask(again, question).value == pytest.approx(ask(chain, question).value, rel=1e-12)


def test_rounding_of_rates_is_enclosed(read):
    """A third of ten, three times: the bounds hold the real number, and would not hold one 1e-12 away."""
    chain = read("ctmc const double third = 1/3; module m x:[0..1]; [] x=0 -> third*10*0.1 : (x'=1); endmodule")
    assert 0 < chain.transitions.rate_error < 10
    (rate,) = chain.transitions.rates
    answer, exact = ask(chain, "P=? [ F<=1 x=1 ]"), -np.expm1(-1 / 3)
    assert answer.low <= exact <= answer.high
    assert not answer.low <= exact * (1 + 1e-12) <= answer.high
    assert rate == pytest.approx(1 / 3)


def test_a_hundred_thousand_states_are_read_in_seconds(read):
    text = """ctmc
    module a
      x : [0..315];
      [] x < 315 -> 1 : (x'=x+1);
      [] x > 0 -> x : (x'=x-1);
      [move] x > 0 -> 0.1 : (x'=x-1);
    endmodule
    module b y : [0..315]; [move] y < 315 -> 1 : (y'=y+1); [] y > 0 -> 2*y : (y'=y-1); endmodule"""
    began = time.process_time()
    chain = read(text)
    assert len(chain) == 316**2
    assert time.process_time() - began < 10.0
