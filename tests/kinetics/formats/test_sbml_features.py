"""Features of SBML, each in a file of our own with its answer by hand: read right, or refused by name."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rate_equations import RateEquations
from sbml_builder import Builder, both_ways

from kinetics.sampling import General

libsbml = pytest.importorskip("libsbml")
TIMES = np.array([0.0, 0.5, 1.0, 2.0, 3.5])


def decay(size=1.0, law="k*A", level=3, **species):
    made = Builder(level, 2 if level == 3 else 4, size)
    made.species("A", 100, **species)
    made.parameter("k", 0.7)
    made.reaction("out", {"A": 1}, {}, law)
    return made


def size_by_rule():
    made = Builder(size=None)
    made.model.getCompartment(0).setConstant(False)
    made.parameter("half", 1.0)
    made.rule("cell", "2*half")
    made.species("A", concentration=50, by_amount=False)
    made.reaction("out", {"A": 1}, {}, "A")
    return made


def growing_size():
    made = decay(law="k*A", by_amount=False)
    made.model.getCompartment(0).setConstant(False)
    made.rule("cell", "1 + time")
    return made


def stoichiometry_by(what, value):
    def build():
        made = Builder()
        made.species("X", 0)
        made.parameter("n", 3.0)
        made.reaction("in", {}, {"X": 1}, "2", ids={"X": "many"})
        getattr(made, what)("many", value)
        return made

    return build


def stoichiometry_in_level_2(value):
    def build():
        made = Builder(2, 4)
        made.species("X", 0)
        made.parameter("n", 3.0)
        reaction = made.reaction("in", {}, {"X": 1}, "2")
        formula = libsbml.StoichiometryMath(2, 4)
        formula.setMath(libsbml.parseL3Formula(value))
        reaction.getProduct(0).setStoichiometryMath(formula)
        return made

    return build


def assigned_by_rules():
    """p = 4, cell = 2, many = 2, A = 8 by volume, B = 24, q = 28: A gains 2 copies at rate 28."""
    made = Builder(size=None)
    made.model.getCompartment(0).setConstant(False)
    made.parameter("p", None)
    made.parameter("q", None, constant=False)
    made.assignment("p", "4 + time")
    made.rule("cell", "p/2")
    made.rule("q", "B + p")
    made.species("A", None, by_amount=False)
    made.species("B", None)
    made.assignment("A", "many*p")
    made.assignment("B", "3*A")
    made.reaction("in", {}, {"A": 1}, "q", ids={"A": "many"})
    made.assignment("many", "p/2")
    return made


def relaxed(t):
    return 25 + 75 * np.exp(-0.8 * t)


def local_parameters():
    """They stand before compartments and global parameters of the same name."""
    made = Builder(size=5.0)
    made.species("A", 100)
    made.parameter("B", 9.0)
    made.parameter("k", 5.0)
    made.reaction("out", {"A": 1}, {}, "k*B*cell*A", k=0.7, B=2.0, cell=0.5)
    return made


def functions():
    made = decay(law="twice(k, A)/2")
    made.function("once", "lambda(x, y, x*y)")
    made.function("twice", "lambda(a, x, once(a, x) + once(x, a))")
    return made


def converted(factor, own=None):
    def build():
        made = Builder()
        made.parameter("f", factor)
        made.model.setConversionFactor("f")
        made.species("A", 100)
        made.species("B", 0)
        if own is not None:
            made.parameter("g", own)
            made.model.getSpecies(1).setConversionFactor("g")
        made.reaction("turn", {"A": 1}, {"B": 1}, "10")
        return made

    return build


def fast():
    made = Builder(3, 1)
    made.species("A", 1)
    made.reaction("out", {"A": 1}, {}, "A").setFast(True)
    return made


def boundary():
    made = Builder()
    made.species("S", 50, boundary=True)
    made.species("C", 2, constant=True, boundary=True)
    made.species("A", 0)
    made.reaction("feed", {"S": 1, "C": 1}, {"A": 1}, "0.1*S*C")
    return made


def references_and_reactions_in_formulas():
    made = decay()
    made.species("B", 0)
    made.reaction("more", {}, {"B": 1}, "out*three", ids={"B": "three"})
    made.model.getReaction("more").getProduct(0).setStoichiometry(3)
    return made


def without_math():
    """A rule, an initial assignment, a trigger, a delay, a priority and an event's assignment that say nothing."""
    made = decay()
    for name in ("free", "other"):
        made.parameter(name, 3.0, constant=False)
    made.rule("free", None)
    made.species("B", 4)
    made.model.createInitialAssignment().setSymbol("B")
    made.event("never", None, B="7")
    set_ = made.event("set", "time >= 2", B="B + free")
    set_.createDelay()
    set_.createPriority()
    empty = made.event("empty", "time >= 1")
    empty.createEventAssignment().setVariable("other")
    return made


