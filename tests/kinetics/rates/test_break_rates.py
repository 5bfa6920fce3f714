"""Rates files with break models: what they give a network, by channel and by class, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rates_files import LINE, SHAPES, rates_file

from kinetics import Model
from kinetics.assembly import RuleBook, derive
from kinetics.formats import read, write
from kinetics.network import Network, Tank
from kinetics.networkfree import grow
from kinetics.predicting.ranking import rank
from kinetics.rates import ClassRates
from kinetics.rates.breaks import BREAK_MODELS, Expansion, break_model
from kinetics.sampling import Direct
from kinetics.trust import verify

PARTNERS = {"first-order": 1, "collision": 4, "collision-wall": 5, "collision-species": 4}


@pytest.fixture(params=[law.name for law in BREAK_MODELS])
def model(request):
    return request.param


def test_class_rates_of_a_file_are_its_own_network(model):
    """Propensities, and draws: the same posterior point and gamma variate give the same constants in distribution."""
    rates = rates_file(model)
    by_class = ClassRates.of_rates(LINE, rates)
    states = np.array([[20, 10, 4, 2], [1, 1, 1, 13]])
    assert_allclose(
        by_class.apply(LINE).propensities(states), rates.apply(LINE.network).propensities(states), rtol=1e-13
    )
    rng, n = np.random.default_rng(0), 1000
    drawn = np.array([one.apply(LINE).known_rates for one in by_class.draws(rng, n)])
    direct = rates.draw_constants(LINE.network, rng, n)
    for table in (np.log(drawn), np.log(direct)):
        assert (table.std(axis=0) > 0.1).all()
    error = np.hypot(np.log(drawn).std(axis=0), np.log(direct).std(axis=0)) / np.sqrt(n)
    assert (np.abs(np.log(drawn).mean(axis=0) - np.log(direct).mean(axis=0)) < 5 * error).all()
    assert_allclose(np.log(drawn).std(axis=0), np.log(direct).std(axis=0), rtol=0.2)
    # control: with the shape taken as known the constants of large partners vary less
    if SHAPES[model]:
        known = by_class.replace(breaks=by_class.breaks.replace(posterior=None))
        held = known.replace(classes={k: c.replace(exposure_by_shape=None) for k, c in known.classes.items()})
        narrow = np.log([one.apply(LINE).known_rates for one in held.draws(rng, n)]).std(axis=0)
        assert (narrow < 0.85 * np.log(direct).std(axis=0)).any()


def test_class_rates_are_saved_with_their_break_model(model, tmp_path):
    rates = ClassRates.of_rates(LINE, rates_file(model))
    rates.save(tmp_path / "classes.toml")
    again = ClassRates.load(tmp_path / "classes.toml")
    assert again == rates
    assert again.breaks.model == model
    assert again.tank == (2, 2, 3)


def test_books_are_ranked_under_any_break_model(model):
    made = rank([LINE.book], ClassRates.of_rates(LINE, rates_file(model)), 8, 100.0, runs=100, draws=2)
    (book,) = made.books
    assert 0 < book.answer("yield").value < 1
    assert len(book.drawn) == 2


def test_growth_without_a_network_takes_models_that_weight_partners_by_size():
    for name in ("first-order", "collision", "collision-wall"):
        grow(LINE.book, ClassRates.of_rates(LINE, rates_file(name)), 10, 1.0)
    with pytest.raises(ValueError, match=r"break model 'collision-species' weights partners by species"):
        grow(LINE.book, ClassRates.of_rates(LINE, rates_file("collision-species")), 10, 1.0)


@pytest.mark.parametrize("suffix", [".net", ".xml"])
def test_expanded_networks_go_through_files(model, suffix, tmp_path):
    network = rates_file(model).apply(LINE.network, Tank((3, 3, 3)))
    write(Model(network, network.state([30, 5, 3, 1]), {}), tmp_path / f"line4{suffix}")
    again = read(tmp_path / f"line4{suffix}").network
    assert again.species == network.species
    assert_array_equal(again.stoichiometry, network.stoichiometry)
    assert_array_equal(again.reactants, network.reactants)
    states = np.array([[20, 10, 4, 2], [1, 1, 1, 13], [0, 2, 0, 1]])
    assert_allclose(again.propensities(states), network.propensities(states), rtol=1e-13)


def test_samplers_are_verified_on_an_expanded_network():
    """And a network without one channel, a break by quadmers, is seen as wrong: the control."""
    rates = rates_file("collision-wall")
    network = rates.apply(LINE.network)
    assert verify(network, Direct(), [4, 2, 0, 1], [20.0], runs=4000).passed

    class Short:
        """Samples another network."""

        name = "short"

        def simulate(self, given, *arguments, **options):
            constants = np.where(["by quadmer" in name for name in given.channels], 0.0, given.known_rates)
            return Direct().simulate(given.with_rates(4 * constants), *arguments, **options)

    assert not verify(network, Short(), [4, 2, 0, 1], [20.0], runs=4000).passed


def refuse(rates, words, network=LINE.network, tank=None):
    with pytest.raises(ValueError, match=words):
        rates.apply(network, tank)


def test_what_does_not_fit_is_refused():
    good = rates_file("collision-wall")
    refuse(good.replace(tank=None), "do not state their tank", tank=Tank((3, 3, 3)))
    other = derive(RuleBook.load("t5")).network
    refuse(good, "these rates are for another network", other)
    species = rates_file("collision-species")
    renamed = Network(
        ("A", "B", "C", "D"), LINE.network.channels, LINE.network.reactants, LINE.network.stoichiometry,
        LINE.network.ways, conserved=dict(LINE.network.conserved),
    )  # fmt: skip
    refuse(species, "has the shape parameters weight B, weight C, weight D; weight dimer", renamed)
    bare = replace(renamed, conserved={})
    refuse(rates_file("collision"), "weights by size need one conserved quantity", bare)
    for breaks, words in (
        ({"model": "collision", "shape": {}}, "has the shape parameters alpha; none came"),
        ({"model": "collision", "shape": {"wall": 1.0}}, "has the shape parameters alpha; wall came"),
        ({"model": "first-order", "shape": {"alpha": 1.0}}, "has the shape parameters none; alpha came"),
        ({"model": "collision", "shape": {"alpha": 9.0}}, "alpha = 9 of break model 'collision'; expected -1 to 4"),
    ):
        refuse(rates_file("first-order", breaks=breaks), words)
    channels = {name: entry.as_dict(none=False) for name, entry in good.channels.items()}
    channels["4->2+2"] |= {"exposures": (1.0, 2.0)}
    refuse(
        rates_file("collision-wall", channels=channels), "exposures to 2 partners; break model 'collision-wall' has 5"
    )
    channels["4->2+2"] |= {"exposures": (1.0, 2.0, 3.0, 4.0, 5.0)}
    refuse(rates_file("collision-wall", channels=channels), r"4->2\+2 has exposure = .*add up to 180: give that number")
    product = {"combinations": "product"}
    refuse(rates_file("collision", convention=product), "unlike the convention 'product'")
    for breaks, words in (
        ({"model": "shaking"}, "unknown break model 'shaking'; expected one of first-order, collision"),
        ({"shape": {}, "posterior": {"points": [[1.0]], "weights": [1.0]}}, "expected none"),
        (
            {"model": "collision", "shape": {"alpha": 1.0}, "posterior": {"points": [[1.0]], "weights": [0.5]}},
            "expected probabilities",
        ),
    ):
        with pytest.raises(ValueError, match=words):
            rates_file("first-order", breaks=breaks)


def test_networks_that_cannot_be_expanded_are_refused():
    walled = Network(("wall", "B"), ("b",), [[0, 1]], [[2, -1]], [1.0], conserved={"parts": [1, 2]})
    with pytest.raises(ValueError, match="calls the wall of the tank 'wall'; rename that species"):
        Expansion.of(walled, break_model("collision-wall"))
    big = derive(RuleBook.load("t5")).network
    many = Network(tuple(f"s{i}" for i in range(13)), ("b",), [[0] * 12 + [1]], [[2] + [0] * 11 + [-1]], [1.0])
    with pytest.raises(ValueError, match="for up to 12; this network has 13 species"):
        break_model("collision-species").parameters(many)
    assert len(break_model("collision-species").parameters(big)) == len(big.species) - 1
