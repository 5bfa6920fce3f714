"""Texts of reactions at random: events, constant species, units and repeated lines among parameters and laws."""

from tests.helpers.fuzzed_inputs import EXTREME, PLAIN, Inputs

UNITS = ["nM", "s", "min", "/s", "/M/s", "/(M s)", "nM/s", "M^-1 s^-1", "fL"]
ODD_UNITS = ["/M^9", "nm", "/(", "M M M M", "^2", "1/s", "pM^3 pM^3 pM^3 pM^3", "/s" * 3000, "um^3 L"]
ODD_LINES = [
    "at",
    "when B:",
    "at t:",
    "const",
    "for i in",
    "for i in 1..2:",
    "volume = 0 fL",
    "A[1]",
    "[",
    "at t = 1: A =",
]


class ReactionTexts(Inputs):
    """Files of reactions number 0, 1, ... of a seed."""

    def files(self):
        """One file each."""
        self.made = 0  # names of which each line has its own
        lines = [self.line() for _ in range(int(self.rng.integers(2, 9)))]
        given = ["A + B -> C, k * 2", f"k = {self.value()}", f"A = {self.usual(PLAIN[:3], EXTREME)}", "volume = 1 fL"]
        if self.chance(0.7):
            given.append("time unit: s")
        return {"input.rxn": self.broken("\n".join([*given, *lines]))}

    def value(self):
        """A number, with a unit now and then."""
        unit = f" {self.usual(UNITS, ODD_UNITS)}" if self.chance(0.1) else ""
        return self.usual(PLAIN, EXTREME, 0.02) + unit

    def short(self):
        """A formula, mostly one of a few operations."""
        return (
            self.formula(2) if self.chance(0.06) else self.one(["A", "k", "A + 1", "2", "k * B", "max(A - 1, 0)", "t"])
        )

    def side(self):
        """A side of a reaction."""
        return self.usual(["A", "B", "2 A", "A + B", "0", "C"], ["A[1]", "1e9 A", "A +", "'A'", "A[99999999999]"])

    def line(self):
        """One line of any kind."""
        kinds = [self.reaction, self.event, self.event, self.constant, self.repeated, self.amount]
        return self.one(ODD_LINES) if self.chance(0.02) else self.one(kinds)()

    def reaction(self):
        """With a rate constant or a law."""
        unit = self.one([""] * 4 + ["k", "0.5 /s", "3 /M/s"]) or self.short()
        return f"{self.side()} -> {self.side()}, {unit}"

    def event(self):
        """At a time or on a condition."""
        at = f"at t = {self.one(PLAIN)}{self.one(['', '', ' s', ' min'])}"
        moment = at if self.chance(0.5) else f"when {self.short()} {self.one(['<', '>=', '==', '!='])} {self.short()}"
        more = self.usual(["", "", ", delay 2", ", priority k", ", from trigger"], [", also at 0", ", delay -1", ", x"])
        return f"{moment}{more}: {self.usual(['A', 'B'], ['k', 't', 'S', 'zz'])} = {self.short()}"

    def constant(self):
        """A species held constant."""
        self.made += 1
        name = f"D{self.made}"
        return f"{name} -> A, 1\nconst {self.usual([name, f'{name} = 3'], ['A', 'zz', f'{name}, A'])}"

    def repeated(self):
        """With numbered names."""
        self.made += 1
        last = self.usual(["1", "3", "20"], ["10000", "999999999999", "0", "x"])
        index = self.usual(["i", "i+1", "2*i", "i % 3"], ["i-5", "i/2", "j", "", "i" * 3000, "9**9**9", "1/0"])
        return f"for i in 1..{last}: {self.one(['', f'r{self.made}[i]: '])}X[i] -> X[{index}], {self.short()}"

    def amount(self):
        """A count of another species."""
        self.made += 1
        count = self.usual(["3", "5 nM", "2 * 3"], ["0.1 nM", "1e999", "k nM", "3 /s", self.value()])
        return f"F{self.made} -> G, 2\nF{self.made} = {count}"
