"""SBML files with rate laws and named parameters: written, read back, and the same model at other parameters too."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from kinetics import Network, simulate
from kinetics.formats import FORMATS, proving, read, write
from kinetics.network import Model

TEXT = """
k = 0.5
K = 10
half = k / 2
grow: 0 -> A, 20 * k / (1 + B / K)
pair: A + A -> B, half
eat: A + E -> E, k * A * E / (K + A)
lose: 2 B -> C, 0.01 * k * B * B
seen: C -> 0, piecewise(k, t > 3, 0.1) * C
slow: A + B -> A, min(k, 0.001 * B) * max(0, A - 1) % 7
lent: 3 B + E -> E, k * E
A = 5
E = 2
at t = 2: A = A + 100 * half
observable: total = A + 2 * B
"""
SBML = next(kind for kind in FORMATS if kind.name == "sbml")
TIMES = np.linspace(0, 5, 6)


def model_of(folder, text=TEXT):
    (folder / "model.rxn").write_text(text, encoding="utf-8")
    return read(folder / "model.rxn")


def test_laws_and_parameters_come_back(tmp_path):
    """Propensities at small and large counts, runs under one seed, and all of that with other parameters."""
    model = model_of(tmp_path)
    write(model, tmp_path / "model.xml")
    again = read(tmp_path / "model.xml")
    assert again.network.parameters == {"k": 0.5, "K": 10.0}
    assert again.network.laws.keys() == model.network.laws.keys()  # what is mass action stays that
    rng = np.random.default_rng(2)
    for values in ({}, {"k": 0.7}, {"K": 3.0, "k": 0.1}):
        one, other = model.with_parameters(**values).network, again.with_parameters(**values).network
        for time, most in ((0.0, 3), (3.5, 40), (4.0, 10**6)):
            state = rng.integers(0, most, len(one.species))
            assert_allclose(other.propensities(state, time), one.propensities(state, time), rtol=1e-12)
        runs = [simulate(net, "general", model.initial, TIMES, runs=20, seed=4).counts for net in (one, other)]
        assert len(np.unique(runs[0])) > 10
        assert_array_equal(*runs)
    changed = model_of(tmp_path, TEXT.replace("K = 10", "K = 11")).network
    assert not np.array_equal(again.network.propensities([5, 5, 5, 5], 0), changed.propensities([5, 5, 5, 5], 0))


def test_a_file_that_is_read_and_written_again_stays_the_same(tmp_path):
    """The brackets around what waits for its reactants do not grow."""
    write(model_of(tmp_path), tmp_path / "first.xml")
    write(read(tmp_path / "first.xml"), tmp_path / "second.xml")
    write(read(tmp_path / "second.xml"), tmp_path / "third.xml")
    second, third = (Path(tmp_path, f"{name}.xml").read_text(encoding="utf-8") for name in ("second", "third"))
    assert second == third
    laws = read(tmp_path / "second.xml").network.laws
    assert laws["eat"].text == "k * A * E / (K + A)"  # 0 by itself without A or E
    assert laws["lent"].text == "piecewise(k * E, B >= 3, 0)"


def test_another_program_sees_no_law_without_its_reactants(tmp_path):
    """The file says itself that a law waits: the tree, evaluated without the reader's rules, is 0."""
    write(model_of(tmp_path), tmp_path / "model.xml")
    laws = read(tmp_path / "model.xml").network.laws
    free = Network.from_reactions({name: ({}, {"X": 1}) for name in laws}, [*laws.values()], [*"ABECX"])
    place = {name: s for s, name in enumerate(free.species)}
    for name, species, most in (
        ("lose", "B", 1),
        ("lent", "B", 2),
        ("eat", "E", 0),
        ("slow", "B", 0),
        ("seen", "C", 0),
    ):
        state = np.full(len(place), 9)
        state[place[species]] = most
        assert free.propensities(state, 0.0)[free.channels.index(name)] == 0.0
        state[place[species]] = most + 1
        assert free.propensities(state, 0.0)[free.channels.index(name)] > 0.0


FAULTS = {
    "number": ("<cn> 20 </cn>", "<cn> 21 </cn>"),
    "operator": ("<divide/>", "<times/>"),
    "name": ("<ci> K </ci>", "<ci> k </ci>"),
    "waiting": ("<cn> 3 </cn>", "<cn> 2 </cn>"),
    "comparison": ("<lt/>", "<gt/>"),
    "parameter": ('value="10"', 'value="11"'),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_faulty_writer_of_laws_is_caught(fault, tmp_path):
    model, (before, after) = model_of(tmp_path), FAULTS[fault]
    right = SBML.text(model)
    proving.check_written(SBML, model, right, tmp_path / "m")
    assert before in right
    with pytest.raises(ValueError, match="m is not written"):
        proving.check_written(SBML, model, right.replace(before, after), tmp_path / "m")


def test_random_laws_are_proven_once_written(tmp_path):
    """Sums, quotients, powers, minima and conditions of counts, parameters and the time."""
    rng = np.random.default_rng(31)
    parts = ["A", "B", "p", "q", "t", "2.5", "(A + 1)", "exp(-B / 9)", "sqrt(A)", "floor(B / 2)", "(A > 3)"]

    def formula(depth):
        if not depth:
            return str(rng.choice(parts))
        one, other = formula(depth - 1), formula(rng.integers(depth))
        kind = rng.integers(6)
        forms = (f"({one} + {other})", f"{one} * {other}", f"({one}) / (1 + {other})", f"min({one}, {other})",
                 f"max({one}, {other})", f"piecewise({one}, A > {other}, B)")  # fmt: skip
        return forms[kind]

    for case in range(60):
        sides = rng.choice(["A -> B", "2 A -> B", "A + B -> 2 B", "0 -> A", "3 B -> A + B"], 2)
        lines = [f"r{i}: {each}, (A + t) * 0 + {formula(int(rng.integers(1, 4)))}" for i, each in enumerate(sides)]
        text = "\n".join(
            ["p = 0.25", "q = 3", "species: A, B", *lines, "a: A -> B, p", "b: B -> A, q", "A = 4", "B = 7"]
        )
        model = model_of(tmp_path, text)
        write(model, tmp_path / f"{case}.xml")
        assert read(tmp_path / f"{case}.xml").network.parameters == {"p": 0.25, "q": 3.0}


def test_what_no_file_can_say_is_refused():
    eager = Network.from_reactions({"r": ({"A": 1}, {})}, ["2 + A"], at_zero="refuse")
    with pytest.raises(ValueError, match="a law waits for its reactants; at_zero='refuse' does not fit"):
        SBML.text(Model(eager))
    crowd = Network.from_reactions({"r": ({"A": 171}, {})}, [1.0])
    with pytest.raises(ValueError, match="channel 'r' needs 171 copies of one species, too many"):
        SBML.text(Model(crowd))
