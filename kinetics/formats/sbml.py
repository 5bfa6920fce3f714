"""The format SBML, Levels 2 and 3, read by libsbml as a stochastic model: amounts are copies.

Kinetic laws that are mass action become plain rate constants, for the quick methods; all others are kept as written.
Hucka et al. (2019).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from kinetics.formats.massaction import linear_weights, rate_constant
from kinetics.formats.model import Format, NetworkModel, whole_counts
from kinetics.formats.sbmlfile import document_of
from kinetics.formats.sbmlmath import is_sum, text_of
from kinetics.formats.sbmlwriting import sbml_text
from kinetics.network import Network
from kinetics.network.laws.events import Event
from kinetics.network.laws.expression import Expression, quoted
from kinetics.network.reactions import Reaction

MOST_COPIES = 10**6  # in one place of a reaction


@dataclass(frozen=True)
class Sbml(Format):
    """The reader and writer of SBML files."""

    name: ClassVar[str] = "sbml"
    suffixes: ClassVar[tuple[str, ...]] = (".xml", ".sbml")

    def read(self, path: Path) -> NetworkModel:
        """The file's network with `distinct` combinations, its counts, and what its rules add up."""
        document = document_of(path)  # its model lives as long as it does
        return _SbmlReader(path, document.getModel()).model()

    def text(self, model: NetworkModel) -> str:
        """The model in Level 3 Version 1, amounts in copies."""
        return sbml_text(model)


