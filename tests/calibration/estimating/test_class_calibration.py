"""Constants by rate class: closed forms, network-free runs of known class rates, the choice of what classes share."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from derived_books import derived
from grown_paths import path_of
from numpy.testing import assert_allclose
from scipy.optimize import minimize
from scipy.stats import binom

from calibration.estimating.break_rates import BreaksBySize
from calibration.estimating.class_calibration import BookRuns, ClassFit, calibrate_classes
from calibration.estimating.class_spread import class_spreads, flagged
from calibration.estimating.rate_fit import simplest
from kinetics.assembly import Derivation, RateClass
from kinetics.network import Tank
from kinetics.networkfree import grow, growth_of
from kinetics.rates import ClassRates
from kinetics.rates.breaks import break_model
from kinetics.runs import BY_SEVERAL, BY_WALL, NO_BREAK, JumpPath

TANK = Tank((2.0, 2.0, 2.0))
LINE, T5, JACK = derived("line4"), derived("t5"), derived("jack13")


def truth(breaks="collision-wall", **classes):
    """Class rates of joins by faces and of breaks, under which a jack grows halfway and breaks now and then."""
    shape = {"first-order": {}, "collision": {"alpha": 1.0}, "collision-wall": {"alpha": 1.0, "wall": 60.0}}[breaks]
    known = {
        "join f1 + f1 touching 1": 2e-4,
        "join f1 + f2 touching 1": 1e-4,
        "break": 5e-5 if shape else 4e-3,
    } | classes
    return ClassRates(
        faces="two",
        tank=TANK.size,
        breaks={"model": breaks, "shape": shape},
        classes={key: {"rate": rate} for key, rate in known.items()},
    )


@cache
def grown(breaks="collision-wall", runs=40, seed=0, book="jack13", cubes=40, end=200.0, sizes=False):
    """Paths of network-free runs under the truth."""
    more = {"join 1 f1 + 1 f1 touching 1": 1e-3, "join 1 f1 + 2 f1 touching 1": 5e-5} if sizes else {}
    derivation = derived(book)
    start = {derivation.book.monomer(): cubes}
    if derivation.book.seed() is not None:
        start[derivation.book.seed()] = 2
    made = grow(derivation.book, truth(breaks, **more), start, end, runs, seed)
    return tuple(path_of(run, derivation, TANK) for run in made.runs)


def calibrated(paths, breaks="auto", derivation=JACK):
    return calibrate_classes([BookRuns(derivation, paths)], breaks)


def evidence_of(*paths, books=None):
    """Joins and breaks of runs, class by class."""
    made = calibrate_classes(books or [BookRuns(JACK, paths)], "collision-wall")
    return made.joins, made.breaks


def fitted(likelihood, sharing, breaks=None, by_partner=False):
    if breaks is None:
        return ClassFit.of(likelihood, sharing)
    largest, tank = likelihood.model.largest, likelihood.model.tank
    return ClassFit.of(likelihood, sharing, BreaksBySize.of(break_model(breaks), largest, tank, by_partner))


def test_a_network_free_run_and_its_path_tell_the_same_story():
    made = grow(JACK.book, truth(), {JACK.book.monomer(): 30, JACK.book.seed(): 2}, 200.0, runs=1, seed=4).runs[0]
    path = path_of(made, JACK, TANK)
    back = growth_of(path, JACK)
    times = np.linspace(0, 200, 50)
    assert made.times.size > 10
    assert np.array_equal(back.by_size(times, 20), made.by_size(times, 20))
    sizes = np.array([len(structure) for structure in JACK.structures.values()])
    assert np.array_equal(path.at(times) @ (sizes == 1), made.by_size(times)[:, 1])
    with pytest.raises(ValueError, match="not of the network of book 'line4'"):
        growth_of(path, LINE)


def test_events_and_exposures_by_hand():
    """A hub and three free cubes; at 2 tu one docks at a side face, at 5 tu the wall breaks it off; until 9 tu."""
    dimer = next(
        name
        for name, s in JACK.structures.items()
        if len(s) == 2
        and any(
            "f2" in c.faces for event, ways in JACK.events.items() if event.after == (JACK.species_of(s),) for c in ways
        )
    )
    species = JACK.network.species
    seed, free = JACK.species_of(JACK.book.seed()), JACK.species_of(JACK.book.monomer())
    joined = JACK.channel([seed, free], [species.index(dimer)])
    broken = JACK.channel([species.index(dimer)], [seed, free])
    initial = JACK.network.state({species[seed]: 1, species[free]: 3})
    path = JumpPath(
        JACK.network, initial, [2.0, 5.0], [joined, broken], 9.0, tank=TANK, partners=np.array([NO_BREAK, BY_WALL])
    )
    joins, breaks = evidence_of(path)
    at = {key: i for i, key in enumerate(joins.grouping.keys)}
    exposure = joins.exposure(joins.model)
    # hub: two f1 and four f2 faces, each with two f1 faces of a free cube
    assert exposure[at["join 1 f1 + 1 f1 touching 1"]] == pytest.approx(2 * 2 * 3 * 6.0)
    assert exposure[at["join 1 f1 + 1 f2 touching 1"]] == pytest.approx(4 * 2 * 3 * 6.0)
    # hub with an arm: its tops, and the arm's own; three sides
    assert exposure[at["join 1 f1 + 2 f1 touching 1"]] == pytest.approx((2 + 1) * 2 * 2 * 3.0)
    assert exposure[at["join 1 f1 + 2 f2 touching 1"]] == pytest.approx(3 * 2 * 2 * 3.0)
    assert joins.parts(joins.model)[at["join 1 f1 + 1 f2 touching 1"]].at_events.tolist() == [[2 * 4 * 3]]
    of = breaks.grouping.keys.index("break 1 f1 + 1 f2")
    exposures = breaks.exposure(breaks.model)
    assert_allclose(exposures[of, :3], [2 * 3.0, 0.0, 0.0])  # two free cubes, and not itself
    assert_allclose(exposures[of, -2:], 3.0)
    assert not np.delete(exposures, of, axis=0).any()
    by_anyone = [2, *[0] * 11, 0, 1, 1]
    assert_allclose(breaks.parts(breaks.model)[of].at_events, [by_anyone])
    by_wall = replace(breaks.model, by_partner=True)
    assert_allclose(breaks.parts(by_wall)[of].at_events, [[*[0] * 13, 1, 0]])
    # broken by another arm that broke at the same blow, so that it is there no more: by anyone
    by_dimer = replace(path, partners=np.array([NO_BREAK, species.index(dimer)]))
    assert_allclose(evidence_of(by_dimer)[1].parts(by_wall)[of].at_events, [by_anyone])
    # by several at once: by any body, but not by the wall alone
    crowded = replace(path, partners=np.array([NO_BREAK, BY_SEVERAL]))
    assert_allclose(evidence_of(crowded)[1].parts(by_wall)[of].at_events, [[*by_anyone[:13], 0, 1]])
    # the same in a tank of twice the volume, for constants of the first
    larger = JumpPath(JACK.network, initial, path.times, path.channels, 9.0, tank=Tank((4.0, 2.0, 2.0)))
    both, _ = evidence_of(path, larger)
    assert_allclose(both.exposure(both.model), 1.5 * exposure)


def test_known_rates_come_back_within_their_intervals():
    """Two constants of joins and one of breaks, from 40 runs; twice the breaks would be seen."""
    made = calibrated(grown(), "collision-wall")
    assert made.chosen_joins.sharing == "faces"
    assert made.chosen_breaks.sharing == "event"
    rates, true = made.rates(), truth()
    assert rates.tank == TANK.size
    for key in ("join f1 + f1 touching 1", "join f1 + f2 touching 1"):
        entry = rates.classes[key]
        assert entry.low < true.classes[key].rate < entry.high
        assert entry.high < 1.3 * entry.low
    weights = [float(np.append(*t.breaks.by_size([1.0])[:2]) @ [40, 1]) for t in (rates, true)]
    seen, known = (w * t.classes["break"].rate for w, t in zip(weights, (rates, true), strict=True))
    assert seen == pytest.approx(known, rel=4 / np.sqrt(rates.classes["break"].events))
    assert rates.classes["break"].events > 200


@pytest.mark.validate
def test_intervals_cover():
    """Of 120 calibrations, each from two runs; intervals of half the width are caught."""
    paths = grown("first-order", runs=240, seed=7)
    true = truth("first-order")
    inside, narrow, asked = 0, 0, 0
    for i in range(0, 240, 2):
        joins, breaks = evidence_of(*paths[i : i + 2])
        fits = fitted(joins, "faces"), fitted(breaks, "event", "first-order")
        for key, entry in ((k, fit.entries[k]) for fit in fits for k in fit.channels):
            known = true.classes[key].rate
            asked += 1
            inside += entry.low <= known <= entry.high
            narrow += (entry.low + entry.rate) / 2 <= known <= (entry.rate + entry.high) / 2
    assert binom.cdf(inside, asked, 0.95) > 1e-6
    assert binom.cdf(narrow, asked, 0.95) < 1e-6
    assert asked == 360


def test_what_classes_share_is_found():
    assert calibrated(grown("first-order", runs=30, seed=2)).chosen_breaks.breaks.name == "first-order"
    by_sizes = calibrated(grown("first-order", runs=60, seed=3, sizes=True))
    assert by_sizes.chosen_joins.sharing == "sizes"
    rates = by_sizes.rates()
    entry = rates.classes["join 1 f1 + 1 f1 touching 1"]
    assert entry.low < 1e-3 < entry.high
    # a class that no run had takes the entry for its faces, whose evidence says how far classes lie apart
    assert rates.key(RateClass("join", (1, 99), ("f1", "f1"))) == "join f1 + f1 touching 1"
    assert rates.classes["join f1 + f1 touching 1"].events < 5


def test_places_that_touch_two_cubes_have_a_constant_of_their_own():
    """Known rates come back, .3 of the open ones in corners. The control knows no places; its constant is flagged."""
    pyramid = derived("pyramid45_breaking")
    known = {"join touching 1": 4e-4, "join": 1.2e-4, "break": 1e-3}
    rates = ClassRates(faces="two", classes={key: {"rate": rate} for key, rate in known.items()})
    start = {pyramid.book.monomer(): 80, pyramid.book.seed(): 3}
    made = grow(pyramid.book, rates, start, 150.0, 6, seed=4).runs
    books = [BookRuns(pyramid, tuple(path_of(run, pyramid, TANK) for run in made))]
    found = calibrate_classes(books, "first-order")
    assert found.chosen_joins.sharing == "touched"
    entries = found.rates().classes
    for key, rate in (("join touching 1", 4e-4), ("join touching 2", 1.2e-4)):
        assert entries[key].low < rate < entries[key].high
        assert entries[key].high < 1.5 * entries[key].low
    assert not flagged(class_spreads(books, found))  # nor by structures that grow but once
    control = calibrate_classes(books, "first-order", "event")
    assert control.chosen_joins.entries["join"].high < 4e-4
    assert ("join", "cubes touched") in {(each.key, each.by) for each in flagged(class_spreads(books, control))}


def test_jacks_say_little_of_corners():
    """In jacks every place touches one cube: the constant is of such places, and others borrow a wide one."""
    made = calibrate_classes([BookRuns(JACK, grown("first-order", runs=10, seed=2))], "first-order", "touched")
    entries = made.rates().classes
    assert entries["join touching 1"].rate == entries["join"].rate
    assert entries["join touching 1"].events > 100
    assert entries["join"].events == 2
    fixed = calibrate_classes([BookRuns(JACK, grown("first-order", runs=10, seed=2))], "first-order", "event")
    assert fixed.rates().classes["join"].events > 100  # asked to be one constant of all joins


def test_many_classes_with_few_events_expect_as_many_events_as_there_were():
    """Half an event a class, by Jeffreys' prior alone, would expect a tenth too many."""
    fit = fitted(evidence_of(*grown("first-order", runs=30, seed=2))[1], "sizes", "first-order")
    seen = fit.best.events.sum()
    own = fit.likelihood.exposure(fit.model) @ fit.model.mixture()[0]
    entries = [fit.entries[key] for key in fit.channels]
    expected = sum(e * (entry.events + 0.5) / entry.exposure for e, entry in zip(own, entries, strict=True))
    assert len(entries) > 20
    assert expected == pytest.approx(seen, rel=0.03)
    assert seen + len(entries) / 2 > 1.05 * seen


