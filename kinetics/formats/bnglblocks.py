"""The lines of a BNGL file's blocks: each is read by the grammar of its block, and written anew from what was read.

What BioNetGen leaves out of the network that it writes is refused by name: TotalRate, counters, counts of matches.
"""

from __future__ import annotations

from collections.abc import Callable

from kinetics.formats.bngltext import BLANKS, NAME, WORD, BnglLine

GAP = f"[{BLANKS}]*"
TAGS = rf"(?:[%@]{WORD})*"
SITE = rf"{NAME}(?:[~%!@](?:{WORD}|\+|\?))*"
MOLECULE = rf"{NAME}{TAGS}(?:\((?:{SITE}(?:,{SITE})*)?\){TAGS})?"
TYPE = rf"{NAME}(?:{GAP}\((?:{NAME}(?:[~!@]{WORD})*(?:,{NAME}(?:[~!@]{WORD})*)*)?\))?"
TAGGED = rf"(?:%{WORD}(?:@{WORD})?|@{WORD})::?"  # of a pattern: its label, its compartment
ATTRIBUTE = r"(?:MatchOnce|Fixed)(?:=\w+)?"
MATCHES = r"(?:==|<=|>=|[=<>])\d+"
NOTHING = rf"0(?=$|[{BLANKS}+,]|<?->)"


def label(line: BnglLine, is_kept: bool = False) -> str:
    """A label or number at the start of a line; only rules keep it."""
    if found := line.take(rf"{NAME}{GAP}:(?!:){GAP}" if is_kept else rf"{NAME}{GAP}:[{BLANKS}]+"):
        kept = f"{found.rstrip(BLANKS + ':')}: "
    else:
        kept = line.take(rf"[0-9]+[{BLANKS}]+(?=[^{BLANKS}])(?!\+|<?->)")
    return kept if is_kept else ""


def pattern(line: BnglLine, counted: bool = False) -> str:
    """A pattern of molecules, or 0 for none. counted : whether `==2` and the like may follow it"""
    if line.take(NOTHING):
        return "0"
    found = [line.take(TAGGED)]
    line.take(GAP)
    found += [line.take(r"\$"), line.take(rf"\{{{ATTRIBUTE}(?:,{ATTRIBUTE})*\}}"), line.take(r"\$")]
    found.append(line.need(rf"{MOLECULE}(?:\.{MOLECULE})*", "a pattern such as A(b!1,s~u).B(a!1)"))
    if matches := line.take(MATCHES):
        if not counted:
            raise line.wrong(f"{matches!r}: BioNetGen counts matches for observables of kind Species alone")
        found.append(matches)
    return "".join(found)


def parameter(line: BnglLine) -> str:
    """A parameter and its value."""
    label(line)
    name = line.need(NAME, "the name of a parameter")
    line.take(rf"{GAP}=")
    return f"{name} {line.expression()}"


def _compartment(line: BnglLine) -> str:
    label(line)
    parts = [line.need(NAME, "the name of a compartment")]
    line.take(GAP)
    parts.append(line.need(r"\d+", "its dimensions, 2 or 3"))
    parts.append(line.expression())
    line.take(GAP)
    return " ".join([*parts, line.take(NAME)])


def _molecule_type(line: BnglLine) -> str:
    label(line)
    found = line.need(TYPE, "a molecule type such as A(b,s~u~p)")
    return found + (" population" if line.take(rf"{GAP}(?i:population)") else "")


def _species(line: BnglLine) -> str:
    """A pattern and an expression: also of an energy pattern, and behind the arrow of a population map."""
    label(line)
    found = pattern(line)
    if not line.blank():
        raise line.unreadable("a blank behind the pattern")
    return f"{found} {line.expression()}"


def _observable(line: BnglLine) -> str:
    label(line)
    kind = line.need(NAME, "Molecules or Species")
    if kind not in ("Molecules", "Species"):
        raise line.wrong(f"the observable of kind {kind!r}; expected Molecules or Species, which networks have")
    line.take(GAP)
    name = line.need(rf"{NAME}(?=[{BLANKS}])", "the name of an observable, and a blank")
    found = []
    while not line.at_end:
        line.take(rf"{GAP},?{GAP}")
        found.append(pattern(line, counted=kind == "Species"))
    return f"{kind} {name} {','.join(found)}"


def _function(line: BnglLine) -> str:
    label(line)
    name = line.need(NAME, "the name of a function")
    arguments = line.take(rf"{GAP}\({GAP}(?:{NAME}{GAP}(?:,{GAP}{NAME}{GAP})*)?\)").strip(BLANKS + "()")
    line.take(rf"{GAP}=")
    return f"{name}({','.join(each.strip(BLANKS) for each in arguments.split(','))}) = {line.expression()}"


def _rule(line: BnglLine) -> str:
    before = label(line, is_kept=True)
    left = _side(line)
    arrow = line.need("<?->", "'+', '->' or '<->'")
    line.take(GAP)
    right = _side(line)
    if not line.blank():
        raise line.unreadable("a blank before the rate")
    rates = [line.expression()]
    if line.take(rf"{GAP},"):
        rates.append(line.expression())
    words = []
    while line.blank() and not line.at_end:
        words.append(_modifier(line))
    return " ".join([f"{before}{left} {arrow} {right} {', '.join(rates)}", *words])


def _side(line: BnglLine) -> str:
    """Patterns with + between them. Blanks behind them are read where they end the left side."""
    found = [pattern(line)]
    while line.take(rf"{GAP}\+{GAP}"):
        found.append(pattern(line))
    line.take(rf"{GAP}(?=<?->)")
    return " + ".join(found)


def _modifier(line: BnglLine) -> str:
    """A word behind the rates of a rule."""
    line.refuse_names()
    if line.take(rf"priority{GAP}={GAP}"):
        return f"priority={line.need(r'-?[0-9]+', 'a whole number')}"
    if word := line.take(rf"(?:DeleteMolecules|MoveConnected)(?=$|[{BLANKS}])"):
        return word
    if word := line.take(r"(?:in|ex)clude_(?:reactants|products)\([0-9]+"):
        patterns = []
        while line.take(","):
            patterns.append(pattern(line))
        line.need(r"\)", "')'")
        return f"{word},{','.join(patterns)})"
    raise line.unreadable("a modifier of rules, or the end of the line")


def _population_map(line: BnglLine) -> str:
    before = label(line, is_kept=True)
    left = _side(line)
    line.need("->", "'->'")
    line.take(GAP)
    return f"{before}{left} -> {_species(line)}"


BLOCKS: dict[str, Callable[[BnglLine], str]] = {
    "parameters": parameter,
    "compartments": _compartment,
    "molecule types": _molecule_type,
    "seed species": _species,
    "species": _species,
    "observables": _observable,
    "functions": _function,
    "energy patterns": _species,
    "population maps": _population_map,
    "reaction rules": _rule,
}
