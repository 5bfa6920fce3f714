"""Options and actions outside the blocks of a BNGL file: obeyed, ignored or refused by name.

The network is that of the model as it stands at its first action that generates or simulates it. What an action says is
read as Perl's numbers, texts, lists and hashes, and written anew; nothing else of it reaches BioNetGen.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from kinetics.formats.bnglblocks import pattern
from kinetics.formats.bngltext import BLANKS, NAME, BnglLine
from kinetics.network.laws.reading import NUMBER

CALL = re.compile(rf"(?:[0-9]+[{BLANKS}]+)?({NAME})[{BLANKS}]*\(", re.ASCII)
TEXT = r"'[^']*'|\"[^\"]*\""
OPENS = {"{": "}", "[": "]"}
DEEPEST = 8
# Of generate_network: those that change the network, and those that do not.
LIMITS = ("max_agg", "max_iter", "check_iso")
ASIDE = ("overwrite", "print_iter", "prefix", "suffix", "TextReaction", "TextSpecies", "verbose", "write", "continue")
SIMULATE = ("simulate", "simulate_ode", "simulate_ssa", "simulate_pla", "simulate_nf", "simulate_psa",
            "parameter_scan", "bifurcate")  # fmt: skip
HARMLESS = ("version", "codename", "setModelName", "visualize", "writeFile", "writeModel", "writeNetwork", "writeXML",
            "writeSBML", "writeSBMLMulti", "writeBNGL", "writeNET", "writeMfile", "writeMexfile", "writeLatex",
            "writeMDL", "writeSSC", "writeSSCcfg", "writeCPYfile", "writeCPPfile", "generate_hybrid_model")  # fmt: skip
CACHED = ("saveParameters", "resetParameters", "saveConcentrations", "resetConcentrations")
CHOICES = {
    "MoleculesObservables": ("CountUnique", "CountAll"),
    "SpeciesObservables": ("CountUnique", "CountAll"),
    "SpeciesLabel": ("Auto", "HNauty", "Quasi"),
}

Value = str | list["Value"] | dict[str, "Value"]


@dataclass
class Actions:
    """The actions of a file, as far as they are read.

    settings : those that change the model before its network is generated, written anew
    limits : of generate_network, written anew
    has_others : whether there are some that are not carried out
    concentrations : the line that says that amounts are concentrations
    """

    settings: list[str] = field(default_factory=list)
    limits: list[str] | None = None
    is_done: bool = False
    has_others: bool = False
    concentrations: BnglLine | None = None

    @property
    def ends(self) -> bool:
        """Whether the file says after how many rounds of the rules the network ends."""
        return any(limit.startswith("max_iter=") for limit in self.limits or [])

    def add(self, line: BnglLine) -> str:
        """Read a line; an option comes back written anew, since it acts where it stands."""
        call = CALL.match(line.text)
        if call is None:
            raise line.unreadable("a block, a parameter, an option or an action such as generate_network({})")
        name, line.place = call[1], call.end()
        values = _values(line, ")")
        line.take(rf"[{BLANKS}]*;")
        line.end()
        if name == "generate_network":
            self._generates(line, values)
        elif name == "setOption" and not self.is_done:
            return self._option(line, values)
        elif name == "substanceUnits":
            self._units(line, values)
        elif self.is_done or name in SIMULATE or name in HARMLESS:
            self.has_others = True
            self.is_done |= name in SIMULATE
        else:
            self.settings.append(_setting(line, name, values))
        return ""

    def _generates(self, line: BnglLine, values: list[Value]) -> None:
        given = values[0] if values else {}
        if len(values) > 1 or not isinstance(given, dict):
            raise line.wrong("generate_network takes one list of arguments, in braces")
        limits = []
        for name, value in given.items():
            if name in LIMITS:
                limits.append(f"{name}=>{_number(line, name, value)}")
            elif name == "max_stoich" and isinstance(value, dict):
                most = (f"'{_name(line, each)}'=>{_number(line, name, number)}" for each, number in value.items())
                limits.append(f"max_stoich=>{{{','.join(most)}}}")
            elif name not in ASIDE:
                raise line.wrong(f"the argument {name!r} of generate_network is not read")
        if self.limits is not None and sorted(limits) != sorted(self.limits):
            raise line.wrong("generate_network comes again with other limits; keep one")
        self.limits, self.is_done = limits, True

    def _option(self, line: BnglLine, values: list[Value]) -> str:
        if not values or len(values) % 2:
            raise line.wrong("setOption takes names and values")
        written = []
        for name, value in zip(values[::2], values[1::2], strict=True):
            if name == "NumberPerQuantityUnit":
                written += [f'"{name}"', _number(line, name, value)]
            elif isinstance(name, str) and value in CHOICES.get(name, ()):
                written += [f'"{name}"', f'"{value}"']
            elif name == "substanceUnits":
                self._units(line, [value])
            elif name != "energyBNG":
                raise line.wrong(f"the option {name!r} with the value {value!r} is not read")
        return f"setOption({','.join(written)})" if written else ""

    def _units(self, line: BnglLine, values: list[Value]) -> None:
        if not values or not isinstance(values[0], str):
            raise line.wrong("substanceUnits takes Number or Concentration")
        if not values[0].lower().startswith(("num", "item")):
            self.concentrations = line


def _setting(line: BnglLine, name: str, values: list[Value]) -> str:
    """An action that changes the model, written anew."""
    texts = [value for value in values if isinstance(value, str)]
    if name in CACHED and len(texts) == len(values) <= 1:
        return f"{name}({','.join(repr(_name(line, text)) for text in texts)})"
    if name not in ("setParameter", "setConcentration", "addConcentration", "setVolume") or len(texts) != 2:
        raise line.wrong(f"the action {name!r} before the network is generated is not read; take it out of the file")
    target, value = (BnglLine(line.path, line.number, text.strip(BLANKS)) for text in texts)
    named = target.need(NAME, "a name") if name in ("setParameter", "setVolume") else pattern(target)
    written = value.expression()
    target.end()
    value.end()
    return f"{name}('{named}','{written}')"


def _name(line: BnglLine, text: str) -> str:
    if not re.fullmatch(r"\w+", text, re.ASCII):
        raise line.wrong(f"{text!r} came; expected a name")
    return text


def _number(line: BnglLine, name: str, value: Value) -> str:
    if not isinstance(value, str) or not re.fullmatch(rf"[-+]?{NUMBER}", value):
        raise line.wrong(f"{name} is {value!r}; expected a number")
    return value


def _values(line: BnglLine, close: str, depth: int = 0) -> list[Value]:
    """Arguments up to a closing bracket: values with commas, or name => value."""
    found: list[Value] = []
    while not line.take(rf"[{BLANKS}]*\{close}"):
        line.take(f"[{BLANKS}]*")
        if depth > DEEPEST:
            raise line.wrong("brackets are nested too deeply")
        if quoted := line.take(TEXT):
            found.append(quoted[1:-1])
        elif opened := line.take(r"[{\[]"):
            inner = _values(line, OPENS[opened], depth + 1)
            found.append(inner if opened == "[" else _pairs(line, inner))
        else:
            found.append(line.need(r"[-+*/.\w]+", f"a number, a text, a list or {close!r}"))
        line.need(rf"[{BLANKS}]*(?:=>|,|(?=\{close}))", f"',' or {close!r}")
    return found


def _pairs(line: BnglLine, values: list[Value]) -> dict[str, Value]:
    names = values[::2]
    if len(values) % 2 or not all(isinstance(name, str) for name in names):
        raise line.wrong("a hash of Perl is {name=>value, ...}")
    return dict(zip(map(str, names), values[1::2], strict=True))
