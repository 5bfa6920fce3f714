"""Net laws as two directions: parts that are never below 0, or one channel, or none."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from sbml_builder import both_ways

from kinetics import Transient, solve
from kinetics.formats.directions import directions_of, is_never_below_0, is_seen_below_0
from kinetics.network.laws.expression import Expression
from kinetics.network.laws.program import evaluate, steps_of

pytest.importorskip("libsbml")
PLACES = {"X": 0, "Y": 1, "Z": 2}
STATES = np.random.default_rng(3).integers(0, 12, (400, 3))


def values(law, time=1.7):
    return evaluate(steps_of(law, PLACES), STATES, time)


@pytest.mark.parametrize(
    "law",
    [
        "0.3 * X - 0.2 * Y",
        "2 * (0.3 * X + -1 * 0.2 * Y * Z)",
        "-(X - 2 * Y) / (1 + X + Z)",
        "(X - Y) / (-3 - Z)",
        "(X - Y) * (Z - 4)",
        "+X - +Y",
        "piecewise(X - Y, Z > 4, 0, t > 3, -X)",
        "X - Y * exp(-Z) - 0.1 * t",
        "X * (X - 1) / 2 - Y",
        "-X",
        "X / Y - Z",
    ],
)
def test_two_parts_of_at_least_0_give_the_law_back(law):
    whole = Expression(law)
    assert is_seen_below_0(whole)
    assert not is_never_below_0(whole, {})
    parts = [np.zeros(len(STATES)) if part is None else values(part) for part in directions_of(whole)]
    known = np.isfinite(values(whole))
    assert known.sum() > 300
    assert all((part[known] >= 0).all() for part in parts)
    assert_allclose((parts[0] - parts[1])[known], values(whole)[known], rtol=1e-12, atol=1e-12)
    assert not np.allclose((parts[0] + parts[1])[known], values(whole)[known])  # a control that must differ


@pytest.mark.parametrize(
    ("law", "least", "proven"),
    [
        ("X - 1", {"X": 1}, True),
        ("X - 1", {}, False),
        ("X * (X - 1) * (X - 2) * Y", {}, True),
        ("X * (X - 2)", {}, False),
        ("(X - Y) ** 2 + abs(X - Y) + exp(X - Y) + sqrt(X)", {}, True),
        ("(X - Y) ** 3", {}, False),
        ("(1 + X) ** (Y - Z)", {}, True),
        ("1 + cos(X - Y)", {}, True),
        ("0.9 + cos(X - Y)", {}, False),
        ("max(X - Y, 0) * min(X, 3) * ((X - Y) % 2)", {}, True),
        ("(X < Y) + (not X)", {}, True),
        ("log(1 + 1) * floor(X + 0.5) * ceil(X)", {}, True),
        ("floor(1e200 * (1 + X) * 1e200)", {}, True),  # infinite, where it can be
        ("log(X)", {}, False),
        ("t * X / (1 + t)", {}, True),
        ("X / (Y - 3)", {}, False),
        ("piecewise(X, X > Y, X - Y)", {}, False),
    ],
)
def test_signs_are_proven_or_not(law, least, proven):
    assert is_never_below_0(Expression(law), least) == proven
    if proven:
        kept = STATES[np.all([STATES[:, PLACES[name]] >= n for name, n in least.items()] or [[True] * 400], axis=0)]
        assert (evaluate(steps_of(Expression(law), PLACES), kept, 1.7) >= 0).all()


@pytest.mark.parametrize("law", ["sin(X - Y)", "(X - Y) ** 3", "max(X - Y, -1)", "X / (Y - 3)"])
def test_forms_that_show_no_directions(law):
    assert directions_of(Expression(law)) is None


def test_a_reversible_reaction_fluctuates(tmp_path):
    """Binomial counts with the closed mean and variance; as one channel with the net law they would freeze at 25."""
    model = both_ways()().read(tmp_path)
    assert model.network.is_mass_action
    assert model.network.channels == ("turn", "turn backward")
    assert model.notes == ("turn is reversible: k * X  (k = 0.6) forward, p * Y  (p = 0.2) backward",)
    found = solve(model.network, Transient(), model.initial, [50.0])
    assert_allclose(found.mean()[0], [25, 75], rtol=1e-9)
    assert_allclose(found.sd()[0], math.sqrt(100 * 0.25 * 0.75), rtol=1e-9)


@pytest.mark.parametrize(
    ("law", "note"),
    [
        ("k*X*(1 - Y/(3 + Y))", "not proven to be at least 0"),  # it never is: split, it would be too noisy
        ("k*X*(1 + 0.5*sin(time))", None),
        ("k*X*(X - 1)*(X - 2)*exp(-Y)", None),
        ("k*(X - 1)", None),  # below one X the channel waits
        ("k*X*max(0, 5 - Y)", None),
        ("k*(X - Y)^2", None),
    ],
)
def test_a_law_of_one_direction_stays_one_channel(law, note, tmp_path):
    model = both_ways(law)().read(tmp_path)
    assert model.network.channels == ("turn",)
    assert [note in each for each in model.notes] == [True] if note else model.notes == ()
