"""Whether a constant serves all that is pooled in it: size and power of the test, and rates that it must flag."""

from collections import defaultdict

import numpy as np
import pytest
from derived_books import derived
from grown_paths import path_of
from scipy.stats import binom

from calibration.estimating.class_calibration import BookRuns, calibrate_classes
from calibration.estimating.class_spread import SPREAD, class_spreads, flagged
from kinetics.networkfree import grow
from kinetics.rates import ClassRates

LINE = derived("line4")
RATES = {"join": {"rate": 2e-4}, "break": {"rate": 2e-3}}


def spreads(paths, share="event"):
    books = [BookRuns(LINE, tuple(paths))]
    return class_spreads(books, calibrate_classes(books, "first-order", share))


def runs(number, seed, **more):
    classes = RATES | {key: {"rate": rate} for key, rate in more.items()}
    rates = ClassRates(faces="two", classes=classes)
    made = grow(LINE.book, rates, {LINE.book.monomer(): 40}, 150.0, number, seed)
    return [path_of(run, LINE) for run in made.runs]


def test_what_is_alike_is_rarely_flagged():
    """60 calibrations of four runs each, each test at its own level, by the binomial at 1e-6."""
    paths = runs(240, seed=3)
    found = [spreads(paths[i : i + 4]) for i in range(0, 240, 4)]
    by_test = defaultdict(list)
    for each in (test for study in found for test in study):
        by_test[each.key, each.by].append(each.p)
    assert {("join", "sizes"), ("join", "structure"), ("break", "sizes")} <= set(by_test)
    for p in map(np.array, by_test.values()):
        assert binom.sf((p <= 0.05).sum() - 1, p.size, 0.05) > 1e-6
        assert p.size < 20 or p.mean() > 0.3  # uniform, not all near 0
    assert sum(bool(flagged(each)) for each in found) <= 6


def test_rates_that_differ_are_flagged():
    """The control: pairs of single cubes join three times as fast, and the constant of all joins hides it."""
    off = flagged(spreads(runs(8, seed=5, **{"join 1 f1 + 1 f1 touching 1": 6e-4})))
    assert {(each.key, each.by) for each in off} >= {("join", "sizes"), ("join", "structure")}
    worst = next(each for each in off if each.by == "sizes")
    rates = dict(zip(worst.groups, worst.events / worst.exposure, strict=True))
    assert rates["1 + 1"] == max(rates.values())
    assert worst.sentence.startswith("join by sizes (")
    # told apart by sizes, each constant is that of its own
    assert not flagged(spreads(runs(8, seed=5, **{"join 1 f1 + 1 f1 touching 1": 6e-4}), "sizes"))


def test_power_is_that_of_rates_that_scatter():
    """Stated for rates that scatter by half: beside calibrations of runs whose rates do."""
    (stated,) = (e for e in spreads(runs(4, seed=6)) if (e.key, e.by) == ("join", "sizes"))
    rng = np.random.default_rng(7)
    sizes = [str(c) for c in LINE.rate_classes if c.event == "join"]
    seen = []
    for study in range(60):
        factors = rng.gamma(1 / SPREAD**2, SPREAD**2, size=len(sizes))
        paths = runs(4, 100 + study, **{key: 2e-4 * f for key, f in zip(sizes, factors, strict=True)})
        seen += [e.p <= 0.01 for e in spreads(paths) if (e.key, e.by) == ("join", "sizes")]
    assert np.mean(seen) == pytest.approx(stated.power, abs=0.25)
    assert 0.1 < stated.power < 1
