"""Events on time and on counts: closed forms, order, and what is refused."""

from math import exp

import numpy as np
import pytest
from known_systems import assert_follows_cdf, assert_follows_table
from numpy.testing import assert_array_equal
from scipy.stats import binom, poisson

from kinetics import sample_path
from kinetics.network import Network
from kinetics.network.laws import Event
from kinetics.sampling import Auto, General

DECAY = {"death": ({"X": 1}, {})}
BIRTH = {"birth": ({}, {"X": 1})}
STILL = {"swap": ({"A": 1}, {"B": 1})}  # at rate 0: only events change anything


def counts_of(reactions, rates, events, initial, times, runs=1, seed=51):
    net = Network.from_reactions(reactions, rates, events=events)
    return General().simulate(net, initial, times, runs=runs, seed=seed).counts


def still(events, initial, times):
    """Counts (T, 2) where nothing but events happens."""
    return counts_of(STILL, [0.0], events, initial, times)[0].tolist()


def two_parts(n, p, m, q):
    """Law of the sum of two binomial counts."""
    return np.convolve(binom(n, p).pmf(np.arange(n + 1)), binom(m, q).pmf(np.arange(m + 1)))


def test_a_dose_between_output_times():
    """Copies there from the start, and copies of the dose: each is left with its own probability."""
    dose = Event("dose", "t >= 0.7", {"X": "X + 30"})
    counts = counts_of(DECAY, [1.0], [dose], [20], [0.5, 1.2], runs=4000)[:, :, 0]
    assert_follows_cdf(counts[:, 0], binom(20, exp(-0.5)).cdf)
    law = two_parts(20, exp(-1.2), 30, exp(-0.5))
    assert_follows_table(np.bincount(counts[:, 1], minlength=51), law)
    with pytest.raises(AssertionError, match="chi-square"):  # a dose at 0.6
        assert_follows_table(np.bincount(counts[:, 1], minlength=51), two_parts(20, exp(-1.2), 30, exp(-0.6)))


def test_a_dose_at_an_output_time_counts_at_it():
    dose = Event("dose", "t >= 25", {"A": "A + 7"})
    assert still([dose], [1, 0], [24.999999999999, 25.0, 30.0]) == [[1, 0], [8, 0], [8, 0]]


def test_repeated_doses_come_at_their_times():
    doses = [Event.every(12, {"A": "A + 1"}), Event.every(0.1, {"B": "B + 1"}, start=0, name="often")]
    times = [0.0, 11.999999, 12.0, 23.999999, 24.0, 120.0]
    counts = still(doses, [0, 0], times)
    assert [a for a, _ in counts] == [0, 0, 1, 1, 2, 10]
    assert [b for _, b in counts] == [1, 120, 121, 240, 241, 1201]


def test_doses_that_decay():
    """Every 0.5 tu ten copies, each of which is left after its own time."""
    counts = counts_of(DECAY, [1.0], [Event.every(0.5, {"X": "X + 10"}, start=0)], [0], [1.4], runs=4000)[:, 0, 0]
    parts = [binom(10, exp(-age)).pmf(np.arange(11)) for age in (1.4, 0.9, 0.4)]
    law = np.convolve(np.convolve(parts[0], parts[1]), parts[2])
    assert_follows_table(np.bincount(counts, minlength=31), law)


def test_an_event_on_a_count():
    """Births are counted modulo 10: whole law from the Poisson law of all births."""
    full = Event("full", "X >= 10", {"X": 0})
    counts = counts_of(BIRTH, [4.0], [full], [0], [6.0], runs=4000)[:, 0, 0]
    law = poisson(24.0).pmf(np.arange(200)).reshape(20, 10).sum(axis=0)
    assert_follows_table(np.bincount(counts, minlength=10), law)
    shorter = poisson(24.0).pmf(np.arange(198)).reshape(22, 9).sum(axis=0)
    with pytest.raises(AssertionError, match="chi-square"):  # at 9 already
        assert_follows_table(np.bincount(counts, minlength=10), np.append(shorter, 0.0))


def test_an_event_under_a_timed_law():
    """A Poisson process with a changing rate, modulo 10, and half of what is there taken at a time."""
    events = [Event("full", "X >= 10", {"X": "X - 10"}), Event("wash", "t >= 3", {"X": 0})]
    counts = counts_of(BIRTH, ["4 * (1 + sin(t))"], events, [0], [5.5], runs=4000)[:, 0, 0]
    mean = 4 * (2.5 + np.cos(3.0) - np.cos(5.5))
    law = poisson(mean).pmf(np.arange(200)).reshape(20, 10).sum(axis=0)
    assert_follows_table(np.bincount(counts, minlength=10), law)


def test_a_condition_on_count_and_time():
    """Fed at 2 tu where few are left, else when the count falls to 5 later."""
    feed = Event("feed", "t >= 2 and X <= 5", {"X": 1000})
    counts = counts_of(DECAY, [1.0], [feed], [8], [1.999999, 2.0], runs=2000)[:, :, 0]
    assert_array_equal(counts[:, 1] == 1000, counts[:, 0] <= 5)
    late = counts_of(DECAY, [1.0], [feed], [30], [2.0, 4.0], runs=300)[:, :, 0]
    assert not ((late[:, 0] > 5) & (late[:, 0] < 1000) & (late[:, 1] <= 5)).any()