def division():
    """7 - 3 trunc(-7/3): remainders have the sign of what is divided, as quotients are cut."""
    return decay(law="A*(rem(-7, 3) + 2)*quotient(-7, 3)/(-2)*k")


def truth():
    mixed, logic = "piecewise(1, 1 && (A > 0), 5)", "piecewise(1, implies(A < 0, A > 1) && xor(true, A < 0), 3)"
    return decay(law=f"k*A*(A >= 0)*{mixed}*{logic}")


def events(**options):
    """X = 10 + t for whole t, from a clock of events; then doubled with delay 1, once the clock has passed 12."""

    def build():
        made = Builder()
        made.species("X", 10)
        made.species("Y", 0)
        for t in (1, 2, 3):
            made.event(f"tick{t}", f"time >= {t}", X="X + 1")
        made.event("double", "X >= 12", Y="2*X + 1", **options)
        return made

    return build


def event_at_0():
    made = Builder()
    made.species("Y", 0)
    made.event("start", "Y < 1", initial=False, Y="5")
    return made


def when(t, first, *steps):
    """A step function: first, then (time, value) pairs."""
    return np.select([t >= start for start, _ in reversed(steps)], [value for _, value in reversed(steps)], first)


def alike(priority, other):
    def build():
        made = Builder()
        made.species("X", 1)
        made.event("one", "time >= 1", priority="2", at_trigger=False, X="2*X")
        made.species("Y", 1)
        made.event("other", "time >= 1", priority=priority, at_trigger=False, **other)
        return made

    return build


def dosed():
    made = both_ways()()
    made.event("dose", "X < 60 && time < 2", delay="0.9", X="X + Y/4", Y="2*Y")
    return made


def dosed_x(t):
    """X falls to 60 and Y rises to 40 at `turned`; 0.9 later there are 70 and 80, which relax to 37.5 of X."""
    turned = np.log(75 / 35) / 0.8
    return np.where(t < turned + 0.9, relaxed(t), 37.5 + 32.5 * np.exp(-0.8 * (t - turned - 0.9)))


