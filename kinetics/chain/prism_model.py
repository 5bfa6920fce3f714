"""A network as a model of PRISM: the text of a `.sm` or `.prism` file, which Storm reads as well.

https://www.prismmodelchecker.org/manual/ThePRISMLanguage. Each species is a variable up to the most copies that were
found, each channel a command, and each species and observable a reward.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping, Sequence
from math import factorial

import numpy as np

from kinetics.network import Network
from kinetics.network.laws.expression import Expression, name_of
from kinetics.support.arrays import Ints

# Words of the language, which no variable may have for a name.
LANGUAGE = """
A bool clock const ctmc C double dtmc E endinit endinvariant endmodule endobservables endrewards endsystem false formula
filter func F global G init invariant I int label max mdp min module X nondeterministic observable observables of Pmax
Pmin P pomdp popta probabilistic prob pta rate rewards Rmax Rmin R S smg stochastic system true U W mod pow floor ceil
round log ma
"""
TAKEN = frozenset(LANGUAGE.split())
SIGNS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
COMPARED = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "=", ast.NotEq: "!="}
CALLED = ("min", "max", "floor", "ceil", "pow")  # alike in both languages


def prism_names(names: Sequence[str]) -> dict[str, str]:
    """Each name as one that PRISM takes, all different: what is no letter or digit becomes _."""
    found: dict[str, str] = {}
    used: set[str] = set()
    for name in names:
        plain = re.sub(r"\W", "_", name, flags=re.ASCII)
        plain = f"n_{plain}" if plain in TAKEN or not re.match(r"[A-Za-z_]", plain) else plain
        while plain in used:
            plain += "_"
        used.add(plain)
        found[name] = plain
    return found


def prism_text(
    network: Network, initial: Ints, most: Ints, observables: Mapping[str, Mapping[str, float]] | None = None
) -> str:
    """The model of a network from counts (S,), with at most so many (S,) copies of each species.

    ValueError: rates depend on time, there are events, or a rate law uses a function that PRISM has not
    """
    network.check_homogeneous()
    names = prism_names(network.species)
    tops = np.maximum(most, initial).tolist()
    # a variable needs two values
    variables = [
        f"  {names[name]} : [0..{max(top, 1)}] init {count};"
        for name, top, count in zip(network.species, tops, initial.tolist(), strict=True)
    ]
    commands = [_command(network, channel, names) for channel in range(len(network.channels))]
    sums = {name: {name: 1.0} for name in network.species} | dict(observables or {})
    rewards = [
        f'rewards "{name}"\n  true : {" + ".join(f"{weight!r} * {names[each]}" for each, weight in terms.items())};\n'
        "endrewards"
        for name, terms in sums.items()
        if terms and '"' not in name
    ]
    module = ["ctmc", "", "module network", *variables, "", *filter(None, commands), "endmodule", ""]
    return "\n".join([*module, *rewards]) + "\n"


def _command(network: Network, channel: int, names: Mapping[str, str]) -> str:
    """A channel as a command; empty where it never fires or changes nothing."""
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
        reactants = []  # the law is 0 where they are missing
    factors = [repr(rate), repr(float(network.ways[channel]))]
    factors += [_value(law.tree, law, names)] if law else [_ways(*each, network.combinations) for each in reactants]
    guard = " & ".join(f"{name} >= {taken}" for name, taken in reactants) or "true"
    updates = " & ".join(
        f"({species[place]}' = {species[place]} {'+' if gain > 0 else '-'} {abs(gain)})"
        for place, gain in zip(changed, gains, strict=True)
    )
    return f"  // {title}\n  [] {guard} -> {' * '.join(factors)} : {updates};"


def _ways(name: str, taken: int, combinations: str) -> str:
    """The combinations of so many copies of a species."""
    if combinations == "product":
        return " * ".join([name] * taken)
    ordered = " * ".join([name, *(f"({name} - {i})" for i in range(1, taken))])
    return ordered if combinations == "ordered" or taken == 1 else f"({ordered}) / {factorial(taken)}.0"


def _value(node: ast.expr, law: Expression, names: Mapping[str, str]) -> str:
    """A part of a rate law as a number in PRISM's language."""

    def value(inner: ast.expr) -> str:
        return _value(inner, law, names)

    name = name_of(node)
    if name is not None:
        return repr(law.parameters[name]) if name in law.parameters else names[name]
    if isinstance(node, ast.Constant):
        return repr(float(node.value))  # type: ignore[arg-type]
    if isinstance(node, ast.Name):
        return repr(float(np.pi))
    if isinstance(node, ast.BinOp) and type(node.op) in SIGNS:
        return f"({value(node.left)} {SIGNS[type(node.op)]} {value(node.right)})"
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
        return f"pow({value(node.left)}, {value(node.right)})"
    if isinstance(node, ast.UnaryOp) and not isinstance(node.op, ast.Not):
        return f"({'-' if isinstance(node.op, ast.USub) else ''}{value(node.operand)})"
    if isinstance(node, ast.Compare | ast.BoolOp | ast.UnaryOp):
        return f"({_truth(node, law, names)} ? 1 : 0)"
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        given = node.args
        if node.func.id in CALLED:
            return f"{node.func.id}({', '.join(map(value, given))})"
        if node.func.id == "sqrt":
            return f"pow({value(given[0])}, 0.5)"
        if node.func.id == "piecewise":
            otherwise = value(given[-1])
            for k in range(len(given) - 3, -1, -2):
                otherwise = f"({_truth(given[k + 1], law, names)} ? {value(given[k])} : {otherwise})"
            return otherwise
    raise ValueError(f"the rate law {law.text!r} uses {ast.unparse(node)}, which PRISM's language cannot say")


def _truth(node: ast.expr, law: Expression, names: Mapping[str, str]) -> str:
    """A part of a rate law as true or false."""
    if isinstance(node, ast.BoolOp):
        sign = " & " if isinstance(node.op, ast.And) else " | "
        return "(" + sign.join(_truth(each, law, names) for each in node.values) + ")"
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        return f"!{_truth(node.operand, law, names)}"
    if isinstance(node, ast.Compare):
        sides = [_value(each, law, names) for each in (node.left, *node.comparators)]
        pairs = zip(sides[:-1], node.ops, sides[1:], strict=True)
        return "(" + " & ".join(f"{left} {COMPARED[type(op)]} {right}" for left, op, right in pairs) + ")"
    return f"({_value(node, law, names)} != 0)"