def test_books_add_up():
    """Line and T in one calibration: events and exposures of shared classes are summed; a wrong scheme is refused."""
    line, t5 = grown("first-order", 10, 1, "line4"), grown("first-order", 10, 1, "t5")
    books = [BookRuns(LINE, line), BookRuns(T5, t5)]
    both, *apart = (evidence_of(books=some)[0] for some in (books, books[:1], books[1:]))
    for key, exposure in zip(both.grouping.keys, both.exposure(both.model), strict=True):
        parts = [e.exposure(e.model)[e.grouping.keys.index(key)] for e in apart if key in e.grouping.keys]
        assert_allclose(exposure, np.sum(parts, axis=0))
    assert both.counts.sum() == sum(e.counts.sum() for e in apart)
    fit = fitted(both, "faces")
    assert fit.entries["join f1 + f1 touching 1"].low < 2e-4 < fit.entries["join f1 + f1 touching 1"].high


def test_a_channel_of_several_classes_is_shared_out_by_largest_likelihood():
    """Against a general maximiser; shares by ways alone are not the maximum."""
    joins, breaks = [c for c in LINE.events if len(c.before) == 2], [c for c in LINE.events if len(c.before) == 1]
    first, second = RateClass("join", (1, 1), ("f1", "f1")), RateClass("join", (1, 1), ("f1", "f2"))
    events = {event: dict(LINE.events[event]) for event in (*joins, *breaks)}
    events[joins[0]] = {first: 3.0, second: 1.0}
    events[joins[1]] = {first: 4.0}
    mixed = Derivation(LINE.book, LINE.structures, events)
    paths = [JumpPath(mixed.network, p.initial, p.times, p.channels, p.end, tank=TANK) for p in _line_paths()]
    joins_of, _ = evidence_of(books=[BookRuns(mixed, tuple(paths))])
    fit = fitted(joins_of, "sizes")
    shares, exposure = joins_of.grouping.shares, joins_of.exposure(joins_of.model)[:, 0]

    def cost(logs):
        k = np.exp(logs)
        return -(joins_of.counts @ np.log(shares @ k) - exposure @ k)

    best = minimize(cost, np.full(len(exposure), np.log(1e-4)), method="BFGS")
    assert joins_of.grouping.keys == fit.channels
    assert fit.log_likelihood + cost(np.log(fit.best.coefficients[0])) == pytest.approx(_at_events(paths), abs=1e-6)
    assert cost(np.log(fit.best.coefficients[0])) == pytest.approx(best.fun, abs=1e-6)
    assert_allclose(fit.best.coefficients[0], np.exp(best.x), rtol=1e-3)
    by_ways = joins_of.counts @ shares
    assert cost(np.log(by_ways / exposure)) > best.fun + 1
    with pytest.raises(ValueError, match="shared out"):
        fit.profile(f"k {fit.channels[0]}", 1e-3)


