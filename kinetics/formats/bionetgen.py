"""The format of BioNetGen network files, .net: parameters, species, reactions and groups, in plain text.

A reaction's rate is a constant times a number of ways; like reactants are counted n (n - 1), so a reaction of two
copies of one species carries a factor of one half in the file. Faeder, Blinov & Hlavacek (2009).
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np

from kinetics.formats.base import Format
from kinetics.formats.blocks import Line, blocks_of
from kinetics.formats.formulas import node_in_file, number
from kinetics.formats.netlaws import KINDS, law_of
from kinetics.formats.netwriting import net_text
from kinetics.formats.scaling import is_count, model_of
from kinetics.network import Model, Network
from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import MOST_NODES, Code, Graph
from kinetics.network.laws.reading import NUMBER
from kinetics.network.parameters import Parameters
from kinetics.network.sparse_tables import SparseTable
from kinetics.support.arrays import Floats, Ints
from kinetics.support.limits import text_in

IDENTIFIER = re.compile(r"[A-Za-z_]\w*")
BARE = re.compile(r"\w+\(\)")
FIXED = re.compile(r"(@\w+:{1,2})?\$")  # a species whose count no reaction changes
FACTOR = re.compile(rf"(?:({NUMBER})\*)?([A-Za-z_]\w*)(?:\(\))?")


@dataclass(frozen=True)
class BioNetGen(Format):
    """The reader and writer of BioNetGen's .net files."""

    name: ClassVar[str] = "net"
    suffixes: ClassVar[tuple[str, ...]] = (".net",)

    def read(self, path: Path, copies_per_unit: float | None = None) -> Model:
        """The file's network with `ordered` combinations, its counts and its groups."""
        return model_in(path, text_in(path), copies_per_unit)

    def text(self, model: Model) -> str:
        """The model as a .net file."""
        return net_text(model)


def model_in(path: Path, text: str, copies_per_unit: float | None) -> Model:
    """The model of a text; `path` is the user's file, for messages."""
    return _NetReader(path, blocks_of(path, text), Graph(MOST_NODES + len(text)), copies_per_unit).model()


