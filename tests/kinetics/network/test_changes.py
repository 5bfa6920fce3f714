"""Changes of a network: the copy is right, is checked, and of 20,000 species and channels makes no dense table."""

import tracemalloc
from copy import copy
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from known_systems import bare_line, line
from numpy.testing import assert_array_equal

from kinetics import ChannelRate, ClassRates, Convention, Rates
from kinetics.assembly import RateClass
from kinetics.network import Network
from kinetics.network.laws import Event
from kinetics.network.sparse_tables import SparseTable

N = 20_000
DOSE = Event("dose", "t >= 5", {"s0": "s0 + 10"})


class Unsearched(tuple):
    """Names that may be walked through, but not searched one by one."""

    def __contains__(self, name):
        raise AssertionError(f"searched for {name}")

    def index(self, *args):
        raise AssertionError(f"searched for {args[0]}")


@pytest.fixture(scope="module")
def whole_ring():
    names = [f"s{i}" for i in range(N)]
    reactions = {f"r{i}": ({names[i]: 1}, {names[(i + 1) % N]: 1}) for i in range(N)}
    net = replace(Network.from_reactions(reactions), conserved={"copies": np.ones(N)})
    object.__setattr__(net, "species", Unsearched(net.species))
    object.__setattr__(net, "channels", Unsearched(net.channels))
    return net


@pytest.fixture
def ring(whole_ring, monkeypatch):
    """A ring of conversions that fails where someone asks for a dense table or searches all names."""

    def refuse(table):
        raise AssertionError(f"a dense table of {table.shape}")

    monkeypatch.setattr(SparseTable, "dense", refuse)
    return copy(whole_ring)


def rates_of(net):
    channels = {name: ChannelRate(rate=2.0, ways=3.0) for name in reversed(net.channels)}
    return Rates(convention=Convention(combinations="ordered"), channels=channels)


def with_class_rates(net):
    """All channels of one class, of what a derivation of so many species would give."""
    join = RateClass("join", (1, 1), ("a", "a"))
    events = {name: {join: 1.0} for name in net.channels}
    derivation = SimpleNamespace(network=net, rate_classes=(join,), events=events, book=SimpleNamespace(scheme=None))
    return ClassRates.uniform(join=2.0).apply(derivation)


CHANGES = {
    "rates": lambda net: net.with_rates(np.ones(N), ways=2 * np.ones(N), combinations="product"),
    "laws": lambda net: replace(net, laws={"r0": "2 * s0", "r19999": "s5 * (1 + sin(t))"}, at_zero="refuse"),
    "events": lambda net: replace(net, events=[DOSE]),
    "conserved": lambda net: replace(net, conserved={"double": 2 * np.ones(N)}),
    "file of rates": lambda net: rates_of(net).apply(net),
    "file of class rates": with_class_rates,
    "state": lambda net: net.state({f"s{i}": 1 for i in range(N)}),
    "index": lambda net: [net.index(f"s{i}") for i in range(N)],
    "fingerprint": lambda net: replace(net, events=[DOSE]).fingerprint,
    "repr": repr,
    "propensities": lambda net: net.with_rates(np.ones(N)).propensities(np.ones(N, dtype=int)),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_of_a_large_network_makes_no_dense_table_and_searches_no_names(ring, change):
    tracemalloc.start()
    try:
        CHANGES[change](ring)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 50e6  # a dense table would be 3.2 GB


def test_the_fixture_sees_dense_tables_and_searches(ring):
    with pytest.raises(AssertionError, match="a dense table of"):
        _ = ring.reactants
    with pytest.raises(AssertionError, match="searched for s1"):
        _ = "s1" in ring.species


def test_each_change_is_there_and_nothing_else_is():
    net = bare_line().with_rates(np.arange(8.0))
    first, second = net.channels[:2]
    changed = net.with_rates(np.ones(8), 2 * np.ones(8), "product")
    assert (changed.combinations, changed.conserved) == ("product", net.conserved)
    assert_array_equal(changed.rate_constants * changed.ways, 2 * np.ones(8))
    lawful = replace(changed, laws={second: "monomer * dimer", first: "2 * monomer"}, at_zero="refuse")
    assert list(lawful.laws) == [first, second]
    assert lawful.at_zero == "refuse"
    assert_array_equal(lawful.propensities([5, 2, 0, 0])[:2], [20, 20])
    feed = Event("feed", "t >= 1", {"monomer": "monomer + 1"})
    fed = replace(lawful, events=[feed])
    assert fed.events == (feed,)
    assert replace(fed, events=()).fingerprint == lawful.fingerprint
    assert len({net.fingerprint, lawful.fingerprint, fed.fingerprint}) == 3
    assert replace(fed, events=(), laws={}, at_zero="block").fingerprint == net.fingerprint == changed.fingerprint
    assert list(replace(fed, conserved={}).conserved) == []
    assert net.laws == {}
    assert net.events == ()
    assert_array_equal(net.rate_constants, np.arange(8.0))
    made_at_once = Network(
        net.species, net.channels, net.sparse_reactants, net.sparse_stoichiometry,
        fed.ways, fed.rate_constants, "product", net.conserved, fed.laws, [feed], "refuse", time_unit="tu",
    )  # fmt: skip
    assert made_at_once.fingerprint == fed.fingerprint
    assert str(made_at_once) == str(fed)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda net: net.with_rates([1.0]), "rate_constants has shape"),
        (lambda net: net.with_rates(-np.ones(8)), "rate_constants holds -1.0; expected at least 0"),
        (lambda net: net.with_rates(np.ones(8), ways=[1]), "ways has shape"),
        (lambda net: net.with_rates(np.ones(8), combinations="unlike"), "combinations = 'unlike'; expected one of"),
        (
            lambda net: replace(net, laws={"sideways": "1"}),
            "a law for channel 'sideways', which the network does",
        ),
        (lambda net: replace(net, laws={net.channels[0]: "2 * pentamer"}), "unknown name 'pentamer'"),
        (lambda net: replace(net, at_zero="never"), "at_zero = 'never'; expected one of block, refuse"),
        (lambda net: replace(net, events=["dose"]), "expected a sequence of kinetics.network.laws.Event"),
        (lambda net: replace(net, events=[DOSE]), "event 'dose' sets 's0'"),
        (lambda net: replace(net, events=[Event("a", "t > 1", {"dimer": 1})] * 2), "events has 'a' twice"),
        (lambda net: replace(net, conserved={"cubes": np.ones(4)}), "changes the conserved quantity 'cubes' by"),
    ],
)
def test_a_change_is_checked_as_a_new_network_is(change, message):
    with pytest.raises(ValueError, match=message):
        change(line())


def test_a_long_list_of_species_is_cut_short_in_messages(ring):
    with pytest.raises(ValueError, match=r"unknown species 'x'; the network has s0, s1, .*, s11 and 19988 more$"):
        ring.index("x")
