"""SBML: what of it is read, as mass action where it is that and as written where not; and what is refused."""

import json
import math

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose, assert_array_equal
from sbml_builder import Builder

from kinetics import Auto, Model, simulate
from kinetics.formats import read, write
from kinetics.formats.massaction import rate_constant
from kinetics.network import Network
from kinetics.network.laws.expression import Expression
from wellmixed import main

libsbml = pytest.importorskip("libsbml")


@pytest.mark.parametrize(("level", "version"), [(2, 1), (2, 4), (3, 1), (3, 2)])
def test_mass_action_becomes_plain_rates(level, version, tmp_path):
    """Local parameters before global ones, left-associative division, a batch, a held species, a catalyst."""
    made = Builder(level, version)
    for name in ("A", "B", "E"):
        made.species(name, 7)
    made.species("S", 3, boundary=True)
    made.parameter("k", 2.0)
    made.reaction("pair", {"A": 2}, {"B": 1}, "k*A*(A-1)/2")
    made.reaction("own", {"A": 1}, {}, "A*k", k=0.5)
    made.reaction("batch", {}, {"A": 100}, "k/4/5")
    made.reaction("fed", {"S": 1}, {"B": 1}, "0.1*S")
    made.reaction("helped", {"B": 1}, {"A": 1}, "k*E*B")
    model = made.read(tmp_path)
    net = model.network
    assert net.species == ("A", "B", "E", "S")
    assert_array_equal(model.initial, [7, 7, 7, 3])
    assert net.is_mass_action
    assert_allclose(net.rate_constants, [2, 0.5, 0.1, 0.1, 2], rtol=1e-15)
    assert_array_equal(net.stoichiometry, [[-2, 1, 0, 0], [-1, 0, 0, 0], [100, 0, 0, 0], [0, 1, 0, 0], [1, -1, 0, 0]])
    assert_array_equal(net.reactants, [[2, 0, 0, 0], [1, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1], [0, 1, 1, 0]])
    assert_allclose(net.propensities([5, 2, 3, 3]), [20, 2.5, 0.1, 0.3, 12])


@pytest.mark.parametrize(
    ("law", "needed", "expected"),
    [
        ("k * A", {"A": 1}, (0.5, {"A": 1})),
        ("(A - 1) * 3 * A / 2 / k", {"A": 2}, (6.0, {"A": 2})),
        ("A * (A - 1) * (A - 2) * B / 6", {"A": 3, "B": 1}, (1.0, {"A": 3, "B": 1})),
        ("k * A", {}, (0.5, {"A": 1})),
        ("2 ** 3 * exp(0)", {}, (8.0, {})),
        ("k * A * A", {"A": 2}, None),  # the deterministic law, which is another one
        ("k * A * (A - 1)", {"A": 3}, None),
        ("k * A * (A - 2)", {"A": 2}, None),
        ("k * A", {"A": 5}, None),
        ("k", {"A": 1}, None),
        ("k * A / B", {"A": 1}, None),
        ("A / (k + A)", {"A": 1}, None),
        ("k * A * t", {"A": 1}, None),
        ("-k * A", {"A": 1}, None),
        ("k * A - k", {"A": 1}, None),
        ("1 / 0 * A", {"A": 1}, None),
    ],
)
def test_what_is_mass_action(law, needed, expected):
    assert rate_constant(Expression(law, {"k": 0.5}), needed) == expected


