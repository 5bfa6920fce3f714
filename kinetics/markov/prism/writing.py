"""A network as a model of PRISM: the text of a `.sm` or `.prism` file, which Storm reads as well.

https://www.prismmodelchecker.org/manual/ThePRISMLanguage. Each species is a variable up to the most copies that were
found, each channel a command, and each species and observable a reward.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from math import factorial

import numpy as np

from kinetics.markov.prism.tokens import TAKEN
from kinetics.network import Model, Network
from kinetics.network.checks import spelled_apart
from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import TRUTHS, Code
from kinetics.network.laws.reading import LONGEST, shortened
from kinetics.network.network import check_homogeneous
from kinetics.support.arrays import Ints

WORD = re.compile(r"(?<![\w.])[A-Za-z_]\w*", re.ASCII)
VARIABLE = re.compile(r"  (.*) : \[0\.\.\d+\] init \d+;")
FRAME = ("", "ctmc", "module network", "endmodule", "endrewards")
SIGNS = {Code.ADD: "+", Code.SUBTRACT: "-", Code.MULTIPLY: "*", Code.DIVIDE: "/"}
COMPARED = {Code.LESS: "<", Code.LESS_EQUAL: "<=", Code.EQUAL: "=", Code.NOT_EQUAL: "!="}
JOINED = {Code.AND: "&", Code.OR: "|"}
CALLED = {
    Code.MINIMUM: "min",
    Code.MAXIMUM: "max",
    Code.FLOOR: "floor",
    Code.CEILING: "ceil",
    Code.POWER: "pow",
}


def prism_names(names: Sequence[str], taken: Collection[str] = ()) -> dict[str, str]:
    """Each name as one that PRISM takes, all different and none `taken`: what is no letter or digit becomes _."""

    def plain(name: str) -> str:
        word = re.sub(r"\W", "_", name, flags=re.ASCII)
        return f"n_{word}" if word in TAKEN or not re.match(r"[A-Za-z_]", word) else word

    return dict(zip(names, spelled_apart(names, plain, taken), strict=True))


def prism_text(model: Model, most: Ints) -> str:
    """A model in the language of PRISM, with at most so many (S,) copies of each species.

    ValueError: rates depend on time, there are events, or a rate law uses a function that PRISM has not

    >>> import numpy as np
    >>> from kinetics import Model, Network
    >>> from kinetics.markov import prism_text
    >>> text = prism_text(Model(Network.from_text("make: A -> B, 2"), {"A": 5}), np.array([5, 5]))
    >>> [line.strip() for line in text.splitlines() if "->" in line]
    ["[] n_A >= 1 -> 2.0 * 1.0 * n_A : (n_A' = n_A - 1) & (B' = B + 1);"]
    """
    network, initial = model.network, model.initial
    check_homogeneous(network)
    names = prism_names(network.species)
    tops = np.maximum(most, initial).tolist()
    # a variable needs two values
    variables = [
        f"  {names[name]} : [0..{max(top, 1)}] init {count};"
        for name, top, count in zip(network.species, tops, initial.tolist(), strict=True)
    ]
    commands = [_command(network, channel, names) for channel in range(len(network.channels))]
    sums = {name: {name: 1.0} for name in network.species} | dict(model.observables)
    spelled = prism_names(list(sums))
    rewards = [
        f'rewards "{spelled[name]}"\n  true : '
        f"{' + '.join(f'{weight!r} * {names[each]}' for each, weight in terms.items()) or '0'};\nendrewards"
        for name, terms in sums.items()
    ]
    module = ["ctmc", "", "module network", *variables, "", *filter(None, commands), "endmodule", ""]
    text = "\n".join([*module, *rewards]) + "\n"
    _check_identifiers(text)
    return text


def _check_identifiers(text: str) -> None:
    """A ValueError if the lines of a model hold other names than those they declare, or none that PRISM takes."""
    lines = [line for line in text.splitlines() if not line.startswith("  //")]
    declared = [found[1] for line in lines if (found := VARIABLE.fullmatch(line))]
    rewarded = [found[1] for line in lines if (found := re.fullmatch(r'rewards "(.*)"', line))]
    known = {*declared, *CALLED.values(), "true"}
    used = [word for line in lines if line.startswith(("  []", "  true")) for word in WORD.findall(line)]
    others = [
        line for line in lines if not line.startswith("  ") and line not in FRAME and not line.startswith("rewards")
    ]
    wrong = [name for name in (*declared, *rewarded) if not WORD.fullmatch(name) or name in TAKEN]
    doubled = [name for names in (declared, rewarded) for name, count in Counter(names).items() if count > 1]
    unknown = [word for word in used if word not in known]
    for name in (*wrong, *doubled, *unknown, *others):
        raise ValueError(f"the model would hold {name[:80]!r}, which PRISM would misread; rename what is written so")


def _command(network: Network, channel: int, names: Mapping[str, str]) -> str:
    """A channel as a command; empty if it never fires or changes nothing."""
    species = [names[name] for name in network.species]
    rate = float(network.known_rates[channel] * 1.0)
    changed, gains = (part.tolist() for part in network.sparse_stoichiometry.row(channel))
    if rate * network.ways[channel] == 0.0 or not changed:
        return ""
    places, needed = (part.tolist() for part in network.sparse_reactants.row(channel))
    reactants = [(species[place], taken) for place, taken in zip(places, needed, strict=True)]
    title = network.channels[channel]
    law = network.laws.get(title)
    if law is not None and network.at_zero != "block":
        reactants = []  # the law is 0 if they are missing
    factors = [repr(rate), repr(float(network.ways[channel]))]
    factors += [_value(law, names)] if law else [_ways(*each, network.combinations) for each in reactants]
    guard = " & ".join(f"{name} >= {taken}" for name, taken in reactants) or "true"
    updates = " & ".join(
        f"({species[place]}' = {species[place]} {'+' if gain > 0 else '-'} {abs(gain)})"
        for place, gain in zip(changed, gains, strict=True)
    )
    return f"  // {' '.join(title.split())}\n  [] {guard} -> {' * '.join(factors)} : {updates};"


def _ways(name: str, taken: int, combinations: str) -> str:
    """The combinations of so many copies of a species."""
    if combinations == "product":
        return " * ".join([name] * taken)
    ordered = " * ".join([name, *(f"({name} - {i})" for i in range(1, taken))])
    return ordered if combinations == "ordered" or taken == 1 else f"({ordered}) / {factorial(taken)}.0"


def _value(law: Expression, names: Mapping[str, str]) -> str:
    """A rate law as a number in PRISM's language; a ValueError if it cannot be said, or only at great length."""
    found: list[tuple[str, str]] = []  # each node as a number, and as true or false
    for code, parts, value in law.formula:
        inner = [found[part] for part in parts]
        number, truth = _spelled(code, value, inner, law, names)
        if code in TRUTHS:
            number = f"({truth} ? 1 : 0)"
        found.append((number, truth or f"({number} != 0)"))
        if len(number) > LONGEST:
            raise ValueError(f"the rate law {shortened(law.text)!r} has over {LONGEST} characters in PRISM's language")
    return found[-1][0]


