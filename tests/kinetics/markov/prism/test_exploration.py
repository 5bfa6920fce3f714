"""How states are found: many in a row, states taken along that are never reached, and bounds on their number."""

import time

import numpy as np
import pytest

from kinetics.markov import read_prism
from kinetics.markov.prism import exploration


@pytest.fixture
def read(tmp_path):
    def reading(text, **more):
        (tmp_path / "model.prism").write_text(text, encoding="utf-8")
        return read_prism(tmp_path / "model.prism", **more)

    return reading


WALK = """ctmc
module m
  x : [0..{n}];
  [] x < {n} -> 1 : (x'=x+1);
  [] x > 0 -> 1 / x : (x'=x-1);
endmodule"""
# what is wrong with states off the diagonal must not matter: 1 / (1 - |x - y|) there, and new values out of range
CLOSED = """ctmc
const int n = {n};
module m
  x : [0..n] init n;
  y : [0..n];
  [] x > 0 -> 1 / (x + y = n ? 1 : 0) : (x'=x-1) & (y'=y+1);
  [] y > 0 -> 2 : (x'=x+1) & (y'=y-1);
endmodule"""
# stages, which come round after each step
STAGES = """ctmc
module m
  x : [0..{n}];
  stage : [0..2];
  [] stage < 2 -> 1 : (stage'=stage+1);
  [] stage = 2 & x < {n} -> 1 : (x'=x+1) & (stage'=0);
endmodule"""


@pytest.mark.parametrize(("text", "states", "rates"), [(WALK, 1, 2), (CLOSED, 1, 2), (STAGES, 3, 3)])
def test_many_states_in_a_row(read, text, states, rates):
    """One new state a step: states are taken along, so that this takes a second, not minutes."""
    n, began = 30_000, time.process_time()
    chain = read(text.format(n=n))
    assert time.process_time() - began < 10.0
    assert len(chain) == states * (n + 1)
    assert chain.transitions.rates.size == rates * n + (2 if states == 3 else 0)
    assert np.asarray(chain.counts)[:, 0].max() == n


@pytest.mark.parametrize("text", [WALK, CLOSED, STAGES])
@pytest.mark.parametrize("most", [0, 7, 64, 4096])
def test_taking_states_along_changes_nothing(read, text, most, monkeypatch):
    def table(chain):
        entries = chain.transitions.generator().tocoo()
        states = np.asarray(chain.counts).tolist()
        ends = ([states[i] for i in places] for places in (entries.row, entries.col))
        return sorted(zip(*ends, entries.data.tolist(), strict=True))

    expected = table(read(text.format(n=300)))
    monkeypatch.setattr(exploration, "LEAST_AHEAD", most or 10**9)
    monkeypatch.setattr(exploration, "MOST_AHEAD", most)
    monkeypatch.setattr(exploration, "BATCH", 50)
    assert table(read(text.format(n=300))) == expected


def test_what_is_wrong_with_a_state_that_is_reached_is_said(read):
    text = WALK.format(n=200).replace("1 / x", "1 / (x - 150)")
    with pytest.raises(ValueError, match=r"line 5, column 17: .*negative.* in the state x=1$"):
        read(text)
    with pytest.raises(ValueError, match=r"division by zero in the state x=150$"):
        read(WALK.format(n=200).replace("1 / x", "1 / max(x - 150, 150 - x)"))


def test_a_billion_states_are_refused_soon(read):
    """9 of 10 variables free: refused when more states than allowed are found, not when all are."""
    text = "ctmc module m " + " ".join(f"x{k} : [0..9];" for k in range(9))
    text += " ".join(f"[] x{k} < 9 -> 1 : (x{k}'=x{k}+1); [] x{k} > 0 -> 1 : (x{k}'=x{k}-1);" for k in range(9))
    began = time.process_time()
    with pytest.raises(ValueError, match=r"over 20000 states are reachable\. .*max_states"):
        read(text + " endmodule", max_states=20_000)
    assert time.process_time() - began < 20.0
    assert len(read("ctmc module m x : [0..1000000000]; [] x < 3 -> 1 : (x'=x+1); endmodule", max_states=4)) == 4
    with pytest.raises(ValueError, match="over 3 states"):
        read("ctmc module m x : [0..1000000000]; [] x < 3 -> 1 : (x'=x+1); endmodule", max_states=3)
    with pytest.raises(ValueError, match="max_states"):
        read("ctmc module m x : [0..1]; endmodule", max_states=0)
