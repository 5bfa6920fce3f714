"""The search for states: in which order, how far, and when it is given up."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from kinetics import Network, reachable
from kinetics.markov.transient import search
from kinetics.markov.transient.endless import endless_growth
from kinetics.markov.transient.search import Search, TooManyStatesError, state_bytes
from kinetics.native import library

LAWS = """A -> B, 0.3 * A * (B < 15)
B -> C, 1.0 * (B > 3)
C -> A, 0.1 * C / (1 + A)
A + B -> C, 0.2
A = 18"""
QUEUE = "arrive: 0 -> Job, 0.9\nserve: Job -> 0, 1.0 * (Job > 0)"


def level_by_level(net, start, stop):
    """All states, those of a level sorted: one by one, by the propensities."""
    found = {tuple(start): None}
    level = [tuple(start)]
    while level:
        new = set()
        for state in level:
            if stop is not None and stop(np.array([state]))[0]:
                continue
            for rate, change in zip(net.propensities(state), net.stoichiometry, strict=True):
                if rate > 0.0 and change.any():
                    new.add(tuple((np.array(state) + change).tolist()))
        level = sorted(new - found.keys())
        found |= dict.fromkeys(level)
    return np.array(list(found))


@pytest.mark.parametrize("stop", [None, lambda states: states[:, 2] >= 6])
@pytest.mark.parametrize("compiled_in_c", [True, False])
def test_laws_are_judged_ahead_and_the_order_is_that_of_the_levels(stop, compiled_in_c, monkeypatch):
    net = Network.from_text(LAWS)
    expected = level_by_level(net, [18, 0, 0], stop)
    if not compiled_in_c:
        monkeypatch.setattr(library, "library", lambda: None)
    assert_array_equal(reachable(net, [18, 0, 0], stop).states, expected)


def test_pieces_of_any_size_find_the_same_states(monkeypatch):
    net = Network.from_text(LAWS)
    conversions = Network.from_text("A <-> B, 1, 1\nB <-> C, 1, 1\nA = 30")
    whole = [reachable(net, [18, 0, 0]).states, reachable(conversions, [30, 0, 0]).states]
    monkeypatch.setattr(search, "CHUNK", 8)
    monkeypatch.setattr(search, "DOUBTFUL", 20)
    for found, expected in zip((reachable(net, [18, 0, 0]), reachable(conversions, [30, 0, 0])), whole, strict=True):
        assert_array_equal(found.states, expected)


def test_what_is_never_reached_need_have_no_value():
    """A condition and a law that hold no more beyond 40: the states ahead of those reached must not matter."""

    def stop(states):
        if states.max() > 40:
            raise RuntimeError("asked beyond the end")
        return states[:, 0] >= 40

    assert len(reachable(Network.from_text("0 <-> A, 1, 1"), [0], stop)) == 41
    net = Network.from_text("0 -> A, sqrt(40 - A)\nA -> 0, 1")
    assert len(reachable(net, [0])) == 41
    with pytest.raises(ValueError, match=r"the law of channel 'r1'.* at A = 41"):
        reachable(Network.from_text("0 -> A, sqrt(40 - A) + 0.1"), [0])


def test_laws_and_stops_are_asked_in_blocks():
    """A narrow network has one new state an event; a call for each took half a millisecond a state."""
    calls = []

    def stop(states):
        calls.append(len(states))
        return states[:, 0] >= 50_000

    found = reachable(Network.from_text(QUEUE), [0], stop)
    assert len(found) == 50_001
    assert len(calls) < 60


def wide(n):
    return Network.from_text("\n".join(f"S{i} -> S{i + 1}, 1" for i in range(n)))


def test_the_table_of_states_is_bounded_by_bytes():
    net = wide(300)
    most = search.MAX_BYTES // state_bytes(301)
    assert 50_000 < most < 250_000
    with pytest.raises(TooManyStatesError, match=f"over {most} states .* 512 MB hold for 301 species") as caught:
        reachable(net, {"S0": 1000})
    assert "max_states" not in str(caught.value)


def test_a_table_gets_all_of_its_room_at_once(monkeypatch):
    """From some size on: no copy is made while it grows."""
    monkeypatch.setattr("kinetics.native.state_tables.ALL_AT_ONCE", 2**10)
    net = Network.from_text("A <-> B, 1, 1\nB <-> C, 1, 1")
    assert len(reachable(net, {"A": 30}, max_states=496)) == 496
    with pytest.raises(TooManyStatesError, match="over 495 states"):
        reachable(net, {"A": 30}, max_states=495)


ENDLESS = {
    QUEUE: "channel 'arrive' raises Job",
    "A -> B, 1\nB -> 2 A, 1\nA -> 0, 1\nA = 3": "raise A|raise B|raise A, B",
    "2 A -> 3 A, 0.01\nA -> 0, 0.1\nA = 20": "'r1' raises A",
    "off <-> on, 1, 1\non -> on + M, 3\nM -> 0, 1\noff = 1": "raises M",
}


@pytest.mark.parametrize("text", list(ENDLESS))
def test_a_network_without_end_is_refused_at_once(text):
    net = Network.from_text(text)
    with pytest.raises(TooManyStatesError, match=r"infinitely many states are reachable: .*without bound") as caught:
        reachable(net, net.initial)
    assert any(part in str(caught.value) for part in ENDLESS[text].split("|"))


@pytest.mark.parametrize(
    ("text", "size"),
    [
        ("0 -> A, 1.0 * (A < 30000)\nA -> 0, 1", 30_001),  # a law that ends it
        ("A <-> B, 1, 1\nB <-> C, 1, 1\nA = 220", 24_531),
        ("2 A -> B, 1\nB -> 2 A, 1\nB <-> C, 1, 1\nA = 440", 24_531),
        ("Gone -> Gone + M, 3\nA <-> B, 1, 1\nB <-> C, 1, 1\nA = 220", 24_531),  # a channel that never fires
    ],
)
def test_a_network_with_an_end_is_listed(text, size):
    net = Network.from_text(text)
    assert len(reachable(net, net.initial)) == size


def test_no_finite_network_is_said_to_be_endless():
    """Random conversions that conserve a weight: none grows, whatever the walk does."""
    rng = np.random.default_rng(4)
    for _ in range(15):
        weights = rng.integers(1, 4, size=4)
        pairs = rng.integers(0, 4, size=(5, 2))
        reactions = {
            f"r{k}": ({f"S{a}": int(weights[b])}, {f"S{b}": int(weights[a])})
            for k, (a, b) in enumerate(pairs)
            if a != b
        }
        net = Network.from_reactions(reactions, np.ones(len(reactions)), species=[f"S{i}" for i in range(4)])
        assert endless_growth(net, np.array([[30, 20, 10, 5]])) == ""
    growing = Network.from_text("2 A -> B, 1\nB -> 3 A, 1")
    assert "raise" in endless_growth(growing, np.array([[4, 0]]))


def test_a_search_goes_on_from_any_states():
    """As a projection uses it: an event at a time, from chosen states."""
    net = Network.from_text(LAWS)
    one = Search(net, np.array([[18, 0, 0]]))
    one.go_on(0, 1, np.zeros(1, dtype=bool))
    assert_array_equal(one.states, [[18, 0, 0], [17, 1, 0]])
    one.go_on(1, 2, np.array([True, True]))
    assert len(one) == 2
