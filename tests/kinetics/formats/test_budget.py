"""Small files and texts that ask for exponential work: read right, or refused, in little time and memory."""

from itertools import pairwise

import pytest
from limited import outcomes

pytest.importorskip("libsbml")


def chained(levels):
    """Comparisons within each other; as a tree, the middle of a < b < c counts twice."""
    text = "A"
    for _ in range(levels):
        text = f"(1<{text}<3)"
    return text


def net(functions, rate="f"):
    lines = "\n".join(f"{i} {name}() {text}" for i, (name, text) in enumerate(functions, 1))
    return (
        f"begin functions\n{lines}\nend functions\nbegin species\n1 A() 5\nend species\n"
        f"begin reactions\n1 1 0 {rate}\nend reactions\nbegin groups\n1 g 1\nend groups\n"
    )


def apply(sign, *parts):
    return f"<apply><{sign}/>{''.join(parts)}</apply>"


def ci(name):
    return f"<ci> {name} </ci>"


def sbml(law=None, functions="", parameters="", rules="", events=""):
    """A decay with this law."""

    def listed(name, content):
        return f"<listOf{name}>{content}</listOf{name}>" if content else ""

    law = law or apply("times", "<cn> 0.1 </cn>", ci("A"))
    return (
        '<?xml version="1.0" encoding="UTF-8"?><sbml xmlns="http://www.sbml.org/sbml/level3/version2/core" level="3" '
        f'version="2"><model id="m">{listed("FunctionDefinitions", functions)}'
        '<listOfCompartments><compartment id="c" spatialDimensions="3" size="1" constant="true"/></listOfCompartments>'
        '<listOfSpecies><species id="A" compartment="c" initialAmount="5" hasOnlySubstanceUnits="true" '
        'boundaryCondition="false" constant="false"/></listOfSpecies>'
        f"{listed('Parameters', parameters)}{listed('Rules', rules)}"
        '<listOfReactions><reaction id="r" reversible="false"><listOfReactants><speciesReference species="A" '
        f'stoichiometry="1" constant="true"/></listOfReactants><kineticLaw>{math(law)}</kineticLaw></reaction>'
        f"</listOfReactions>{listed('Events', events)}</model></sbml>"
    )


def math(content):
    return f'<math xmlns="http://www.w3.org/1998/Math/MathML">{content}</math>'


def function(name, body, argument="x"):
    lambda_ = f"<lambda><bvar>{ci(argument)}</bvar>{body}</lambda>"
    return f'<functionDefinition id="{name}">{math(lambda_)}</functionDefinition>'


def rule(name, body):
    return f'<assignmentRule variable="{name}">{math(body)}</assignmentRule>'


def doubling_rules(n, sign="plus", law=False):
    names = [f"p{i}" for i in range(n)]
    rules = [rule("p0", ci("A")), *(rule(b, apply(sign, ci(a), ci(a))) for a, b in pairwise(names))]
    parameters = "".join(f'<parameter id="{name}" constant="false"/>' for name in names)
    return sbml(ci(names[-1]) if law else None, parameters=parameters, rules="".join(rules))


def doubling_functions(n, apart=False):
    """Each calls the one before twice: with the same argument, or with two."""
    first = function("f0", FIRST)
    parts = [ci("x"), FIRST if apart else ci("x")]
    others = [
        function(f"f{i}", apply("plus", *(f"<apply>{ci(f'f{i - 1}')}{part}</apply>" for part in parts)))
        for i in range(1, n)
    ]
    return sbml(f"<apply>{ci(f'f{n - 1}')}{ci('A')}</apply>", functions="".join([first, *others]))


def calling_functions(n, calls):
    """Each calls the one before many times."""
    first = function("f0", FIRST)
    others = [
        function(f"f{i}", apply("plus", *[f"<apply>{ci(f'f{i - 1}')}{ci('x')}</apply>"] * calls)) for i in range(1, n)
    ]
    return sbml(f"<apply>{ci(f'f{n - 1}')}{ci('A')}</apply>", functions="".join([first, *others]))


def event(trigger, value):
    return (
        f'<event id="e" useValuesFromTriggerTime="true"><trigger initialValue="true" persistent="true">{math(trigger)}'
        f'</trigger><listOfEventAssignments><eventAssignment variable="A">{math(value)}</eventAssignment>'
        "</listOfEventAssignments></event>"
    )