@dataclass
class _NetReader:
    """One file while it is read."""

    path: Path
    blocks: dict[str, list[Line]]
    graph: Graph
    copies_per_unit: float | None = None
    parameters: dict[str, float] = field(default_factory=dict)
    species: list[str] = field(default_factory=list)
    fixed: list[bool] = field(default_factory=list)
    functions: dict[str, int] = field(default_factory=dict)  # name -> its node
    texts: dict[str, str] = field(default_factory=dict)  # parameter -> what the file says it is
    named: dict[str, int] = field(default_factory=dict)  # parameter -> its node
    numbers: dict[str, float] = field(default_factory=dict)  # species that nothing changes and that are no count
    keeps_names: bool = True

    def model(self) -> Model:
        self._read_parameters()
        initial = self._read_species()
        observables = self._observables()
        lines = self.blocks["reactions"]
        needs, makes = (self._sides(lines, word) for word in (1, 2))
        rows = np.concatenate([needs[0], makes[0]])
        columns = np.concatenate([needs[1], makes[1]])
        copies = np.repeat(np.array([-1, 1]), [needs[0].size, makes[0].size])
        free = ~np.array(self.fixed, dtype=bool)[columns]
        changes = SparseTable.of_entries((len(lines), len(self.species)), rows[free], columns[free], copies[free])
        self.numbers = self._numbers(initial, set(changes.columns[changes.copies != 0].tolist()))
        given = self._name_parameters()
        self._read_functions(observables)
        ways, rates = self._rates(lines)
        channels = self._channels(lines)
        is_counted = np.array([name not in self.numbers for name in self.species], dtype=bool)
        counted = [name for name in self.species if name not in self.numbers]
        moved = np.cumsum(is_counted) - 1  # place of a species -> its place among those that are counted
        shape = (len(lines), len(counted))
        kept = is_counted[needs[1]]
        needed = needs[0][kept], moved[needs[1][kept]]
        network = Network(
            tuple(counted),
            tuple(channels),
            SparseTable.of_entries(shape, *needed, np.ones(needed[0].size, dtype=np.int64)),
            SparseTable.of_entries(shape, changes.rows, moved[changes.columns], changes.copies),
            ways,
            rates,
            "ordered",
            laws=self._laws(lines, channels),
            given=replace(given, rates=self._formulas_of_rates(lines, channels), initial=self._formulas_of_counts()),
        )
        amounts = {name: initial[place] for place, name in enumerate(self.species) if name not in self.numbers}
        notes = [
            f"nothing changes {name}; its value, {n:g} in the file, is read as a number, not a count"
            for name, n in self.numbers.items()
        ]
        hidden = [name for name, weights in observables.items() if not self.numbers.keys().isdisjoint(weights)]
        notes += [f"{name} is not a sum of counts and is not shown" for name in hidden]
        shown = {name: weights for name, weights in observables.items() if name not in hidden}
        return model_of(self.path, network, amounts, self.copies_per_unit, shown, notes)

    def _numbers(self, initial: list[float], changed: set[int]) -> dict[str, float]:
        """Amounts of the species that no reaction changes, of those that no count can be."""
        held = [(name, initial[place]) for place, name in enumerate(self.species) if place not in changed]
        return {name: amount for name, amount in held if not is_count(amount * (self.copies_per_unit or 1.0))}

    def _read_parameters(self) -> None:
        for line in self.blocks.get("parameters", []):
            words = self._numbered(line, "a parameter is `name value`", 2)
            name, text = words[0], " ".join(words[1:]).removeprefix("=")
            if not IDENTIFIER.fullmatch(name) or name in self.parameters:
                fault = "comes twice" if name in self.parameters else "is not a name"
                raise self._wrong(line, f"parameter {name!r} {fault}")
            self.parameters[name] = self._value(line, text)
            self.texts[name] = text

    def _name_parameters(self) -> Parameters:
        """The parameters, which keep their names unless a species has the same, or weights of groups are formulas."""
        given: dict[str, float | Expression] = {}
        for name, text in self.texts.items():
            is_plain = re.fullmatch(NUMBER, text) is not None
            if not self.keeps_names:
                self.named[name] = self.graph.number(self.parameters[name])
                continue
            place = self.graph.number(self.parameters[name]) if is_plain else self._node(text)
            if name in self.places:
                self.named[name] = place
                continue
            formula = None if is_plain else self._expression(place)
            given[name] = formula if formula is not None and formula.parameters else self.parameters[name]
            self.named[name] = self.graph.name(name)
        return Parameters(given | {name: amount for name, amount in self.numbers.items() if self._is_stated(name)})

    def _is_stated(self, name: str) -> bool:
        """Whether the amount of a species is a plain number of the file, and its name no parameter's."""
        return name not in self.parameters and re.fullmatch(NUMBER, self._amount(name)) is not None

    def _amount(self, name: str) -> str:
        """What the file says that a species starts from."""
        return " ".join(self.blocks["species"][self.species.index(name)].words[2:])

    def _count(self, name: str) -> int:
        """The node of a species: its count, or the number that it is."""
        is_formula = name in self.numbers and not self._is_stated(name)
        return self._node(self._amount(name)) if is_formula else self.graph.name(name)

    def _node(self, text: str) -> int:
        """The node of a formula of parameters."""
        return self.named[text] if text in self.named else node_in_file(text, self.graph, self.named.get)

    def _expression(self, place: int) -> Expression:
        """A node with the values of the parameters that it reads."""
        formula = self.graph.formula(place)
        used = [str(node.value) for node in formula if node.code == Code.COUNT]
        values = {name: self.parameters[name] for name in used if name not in self.places}
        return Expression.of(formula, values | {name: self.numbers[name] for name in used if name in self.numbers})

    def _read_species(self) -> list[float]:
        """Amounts (S,) at time 0."""
        amounts: dict[str, float] = {}
        for line in self.blocks["species"]:
            words = self._numbered(line, "a species is `pattern count`", 2)
            marked = FIXED.match(words[0])
            name = words[0].replace("$", "", 1) if marked else words[0]
            if int(line.words[0]) != len(self.species) + 1:
                raise self._wrong(line, f"species number {line.words[0]} came; expected {len(self.species) + 1}")
            if name in amounts:
                raise self._wrong(line, f"species {name!r} comes twice")
            text = " ".join(words[1:])
            # A plain number keeps all its digits: a float has those up to 2**53 only.
            amounts[name] = int(text) if re.fullmatch("[0-9]{1,19}", text) else self._value(line, text)
            if not 0 <= amounts[name] < 2.0**63:
                raise self._wrong(line, f"{amounts[name]:g} copies of {name!r}; expected a count from 0 to 2**63 - 1")
            self.species.append(name)
            self.fixed.append(marked is not None)
        # `A()` is how the format writes a species without sites.
        bare = [name.removesuffix("()") if BARE.fullmatch(name) else name for name in self.species]
        if len(set(bare)) == len(bare):
            self.species = bare
        return list(amounts.values())

    def _sides(self, lines: list[Line], word: int) -> tuple[Ints, Ints]:
        """Row and column of every species on one side of the reactions."""
        try:
            texts = [line.words[word] for line in lines]
            numbers = np.array(",".join(texts).split(",") if texts else [], dtype=np.int64)
        except (ValueError, IndexError, OverflowError):
            raise self._wrong(self._first_broken(lines, word), self._reaction_form()) from None
        lengths = np.array([text.count(",") + 1 for text in texts], dtype=np.int64)
        rows = np.repeat(np.arange(lengths.size), lengths)
        beyond = np.flatnonzero((numbers < 0) | (numbers > len(self.species)))
        if beyond.size:
            line = lines[rows[beyond[0]]]
            raise self._wrong(line, f"species {numbers[beyond[0]]}; the file has 1 to {len(self.species)}")
        return rows[numbers > 0], numbers[numbers > 0] - 1  # 0 stands for nothing

    def _first_broken(self, lines: list[Line], word: int) -> Line:
        return next(
            line
            for line in lines
            if len(line.words) <= word or not re.fullmatch(r"[0-9]{1,18}(,[0-9]{1,18})*", line.words[word])
        )

    def _reaction_form(self) -> str:
        return "a reaction is `number reactants products rate`, as in `7 1,2 3 0.5*kon`, with 0 for nothing"

    def _read_functions(self, observables: dict[str, dict[str, float]]) -> None:
        """Functions, each of those before it."""
        groups: dict[str, int] = {}

        def meaning(name: str) -> int | None:
            if name in self.functions:
                return self.functions[name]
            if name in observables:
                groups[name] = groups[name] if name in groups else self._sum(observables[name])
                return groups[name]
            return self.named.get(name)

        for line in self.blocks.get("functions", []):
            words = self._numbered(line, "a function is `name() formula`", 2)
            name = words[0].removesuffix("()")
            if not IDENTIFIER.fullmatch(name) or name in self.functions:
                raise self._wrong(line, f"the function {words[0]!r} comes twice, or is no `name()`")
            try:
                self.functions[name] = node_in_file(" ".join(words[1:]).removeprefix("="), self.graph, meaning)
            except ValueError as error:
                raise self._wrong(line, str(error)) from None

    def _sum(self, weights: dict[str, float]) -> int:
        """A weighted sum of counts."""
        add, graph = self.graph.add, self.graph
        terms = [
            self._count(each) if weight == 1 else add(Code.MULTIPLY, (graph.number(weight), self._count(each)))
            for each, weight in weights.items()
        ]
        return graph.all_of(Code.ADD, terms or [graph.number(0.0)])

    def _rates(self, lines: list[Line]) -> tuple[Floats, Floats]:
        """Ways and rate constant of every reaction; 1 if a rate law takes the constant's place."""
        known: dict[str, tuple[float, float]] = {}
        found = []
        for line in lines:
            if len(line.words) < 4:
                raise self._wrong(line, self._reaction_form())
            text = line.words[3]
            if len(line.words) > 4 and not self._is_lawful(line):
                text = " ".join(line.words[3:])
            if text not in known:
                factored = FACTOR.fullmatch(text)
                ways, constant = (float(factored[1] or 1), factored[2]) if factored else (1.0, text)
                known[text] = ways, 1.0 if self._is_lawful(line) else self._value(line, constant)
                if known[text][1] < 0:
                    raise self._wrong(line, f"the rate {text!r} comes to {known[text][1]:g}; it must not be negative")
            ways, constant = known[text]
            held = [] if self._is_lawful(line) else self._held(line)
            found.append((ways, constant * math.prod(self.numbers[name] for name in held)))
        table = np.array(found, dtype=np.float64).reshape(-1, 2)
        return table[:, 0], table[:, 1]

    def _formulas_of_rates(self, lines: list[Line], channels: list[str]) -> dict[str, Expression]:
        """Channel -> rate constant, of those that are formulas of parameters."""
        found: dict[str, Expression] = {}
        made: dict[tuple[str, ...], Expression] = {}
        for line, channel in zip(lines, channels, strict=True):
            text, held = " ".join(line.words[3:]), self._held(line)
            if self._is_lawful(line) or (re.fullmatch(NUMBER, text) and not held):
                continue
            key = (text, *held)
            if key not in made:
                factored = FACTOR.fullmatch(text)
                constant = self._node(factored[2] if factored else text)
                amounts = [self._count(name) for name in held]
                made[key] = self._expression(self.graph.all_of(Code.MULTIPLY, [constant, *amounts]))
            if made[key].parameters:
                found[channel] = made[key]
        return found

    def _reactants(self, line: Line) -> list[str]:
        return [self.species[int(n) - 1] for n in line.words[1].split(",") if n != "0"]

    def _held(self, line: Line) -> list[str]:
        """The reactants that are numbers; of each at most one copy, since n (n - 1) is of counts."""
        held = [name for name in self._reactants(line) if name in self.numbers] if self.numbers else []
        if len(set(held)) < len(held):
            raise self._wrong(line, f"two of {held[0]!r}, which starts from {self.numbers[held[0]]:g}: no count")
        return held

    def _formulas_of_counts(self) -> dict[str, int | Expression]:
        """Species -> amount at time 0, of those that are formulas of parameters."""
        found: dict[str, int | Expression] = {}
        for name, line in zip(self.species, self.blocks["species"], strict=True):
            text = " ".join(line.words[2:])
            amount = None if name in self.numbers or re.fullmatch(NUMBER, text) else self._expression(self._node(text))
            if amount is not None and amount.parameters:
                found[name] = amount
        return found

    def _is_lawful(self, line: Line) -> bool:
        """Whether the rate is a function, or one of the format's named rate laws."""
        factored = FACTOR.fullmatch(line.words[3])
        return factored is not None and (factored[2] in self.functions or factored[2] in KINDS)

    def _laws(self, lines: list[Line], channels: list[str]) -> dict[str, Expression]:
        """Channel -> rate law, of the reactions that have one."""
        if not self.functions and not any(line.words[3].rpartition("*")[2] in KINDS for line in lines):
            return {}
        laws = {}
        for line, channel in zip(lines, channels, strict=True):
            if self._is_lawful(line):
                name = FACTOR.fullmatch(line.words[3])[2]  # type: ignore[index]  # it matched before
                self._held(line)
                reactants = self._reactants(line)
                if self.copies_per_unit is not None and len(set(reactants)) < len(reactants):
                    raise self._wrong(
                        line, "a function times like reactants, n (n - 1), has no scale of copies per unit"
                    )
                for word in line.words[4:]:
                    self._value(line, word)
                try:
                    values = [self._node(word) for word in line.words[4:]]
                    nodes = [self._count(name) for name in reactants]
                    laws[channel] = self._expression(law_of(self.graph, name, self.functions, values, nodes))
                except ValueError as error:
                    raise self._wrong(line, str(error)) from None
        return laws

    def _channels(self, lines: list[Line]) -> list[str]:
        """The reactions' own labels where these differ, else with their numbers."""
        labels = [line.comment.strip() for line in lines]
        if all(labels) and len(set(labels)) == len(labels):
            return labels
        return [f"{label or 'reaction'}.{place}" for place, label in enumerate(labels, 1)]

    def _observables(self) -> dict[str, dict[str, float]]:
        groups: dict[str, dict[str, float]] = {}
        for line in self.blocks.get("groups", []):
            words = self._numbered(line, "a group is `name 1,2*3`", 1)
            if not IDENTIFIER.fullmatch(words[0]) or words[0] in groups:
                raise self._wrong(line, f"the group {words[0]!r} comes twice, or is no name")
            weights: dict[str, float] = {}
            for part in ",".join(words[1:]).split(",") if words[1:] else []:
                weight, _, place = part.rpartition("*")
                if not place.isdecimal() or not 1 <= int(place) <= len(self.species):
                    raise self._wrong(line, f"{part!r} is not one of the species 1 to {len(self.species)}")
                name = self.species[int(place) - 1]
                self.keeps_names &= re.fullmatch(NUMBER, weight or "1") is not None
                weights[name] = weights.get(name, 0.0) + (self._value(line, weight) if weight else 1.0)
            groups[words[0]] = weights
        return groups

    def _numbered(self, line: Line, form: str, least: int) -> list[str]:
        """The words behind a line's number."""
        if len(line.words) <= least or not line.words[0].isdecimal():
            raise self._wrong(line, f"{' '.join(line.words)[:80]!r} came; {form}, behind its number")
        return list(line.words[1:])

    def _value(self, line: Line, text: str) -> float:
        try:
            return number(text, self.parameters)
        except ValueError as error:
            raise self._wrong(line, str(error)) from None

    @cached_property
    def places(self) -> frozenset[str]:
        """The species, once all are read."""
        return frozenset(self.species)

    def _wrong(self, line: Line, fault: str) -> ValueError:
        return ValueError(f"{self.path}, line {line.number}: {fault}")
