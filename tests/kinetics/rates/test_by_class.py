"""Rate constants by rate class: pooling, fallbacks, conventions, draws, files."""

from dataclasses import replace

import numpy as np
import pytest
from known_systems import assert_follows_cdf
from numpy.testing import assert_allclose
from scipy.stats import gamma

from kinetics.assembly import Derivation, RateClass, RuleBook, derive
from kinetics.rates import ChannelRate, ClassRates, Convention, Rates
from kinetics.rates.class_entries import ClassRate, general_entries, measured_class, over_classes

LINE, T5 = derive(RuleBook.load("line4")), derive(RuleBook.load("t5"))
FILE = """
faces = "two"
[classes]
join = { rate = 7e-5 }
"join f2 + f1 touching 1" = { rate = 5e-5, events = 20, exposure = 4e5 }
"join 2  f2 + 2 f1 touching 1" = { rate = 3e-5, low = 2e-5, high = 4e-5 }
"break 3 f1 + 1 f1" = { rate = 2e-5 }
"""


def loaded(folder, text=FILE):
    path = folder / "classes.toml"
    path.write_text(text, encoding="utf-8")
    return ClassRates.load(path)


def rates_of(derivation, **channels):
    """Every channel at 1e-5 with 10 events, but for the named ones; ways from geometry."""
    entries = {
        name: ChannelRate(rate=1e-5, ways=ways, events=10, exposure=1e6)
        for name, ways in zip(derivation.network.channels, derivation.network.ways, strict=True)
    }
    return Rates(convention=Convention(combinations="distinct"), channels=entries | channels)


def test_the_most_particular_entry_counts(tmp_path):
    rates = loaded(tmp_path)
    assert rates.rate(RateClass("join", (2, 2), ("f1", "f2"))) == 3e-5
    assert rates.rate(RateClass("join", (2, 3), ("f2", "f1"))) == 5e-5  # whichever side is larger
    assert rates.rate(RateClass("join", (1, 1), ("f1", "f1"))) == 7e-5
    assert rates.rate(RateClass("break", (1, 3), ("f1", "f1"))) == 2e-5
    with pytest.raises(ValueError, match=r"no rate for class 'break 1 f1 \+ 4 f1'; add it, or .*'break f1 \+ f1'"):
        rates.rate(RateClass("break", (1, 4), ("f1", "f1")))
    with pytest.raises(ValueError, match=r"no rate for class 'break 1 f1 \+ 1 f1'"):
        rates.apply(LINE)


def test_places_that_touch_more_cubes_have_an_entry_of_their_own(tmp_path):
    rates = loaded(tmp_path, FILE + '"join touching 2" = { rate = 2e-5 }\n')
    assert rates.rate(RateClass("join", (1, 5), ("f1", "f1"), 2)) == 2e-5
    assert rates.rate(RateClass("join", (2, 2), ("f1", "f2"), 2)) == 2e-5  # not that of two sides that meet once
    assert rates.rate(RateClass("join", (1, 5), ("f1", "f1"), 3)) == 7e-5


def test_open_places_say_little_of_pockets():
    """The entry for all joins: as wide as two events where one number was touched, else as their scatter leaves it."""
    one, two = measured_class(6e-5, 600, 1e7), measured_class(2e-5, 100, 5e6)
    alone = general_entries({"join f1 + f1 touching 1": one})
    assert alone["join touching 1"] == one  # control: other faces where as many are touched
    assert alone["join"].rate == one.rate
    assert alone["join"].events == 2
    drawn = gamma(2.5, scale=1 / alone["join"].exposure).ppf([0.025, 0.975]) / one.rate
    assert_allclose(drawn, (1 / 6, 2.57), rtol=0.01)
    both = general_entries({"join touching 1": one, "join touching 2": two})
    assert both["join"] == over_classes([one, two])
    assert both["join"].events > 2
    known = {"break f1 + f1": one}
    assert general_entries(known)["break"] == one  # a bond that breaks is always alone


@pytest.mark.parametrize("table", ["table3", "table3_geometric", "table3_literal"])
def test_classes_of_a_table_give_its_own_propensities(table):
    """Whatever ways the table counts, and whatever combinations."""
    rates = Rates.load(table)
    states = np.array([[60, 0, 0, 0], [20, 10, 4, 2], [1, 1, 1, 13]])
    expected = rates.apply(LINE.network).propensities(states)
    assert_allclose(ClassRates.of_rates(LINE, rates).apply(LINE).propensities(states), expected, rtol=1e-14)


