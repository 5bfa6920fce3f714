"""Class rates in the network of a book: their draws, moments and elasticities, and the intervals of predictions."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from derived_books import derived
from numpy.testing import assert_allclose

from kinetics.commands.passage import passage as passage_command
from kinetics.commands.predict import predict as predict_command
from kinetics.network import Tank
from kinetics.rates import BookRates, ClassRates

LINE, T5 = derived("line4"), derived("t5")
SIZES = (9e5, 2e5, 1e5, 3e4, 4e4, 4e4)  # exposure to bodies of 1 to 4 cubes, to the wall, to nobody; tu
SHAPES = ((1.0, 20.0), (1.5, 60.0), (2.0, 30.0))


def weighted(shape):
    return float(np.append(np.arange(1.0, 5.0) ** shape[0], [shape[1], 0.0]) @ SIZES)


def rates(**changes):
    """Joins of dimers by themselves, all others together; breaks by bodies and walls, whose shape is not known."""
    whole = weighted(SHAPES[1])
    table = {
        "faces": "two",
        "tank": (2.0, 2.0, 3.0),
        "breaks": {
            "model": "collision-wall",
            "shape": dict(zip(("alpha", "wall"), SHAPES[1], strict=True)),
            "posterior": {"points": SHAPES, "weights": (0.2, 0.5, 0.3)},
        },
        "classes": {
            "join 2 f1 + 2 f1 touching 1": {"rate": 4e-5, "events": 9, "exposure": 9 / 4e-5},
            "join": {"rate": 7e-5, "events": 60, "exposure": 60 / 7e-5},
            "break": {"rate": 25 / whole, "events": 25, "exposure": whole, "exposures": SIZES},
        },
    }
    return ClassRates(**table | changes)


def test_draws_are_those_of_the_file():
    """Set by set, with the same random numbers; if the shape left the rates of breaks alone, they would differ."""
    known = rates()
    of_book = BookRates(known, LINE)
    posterior = of_book.posterior(LINE.network)
    assert posterior.names == ("join 2 f1 + 2 f1 touching 1", "join", "break", "alpha", "wall")
    drawn = posterior.constants(posterior.draw(np.random.default_rng(3), 20))
    sets = known.draws(np.random.default_rng(3), 20)
    expected = np.array([one.apply(LINE).known_rates for one in sets])
    assert_allclose(drawn, expected, rtol=1e-6)
    blind = replace(posterior, known=tuple(entry.replace(exposures=None) for entry in posterior.known))
    assert not np.allclose(blind.constants(blind.draw(np.random.default_rng(3), 20)), expected, rtol=1e-2)
    assert_allclose(of_book.apply(LINE.network).known_rates, known.apply(LINE).known_rates, rtol=1e-14)


def test_means_are_those_of_draws_and_channels_of_a_class_vary_together():
    posterior = BookRates(rates(), LINE).posterior(LINE.network)
    drawn = posterior.constants(posterior.draw(np.random.default_rng(4), 40_000))
    error = drawn.std(axis=0) / 200
    assert (np.abs(drawn.mean(axis=0) - posterior.expected_constants()) < 6 * error).all()
    joins = [r for r, name in enumerate(LINE.network.channels) if "+" in name.split("->")[0]]
    together = np.corrcoef(drawn[:, : len(joins)].T)
    assert (np.abs(together) > 0.999).sum() > len(joins)  # those of one entry
    assert (np.abs(together) < 0.1).any()  # and not those of the other


def test_parts_of_the_constants_are_their_derivatives():
    posterior = BookRates(rates(), LINE).posterior(LINE.network)
    middle = posterior.mean
    parts = posterior.parts(middle)
    for k in range(3):
        step = np.ones_like(middle)
        step[k] += 1e-6
        slope = (posterior.constants([middle * step]) / posterior.constants([middle]) - 1) / 1e-6
        assert_allclose(parts[k], slope[0], atol=1e-5)


def test_exposures_at_some_shapes_serve_these_alone():
    known = rates()
    exposures = tuple(map(weighted, SHAPES))
    entry = known.classes["break"].replace(exposures=None, exposure_by_shape=exposures)
    by_shape = known.replace(classes=known.classes | {"break": entry})
    one, other = (BookRates(each, LINE).posterior(LINE.network) for each in (known, by_shape))
    table = one.draw(np.random.default_rng(5), 10)
    assert_allclose(other.constants(table), one.constants(table), rtol=1e-9)
    with pytest.raises(ValueError, match="known only at the points of the shape's posterior"):
        other.constants([other.mean])


def test_other_books_and_tanks():
    of_book = BookRates(rates(), LINE)
    assert BookRates(rates(), T5).posterior(T5.network).names == ("join", "break", "alpha", "wall")  # what it uses
    with pytest.raises(ValueError, match="for the network of book 'line4'"):
        of_book.posterior(T5.network)
    twice = of_book.apply(LINE.network, Tank((4.0, 2.0, 3.0))).known_rates / of_book.apply(LINE.network).known_rates
    assert twice[0] == pytest.approx(0.5)  # a join


def test_predictions_have_intervals(tmp_path):
    """From 69 joins; with a hundred times the evidence they are a tenth as wide."""
    known = rates()
    widths = []
    for name, factor in (("few", 1), ("many", 100)):
        classes = {
            key: {"rate": e.rate, "events": e.events * factor, "exposure": e.exposure * factor}
            for key, e in known.classes.items()
        }
        rates(classes=classes, breaks={"model": "first-order"}).save(tmp_path / f"{name}.toml")
        options = ["--cubes", "20", "--times", "200", "--runs", "100", "--posterior-draws", "100", "--json", "--rates"]
        done = CliRunner().invoke(predict_command, ["line4", *options, str(tmp_path / f"{name}.toml")])
        assert done.exit_code == 0, done.output
        said = json.loads(done.output)
        assert said["tank"] == [2.0, 2.0, 3.0]
        limits = said["interval"]
        place = said["species"].index("monomer")
        low, high = limits["low"][-1][place], limits["high"][-1][place]
        assert low < said["mean"][-1][place] < high
        widths.append(high - low)
    assert widths[1] < 0.3 * widths[0]
    waits = ["line4", "--cubes", "6", "--species", "dimer", "--posterior-draws", "20", "--json", "--rates"]
    done = CliRunner().invoke(passage_command, [*waits, str(tmp_path / "few.toml")])
    assert done.exit_code == 0, done.output