def test_runs_do_not_depend_on_grid_or_threads():
    net = Network.from_reactions(
        {**BIRTH, **DECAY},
        ["9 * (1 + sin(t))", "X"],
        events=[Event.every(1.3, {"X": "X + 5"}), Event("full", "X >= 25", {"X": "floor(X / 2)"})],
    )
    times = np.linspace(0, 8, 17)
    whole = General().simulate(net, [3], times, runs=30, seed=52, threads=1).counts
    assert_array_equal(General().simulate(net, [3], times, runs=30, seed=52, threads=2).counts, whole)
    assert_array_equal(Auto().simulate(net, [3], times[3:9:3], runs=30, seed=52).counts, whole[:, 3:9:3])


# What happens at one moment.


def test_order_of_events_of_one_moment():
    first = Event("first", "t >= 1", {"A": "A + 1"})
    second = Event("second", "t >= 1", {"A": "A * 10"})
    assert still([first, second], [3, 0], [1.0]) == [[40, 0]]
    assert still([second, first], [3, 0], [1.0]) == [[31, 0]]
    urgent = Event("second", "t >= 1", {"A": "A * 10"}, priority=2)
    assert still([first, urgent], [3, 0], [1.0]) == [[31, 0]]
    # With the counts of the moment itself, the last one stays.
    early = [Event(e.name, e.when, e.assign, from_trigger=True) for e in (first, second)]
    assert still(early, [3, 0], [1.0]) == [[30, 0]]


def test_all_new_counts_of_an_event_follow_from_the_same_counts():
    assert still([Event("swap", "t >= 1", {"A": "B", "B": "A"})], [3, 8], [1.0]) == [[8, 3]]


def test_events_set_off_others_and_are_not_called_back():
    events = [
        Event("push", "t >= 1", {"A": 50}),
        Event("pull", "A > 40", {"B": "A", "A": 0}),
        Event("too late", "t >= 1 and A < 10", {"B": "B + 1000"}),
    ]
    # The third is due at 1 as A is 0 there, and happens though the first, which comes before it, undoes that; and once
    # more as the second makes its condition true again.
    assert still(events, [0, 0], [0.5, 1.0]) == [[0, 0], [0, 2050]]
    once = Event("too late", "t >= 1 and A < 10", {"B": "B + 1000"}, persistent=False)
    assert still([*events[:2], once], [0, 0], [0.5, 1.0]) == [[0, 0], [0, 1050]]


def test_what_was_true_before_waits_for_the_next_time():
    at_start = {"when": "A < 5", "assign": {"A": 20}}
    assert still([Event("low", **at_start)], [3, 0], [0.0, 9.0]) == [[3, 0], [3, 0]]
    assert still([Event("low", was_true=False, **at_start)], [3, 0], [0.0, 9.0]) == [[20, 0], [20, 0]]
    again = [Event("low", **at_start), Event("up", "t >= 1", {"A": 9}), Event("down", "t >= 2", {"A": 4})]
    assert still(again, [3, 0], [1.5, 2.0]) == [[9, 0], [20, 0]]


def test_conditions_that_touch_or_cross_their_limit():
    assert still([Event("cross", "sin(t) > 0.5", {"A": "A + 1"})], [0, 0], [0.52, 0.53, 6.8, 6.81]) == [
        [0, 0],
        [1, 0],
        [1, 0],
        [2, 0],
    ]
    assert still([Event("point", "t == 3", {"A": "A + 1"})], [0, 0], [2.9, 3.0, 9.0]) == [[0, 0], [1, 0], [1, 0]]
    assert still([Event("never", "sin(t) > 1.5", {"A": "A + 1"})], [0, 0], [1000.0]) == [[0, 0]]


@pytest.mark.parametrize(
    ("event", "message"),
    [
        (Event("half", "t >= 1", {"A": "A / 2"}), r"event 'half' sets 'A' to A / 2 = 1.5 at A = 3, B = 0, t = 1"),
        (Event("debt", "t >= 1", {"A": "A - 4"}), "= -1 at A = 3.*a whole number from 0 to 2"),
        (Event("lost", "t >= 1", {"A": "A / B"}), "= inf at"),
        (Event("much", "t >= 1", {"A": "2 ** 60"}), "= 1.15292e"),
        (Event("fast", "sin(1e9 * (t + 1)) > 0.5", {"A": 1}), r"event 'fast': when .* turns true cannot be determined"),
    ],
)
def test_impossible_events_are_refused_with_counts_and_time(event, message):
    with pytest.raises(ValueError, match=message):
        still([event], [3, 0], [5.0])