def test_laws_as_they_are_written(tmp_path):
    """Concentrations in a volume, rules, functions, piecewise and time."""
    made = Builder(size=2.0)
    made.species("A", concentration=5.0, by_amount=False)
    made.species("B", 4)
    made.species("total", None, by_amount=True, boundary=True)
    made.parameter("k", 3.0)
    made.parameter("half", constant=False)
    made.rule("half", "k/2 + 0*B")
    made.rule("total", "2*A*cell + B")
    made.function("mm", "lambda(s, v, m, v*s/(m + s))")
    made.reaction("turn", {"A": 1}, {"B": 1}, "cell*mm(A, k, half)")
    made.reaction("square", {"B": 2}, {}, "k*B*B")
    made.reaction("same", {"A": 2}, {}, "k*A*A*cell")
    made.reaction("wave", {}, {"B": 1}, "piecewise(1 + sin(time), time < 5 && B <= 9, log10(B^2), total > 3, 0)")
    model = made.read(tmp_path)
    net = model.network
    assert net.species == ("A", "B")
    assert_array_equal(model.initial, [10, 4])
    assert model.observables == {"total": {"A": 2.0, "B": 1.0}}
    assert model.notes == (
        "the law of wave is not proven to be at least 0; a run in which it is negative ends with an error",
        "half is not a sum of counts and is not shown",
    )
    for time, a, b in ((1.0, 10, 4), (1.0, 3, 12), (7.0, 6, 2)):
        half, x = 1.5, a / 2
        wave = 1 + math.sin(time) if time < 5 and b <= 9 else math.log10(b**2)
        expected = [2 * 3 * x / (half + x), 3 * b * b, 3 * x * x * 2, wave]
        assert_allclose(net.propensities([a, b], time), expected, rtol=1e-12)


def test_constant_rules_and_initial_assignments(tmp_path):
    made = Builder()
    made.species("A", 1)
    made.parameter("k", constant=False)
    made.parameter("n", 6.0)
    made.rule("k", "n/3")
    made.assignment("A", "n*5")
    made.reaction("out", {"A": 1}, {}, "k*A")
    model = made.read(tmp_path)
    assert model.network.is_mass_action
    assert_array_equal(model.initial, [30])
    assert_allclose(model.network.rate_constants, [2.0])


def test_a_sum_of_very_many_species(tmp_path):
    names = [f"a_species_with_a_long_name_{i}" for i in range(400)]
    network = Network.from_reactions({"in": ({}, {names[0]: 1})}, [1.0], species=names)
    model = Model(network, np.arange(400), {"all": {name: float(i) for i, name in enumerate(names, 1)}})
    write(model, tmp_path / "sum.xml")
    again = read(tmp_path / "sum.xml")
    assert again.observables == model.observables
    assert_array_equal(again.initial, model.initial)


def test_events(tmp_path):
    made = Builder()
    made.species("P", 100)
    made.species("D", 2, by_amount=False)
    made.parameter("k", 0.1)
    made.reaction("out", {"P": 1}, {}, "k*P")
    made.event("refill", "P < 30", P="P + 70", D="0")
    made.event("stop", "time >= 25.5", priority="2", P="0")
    refill, stop = made.read(tmp_path).network.events
    assert (refill.condition.text, stop.condition.text) == ("P < 30", "t >= 25.5")
    assert {name: value.text for name, value in refill.new_counts.items()} == {"P": "P + 70", "D": "0"}
    assert (refill.priority, stop.priority) == (0.0, 2.0)
    assert refill.was_true
    assert refill.from_trigger


def test_events_in_runs(tmp_path):
    """Immigration and death, and at 2.5 tu, between two times of the grid, 50 copies; a feed below 5 copies.

    After the event the count is binomial plus Poisson: every mean within 5.2 standard errors, at 1e-6 a time.
    """
    made = Builder()
    made.species("X", 0)
    made.species("F", 1)
    made.parameter("k", 2.0)
    made.reaction("in", {}, {"X": 1}, "k")
    made.reaction("out", {"X": 1}, {}, "0.5*X")
    made.reaction("eat", {"F": 1}, {}, "F/(1 + 0*F)")
    made.event("dose", "time >= 2.5", X="50")
    made.event("feed", "F < 1", F="7")
    model = made.read(tmp_path)
    assert not model.network.is_mass_action
    times = np.array([2.0, 3.0, 5.0])
    counts = simulate(model.network, Auto(), model.initial, times, 4000, 1).counts
    left = np.exp(-0.5 * (times - 2.5))
    mean = np.where(times < 2.5, 4 * (1 - np.exp(-0.5 * times)), 50 * left + 4 * (1 - left))
    variance = np.where(times < 2.5, mean, 50 * left * (1 - left) + 4 * (1 - left))
    standard_error = np.sqrt(variance / 4000)
    off = np.abs(counts[..., 0].mean(axis=0) - mean) / standard_error
    assert off.max() < 5.2
    assert np.abs(counts[..., 0].var(axis=0) / variance - 1).max() < 5.2 * math.sqrt(3 / 4000)
    assert np.abs(counts[..., 0].mean(axis=0) - 1.03 * mean).max() > 5.2 * standard_error.max()  # a control
    assert counts[..., 1].min() >= 1
    assert counts[..., 1].max() == 7


