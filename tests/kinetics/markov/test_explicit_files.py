"""Chains as explicit files of PRISM: out and in again, and damaged ones refused with their line."""

import numpy as np
import pytest
from known_systems import line
from numpy.testing import assert_allclose, assert_array_equal

from kinetics import Chain, Network, Reward
from kinetics.markov import read_explicit, write_explicit

RATES = np.array([[0, 1.0 / 3.0, 0], [2e-9, 0, 1.0], [0, 0, 0]])


def example():
    rewards = {"both": Reward([0.0, 0.1, 2.0], np.where(RATES > 0, 1 / 7, 0.0)), "state": [1.0, 0.0, 0.0]}
    return Chain(RATES, 1, {"up": [False, True, True]}, rewards, ("x", "y"), [[0, 5], [1, -4], [2, 3]])


def test_out_and_in_again(tmp_path):
    chain = example()
    write_explicit(chain, tmp_path / "m.tra")
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"m.tra", "m.sta", "m.lab", "m1.srew", "m1.trew", "m2.srew"}
    back = read_explicit(tmp_path / "m.tra")
    assert_array_equal(back.transitions.generator().toarray(), RATES - np.diag(RATES.sum(axis=1)))
    assert_array_equal(back.initial, chain.initial)
    assert_array_equal(back.counts, chain.counts)
    assert back.variables == ("x", "y")
    assert_array_equal(back.labels["up"], chain.labels["up"])
    assert_array_equal(back.labels["deadlock"], [False, False, True])
    for name in ("both", "state"):
        assert back.reward(name, up_to=2.0).value == chain.reward(name, up_to=2.0).value
    assert back.until("y = 3", by=1.0).value == chain.until("y = 3", by=1.0).value
    again = tmp_path / "again"
    again.mkdir()
    write_explicit(back, again / "m.tra")
    for name in names:
        assert (again / name).read_text() == (tmp_path / name).read_text()


def test_a_network_goes_out(tmp_path):
    chain = Chain.of(line(), {"monomer": 8})
    write_explicit(chain, tmp_path / "line.tra")
    back = read_explicit(tmp_path / "line.tra")
    assert back.variables == ("monomer", "dimer", "trimer", "quadmer")
    assert_allclose(back.until("quadmer >= 1", by=50.0).value, chain.until("quadmer >= 1", by=50.0).value, rtol=1e-13)


def test_a_file_as_prism_and_storm_write_it(tmp_path):
    (tmp_path / "a.tra").write_text("ctmc\n0 1 2.5\n1 1 4\n1 0 1\n")
    (tmp_path / "a.trew").write_text("2 2\n1 1 3\n0 1 1\n")
    (tmp_path / "a.lab").write_text('0="init" 1="deadlock"\n1: 0\n')
    chain = read_explicit(tmp_path / "a.tra")
    assert_array_equal(chain.initial, [0.0, 1.0])
    # a state that leads to itself at rate 4 earns 3 each time; in the end it holds 2.5 / 3.5
    shares = np.array([1.0, 2.5]) / 3.5
    assert_allclose(chain.reward(stationary=True).value, shares @ [2.5, 12.0], rtol=1e-14)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("m.tra", "", "is empty"),
        ("m.tra", "3 1\n0 1 2.0\n1 2 1.0\n", "2 lines follow, where its first one says 1"),
        ("m.tra", "3 1\n0 9 2.0\n", "states go from 0 to 2; 9"),
        ("m.tra", "3 1\n0 -1 2.0\n", "states go from 0 to 2"),
        ("m.tra", "3 1\n0 1\n", "line 2: '0 1'; expected two states and a number"),
        ("m.tra", "3 1\n0 1 x\n", "line 2"),
        ("m.tra", "3 1\n0 99999999999999999999 1\n", "line 2: '0 99999999999999999999 1'; expected two states"),
        ("m.tra", "3 1\n0 1 -2.0\n", "a rate is -2"),
        ("m.tra", "3 1\n0 1 nan\n", "a rate is nan"),
        ("m.tra", "dtmc\n0 1 1\n", "only Markov chains in continuous time"),
        ("m.tra", "three\n", "line 1: 'three'; expected numbers of states"),
        ("m.sta", "(x,y)\n0:(0,5)\n1:(1,4)\n", "in all 3 states"),
        ("m.sta", "(x,y)\n0:(0,5)\n1:(1)\n2:(1,1)\n", "line 3"),
        ("m.sta", "(x,y)\n0:(0,5)\n1:(1,4)\n1:(2,4)\n2:(1,1)\n", "line 4: state 1 comes a second time"),
        ("m1.srew", "3 2\n1 1.0\n1 2.0\n", "line 3: state 1 comes a second time"),
        ("m.lab", '0="init" 1="deadlock" 2="up"\n0: 0\n1: 0\n', "2 states have the label 'init'; expected one"),
        ("m.lab", '0="init"\n7: 0\n', "line 2: '7: 0'; expected a state below 3"),
        ("m.lab", '0="init"\n0: 5\n', "numbers of labels"),
        ("m1.srew", "3 1\n7 1.0\n", "line 2"),
        ("m1.srew", "4 1\n1 1.0\n", "4 states and 1 rewards; expected 3"),
        ("m1.srew", "3 1\n1 -1.0\n", "holds -1; expected at least 0"),
        ("m1.trew", "3 1\n0 1 oops\n", "two states and a number"),
    ],
)
def test_damaged_files_are_refused(tmp_path, name, text, message):
    write_explicit(example(), tmp_path / "m.tra")
    (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=message):
        read_explicit(tmp_path / "m.tra")


