"""A model: which counts it has, what its names stand for, and that every function takes it as it takes a network."""

from dataclasses import replace

import numpy as np
import pytest

from kinetics import Chain, Model, Network, first_passage, predict, sample_path, simulate, solve, stationary

TEXT = "bind: 2 A -> D, k\npart: D -> 2 A, 0.5\nA = 2 * n\nn = 3"


def dimers():
    return replace(Network.from_text(TEXT, k=0.1), conserved={"atoms": [1, 2]})


def test_counts_that_are_given_go_before_those_that_are_stated():
    assert Model(dimers()).initial.tolist() == Model.of(dimers()).initial.tolist() == [6, 0]
    assert Model.of(dimers(), {"D": 2}).initial.tolist() == [6, 2]
    assert Model.of(Model(dimers(), [1, 1]), {"D": 2}).initial.tolist() == [1, 2]
    assert Model.of(dimers(), [4, 0]).initial.tolist() == [4, 0]
    assert Model.of(dimers(), {"A": 2**62 + 1, "D": 3}).initial.tolist() == [
        2**62 + 1,
        3,
    ]  # more digits than a float has
    for counts, said in (({"B": 1}, "unknown species 'B'"), ({"A": 0.5}, "whole numbers"), ([1], "has shape")):
        with pytest.raises(ValueError, match=said):
            Model.of(dimers(), counts)


def test_a_point_changes_what_its_names_stand_for():
    model = Model(dimers(), observables={"bonds": {"D": 1}})
    assert [model.kind(name) for name in ("k", "A", "part", "atoms")] == [
        "parameter", "species", "channel", "conserved quantity",
    ]  # fmt: skip
    there = model.at({"k": 2.0, "part": 3.0, "D": 4})
    assert there.network.known_rates.tolist() == [2.0, 3.0]
    assert there.initial.tolist() == [6, 4]
    assert model.at({"n": 5}).initial.tolist() == [10, 0]  # a count that is a formula follows
    assert model.at({"atoms": 9}).initial.tolist() == [9, 0]
    assert there.observables == model.observables
    for name, said in (("bind", "scan what it reads: k"), ("bonds", "no parameter, species or channel")):
        with pytest.raises(ValueError, match=said):
            model.kind(name)
    assert model.counted("bonds") == model.counted("D") == {"D": 1.0}
    with pytest.raises(ValueError, match="'bond' is neither a species nor an observable; did you mean bonds"):
        model.counted("bond")


def test_the_digest_is_of_all_that_decides_what_a_model_does():
    model = Model(dimers(), observables={"bonds": {"D": 1}})
    others = [model.at({"k": 2.0}), model.at({"A": 5}), Model(dimers()), Model(dimers().with_rates([0.1, 0.5], [2, 1]))]
    assert len({each.digest for each in (model, *others)}) == 5
    assert model.at({"k": 0.1, "A": 6}).digest == model.digest


@pytest.mark.parametrize(
    "answer",
    [
        lambda model, counts: solve(model, "transient", counts, [1.0]).mean(),
        lambda model, counts: simulate(model, "ssa", counts, [1.0], runs=9, seed=1).counts,
        lambda model, counts: sample_path(model, counts, 1.0, seed=1).states,
        lambda model, counts: predict(Model.of(model, counts), None, [1.0], "transient").mean,
        lambda model, counts: first_passage(model, counts, "D", 2).mean,
        lambda model, counts: stationary(model, counts).probabilities,
        lambda model, counts: Chain.of(model, counts).counts,
    ],
)
def test_every_question_takes_a_model_or_a_network_and_counts(answer):
    expected = answer(dimers(), {"A": 5})
    np.testing.assert_array_equal(answer(Model(dimers(), {"A": 5}), None), expected)
    np.testing.assert_array_equal(answer(Model(dimers()), {"A": 5}), expected)
    assert not np.array_equal(answer(Model(dimers()), None), expected)