READ = {
    "size by a rule": (size_by_rule, {"A": lambda t: 100 * np.exp(-t / 2)}),
    "size that grows": (growing_size, {"A": lambda t: 100 * (1 + t) ** -0.7}),
    "stoichiometry by a rule": (stoichiometry_by("rule", "n + 1"), {"X": lambda t: 8 * t}),
    "stoichiometry by an assignment": (stoichiometry_by("assignment", "2*n"), {"X": lambda t: 12 * t}),
    "stoichiometry by a formula": (stoichiometry_in_level_2("n - 1"), {"X": lambda t: 4 * t}),
    "assignments that use rules": (
        assigned_by_rules,
        {"A": lambda t: 16 + 56 * t, "B": lambda t: 24 + 0 * t},
    ),
    "reversible": (both_ways(), {"X": relaxed, "Y": lambda t: 100 - relaxed(t)}),
    "reversible in a volume": (
        both_ways("cell*(k*X + -1*p*Y)", size=4.0, by_amount=False),
        {"X": relaxed},
    ),
    "reversible quotient": (both_ways("(k*X - p*Y)/(0.5 + 0.5*(X + Y)/100)"), {"X": relaxed}),
    "reversible pieces": (both_ways("piecewise(0, time < 0, k*X - p*Y)"), {"X": relaxed}),
    "reversible by name alone": (both_ways("0.8*X*(1 - 0/(1 + Y))"), {"X": lambda t: 100 * np.exp(-0.8 * t)}),
    "concentration": (lambda: decay(5.0, "k*A*cell", by_amount=False), {"A": lambda t: 100 * np.exp(-0.7 * t)}),
    "concentration without volume": (
        lambda: decay(5.0, "k*A", by_amount=False),
        {"A": lambda t: 100 * np.exp(-0.14 * t)},
    ),
    "amount": (lambda: decay(5.0, "k*A"), {"A": lambda t: 100 * np.exp(-0.7 * t)}),
    "local parameters": (local_parameters, {"A": lambda t: 100 * np.exp(-0.7 * t)}),
    "functions": (functions, {"A": lambda t: 100 * np.exp(-0.7 * t)}),
    "conversion factors": (converted(2, 3), {"A": lambda t: 100 - 20 * t, "B": lambda t: 30 * t}),
    "held species": (boundary, {"A": lambda t: 10 * t, "S": lambda t: 50 + 0 * t}),
    "rates in formulas": (
        references_and_reactions_in_formulas,
        {"B": lambda t: 9 * 100 * (1 - np.exp(-0.7 * t))},
    ),
    "no math": (without_math, {"B": lambda t: when(t, 4.0, (2, 7.0)), "A": lambda t: 100 * np.exp(-0.7 * t)}),
    "time": (lambda: decay(law="k*A*time"), {"A": lambda t: 100 * np.exp(-0.35 * t**2)}),
    "Avogadro's number": (lambda: decay(law="k*A*avogadro/6.02214179e23"), {"A": lambda t: 100 * np.exp(-0.7 * t)}),
    "division": (division, {"A": lambda t: 100 * np.exp(-0.7 * t)}),
    "truth as numbers": (truth, {"A": lambda t: 100 * np.exp(-0.7 * t)}),
    "events": (events(), {"X": lambda t: 10 + np.floor(np.minimum(t, 3)), "Y": lambda t: when(t, 0, (2, 25))}),
    "delayed event": (events(delay="1.25"), {"Y": lambda t: when(t, 0, (3.25, 25))}),
    "delayed event of its own time": (events(delay="1.25", at_trigger=False), {"Y": lambda t: when(t, 0, (3.25, 27))}),
    "delay by a formula": (events(delay="X/12 + cell/4"), {"Y": lambda t: when(t, 0, (3.25, 25))}),
    "an order by priority": (alike("3", {"X": "X + 1"}), {"X": lambda t: when(t, 1, (1, 4))}),
    "an order that does not matter": (alike("2", {"Y": "5"}), {"X": lambda t: when(t, 1, (1, 2))}),
    "a delayed event on a count": (dosed, {"X": dosed_x}),
    "an event at 0": (event_at_0, {"Y": lambda t: 5 + 0 * t}),
}


def unset_size():
    made = Builder(size=None)
    made.species("A", 5, by_amount=False)
    made.reaction("out", {"A": 1}, {}, "A")
    return made


def circle():
    made = decay()
    for name, other in (("a", "b"), ("b", "a")):
        made.parameter(name, constant=False)
        made.rule(name, f"{other} + 1")
    return made


def rate_of_change():
    made = decay()
    made.species("B", 0)
    made.reaction("in", {}, {"B": 1}, "1 + rateOf(A)")
    return made


def setting(name):
    def build():
        made = decay()
        made.model.getCompartment(0).setConstant(False)
        made.parameter("free", 1.0, constant=False)
        made.event("set", "time > 1", **{name: "3"})
        return made

    return build


def rule_of(make):
    def build():
        made = decay()
        made.parameter("free", 1.0, constant=False)
        made.rule("free" if "Rate" in make else None, "A - free", make)
        return made

    return build


def late_in_a_changing_volume():
    made = growing_size()
    made.event("late", "time >= 1", delay="1", A="3")
    return made