def test_a_channel_of_several_classes_goes_at_the_sum():
    """1 + 1 -> 2 by 4 ways of one face pair and 8 of another."""
    first, second = RateClass("join", (1, 1), ("f1", "f1")), RateClass("join", (1, 1), ("f1", "f2"))
    event = next(iter(LINE.events))
    mixed = Derivation(LINE.book, LINE.structures, LINE.events | {event: {first: 4.0, second: 8.0}})
    rates = ClassRates(
        classes={
            "join f1 + f1 touching 1": {"rate": 1.0},
            "join 1 f1 + 1 f2 touching 1": {"rate": 10.0},
            "break": {"rate": 0.0},
        }
    )
    network = rates.apply(mixed)
    assert network.ways[0] * network.rate_constants[0] == pytest.approx(4 * 1.0 + 8 * 10.0)
    assert_allclose(network.rate_constants[1:4], 1.0)

    # The way back: each class is told the channel's rate, unless another channel is of that class alone.
    pooled = ClassRates.of_rates(mixed, rates_of(mixed, **{"1+1->2": ChannelRate(rate=7.0, ways=12)}))
    assert pooled.rate(first) == pooled.rate(second) == 7.0
    other = list(LINE.events)[1]
    known = Derivation(LINE.book, LINE.structures, mixed.events | {other: {first: 4.0}})
    assert ClassRates.of_rates(known, rates_of(known)).classes[str(first)].events == 10
    assert ClassRates.of_rates(known, rates_of(known)).classes[str(second)].events == pytest.approx(10 * 8 / 12)


def test_channels_of_one_class_are_pooled():
    """`1 f1 + 2 f1` of the T: two channels, by 2 and by 4 ways; their rates are worth their exposures."""
    channels = {
        "1+dimer.b->trimer.b": ChannelRate(rate=3e-5, ways=2, events=30, exposure=1e6),
        "1+dimer.b->trimer.c": ChannelRate(rate=1e-5, ways=4, events=30, exposure=3e6),
    }
    pooled = ClassRates.of_rates(T5, rates_of(T5, **channels))
    entry = pooled.classes["join 1 f1 + 2 f1 touching 1"]
    assert (entry.rate, entry.events, entry.exposure) == (60 / 4e6, 60, 4e6)
    assert entry.low == pytest.approx(gamma(60).ppf(0.025) / 4e6)
    assert entry.high == pytest.approx(gamma(61).ppf(0.975) / 4e6)
    network = pooled.apply(T5)
    both = [network.channels.index(name) for name in channels]
    assert_allclose(network.rate_constants[both], 60 / 4e6)
    bare = {name: channel.replace(events=None, exposure=None) for name, channel in channels.items()}
    entry = ClassRates.of_rates(T5, rates_of(T5, **bare)).classes["join 1 f1 + 2 f1 touching 1"]
    assert (entry.rate, entry.exposure) == (pytest.approx((2 * 3e-5 + 4 * 1e-5) / 6), None)


def test_ways_of_the_file_are_put_into_evidence_too():
    """Half the ways in the file: half the constant, from twice the exposure."""
    channel = ChannelRate(rate=4e-5, low=2e-5, high=6e-5, ways=2, events=40, exposure=1e6)
    entry = ClassRates.of_rates(LINE, rates_of(LINE, **{"1+1->2": channel})).classes["join 1 f1 + 1 f1 touching 1"]
    assert (entry.rate, entry.low, entry.high, entry.events, entry.exposure) == (2e-5, 1e-5, 3e-5, 40, 2e6)


def test_an_entry_over_sizes_is_worth_what_their_scatter_leaves():
    alike = ClassRates.of_rates(LINE, rates_of(LINE)).classes["join f1 + f1 touching 1"]
    assert (alike.rate, alike.events) == (1e-5, 40)
    apart = {"1+1->2": ChannelRate(rate=1e-4, ways=4, events=100, exposure=1e6)}
    entry = ClassRates.of_rates(LINE, rates_of(LINE, **apart)).classes["join f1 + f1 touching 1"]
    rate = 130 / 4e6
    between = (np.var([100, 10, 10, 10], ddof=1) - 130 / 4) / 1e12  # beyond what counting gives
    assert entry.rate == pytest.approx(rate)
    assert entry.events == pytest.approx(rate**2 / (between + rate / 4e6) - 0.5)
    assert (entry.events + 0.5) / entry.exposure == pytest.approx(rate)
    assert entry.low < 1e-5
    assert entry.high > 1e-4
    assert ClassRates.of_rates(LINE, Rates.load("table3")).classes["join f1 + f1 touching 1"].exposure is None


def test_an_entry_over_classes_predicts_the_rate_of_one_that_was_not_measured():
    """Rates of 20 classes from a gamma distribution: draws have its mean and spread, those of all pooled do not."""
    rng = np.random.default_rng(2)
    means, spreads, pooled = [], [], []
    for _ in range(200):
        true = rng.gamma(4.0, 0.25, size=20)
        entries = [measured_class(n / 15, n, 15.0) for n in rng.poisson(15 * true).tolist()]
        entry = over_classes(entries)
        drawn = rng.gamma(entry.events + 0.5, 1 / entry.exposure, size=2000)
        means.append(drawn.mean())
        spreads.append(drawn.std())
        pooled.append(np.sqrt(sum(e.events for e in entries)) / 300)
    assert np.mean(means) == pytest.approx(1.0, abs=0.04)
    assert np.mean(spreads) == pytest.approx(0.5, abs=0.06)
    assert np.mean(pooled) < 0.1  # control: without the scatter