@dataclass
class _SbmlReader:
    """One file while it is read.

    meanings : id -> what stands for it in formulas, in our own grammar
    states : ids of the species that a state counts
    size : id of a species -> what turns its amount into its value in formulas: 1, or the volume it is in
    """

    path: Path
    source: Any
    meanings: dict[str, str] = field(default_factory=dict)
    states: list[str] = field(default_factory=list)
    size: dict[str, float] = field(default_factory=dict)

    def model(self) -> NetworkModel:
        """The model as a network of ours."""
        self._check_scope()
        rules = {rule.getVariable(): rule for rule in self._each("Rules")}
        for place in self._each("Compartments"):
            if place.getId() not in rules:
                self.meanings[place.getId()] = repr(self._volume(place))
        initial = self._species(rules)
        for parameter in self._each("Parameters"):
            if parameter.getId() not in rules and parameter.isSetValue():
                self.meanings[parameter.getId()] = _number_text(parameter.getValue())
        sums = self._rules(rules)
        reactions, laws = self._reactions()
        network = Network.from_reactions(reactions, laws, self.states, events=self._events())
        observables = {name: self._weights(rule, rule.getMath(), network.species) for name, rule in sums.items()}
        notes = [f"{name} is no sum of counts and is not shown" for name, each in observables.items() if each is None]
        linear = {
            name: {species: weight * self.size.get(name, 1.0) for species, weight in weights.items()}
            for name, weights in observables.items()
            if weights is not None
        }
        return NetworkModel(network, whole_counts(self.path, initial), linear, tuple(notes))

    def _each(self, plural: str) -> list[Any]:
        """All members of one of the model's lists."""
        listed = getattr(self.source, f"getListOf{plural}")()
        return [listed.get(i) for i in range(listed.size())]

    def _check_scope(self) -> None:
        """Refuse what has no counterpart: it would be left out in silence."""
        for rule in self._each("Rules"):
            if not rule.isAssignment():
                kind = "a rate rule" if rule.isRate() else "an algebraic rule"
                raise self._wrong(rule, f"{kind}: counts change by reactions and events only")
        for event in self._each("Events"):
            if event.isSetDelay():
                raise self._wrong(event, f"event {event.getId()!r} has a delay, which is not read")
        for reaction in self._each("Reactions"):
            if reaction.isSetFast() and reaction.getFast():
                raise self._wrong(reaction, f"reaction {reaction.getId()!r} is `fast`, which has no stochastic meaning")
        for constraint in self._each("Constraints"):
            raise self._wrong(constraint, "a constraint: runs are not stopped by conditions")
        if self.source.isSetConversionFactor():
            raise self._wrong(self.source, "a conversion factor: amounts are copies here")

    def _volume(self, compartment: Any) -> float:
        """Size of a compartment; 1 where the file gives none."""
        return compartment.getSize() if compartment.isSetSize() else 1.0

    def _species(self, rules: dict[str, Any]) -> dict[str, float]:
        """Copies at time 0 of the species that a state counts."""
        initial = {}
        volumes = {place.getId(): self._volume(place) for place in self._each("Compartments")}
        for species in self._each("Species"):
            name = species.getId()
            if species.isSetConversionFactor():
                raise self._wrong(species, f"species {name!r} has a conversion factor: amounts are copies here")
            by_amount = species.getHasOnlySubstanceUnits()
            self.size[name] = 1.0 if by_amount else volumes.get(species.getCompartment(), 1.0)
            if not self.size[name] > 0:
                raise self._wrong(species, f"species {name!r} is a concentration in a volume of {self.size[name]:g}")
            if name in rules:
                continue
            if species.isSetInitialAmount():
                copies = species.getInitialAmount()
            elif species.isSetInitialConcentration():
                copies = species.getInitialConcentration() * volumes.get(species.getCompartment(), 1.0)
            else:
                raise self._wrong(species, f"species {name!r} has no initial amount")
            self.states.append(name)
            initial[name] = copies
            shown = quoted(name)
            self.meanings[name] = shown if self.size[name] == 1 else f"({shown} / {self.size[name]!r})"
        return initial

    def _rules(self, rules: dict[str, Any]) -> dict[str, Any]:
        """The rules in an order in which each uses only those before it; what they give is put into the meanings."""
        waiting = dict(rules)
        ordered = {}
        while waiting:
            ready = [name for name, rule in waiting.items() if not _names(rule.getMath()) & set(waiting)]
            if not ready:
                raise self._wrong(next(iter(waiting.values())), f"rules go round in a circle: {', '.join(waiting)}")
            for name in ready:
                rule = waiting.pop(name)
                self.meanings[name] = f"({self._text(rule, rule.getMath())})"
                ordered[name] = rule
        return ordered

    def _weights(self, rule: Any, math: Any, species: tuple[str, ...]) -> dict[str, float] | None:
        """Weights of a sum of counts, term by term, however long it is; None for any other formula."""
        total: dict[str, float] = {}
        waiting = [math]
        while waiting:
            term = waiting.pop()
            if is_sum(term):
                waiting += [term.getChild(i) for i in reversed(range(term.getNumChildren()))]
                continue
            part = linear_weights(self._expression(rule, self._text(rule, term)), species)
            if part is None:
                return None
            for name, weight in part.items():
                total[name] = total.get(name, 0.0) + weight
        return total

    def _reactions(self) -> tuple[dict[str, Reaction], list[float | Expression]]:
        """Reactants and products of each reaction, and its rate constant or rate law."""
        held = {s.getId() for s in self._each("Species") if s.getBoundaryCondition() or s.getConstant()}
        reactions: dict[str, Reaction] = {}
        laws: list[float | Expression] = []
        for reaction in self._each("Reactions"):
            before, after = (
                self._side(reaction, getattr(reaction, f"getListOf{side}")()) for side in ("Reactants", "Products")
            )
            law = self._law(reaction)
            # What is held is neither taken nor made.
            taken = {name: copies for name, copies in before.items() if name not in held}
            made = {name: copies for name, copies in after.items() if name not in held}
            for name in (taken | made).keys() - set(self.states):
                raise self._wrong(reaction, f"reaction {reaction.getId()!r} changes {name!r}, which a rule gives")
            lost = {name: max(0, copies - made.get(name, 0)) for name, copies in taken.items()}
            found = rate_constant(law, lost)
            if found is None:
                laws.append(law)
            else:
                k, needed = found
                laws.append(k)
                net = {name: made.get(name, 0) - taken.get(name, 0) for name in needed | taken | made}
                taken = needed
                made = {name: needed.get(name, 0) + gain for name, gain in net.items()}
            reactions[reaction.getId()] = (taken, made)
        return reactions, laws

    def _side(self, reaction: Any, references: Any) -> dict[str, int]:
        """Copies of each species on one side of a reaction."""
        copies: dict[str, int] = {}
        for i in range(references.size()):
            reference = references.get(i)
            n = reference.getStoichiometry()
            if reference.isSetStoichiometryMath() or not 0 <= n <= MOST_COPIES or n != int(n):
                raise self._wrong(
                    reference,
                    f"reaction {reaction.getId()!r} has {n:g} of {reference.getSpecies()!r}; expected whole copies, "
                    f"at most {MOST_COPIES}, and no formula",
                )
            copies[reference.getSpecies()] = copies.get(reference.getSpecies(), 0) + int(n)
        return copies

    def _law(self, reaction: Any) -> Expression:
        law = reaction.getKineticLaw()
        if law is None or law.getMath() is None:
            raise self._wrong(reaction, f"reaction {reaction.getId()!r} has no kinetic law")
        own = {}
        for i in range(law.getNumParameters()):  # those of Level 3, too
            parameter = law.getParameter(i)
            own[parameter.getId()] = _number_text(parameter.getValue())
        return self._expression(law, self._text(law, law.getMath(), own))

    def _events(self) -> list[Event]:
        """Events without delay, on time and counts."""
        sources = self._each("Events")
        return [self._event(event, place, len(sources) == 1) for place, event in enumerate(sources, 1)]

    def _event(self, event: Any, place: int, is_alone: bool) -> Event:
        name, trigger = event.getId() or f"event {place}", event.getTrigger()
        if trigger.isSetPersistent() and not trigger.getPersistent() and not is_alone:
            raise self._wrong(event, f"event {name!r} is not persistent, which is read of a lone event only")
        rank = "0" if event.getPriority() is None else self._text(event, event.getPriority().getMath())
        try:
            priority = float(rank.strip("()"))
        except ValueError:
            raise self._wrong(event, f"event {name!r} has a priority that is no number") from None
        assign: dict[str, str | float | Expression] = {}
        for i in range(event.getNumEventAssignments()):
            change = event.getEventAssignment(i)
            species = change.getVariable()
            if species not in self.states:
                raise self._wrong(change, f"event {name!r} sets {species!r}; only counts of species can be set")
            text, size = self._text(change, change.getMath()), self.size[species]
            assign[species] = self._expression(change, text if size == 1 else f"({text}) * {size!r}")
        return Event(
            name,
            self._expression(trigger, self._text(trigger, trigger.getMath())),
            assign,
            priority=priority,
            was_true=not trigger.isSetInitialValue() or trigger.getInitialValue(),
            from_trigger=event.getUseValuesFromTriggerTime(),
        )

    def _text(self, element: Any, math: Any, own: dict[str, str] | None = None) -> str:
        try:
            return text_of(math, self.meanings | own if own else self.meanings)
        except (ValueError, RecursionError) as error:
            raise self._wrong(element, str(error)) from None

    def _expression(self, element: Any, text: str) -> Expression:
        try:
            return Expression(text)
        except ValueError as error:
            raise self._wrong(element, str(error)) from None

    def _wrong(self, element: Any, fault: str) -> ValueError:
        return ValueError(f"{self.path}, line {element.getLine()}: {fault}")


def _number_text(value: float) -> str:
    return repr(value) if value >= 0 else f"({value!r})"


def _names(node: Any) -> set[str]:
    """All ids in a formula."""
    found, waiting = set(), [node]
    while waiting:  # a sum of thousands of terms is thousands deep, too deep for recursion
        node = waiting.pop()
        if node.isName():
            found.add(node.getName())
        waiting += [node.getChild(i) for i in range(node.getNumChildren())]
    return found
