"""Volumes, concentrations and rate constants with units: propensities by hand, rounding, and what is refused."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from kinetics.network import Network
from kinetics.network.units import UNITS, Unit, kind_text, quantity_in

N_A = 6.02214076e23


def test_propensities_are_those_of_the_textbook():
    """k n_A n_B / (N_A V), by hand, in a volume of 2 fL; 1 fL would be twice as fast."""
    text = "volume = {} fL\nA + B -> C, k1\nC -> A + B, k2\nk1 = 1e6 /M/s\nk2 = 0.1 /s\nA = 50 nM\nB = 20 nM"
    network = Network.from_text(text.format(2))
    copies = 1e-9 * N_A * 2e-15  # of 1 nM: 1.2044
    assert network.initial == {"A": round(50 * copies), "B": round(20 * copies)} == {"A": 60, "B": 24}
    expected = [1e6 / (N_A * 2e-15) * 60 * 24, 0.1 * 7]
    assert_allclose(network.propensities([60, 24, 7]), expected, rtol=1e-14)
    assert network.time_unit == "s"
    assert network.parameters == {"k1": 1e6, "k2": 0.1}
    assert_allclose(network.with_parameters(k1=3e6).propensities([60, 24, 7]), [3 * expected[0], 0.7], rtol=1e-14)
    assert_allclose(Network.from_text(text.format(2), k1=3e6).propensities([60, 24, 7])[0], 3 * expected[0], rtol=1e-14)
    other = Network.from_text(text.format(1)).propensities([60, 24, 7])
    assert_allclose(other, [2 * expected[0], 0.7], rtol=1e-14)


@pytest.mark.parametrize(
    ("reaction", "k", "expected"),
    [
        ("0 -> A", "3 M/s", 3),
        ("0 -> A", "3 nM/s", 3e-9),
        ("A -> 0", "3 /s", 3),
        ("2 A -> 0", "3 /M/s", 3),
        ("A + B -> 0", "3 /M/s", 3),
        ("2 A + B -> 0", "3 /M^2/s", 3),
        ("3 A -> 0", "3 /(uM^2 s)", 3e12),
        ("A + S -> S", "3 /mM/s", 3e3),
    ],
)
@pytest.mark.parametrize("combinations", ["distinct", "ordered", "product"])
def test_large_counts_follow_the_rate_equation(reaction, k, expected, combinations):
    """In 1 mL the rate per volume is k [A]^a [B]^b, for like reactants too, however they are counted."""
    volume = N_A * 1e-3
    text = f"volume = 1 mL\n{reaction}, {k}\nA + B + S -> A, 0\nconst S = 5\ncombinations: {combinations}"
    network = Network.from_text(text)
    by_name = dict(zip("ABS", (1e-9, 3e-9, 5e-9), strict=True))  # molar
    order = network.species
    counts = np.array([round(by_name[name] * volume) for name in order], dtype=np.int64)
    sides = network.reactants[0]
    rate = expected * np.prod([by_name[name] ** int(n) for name, n in zip(order, sides, strict=True)])
    assert_allclose(network.propensities(counts)[0] / volume, rate, rtol=1e-8)


def test_two_like_reactants_by_hand():
    """k A (A - 1) / (N_A V): 20 copies react as 380 ordered pairs, half of them distinct, at 2 k / (N_A V) each."""
    network = Network.from_text("volume = 1 fL\n2 A -> D, 1e6 /M/s\n3 A -> D, 1e6 /M^2/s")
    nv = N_A * 1e-15
    assert_allclose(network.rate_constants, [2e6 / nv, 6e6 / nv**2], rtol=1e-14)
    assert_allclose(network.propensities([20, 0]), [1e6 / nv * 380, 1e6 / nv**2 * 20 * 19 * 18], rtol=1e-14)
    plain = Network.from_text("2 A -> D, 0.5")  # without units: per distinct pair, as ever
    assert_allclose(plain.propensities([20, 0]), [0.5 * 190])


def test_units_of_time():
    """Rates in the unit that the text states, or else in that of its numbers; times of events too."""
    text = "A -> B, 6 /min\nB -> A, 3 /{}\nat t = 2 h, delay 30 min: A = 0"
    with pytest.raises(
        ValueError, match="units of time differ, min and s; state that of the model, as by a line 'time"
    ):
        Network.from_text(text.format("s"))
    network = Network.from_text("time unit: min\n" + text.format("s"))
    assert_allclose(network.rate_constants, [6, 180])
    assert str(network.events[0]) == "event 1: when t >= 120, 30 tu later: A = 0"
    other = Network.from_text("time unit: h\n" + text.format("d"))
    assert_allclose(other.rate_constants, [360, 3 / 24])
    assert Network.from_text("A -> B, 6 /min").time_unit == "min"
    assert Network.from_text("A -> B, 6").time_unit == ""


def test_laws_read_concentrations():
    """v S / (K + S) with v in nM/min and K in nM is the same law over copies: by hand; and a sum must fit."""
    text = "time unit: min\nvolume = 2 fL\nS -> P, v * S / (K + S)\nK = 5 nM\nv = {}"
    network = Network.from_text(text.format("3 nM/min"))
    copies = 1e-9 * N_A * 2e-15
    assert_allclose(network.propensities([7, 0]), [3 * copies * 7 / (5 * copies + 7)], rtol=1e-14)
    with pytest.raises(ValueError, match=r"line 3, column 9, .*M and /s in one sum or comparison"):
        Network.from_text("time unit: s\nvolume = 2 fL\nS -> P, v * S / (K + v)\nK = 5 nM\nv = 3 /s")


def test_formulas_of_parameters_with_units():
    network = Network.from_text(
        "volume = 1 fL\n2 A -> D, 3 * k\nk = 1e6 /M/s\nq = k / 2\nA + B -> D, q\nc = 10 nM\nA = 2 * c\n"
        "at t = 5: A = A + c, B = 5 nM"
    )
    nv = N_A * 1e-15
    assert_allclose(network.rate_constants, [6e6 / nv, 5e5 / nv])
    assert network.initial == {"A": 12}  # 12.04
    other = network.with_parameters(k=2e6, c=20)
    assert_allclose(other.rate_constants, [12e6 / nv, 1e6 / nv])
    assert other.initial == {"A": 24}
    assert [str(each) for each in network.events[0].new_counts.values()][1] == "3"


def test_words_that_are_names_stay_names():
    """A text that was read before units were means what it meant."""
    network = Network.from_text("M -> s, 2 / s / min(h, d)\nh = 2\nd = 4\nA -> M, 0.5 * k / h\nk = 3 * h / d")
    assert_allclose(network.propensities([1, 4, 3]), [2 / 4 / 2, 3 * 0.5 * 1.5 / 2])
    assert Network.from_text("A -> B, volume\nvolume = 3").parameters == {"volume": 3.0}


@pytest.mark.parametrize("name", UNITS)
def test_every_unit_has_its_size(name):
    prefix, sizes = {"m": 1e-3, "u": 1e-6, "\u00b5": 1e-6, "\u03bc": 1e-6, "n": 1e-9, "p": 1e-12, "f": 1e-15}, {}
    for unit in ("M", "L"):
        sizes |= {unit: 1.0} | {f"{each}{unit}": size for each, size in prefix.items()}
    sizes |= {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0, "d": 86400.0}
    sizes |= {name: 1e-5 for name in UNITS if name.endswith("m") and name not in sizes}  # a micrometre in dm
    assert UNITS[name].scale == sizes[name]


def test_units_as_people_write_them():
    one = Unit(1.0, -1, -1)
    for text in ("1e6 /M/s", "1e6/M/s", "1e6/(M s)", "1e6 / (M * s)", "1e6 M^-1 s^-1", "1e6 M**-1/s", "1e6 /s /M"):
        assert quantity_in(text)[:2] == (1e6, one), text
    assert quantity_in("2 um^3").unit.kind == (0, 0, 3)
    for text in ("1e6", "2 * k", "k", "", "3 and 4", "-1 nM", "1 / 2"):
        assert quantity_in(text) is None, text
    assert quantity_in("1 / s", {"s"}) is None
    assert [kind_text(kind) for kind in ((-1, -1, 0), (1, -1, 0), (-2, -1, 0), (0, 0, 3), (0, 0, 0))] == [
        "/M/s",
        "M/s",
        "/M^2/s",
        "dm^3",
        "no unit",
    ]


# text, what is told of it
WRONG = {
    "first order": ("A -> B, 1 /M/s", r"line 3, column 9, .*1 /M/s has the unit /M/s; a reaction of order 1 .* in /s"),
    "second order": ("A + B -> C, 1 /s", "order 2 .copies of reactants. has a rate constant in /M/s"),
    "like reactants": ("2 A -> C, k\nk = 1 /s", "line 3, column 11, .*k has the unit /s; .*constant in /M/s"),
    "order zero": ("0 -> A, 1 /M/s", "order 0 .*constant in M/s or /s"),
    "no rate": ("A -> B, 1 nM", "1 nM has the unit M; a reaction of order 1"),
    "unknown unit": (
        "A -> B, 1 /s\nA = 5 nm",
        r"line 4, column 7, .*unknown unit 'nm' .did you mean .*expected one such",
    ),
    "unit of a count": (
        "A -> B, 1 /s\nA = 5 s",
        "line 4, column 5, .*5 s has the unit s; expected copies or a concentr",
    ),
    "unit of a time": ("A -> B, 1 /s\nat t = 5 nM: A = 1", "line 4, column 8, .*5 nM has the unit M; expected a time"),
    "unit of a delay": ("A -> B, 1 /s\nat t = 5, delay 1 /s: A = 1", "column 17, .*has the unit /s; expected a time"),
    "part of a copy": ("A -> B, 1 /s\nA = 0.1 nM", "line 4, column 5, .*0.1 nM is 0.0602 copies, which rounds to none"),
    "volume in a rate": ("A -> B, 1 fL/s", "column 9, .*a unit of /s|a unit of dm"),
    "second volume": ("A -> B, 1 /s\nvolume = 2 fL", "line 4, column 10, .*a volume, 1 fL, is stated already"),
    "open bracket": ("A -> B, 1 /(M s", "column 12, .*bracket is never closed"),
    "high power": ("A -> B, 1 /M^7/s", "column 14, .*a power from 1 to 3 was expected"),
    "no power": ("A -> B, 1 /M^k/s", r"unknown name 'M'|\^ is no power here"),
    "unit in a formula": ("A -> B, 2 * k /s\nk = 1", "unknown name 's' .a unit stands behind a number alone"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_slip_is_told_with_line_and_cure(name):
    text, why = WRONG[name]
    with pytest.raises(ValueError, match=why):
        Network.from_text(f"\nvolume = 1 fL\n{text}")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("volume = 0 fL\nA -> B, 1", "line 1, column 10, .*the volume is 0 fL; expected one above 0"),
        ("volume = 1e999 fL\nA -> B, 1", "the volume is 1e999 fL; expected one above 0"),
        ("volume = 5 nM\nA -> B, 1", "line 1, column 10, .*'5 nM' is no volume; expected one such as 1 fL"),
        ("volume = 5 um\nA -> B, 1", "'5 um' is no volume"),
        ("A + B -> C, 1 /M/s", "line 1, column 13, .*in a text without a volume; add a line such as 'volume = 1 fL'"),
        ("A -> B, 1\nA = 5 nM", "line 2, column 5, .*in a text without a volume"),
        ("volume = 1\nA -> B, 1\nA = 5 nM", "in a text without a volume"),
        (
            "time unit: fortnight\nA -> B, 1 /s",
            "line 2, column 9, .*the time unit is stated as 'fortnight'; .*of ms, s",
        ),
    ],
)
def test_volumes_and_times_that_are_missing_or_wrong(text, why):
    with pytest.raises(ValueError, match=why):
        Network.from_text(text)