def _spelled(
    code: Code, value: float | str, inner: list[tuple[str, str]], law: Expression, names: Mapping[str, str]
) -> tuple[str, str]:
    """A node as a number, or as true or false."""
    numbers, truths = [number for number, _ in inner], [truth for _, truth in inner]
    if code == Code.CONSTANT:
        return repr(float(value)), ""
    if code == Code.COUNT:
        name = str(value)
        return repr(law.parameters[name]) if name in law.parameters else names[name], ""
    if code in SIGNS:
        return f"({numbers[0]} {SIGNS[code]} {numbers[1]})", ""
    if code in COMPARED:
        return "", f"({numbers[0]} {COMPARED[code]} {numbers[1]})"
    if code in JOINED:
        return "", f"({truths[0]} {JOINED[code]} {truths[1]})"
    if code in CALLED:
        return f"{CALLED[code]}({', '.join(numbers)})", ""
    match code:
        case Code.NOT:
            return "", f"!{truths[0]}"
        case Code.NEGATE:
            return f"(-{numbers[0]})", ""
        case Code.SQRT:
            return f"pow({numbers[0]}, 0.5)", ""
        case Code.SELECT:
            return f"({truths[1]} ? {numbers[0]} : {numbers[2]})", ""
    raise ValueError(
        f"the rate law {shortened(law.text)!r} uses {code.name.lower()}, which PRISM's language cannot say"
    )