def test_draws_follow_the_posterior_and_shared_channels_move_together():
    channel = ChannelRate(rate=3e-6, ways=4, events=3, exposure=1e6)
    rates = ClassRates.of_rates(T5, rates_of(T5, **{"1+dimer.b->trimer.c": channel}))
    names = T5.network.channels
    drawn = np.array([one.apply(T5).rate_constants for one in rates.draws(np.random.default_rng(1), 5000)])
    two, four, other = (
        drawn[:, names.index(f"1+{name}")] for name in ("dimer.b->trimer.b", "dimer.b->trimer.c", "trimer.b->quadmer.b")
    )
    assert_allclose(two, four)
    assert_follows_cdf(two, gamma(13.5, scale=1 / 2e6).cdf)
    with pytest.raises(AssertionError):  # a single channel's evidence is not the pooled one
        assert_follows_cdf(two, gamma(3.5, scale=1 / 1e6).cdf)
    assert abs(np.corrcoef(two, other)[0, 1]) < 0.1


def test_draws_without_evidence_are_the_rates_themselves():
    rates = ClassRates.uniform(7e-5, 3e-5)
    assert {one.rate(T5.rate_classes[0]) for one in rates.draws(np.random.default_rng(0), 3)} == {7e-5}
    assert rates.without_evidence(T5.rate_classes) == ["join", "break"]
    assert ClassRates.of_rates(LINE, rates_of(LINE)).without_evidence(LINE.rate_classes) == []


def test_files_come_back_as_they_were(tmp_path):
    rates = loaded(tmp_path)
    rates.save(tmp_path / "again.toml")
    assert ClassRates.load(tmp_path / "again.toml") == rates
    assert list(rates.classes)[1:3] == ["join f1 + f2 touching 1", "join 2 f1 + 2 f2 touching 1"]


def test_faces_of_another_scheme_are_refused():
    rates = ClassRates.uniform(1e-4).replace(faces="six")
    with pytest.raises(ValueError, match="for faces = 'six'; book 'line4' has 'two'"):
        rates.apply(LINE)
    assert ClassRates.of_rates(LINE, Rates.load("table3")).faces == "two"


def test_rates_of_another_network_are_refused():
    with pytest.raises(ValueError, match="another network"):
        ClassRates.of_rates(T5, Rates.load("table3"))


def test_a_book_whose_bonds_hold_needs_no_rate_of_breaking():
    held = derive(replace(LINE.book, semantics=LINE.book.semantics.replace(bonds="hold")))
    assert_allclose(ClassRates(classes={"join": ClassRate(rate=2.0)}).apply(held).rate_constants, 2.0)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("[classes]", "[class]", "'classes' is missing"),
        ("join = {", "joins = {", "'joins' is no rate class; expected one as in 'join 1 f1"),
        ("join f2 + f1 touching 1", "join 2 f2 + f1 touching 1", "'join 2 f2 \\+ f1 touching 1' is no rate class"),
        ("join f2 + f1 touching 1", "join 2 f1 + 2 f2 touching 1", "appears twice"),
        (
            "join f2 + f1 touching 1",
            "join f2 + f1",
            "'join f2 \\+ f1' is no rate class; .* 'join f1 \\+ f1 touching 1'",
        ),
        ("join f2 + f1 touching 1", "join touching 0", "'join touching 0' is no rate class"),
        ("join f2 + f1 touching 1", "join touching two", "'join touching two' is no rate class"),
        ("break 3 f1 + 1 f1", "break 3 f1 + 1 f1 touching 1", "the only one between its parts; leave out 'touching'"),
        ("break 3 f1 + 1 f1", "break touching 1", "the only one between its parts; leave out 'touching'"),
        ("rate = 7e-5", "rate = nan", "rate = nan"),
        ("rate = 7e-5", "rate = -1.0", r"rate = -1\.0"),
        ("rate = 7e-5", 'rate = "quick"', "rate = 'quick'"),
        ("rate = 7e-5", "rat = 7e-5", "did you mean 'rate'"),
        ("low = 2e-5", "low = 5e-5", "expected low <= rate <= high"),
        ("low = 2e-5, ", "", "low and high must be given together"),
        ("events = 20, ", "", "events and exposure must be given together"),
        ("exposure = 4e5", "exposure = 0", "exposure = 0"),
        (FILE, "[classes]", "at least 1"),
    ],
)
def test_bad_files(tmp_path, before, after, message):
    assert before in FILE
    with pytest.raises(ValueError, match=message):
        loaded(tmp_path, FILE.replace(before, after, 1))


@pytest.mark.parametrize("join", [-1.0, float("nan"), float("inf"), "quick"])
def test_bad_uniform_rates(join):
    with pytest.raises(ValueError, match="uniform rates"):
        ClassRates.uniform(join)


def test_a_missing_file():
    with pytest.raises(ValueError, match="does not exist"):
        ClassRates.load("nowhere.toml")
