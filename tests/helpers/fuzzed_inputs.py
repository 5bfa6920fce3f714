"""Inputs of every grammar that is read from outside, at random: nested, shared, long, extreme and slightly broken."""

import numpy as np

from tests.helpers import fuzzed_archives

PLAIN = ["0", "1", "2", "0.5", "3.25e2", ".5", "7"]
EXTREME = ["1e999", "1e308", "1e-320", "5e-324", "1e-999", "9223372036854775807", "9223372036854775808", "-1", "nan"]
EXTREME += ["inf", "5.", "007", "1_0", "0x10", "2j", "1e18", "1e22", "-0.0"]
NAMES = ["A", "B", "k", "A", "B", "k"]
ODD_NAMES = ["t", "pi", "if", "True", "x'", "'A'", '"A"', "'t'", "\u00e4", "_e", "exp", "''", "\\", "A\0", "f9"]
SIGNS = ["+", "-", "*", "/", "%"]
ODD_SIGNS = ["^", "**", "<", "=", "!=", "&&", "||", "=>", " and ", " or ", "//", "!", "&", "|", ","]
CALLS = {"exp": 1, "sqrt": 1, "sin": 1, "floor": 1, "abs": 1, "min": 2, "max": 3, "pow": 2}
ODD_CALLS = {"piecewise": 3, "if": 3, "log": 1, "ln": 1, "rint": 1, "log10": 1, "f0": 1, "time": 0, "exp": 2}
ENCODINGS = ["utf-8-sig", "latin-1", "utf-16", "utf-32", "cp037"]
DECLARED = ["latin-1", "UTF-16", "bogus", "", "IBM037"]
MATHS = {"plus": 2, "times": 3, "minus": 2, "divide": 2, "power": 2, "exp": 1, "ln": 1, "sin": 1, "floor": 1, "max": 2}
ODD_MATHS = {"root": 1, "abs": 1, "and": 2, "not": 1, "lt": 3, "eq": 2, "quotient": 2, "rem": 2, "log": 1, "minus": 0}
MANY = [2, 10, 300, 3000]
LONGEST_PART = 100_000  # characters