def base():
    made = Builder()
    made.species("A", 5)
    made.parameter("k", 2.0)
    made.parameter("free", 1.0, constant=False)
    made.reaction("out", {"A": 1}, {}, "k*A")
    return made


def with_constraint(made):
    made.model.createConstraint().setMath(libsbml.parseL3Formula("A > 1"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: m.rule("free", "0.1*A", "createRateRule"), "line .*: a rate rule"),
        (lambda m: m.rule(None, "A - free", "createAlgebraicRule"), "algebraic rule"),
        (with_constraint, "a constraint"),
        (lambda m: m.event("set", "time > 1", free="3"), "event 'set' sets 'free'; only counts of species"),
        (lambda m: m.event("set", "time > 1", A="delay(A, 2)"), "delay.*cannot be written as a rate law"),
        (lambda m: m.reaction("half", {"A": 0.5}, {}, "k*A"), "has 0.5 of 'A'; expected whole copies"),
        (lambda m: m.reaction("nan", {"A": math.nan}, {}, "k*A"), "whole copies"),
        (lambda m: m.reaction("gone", {"A": 1}, {}, "k*free2"), "free2"),
        (lambda m: m.parameter("unset") or m.reaction("u", {"A": 1}, {}, "unset*A"), "'unset' in a formula"),
        (lambda m: m.species("A", 3), "line .*'A'"),
        (lambda m: m.species("N", math.nan), "nan copies of 'N'"),
        (lambda m: m.species("N", -2.0), "-2 copies of 'N'"),
        (lambda m: m.species("N", None), "species 'N' has no initial amount"),
        (lambda m: m.model.createReaction().setId("bare"), "bare|kinetic law|required"),
        (lambda m: m.document.enablePackage(libsbml.CompExtension.getXmlnsL3V1V1(), "comp", True), "package 'comp'"),
    ],
)
def test_what_is_refused(change, message, tmp_path):
    made = base()
    assert made.read(tmp_path).network.is_mass_action
    change(made)
    with pytest.raises(ValueError, match=message):
        made.read(tmp_path)


CORE = "http://www.sbml.org/sbml/level3/version1"
DISTRIB = (
    f'<sbml xmlns="{CORE}/core" level="3" version="1" xmlns:distrib="{CORE}/distrib/version1" '
    'distrib:required="true"><model id="m"/></sbml>'
)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is not XML"),
        (DISTRIB, "requires the package 'distrib' of SBML, which is not read"),
        ("<sbml>", "is not XML"),
        ("<a/>", "line 2: .*XML"),
        ('<?xml version="1.0" encoding="klingon"?><sbml/>', "is not XML"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "line 1: a document type"),
        ("<a>" * 3000 + "</a>" * 3000, "tags over 100 deep"),
        ('<sbml xmlns="http://www.sbml.org/sbml/level3/version1/core" level="3" version="1"/>', "(?i)model"),
    ],
)
def test_files_that_are_no_sbml(text, message, tmp_path):
    path = tmp_path / "bad.sbml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        read(path)


def test_an_observable_of_thousands_of_species_comes_back(tmp_path):
    """libsbml holds its sum as a tree as deep as the sum is long."""
    names = [f"s{i}" for i in range(1200)]
    net = Network.from_reactions({"turn": ({"s0": 1}, {"s1": 1})}, [1.0], names)
    observables = {"weighted": {name: 1.0 + i for i, name in enumerate(names)}}
    write(Model(net, np.zeros(1200, dtype=int), observables), tmp_path / "long.xml")
    again = read(tmp_path / "long.xml")
    assert again.observables == observables
    assert again.notes == ()