FIRST = apply("plus", ci("x"), "<cn> 1 </cn>")


def nested(levels, before, after, inner="A"):
    return before * levels + inner + after * levels


SUM = " + ".join(["A"] * 5000)
POWERS = [("f0", "g*g+1"), *((f"f{i}", f"f{i - 1}*f{i - 1}") for i in range(1, 60)), ("f", "f59/f59*g")]
# Name of the file -> its text, and whether it must be read: what is short and meaningful is.
BOMBS = {
    "comparisons.law": (chained(3), True),
    "comparisons of 45 levels.law": (chained(45), True),
    "comparisons of 45 levels.condition": (chained(45), True),
    "comparisons of 45 levels.net": (net([("f", chained(45).replace("A", "g"))]), True),
    "comparisons of 45 levels.query": (f"P=? [ F<=3 {chained(45)} ]", True),
    "sum of 5000.law": (SUM, True),
    "sum of 5000.condition": (f"{SUM} > 3", True),
    "sum of 400.net": (net([("f", "+".join(["g"] * 400))]), True),
    "sum of 5000.net": (net([("f", "+".join(["g"] * 5000))]), True),
    "functions that square each other.net": (net(POWERS), False),  # their value is infinite
    "product of 5000.law": (SUM.replace("+", "*"), True),
    "brackets 20000 deep.law": (nested(20_000, "(", ")"), True),
    "brackets 60000 deep.law": (nested(60_000, "(", ")"), False),
    "brackets 20000 deep.condition": (nested(20_000, "(", ")") + " > 3", True),
    "brackets 5000 deep.net": (net([("f", nested(5000, "(", ")", "g"))]), True),
    "functions 3000 deep.law": (nested(3000, "exp(", ")"), True),
    "signs 9000 deep.law": (nested(9000, "-", ""), True),
    "powers 3000 deep.law": (nested(3000, "A ** (1 + ", ")"), True),
    "blanks.query": ("P" + " " * 200_000, False),
    "blanks in a bound.query": ("P=? [ F<=" + " " * 200_000, False),
    "26 rules.xml": (doubling_rules(26), True),
    "40 rules.xml": (doubling_rules(40), True),
    "40 rules in a law.xml": (doubling_rules(40, law=True), True),
    "40 rules of products in a law.xml": (doubling_rules(40, "times", law=True), False),  # its value is infinite
    "1000 rules.xml": (doubling_rules(1000), True),
    "20 functions.xml": (doubling_functions(20), True),
    "40 functions.xml": (doubling_functions(40), True),
    "200 functions.xml": (doubling_functions(200), True),
    "20 functions that call 100 times.xml": (calling_functions(20, 100), True),
    "a circle of rules.xml": (doubling_rules(40).replace(ci("A"), ci("p39"), 1), False),
    "a circle of functions.xml": (doubling_functions(40).replace(FIRST, f"<apply>{ci('f39')}{ci('x')}</apply>"), False),
    "20 functions of two arguments.xml": (doubling_functions(20, apart=True), True),
    "sum of 5000.xml": (sbml(apply("plus", *[ci("A")] * 5000)), True),
    "doubling rules in an event.xml": (
        doubling_rules(40).replace(
            "</model>", f"<listOfEvents>{event(apply('gt', ci('p39'), ci('A')), ci('p39'))}</listOfEvents></model>"
        ),
        True,
    ),
    "memory.control": ("", None),
    "time.control": ("", None),
}


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bombs")
    for name, (text, _) in BOMBS.items():
        (folder / name).write_text(text, encoding="utf-8")
    return outcomes(folder)


@pytest.mark.parametrize("name", [name for name in BOMBS if not name.endswith(".control")])
def test_a_bomb_is_read_or_refused(name, found):
    assert found[name][0] == ("read" if BOMBS[name][1] else "refused"), found[name]


def test_the_limits_catch_what_takes_too_much(found):
    """The control: without it, limits that limit nothing would let every bomb pass."""
    assert found["memory.control"][0] == "MemoryError"
    assert found["time.control"][0].startswith("died of signal")
