"""What reads few states or events of a network of very many species and channels makes no dense table of it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_array_equal

from kinetics.formats import write
from kinetics.markov import committor, first_passage
from kinetics.markov.transient import FiniteStateProjection, reachable
from kinetics.network import Model, Network
from kinetics.network.sparse_tables import SparseTable
from kinetics.sampling import sample_path
from wellmixed import main

N = 3000
FAR = 5


@pytest.fixture
def ring(monkeypatch):
    """A ring of conversions that fails where someone asks for a dense table."""

    def refuse(table):
        raise AssertionError(f"a dense table of {table.shape}")

    names = [f"s{i}" for i in range(N)]
    net = Network.from_reactions({f"r{i}": ({names[i]: 1}, {names[(i + 1) % N]: 1}) for i in range(N)}, np.ones(N))
    monkeypatch.setattr(SparseTable, "dense", refuse)
    return net


def one():
    return np.eye(1, N, dtype=int)[0]


def is_far(states):
    return states[:, FAR] > 0


def test_the_tables_are_refused_here(ring):
    with pytest.raises(AssertionError, match="a dense table"):
        ring.stoichiometry  # noqa: B018


def test_a_path(ring):
    path = sample_path(ring, one(), 10.0)
    assert path.times.size > 1
    assert_array_equal(path.states.argmax(axis=1), np.arange(path.times.size + 1))
    assert_array_equal(path.at([10.0])[0], path.states[-1])


@pytest.mark.parametrize("law", [False, True])
def test_few_states(ring, law):
    net = replace(ring, laws={"r0": "2 * s0"}) if law else ring
    space = reachable(net, one(), stop=is_far)
    assert_array_equal(space.states.argmax(axis=1), np.arange(FAR + 1))
    rows, columns, rates, *_ = space.transitions()
    assert_array_equal(rows, np.arange(FAR))
    assert_array_equal(columns, np.arange(1, FAR + 1))
    assert_array_equal(rates, [2.0 if law else 1.0, *np.ones(FAR - 1)])


def test_passages(ring):
    assert first_passage(ring, one(), f"s{FAR}").mean == pytest.approx(FAR, rel=1e-14)
    found = committor(ring, one(), {"far": is_far})
    assert found.probabilities == pytest.approx(1.0, rel=1e-14)
    assert_array_equal(found.sample_path("far").channels, np.arange(FAR))


def test_a_projection(ring):
    solved = FiniteStateProjection(tolerance=1e-6).solve(ring, one(), [0.1])
    assert solved.error < 1e-5


def test_its_json_is_refused_with_advice_and_that_of_a_smaller_one_is_whole(ring, monkeypatch, tmp_path):
    write(Model(ring, one()), tmp_path / "ring.net")
    done = CliRunner().invoke(main, ["rules", "derive", str(tmp_path / "ring.net"), "--json"])
    assert done.exit_code == 2
    assert "3000 by 3000 are 9000000 entries" in " ".join(done.output.split())
    assert "--out" in done.output
    monkeypatch.undo()
    small = Network.from_reactions({"turn": ({"A": 2}, {"B": 1})}, [1.0])
    write(Model(small, np.array([4, 0])), tmp_path / "small.net")
    data = json.loads(CliRunner().invoke(main, ["rules", "derive", str(tmp_path / "small.net"), "--json"]).output)
    assert data["reactants"] == [[2, 0]]
    assert data["stoichiometry"] == [[-2, 1]]