REFUSED = {
    "a random order": (alike("1 + 1", {"X": "X + 1"}), "events 'one' and 'other' have the same priority"),
    "a late concentration": (late_in_a_changing_volume, "'late' sets the concentration of 'A' later"),
    "a varying stoichiometry": (
        stoichiometry_by("rule", "X + 1"),
        r"reaction 'in' has X \+ 1 of 'X', which changes",
    ),
    "a stoichiometry in time": (stoichiometry_by("rule", "time"), "changes with counts or time"),
    "a varying stoichiometry of Level 2": (stoichiometry_in_level_2("X"), "changes with counts or time"),
    "a fraction of a copy": (stoichiometry_by("assignment", "n/2"), "has 1.5 of 'X'; expected whole copies"),
    "a negative stoichiometry": (stoichiometry_by("assignment", "-n"), "has -3 of 'X'; expected whole copies"),
    "a fraction by conversion": (converted(0.5), "has 0.5 of 'A'; expected whole copies"),
    "a law that is no difference": (both_ways("k*sin(X - Y)"), "'turn' is reversible, and its law is no difference"),
    "a law both ways, irreversible": (
        both_ways(reversible=False),
        "'turn' is not reversible, but its law has both directions",
    ),
    "a fast reaction": (fast, "'out' is `fast`"),
    "delay in a formula": (lambda: decay(law="k*delay(A, 1)"), "delay.*cannot be written"),
    "a rate of change": (rate_of_change, "(?i)rateOf.*cannot be written"),
    "an unknown function": (lambda: decay(law="k*A*factorial(3)"), "factorial.*cannot be written"),
    "a rate rule": (rule_of("createRateRule"), "a rate rule"),
    "an algebraic rule": (rule_of("createAlgebraicRule"), "an algebraic rule"),
    "an unset size": (unset_size, "'cell' in a formula is neither"),
    "rules in a circle": (circle, "values go round in a circle: a, b"),
    "an event that sets a parameter": (setting("free"), "'set' sets 'free'; only counts"),
    "an event that sets a size": (setting("cell"), "'set' sets 'cell'; only counts"),
    "infinity": (lambda: decay(law="k*A*piecewise(INF, A > 5, 1)"), "inf in a formula"),
    "nothing that changes": (Builder, "no species whose amount"),
}


@pytest.mark.parametrize("name", READ)
def test_what_is_read_has_the_right_rate_equations(name, tmp_path):
    build, expected = READ[name]
    model = build().read(tmp_path)
    found = RateEquations(model.network).solution(model.initial, TIMES)
    for species, answer in expected.items():
        assert_allclose(found[:, model.network.index(species)], answer(TIMES), rtol=1e-6, atol=1e-6, err_msg=species)
    if not model.network.channels:  # nothing is random, and runs must say the same
        assert_allclose(General().simulate(model.network, model.initial, TIMES, runs=1).counts[0], found)
    if any(np.ptp(found[:, model.network.index(species)]) > 1 for species in expected) and not model.network.events:
        other = RateEquations(model.network, rate=1.03).solution(model.initial, TIMES)  # a control that must differ
        assert not np.allclose(other, found, rtol=1e-3)


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_read_is_refused_by_name(name, tmp_path):
    build, message = REFUSED[name]
    with pytest.raises(ValueError, match=message):
        build().read(tmp_path)


def test_small_files_do_no_exponential_work(tmp_path):
    """Functions that call each other twice, and rules that add the last one twice."""
    made = decay(law="k*A + 0*f39(A)")
    made.function("first", "lambda(x, y, x)")
    made.function("f0", "lambda(x, x)")
    for i in range(1, 40):
        made.function(f"f{i}", f"lambda(x, first(f{i - 1}(x), f{i - 1}(x)))")
    made.parameter("p0", constant=False)
    made.rule("p0", "A")
    for i in range(1, 40):
        made.parameter(f"p{i}", constant=False)
        made.rule(f"p{i}", f"p{i - 1} + p{i - 1}")
    model = made.read(tmp_path)
    assert len(model.network.laws) + model.network.is_mass_action == 1
    assert model.observables["p3"] == {"A": 8.0}
    assert model.observables["p39"] == {"A": 2.0**39}
    assert model.formulas["p3"] == "A + A + (A + A) + (A + A + (A + A))"
    assert model.formulas["p39"].endswith("x38 = x37 + x37; x38 + x38")


def test_formulas_say_what_the_file_means(tmp_path):
    model = size_by_rule().read(tmp_path)
    assert model.formulas == {"cell": "2 * 1", "half": "1", "A": "A / (2 * 1)"}