def _at_events(paths):
    """Sum of the logarithms of ways times combinations at all joins."""
    total = 0.0
    for path in paths:
        joins = np.flatnonzero([len(list(LINE.events)[channel].before) == 2 for channel in path.channels])
        fired = path.channels[joins]
        total += np.log(path.network.ways[fired] * path.network.combinations_of(path.states)[joins, fired]).sum()
    return total


def _line_paths():
    """Runs of the line whose two joins go at very different rates."""
    rates = {"join 1 f1 + 1 f1 touching 1": 2e-3, "join f1 + f1 touching 1": 1e-3, "break": 1e-3}
    known = ClassRates(classes={key: {"rate": rate} for key, rate in rates.items()})
    made = grow(LINE.book, known, 60, 100.0, 5, seed=3)
    return [path_of(run, LINE, TANK) for run in made.runs]


def test_who_broke_what_is_used():
    """Crowds of 15 and of 120 show that partners break bonds; their names give the wall's share.

    A model without walls then calls what was seen impossible.
    """
    paths = grown(seed=9, cubes=15, end=400.0) + grown(seed=9, cubes=120, end=80.0)
    rng = np.random.default_rng(0)
    breaks = [len(event.before) == 1 for event in JACK.events]
    sizes = np.array([len(s) for s in JACK.structures.values()])
    watched = []
    for path in paths:
        partners = np.full(path.channels.size, NO_BREAK)
        for i, channel in enumerate(path.channels.tolist()):
            if breaks[channel]:
                there = path.states[i].copy()
                there[list(JACK.events)[channel].before[0]] -= 1
                weights = np.append(there * sizes, 60.0)
                drawn = int(rng.choice(weights.size, p=weights / weights.sum()))
                partners[i] = BY_WALL if drawn == sizes.size else drawn
        watched.append(JumpPath(JACK.network, path.initial, path.times, path.channels, path.end, None, TANK, partners))
    made = calibrated(tuple(watched))
    assert made.chosen_breaks.model.by_partner
    shape = made.chosen_breaks.model.shape_values
    points = np.array(made.chosen_breaks.terms.posterior.points)
    for (name, value), known in zip(shape.items(), (1.0, 60.0), strict=True):
        middle, sd = points[:, list(shape).index(name)].mean(), points[:, list(shape).index(name)].std()
        assert abs(middle - known) < 4 * sd, (name, value)
        assert sd < 0.3 * known
    without = fitted(made.breaks, "event", "collision", by_partner=True)
    assert without.log_likelihood == -np.inf
    with pytest.raises(ValueError, match="every break model calls impossible"):
        simplest([without])


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (lambda: calibrate_classes([]), "no runs to estimate from"),
        (lambda: calibrated(grown(runs=2, seed=1), "collision-species"), "weights partners by species"),
        (lambda: calibrated(grown(runs=2, seed=1), "magic"), "unknown break model"),
        (lambda: calibrated(grown(runs=2, seed=1), derivation=LINE), "not of the network of book 'line4'"),
    ],
)
def test_bad_input(given, said):
    with pytest.raises(ValueError, match=said):
        given()


def test_files_hold_all_that_was_found(tmp_path):
    rates = calibrated(grown(), "collision-wall").rates({"seed": 3})
    rates.save(tmp_path / "classes.toml")
    again = ClassRates.load(tmp_path / "classes.toml")
    assert again == rates
    assert again.evidence["seed"] == 3
    drawn = again.draws(np.random.default_rng(0), 400)
    totals = [d.classes["break"].rate * (40 + d.breaks.shape["wall"]) for d in drawn]
    alone = [d.classes["break"].rate * (40 + rates.breaks.shape["wall"]) for d in drawn]
    # rate and shape move together, so that the breaks of a crowd are known better than the rate of any one partner
    assert 2 * np.std(totals) / np.mean(totals) < np.std(alone) / np.mean(alone)