def test_a_rate_law_over_a_long_sum(tmp_path):
    made = Builder()
    for i in range(1500):
        made.species(f"s{i}", 1)
    made.reaction("out", {"s0": 1}, {}, " + ".join(f"s{i}" for i in range(1500)))
    model = made.read(tmp_path)
    assert model.network.propensities(model.initial) == 1500.0


def test_fractions_of_a_copy_ask_for_a_scale(tmp_path):
    made = base()
    made.species("B", concentration=0.4)
    made.reaction("fade", {"B": 1}, {}, "B")
    with pytest.raises(ValueError, match=r"'B' starts from 0.4, .* --copies-per-unit"):
        made.read(tmp_path)
    assert_array_equal(made.read(tmp_path, 10).initial, [50, 4])


def test_moles_are_told(tmp_path):
    note = "the file states amounts in moles; they are read as copies"
    for unit, told in (("mole", True), ("item", False), ("own", True)):
        made = base()
        if unit == "own":
            made.model.createUnitDefinition().setId("own")
            part = made.model.getUnitDefinition("own").createUnit()
            part.setKind(libsbml.UNIT_KIND_MOLE)
            part.setExponent(1.0)
            part.setScale(-3)
            part.setMultiplier(1.0)
        made.model.getSpecies(0).setSubstanceUnits(unit)
        assert (note in made.read(tmp_path).notes) == told
        assert note not in made.read(tmp_path, 100).notes


def test_an_own_law_stops_where_reactants_are_missing(tmp_path):
    """Consumption at a constant rate, which would go below zero."""
    made = Builder()
    made.species("A", 3)
    made.reaction("out", {"A": 2}, {}, "1.5")
    net = made.read(tmp_path).network
    assert not net.is_mass_action
    assert_allclose(net.propensities(np.array([[3], [2], [1], [0]]))[:, 0], [1.5, 1.5, 0, 0])


def test_predict_shows_observables_and_how_the_file_was_read(tmp_path):
    """By default: counts, whole sums, and remarks; a scale by its option, which a rule book does not take."""
    made = Builder()
    for name, amount in (("X", 0.5), ("Y", 0.25)):
        made.species(name, amount)
    for name, formula in (("all", "X + Y"), ("part", "0.5*X"), ("square", "X^2")):
        made.parameter(name, constant=False)
        made.rule(name, formula)
    made.reaction("turn", {"X": 1}, {"Y": 1}, "X - 2*Y", reversible=True)
    with pytest.raises(ValueError, match=r"starts from 0\.5"):
        made.read(tmp_path)
    options = ["predict", str(tmp_path / "model.xml"), "--method", "transient", "--times", "50", "--json"]
    run = CliRunner().invoke
    done = run(main, options)
    assert done.exit_code == 2
    assert "--copies-per-unit 1e6" in done.output
    data = json.loads(run(main, [*options, "--copies-per-unit", "12"]).output)
    assert data["species"] == ["X", "Y", "all"]
    assert_allclose(data["mean"], [[6, 3, 9]], rtol=1e-9)
    assert_allclose(data["sd"][0][0], math.sqrt(9 * 2 / 9), rtol=1e-9)
    assert data["notes"][:-1] == [
        "turn is reversible: X forward, 2 * Y backward",
        "square is not a sum of counts and is not shown",
        "one unit of the file's amounts is 12 copies",
        "not shown, because they are not sums of counts with whole weights: part",
    ]
    done = run(main, ["predict", "line4", "--rates", "table3", "--cubes", "4", "--copies-per-unit", "2"])
    assert done.exit_code == 2
    assert "--copies-per-unit 2 is the scale of a network file; line4 is a rule book" in done.output


def test_the_unit_of_time_is_the_files(tmp_path):
    for stated, unit in (("second", "s"), (None, "")):
        made = Builder()
        made.species("A", 3)
        made.reaction("use", {"A": 1}, {}, "2*A")
        if stated:
            made.model.setTimeUnits(stated)
        assert made.read(tmp_path).network.time_unit == unit