class Inputs:
    """Inputs number 0, 1, ... of a seed, each its own random stream."""

    def __init__(self, seed, number):
        self.rng = np.random.default_rng([seed, number])
        self.number = number

    def files(self):
        """Name -> bytes of the files of an input; the first is the one to read."""
        kinds = [self.law, self.condition, self.query, self.net, self.sbml, self.tra, self.run, self.table]
        made = kinds[self.number % len(kinds)]()
        return {name: self.broken(each) if isinstance(each, str) else each for name, each in made.items()}

    def run(self):
        return fuzzed_archives.run_file(self)

    def table(self):
        return fuzzed_archives.table(self)

    def one(self, choices):
        return choices[int(self.rng.integers(len(choices)))]

    def chance(self, probability):
        return self.rng.random() < probability

    def usual(self, choices, odd, probability=0.04):
        """One of the usual choices, now and then an odd one."""
        return self.one(odd if self.chance(probability) else choices)

    def number_text(self):
        """A number as it is written."""
        return self.usual(PLAIN, EXTREME)

    def broken(self, content):
        """Some with bytes taken out, doubled or replaced; some in odd encodings."""
        data = bytearray(content.encode(self.one(ENCODINGS) if self.chance(0.03) else "utf-8", "replace"))
        for _ in range(int(self.rng.integers(1, 4)) if data and self.chance(0.1) else 0):
            place = int(self.rng.integers(len(data) + 1))
            instead = self.one([b"", b"\0", b"((", b"\xff", b"\n", b"9" * 30, bytes(data[:20])])
            data[place : place + int(self.rng.integers(0, 9))] = instead
        return bytes(data)

    def formula(self, depth=4):
        """A formula, or something like it."""
        kind = self.rng.integers(12) if depth else 0
        if kind <= 1:
            return self.number_text() if self.chance(0.5) else self.usual(NAMES, ODD_NAMES)
        inner = self.formula(depth - 1)[:LONGEST_PART]
        if kind <= 4:
            return f"{inner}{self.usual(SIGNS, ODD_SIGNS)}{self.formula(depth - 1)}"
        if kind <= 6:
            return f"({inner})"
        if kind <= 8:
            name, count = self.usual(list(CALLS.items()), list(ODD_CALLS.items()), 0.08)
            return f"{name}({', '.join([inner, *(self.formula(depth - 1) for _ in range(count - 1))][:count])})"
        if kind == 9:
            sign = self.one(["<", "<=", ">", "==", "!="])
            return f"({inner}{sign}{self.formula(depth - 1)}{sign}{self.one(PLAIN)})"
        if kind == 10:
            return f"(-{inner})" if self.chance(0.9) else f"{self.one(['+', ' not ', '!'])}{inner}"
        many = self.one(MANY)
        if self.chance(0.5):  # long
            return self.usual(SIGNS, ODD_SIGNS).join([self.formula(1)[:100]] * many)
        before, after = self.one([("(", ")"), ("exp(", ")"), ("(1<", "<3)"), ("-", ""), ("(1+", ")"), ("(A**", ")")])
        return before * many + self.formula(1) + after * many

    def law(self):
        return {"input.law": self.formula()}

    def condition(self):
        return {"input.condition": f"{self.formula(3)}{self.one(['<', '>=', '=', '!='])}{self.formula(2)}"}

    def query(self):
        bound = self.one(["", "<=3", "<=1e999", "<= " + " " * self.one(MANY), "<=5e-324", ">=1", "[0,1]"])
        phi, psi = self.formula(2), self.formula(2)
        inner = self.one([f"F{bound} {phi}", f"G{bound} {phi}", f"{phi} U{bound} {psi}", phi, f"I={psi}", f"C{bound}"])
        kind, blanks = self.one(["P", "S", "R", 'R{"A"}', "Q"]), " " * self.one([0, 3, 3000])
        return {"input.query": f"{kind}=? [ {inner} ]{blanks}"}

    def net(self):
        """Functions that share those before them, extreme counts, numbers that point anywhere."""
        n = int(self.rng.integers(1, 5))
        places = [str(i) for i in range(1, n + 1)] if self.chance(0.95) else ["0", "1", "99999999999999999999", "-1"]

        def block(name, lines):
            return f"begin {name}\n" + "".join(f"{i} {line}\n" for i, line in enumerate(lines, 1)) + f"end {name}\n"

        functions = [
            f"f{i}() {self.formula(3).replace('f1', f'f{max(i - 1, 0)}')}" for i in range(int(self.rng.integers(4)))
        ]
        rates = [
            "k",
            "0.5",
            "2*k",
            "f0",
            "f1",
            "Sat k k",
            "MM 1 2",
            "Hill k 1 2.5",
            self.usual(PLAIN, [self.formula(2)]),
        ]
        sides = [",".join(self.one(places) for _ in range(int(self.rng.integers(1, 4)))) for _ in range(2 * n)]
        return {
            "input.net": block(
                "parameters", [f"k {self.number_text()}", "B 2", f"g {self.usual(PLAIN, [self.formula(2)])}"]
            )
            + (block("functions", functions) if functions else "")
            + block("species", [f"{'$' * self.chance(0.1)}S{i}() {self.usual(PLAIN[:3], EXTREME)}" for i in range(n)])
            + block("reactions", [f"{a} {b} {self.one(rates)}" for a, b in zip(sides[::2], sides[1::2], strict=True)])
            + block("groups", [f"g {','.join(self.one(places) for _ in range(3))}"])
        }

    def tra(self):
        """A chain of few states, and files beside it."""
        n = int(self.rng.integers(1, 5))

        def state():
            return str(self.rng.integers(n)) if self.chance(0.97) else self.usual(PLAIN[:3], EXTREME)

        lines = [f"{state()} {state()} {self.number_text()}" for _ in range(int(self.rng.integers(1, 6)))]
        sizes = (
            f"{n if self.chance(0.9) else self.usual(PLAIN[:3], EXTREME)} {len(lines)}" if self.chance(0.9) else "ctmc"
        )
        return {
            "input.tra": "\n".join([sizes, *lines]),
            "input.sta": "\n".join(
                [f"({self.one(['x', 'x,y', ''])})", *(f"{i}:({self.usual(PLAIN[:3], EXTREME)})" for i in range(n))]
            ),
            "input.lab": f'0="init" 1="{self.usual(NAMES, ODD_NAMES)}"\n{state()}: 0\n{state()}: 1',
            "input.srew": "\n".join([f"{n} 1", f"{state()} {self.number_text()}"]),
        }

    def math(self, names, depth=3, functions=4):
        """A formula of SBML, over some names and so many functions."""
        if not depth or self.chance(0.25):
            odd = [f'<cn type="e-notation">1<sep/>{self.one(["999", "-320", "2"])}</cn>', "<true/>", "<infinity/>"]
            odd += [
                f'<cn type="rational">1<sep/>{self.one(["0", "3"])}</cn>',
                "<pi/>",
                "<exponentiale/>",
                "<ci> f9 </ci>",
            ]
            return self.usual([f"<cn> {self.number_text()} </cn>", f"<ci> {self.one(names)} </ci>"], odd)
        if functions and self.chance(0.15):
            return f"<apply><ci> f{self.rng.integers(functions)} </ci>{self.math(names, depth - 1, functions)}</apply>"
        if self.chance(0.1):
            value, other, least = (self.math(names, depth - 1, functions) for _ in range(3))
            condition = f"<apply><lt/>{value}{least}</apply>"
            return f"<piecewise><piece>{value}{condition}</piece><otherwise>{other}</otherwise></piecewise>"
        name, count = self.usual(list(MATHS.items()), list(ODD_MATHS.items()))
        parts = [self.math(names, depth - 1, functions) for _ in range(count)]
        if depth == 3 and name in ("plus", "times") and self.chance(0.2):
            parts *= self.one(MANY[:3])
        whole = f"<apply><{name}/>{''.join(parts)}</apply>"
        return whole if self.chance(0.998) else "<apply>" * self.one(MANY) + whole

    def sbml(self):
        """Rules and functions of those before them, or of any; a law, an event, and numbers of all sizes."""
        n = self.one([1, 3, 10, 30])
        names = ["A", "A", "B", "k", *(f"p{i}" for i in range(n))]
        frame = '<math xmlns="http://www.w3.org/1998/Math/MathML">{}</math>'

        def part(tag, key, attribute, content):
            return f'<{tag} {attribute}="{key}">{frame.format(content)}</{tag}>'

        def before(i):
            return names[: 4 + i] if self.chance(0.95) else names

        bodies = [self.math(["x"], functions=i if self.chance(0.97) else 4) for i in range(4)]
        functions = "".join(
            part("functionDefinition", f"f{i}", "id", f"<lambda><bvar><ci> x </ci></bvar>{body}</lambda>")
            for i, body in enumerate(bodies)
        )
        size = self.usual(["1", "2"], ["0", "1e-320"])
        double = "<apply><plus/><ci> {0} </ci><ci> {0} </ci></apply>"
        rules = "".join(
            part(
                "assignmentRule",
                f"p{i}",
                "variable",
                double.format(f"p{i - 1}") if i and self.chance(0.6) else self.math(before(i)),
            )
            for i in range(n)
        )
        constants = f'<parameter id="k" value="{self.usual(PLAIN[:3], EXTREME)}" constant="true"/>'
        parameters = constants + "".join(f'<parameter id="p{i}" constant="false"/>' for i in range(n))
        species = "".join(
            f'<species id="{name}" compartment="c" initialAmount="{self.usual(PLAIN[:3], EXTREME)}" '
            'hasOnlySubstanceUnits="true" '
            'boundaryCondition="false" constant="false"/>'
            for name in "AB"
        )
        side = f'<speciesReference species="A" stoichiometry="{self.usual(PLAIN[1:3], EXTREME)}" constant="true"/>'
        law = self.math(names)
        event = (
            f'<event useValuesFromTriggerTime="true"><trigger initialValue="true" persistent="true">'
            f"{frame.format(self.math(names))}</trigger>"
            f'<delay>{frame.format(self.math(names, 1))}</delay><listOfEventAssignments><eventAssignment variable="B">'
            f"{frame.format(self.math(names))}</eventAssignment></listOfEventAssignments></event>"
        )
        return {
            "input.xml": f'<?xml version="1.0" encoding="{self.usual(["UTF-8"], DECLARED, 0.03)}"?>'
            '<sbml xmlns="http://www.sbml.org/sbml/level3/version2/core" level="3" version="2"><model id="m">'
            f"<listOfFunctionDefinitions>{functions}</listOfFunctionDefinitions>"
            f'<listOfCompartments><compartment id="c" spatialDimensions="3" size="{size}" '
            f'constant="true"/></listOfCompartments><listOfSpecies>{species}</listOfSpecies>'
            f"<listOfParameters>{parameters}</listOfParameters><listOfRules>{rules}</listOfRules>"
            f'<listOfReactions><reaction id="r" reversible="{self.one(["true", "false"])}"><listOfReactants>{side}'
            f'</listOfReactants><listOfModifiers><modifierSpeciesReference species="B"/></listOfModifiers><kineticLaw>'
            f"{frame.format(law)}</kineticLaw></reaction></listOfReactions>"
            f"{f'<listOfEvents>{event}</listOfEvents>' if self.chance(0.4) else ''}</model></sbml>"
        }