def test_every_cut_is_refused_or_the_same(tmp_path):
    """A .tra file cut anywhere: no chain that differs comes of it unseen, but by a last number that was shortened."""
    chain = example()
    write_explicit(chain, tmp_path / "m.tra")
    text = (tmp_path / "m.tra").read_text()
    refused = 0
    for length in range(len(text) - 5):
        (tmp_path / "m.tra").write_text(text[:length])
        try:
            read_explicit(tmp_path / "m.tra")
        except ValueError:
            refused += 1
    assert refused == len(text) - 5


def test_what_the_files_cannot_hold(tmp_path):
    with pytest.raises(ValueError, match="starts in 2 states"):
        write_explicit(Chain(RATES, [0.5, 0.5, 0.0]), tmp_path / "m.tra")
    with pytest.raises(ValueError, match=r"must end in \.tra"):
        write_explicit(example(), tmp_path / "m.txt")
    with pytest.raises(ValueError, match="does not exist"):
        read_explicit(tmp_path / "none.tra")


@pytest.mark.parametrize("labels", [None, '0="up"\n0: 0\n'])
def test_init_and_deadlock_are_there_without_a_file_that_lists_them(labels, tmp_path):
    (tmp_path / "m.tra").write_text("3 2\n0 1 1\n0 2 0\n")
    if labels:
        (tmp_path / "m.lab").write_text(labels)
    chain = read_explicit(tmp_path / "m.tra")
    assert list(chain.labels) == [*(["up"] if labels else []), "init", "deadlock"]
    assert_array_equal(chain.states('"init"'), [True, False, False])
    assert_array_equal(chain.states("deadlock"), [False, True, True])


def test_every_chain_has_them_unless_something_else_is_called_so():
    made = Chain.of(Network.from_text("2 A -> B, 1"), {"A": 5})
    assert_array_equal(np.flatnonzero(made.states('"init"')), [0])
    assert_array_equal(made.states('"deadlock"'), made.states("A = 1"))
    part = Chain.of(line(), {"monomer": 8}, truncate="trimer = 0")
    assert not (part.states("deadlock") & part.truncated).any()  # what lies beyond is not known
    assert_array_equal(Chain([[0, 1.0], [0, 0]], 0, {"deadlock": [True, False]}).states("deadlock"), [True, False])
    named = Chain([[0, 1.0], [0, 0]], 0, variables=("init",), counts=[[3], [4]])
    assert_array_equal(named.states("init = 4"), [False, True])


def test_variables_that_are_true_or_false_are_conditions(tmp_path):
    (tmp_path / "m.tra").write_text("3 3\n0 1 1\n1 2 2\n2 0 1\n")
    (tmp_path / "m.sta").write_text("(x,up,mixed)\n0:(0,true,true)\n1:(1,true,0)\n2:(2,false,1)\n")
    chain = read_explicit(tmp_path / "m.tra")
    assert chain.variables == ("x", "up", "mixed")
    assert chain.counts[:, 1].tolist() == [1, 1, 0]
    for text in ("up", "up = true", "!up = false", "up & x >= 0", "up = 1", "!(up = false)"):
        assert_array_equal(chain.states(text), [True, True, False])
    assert_array_equal(chain.states("!up | mixed = 1"), [True, False, True])
    with pytest.raises(ValueError, match="mixed is a number, neither true nor false"):  # the control
        chain.states("mixed")
    assert chain.reward("up", stationary=True).value == pytest.approx(chain.steady_state("up").value, rel=1e-14)
    folder = tmp_path / "again"
    folder.mkdir()
    write_explicit(chain, folder / "m.tra")
    assert (folder / "m.sta").read_text() == "(x,up,mixed)\n0:(0,true,1)\n1:(1,true,0)\n2:(2,false,1)\n"
    assert (folder / "m.lab").read_text() == '0="init" 1="deadlock"\n0: 0\n'
    assert_array_equal(read_explicit(folder / "m.tra").states("up"), chain.states("up"))
    (tmp_path / "m.lab").write_text('0="init" 1="up"\n0: 0 1\n')
    with pytest.raises(ValueError, match="the label 'up' is also a variable; rename one"):
        read_explicit(tmp_path / "m.tra")


def test_names_of_rewards_and_labels_in_its_files_are_identifiers(tmp_path):
    chain = Chain(RATES, 1, {"A(b)": [True] * 3}, {"max": [1.0] * 3, "B b": [2.0] * 3}, ("A[b]",), [[1], [2], [3]])
    write_explicit(chain, tmp_path / "m.tra")
    assert (tmp_path / "m1.srew").read_text().startswith('# Reward structure "n_max"\n')
    assert (tmp_path / "m2.srew").read_text().startswith('# Reward structure "B_b"\n')
    back = read_explicit(tmp_path / "m.tra")
    assert back.variables == ("A_b_",)
    assert list(back.labels) == ["init", "deadlock", "A_b__"]


def test_a_small_file_cannot_claim_many_states(tmp_path):
    """Refused before anything of their number is made; a few that nothing leads to are no harm."""
    path = tmp_path / "claims.tra"
    path.write_text("900000000 1\n0 1 1.0", encoding="utf-8")
    with pytest.raises(ValueError, match="900000000 states, but 1 transitions"):
        read_explicit(path)
    path.write_text("9 1\n0 1 1.0", encoding="utf-8")
    assert len(read_explicit(path)) == 9