def with_parameters(k=0.5, K=4.0, n=3.0):
    """Mass action, a law, a rule and an event by parameters; `n` also sets a count at time 0, so it stays a number."""
    made = Builder(size=2.0)
    made.species("A", 6)
    made.species("B", 5)
    for name, value in {"k": k, "K": K, "n": n}.items():
        made.parameter(name, value)
    made.parameter("twice", constant=False)
    made.rule("twice", "2*k")
    made.assignment("B", "5*n")
    made.reaction("pair", {"A": 2}, {"B": 1}, "k*A*(A - 1)*3")
    made.reaction("turn", {"B": 1}, {"A": 1}, "twice*B/(K + B)")
    made.reaction("make", {}, {"A": 1}, "n*twice")
    made.event("dose", "B < K", A="A + 1")
    return made


def test_parameters_keep_their_names(tmp_path):
    """Other values mean what they mean in the file."""
    model = with_parameters().read(tmp_path)
    assert model.network.parameters == {"k": 0.5, "K": 4.0}
    assert "= 3" in str(model.network)
    other, changed = with_parameters(k=0.8, K=9.0).read(tmp_path), model.with_parameters(k=0.8, K=9)
    states = np.random.default_rng(0).integers(2, 30, (30, 2))
    assert_allclose(changed.network.propensities(states, 0.0), other.network.propensities(states, 0.0), rtol=1e-15)
    assert not np.any(np.isclose(changed.network.propensities(states, 0.0), model.network.propensities(states, 0.0)))
    assert changed.network.events[0].condition.parameters == {"K": 9.0}
    with pytest.raises(ValueError, match="unknown parameter 'n'"):
        model.with_parameters(n=1)


PACKAGES = ("groups", "fbc", "qual", "comp", "multi", "spatial", "distrib", "layout", "render")


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_that_is_not_required_is_read_past(package, tmp_path):
    """With contents that break its rules; a required one is refused by name, unless it says how a model looks."""
    made = base()
    text = libsbml.writeSBMLToString(made.document)
    name = f"http://www.sbml.org/sbml/level3/version1/{package}/version1"
    junk = '<p:listOfThings p:id="3"><p:nothing/></p:listOfThings>'
    path = tmp_path / "packed.xml"
    for required in ("false", "true"):
        changed = text.replace('level="3"', f'xmlns:p="{name}" p:required="{required}" level="3"', 1)
        changed = changed.replace("</model>", f"{junk}</model>")
        assert changed.count("p:") > 5
        path.write_text(changed, encoding="utf-8")
        if required == "true" and package not in ("layout", "render"):
            with pytest.raises(ValueError, match=f"requires the package '{package}' of SBML, which is not read here"):
                read(path)
        else:
            assert read(path).network.fingerprint == made.read(tmp_path).network.fingerprint


@pytest.mark.parametrize("encoding", ["shift_jis", "utf-7", "klingon", "hex", "hz"])
def test_an_encoding_that_is_not_read_is_told_with_the_file(encoding, tmp_path):
    path = tmp_path / "odd.xml"
    path.write_bytes(f'<?xml version="1.0" encoding="{encoding}"?><a/>'.encode())
    with pytest.raises(ValueError, match=r"odd\.xml"):
        read(path)


def test_names_that_mean_something_in_formulas_stay_species(tmp_path):
    """Phosphate is not the number pi, nor are susceptible and infected infinity."""
    first = tmp_path / "pi.rxn"
    first.write_text("bind: Pi + ADP -> ATP, k\nk = 0.01\nPi = 100\nADP = 50\nobservable: Time = Pi + 2 * ATP")
    model = read(first)
    write(model, tmp_path / "pi.xml")
    again = read(tmp_path / "pi.xml")
    assert again.network.species == ("Pi", "ADP", "ATP")
    assert_allclose(again.network.propensities([7, 5, 1]), [0.35], rtol=1e-15)
    assert again.observables == {"Time": {"Pi": 1.0, "ATP": 2.0}}