def test_events_without_end_are_refused():
    ping = [Event("ping", "A >= 3", {"A": 0}), Event("pong", "A < 3", {"A": 3})]
    with pytest.raises(ValueError, match="has no end: simultaneous events trigger each other"):
        still([*ping, Event("start", "t >= 1", {"A": 3})], [0, 0], [5.0])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Event("", "t > 1", {"A": 1}), "is no name of an event"),
        (lambda: Event("e", "t + 1", {"A": 1}), "event 'e': 't \\+ 1' is no condition"),
        (lambda: Event("e", "t >", {"A": 1}), "event 'e': cannot read"),
        (lambda: Event("e", "t > 1", {}), "event 'e' changes nothing"),
        (lambda: Event("e", "t > 1", ["A"]), "event 'e' assigns .'A'.; expected {species: new count}"),
        (lambda: Event("e", "t > 1", {"A": None}), "event 'e': float.. argument must be"),
        (lambda: Event("e", 5, {"A": 1}), "event 'e': '5.0' is no condition"),
        (lambda: Event("e", "t > 1", {"A": "1 +"}), "event 'e': cannot read"),
        (lambda: Event("e", "t > 1", {"A": 1}, priority=np.nan), "priority nan"),
        (lambda: Event.every(0, {"A": 1}), "every 0 tu from 0"),
        (lambda: Event.every(1, {"A": 1}, start=-2), "every 1 tu from -2"),
    ],
)
def test_bad_events(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_delays_of_events():
    """New counts of the moment of the condition or of the moment at which they are set; delays by the counts."""
    events = [
        Event("one", "t >= 1", {"A": "A + 1"}),
        Event("two", "t >= 2", {"A": "A + 1"}),
        Event("early", "t >= 1.5", {"B": "10 * A"}, delay=1.0, from_trigger=True),
        Event("late", "t >= 1.5", {"B": "B + A"}, delay="2 * A"),
    ]
    assert still(events, [0, 0], [2.0, 2.5, 3.499999, 3.5]) == [[2, 0], [2, 10], [2, 10], [2, 12]]
    again = Event("again", "t % 1 >= 0.5", {"B": "B + 1"}, delay=2.25, was_true=False)  # three wait at a time
    assert [b for _, b in still([again], [0, 0], [2.74, 2.75, 3.75, 9.8])] == [0, 1, 2, 8]


def test_events_that_do_not_persist():
    """A condition that is false again drops what is due, at the same moment or later."""
    up, down = (Event(f"to {n}", f"t >= {t}", {"A": n}) for n, t in ((1, 1), (0, 2)))
    for delay, persistent, expected in ((1.5, False, 0), (1.5, True, 7), (0.5, False, 7), (0.5, True, 7)):
        event = Event("set", "A > 0", {"B": 7}, delay=delay, persistent=persistent)
        assert still([up, down, event], [0, 0], [5.0]) == [[0, expected]]
    for persistent, expected in ((False, [0, 5]), (True, [3, 5])):
        first = Event("first", "t >= 1", {"B": 5}, priority=2.0)
        second = Event("second", "t >= 1 and B < 5", {"A": 3}, persistent=persistent)
        assert still([first, second], [0, 0], [2.0]) == [expected]


def test_delays_under_reactions():
    """One copy of X dies at rate 1; 0.75 tu after that, or while it lives since 0.75 tu, Y is set."""
    reactions = {"death": ({"X": 1}, {}), "still": ({"Y": 1}, {})}
    after = Event("after", "X < 1", {"Y": 1}, delay=0.75)
    while_ = Event("while", "X > 0", {"Y": 1}, delay=0.75, persistent=False, was_true=False)
    times, runs = [0.5, 1.5, 3.0], 4000
    for event, chance in ((after, lambda t: 1 - exp(-max(0.0, t - 0.75))), (while_, lambda t: exp(-0.75) * (t > 0.75))):
        seen = counts_of(reactions, [1.0, 0.0], [event], [1, 0], times, runs=runs)[:, :, 1].sum(axis=0)
        for n, t in zip(seen, times, strict=True):
            low, high = binom(runs, chance(t)).ppf([5e-7, 1 - 5e-7])
            assert low <= n <= high
        assert not binom(runs, 0.9 * chance(3.0)).ppf(5e-7) <= seen[2] <= binom(runs, 0.9 * chance(3.0)).ppf(1 - 5e-7)


@pytest.mark.parametrize(
    ("event", "message"),
    [
        (
            Event("bad", "t >= 1", {"A": 1}, delay="A - 3"),
            "event 'bad': the delay A - 3 is no finite number of at least 0",
        ),
        (
            Event("many", "t % 0.001 < 0.0005", {"A": 1}, delay=1e9),
            "event 'many': the delay .* over 1000 of its kind wait",
        ),
    ],
)
def test_delays_that_cannot_be_are_refused(event, message):
    with pytest.raises(ValueError, match=message):
        still([event], [0, 0], [5.0])


def test_a_path_with_events_is_refused():
    net = Network.from_reactions(BIRTH, [1.0], events=[Event("dose", "t >= 1", {"X": 9})])
    with pytest.raises(ValueError, match=r"a path records firings of channels.*'dose'"):
        sample_path(net, [0], 5.0)
