"""`Model`: a network, its counts at time 0, and its observables."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from kinetics.network.checks import nearest, some_names
from kinetics.network.laws.on_demand import is_formula
from kinetics.network.network import Network
from kinetics.network.tank import Tank
from kinetics.support.arrays import Counts, Ints
from kinetics.support.frozen import set_fields

PARAMETER, SPECIES, CHANNEL, CONSERVED = "parameter", "species", "channel", "conserved quantity"


@dataclass(frozen=True, eq=False)
class Model:
    """A network with its counts at time 0 and its observables: what `read` returns and every question is put to.

    network : the network; its unit of time is that of the model
    initial : counts (S,) at time 0, or by name; by default those that the network states, and 0 of all else
    observables : name -> weight of each species in the sum
    notes : remarks on how a file was read, and on contents that the network does not hold
    tank : where it happens; None for the tank in which its rates were measured, or if it has none
    formulas : name in a file -> what it stands for, as text: a formula over the species' amounts in the file's units
    ValueError: an unknown species, or a count that is no whole number of at least 0

    >>> from kinetics import Model, Network
    >>> binding = Network.from_text("A + B -> AB, 0.1")
    >>> model = Model(binding, {"A": 5, "B": 4}, observables={"all A": {"A": 1, "AB": 1}})
    >>> model.initial.tolist()
    [5, 4, 0]
    """

    network: Network
    initial: Ints = None  # type: ignore[assignment]
    observables: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    formulas: Mapping[str, str] = field(default_factory=dict)
    tank: Tank | None = None

    def __post_init__(self) -> None:
        counts: Counts = self.network.initial if self.initial is None else self.initial
        set_fields(self, initial=self.network.state(counts))
        for name, weights in self.observables.items():
            unknown = [each for each in weights if each not in self.network.species_places]
            if unknown:
                raise ValueError(f"observable {name!r} counts {unknown[0]!r}, which is not a species of the network")

    @classmethod
    def of(cls, model: Model | Network, initial: Counts | None = None) -> Model:
        """The model that a caller gives: a `Model`, or a `Network` with the counts that it states.

        initial : counts (S,) at time 0 in place of the model's, or by name, and the others stay; None for the
            model's
        TypeError: neither a model nor a network

        >>> from kinetics import Model, Network
        >>> Model.of(Network.from_text("A -> B, 1"), {"A": 3}).initial.tolist()
        [3, 0]
        """
        if not isinstance(model, Model | Network):
            raise TypeError(
                f"model is of {type(model).__name__}; expected a Network or a Model, as kinetics.formats.read gives it"
            )
        given = cls(model) if isinstance(model, Network) else model
        return given if initial is None else given.with_counts(initial)

    def with_counts(self, counts: Counts) -> Model:
        """The model with other counts at time 0: all of them (S,), or those of the species that are named."""
        given: Any = counts
        if isinstance(counts, Mapping):
            given = self.initial.tolist()
            for name, number in counts.items():
                given[self.network.index(name)] = number
        return replace(self, initial=given)

    def with_parameters(self, /, **values: float) -> Model:
        """The model with other values of these parameters; rates, laws and counts at time 0 follow."""
        network = self.network.with_parameters(**values)
        given = network.given
        follow = {
            name: given.count(name) for name, each in given.initial.items() if is_formula(each) and each.parameters
        }
        chosen = ", ".join(f"{name} = {value:g}" for name, value in values.items())
        changed = self.with_counts(follow)
        return replace(changed, network=network, notes=(*self.notes, f"chosen: {chosen}"))

    def at(self, point: Mapping[str, float]) -> Model:
        """A copy with other values for these names, see `kind`.

        >>> from kinetics import Model, Network
        >>> model = Model.of(Network.from_text("decay: A -> B, k", k=1), {"A": 3}).at({"k": 2.0, "B": 7})
        >>> model.network.rate_constants.tolist(), model.initial.tolist()
        ([2.0], [3, 7])
        """
        kinds = {name: self.kind(name) for name in point}
        chosen = {name: value for name, value in point.items() if kinds[name] == PARAMETER}
        model = self.with_parameters(**chosen) if chosen else self
        network = model.network
        constants = {name: value for name, value in point.items() if kinds[name] == CHANNEL}
        if constants:
            rates = np.array(network.known_rates)
            for name, value in constants.items():
                rates[network.channel_places[name]] = value
            network = network.with_rates(rates)
        counts: Any = {
            _single(network, name) if kinds[name] == CONSERVED else name: int(value) if value == int(value) else value
            for name, value in point.items()
            if kinds[name] in (SPECIES, CONSERVED)
        }
        return replace(model.with_counts(counts), network=network, notes=self.notes)

    def kind(self, name: str) -> str:
        """What a name stands for: a parameter, a species' count at time 0, or a channel's rate constant.

        A conserved quantity stands for the count of the first species that holds one of it: `cubes` for single cubes.
        ValueError: the name is none of them, or two; or the channel's rate is a formula

        >>> from kinetics import Model, Network
        >>> model = Model(Network.from_text("decay: A -> B, k", k=1))
        >>> model.kind("k"), model.kind("A")
        ('parameter', 'species')
        """
        network = self.network
        kinds: dict[str, Collection[str]] = {
            PARAMETER: network.parameters,
            SPECIES: network.species_places,
            CHANNEL: network.channel_places,
        }
        found = [kind for kind, names in kinds.items() if name in names]
        if not found and _single(network, name):
            return CONSERVED
        if len(found) > 1:
            raise ValueError(f"{name!r} is a {' and a '.join(found)}; rename one of them")
        if found:
            formula = network.laws.get(name) or network.given.rates.get(name) if found[0] == CHANNEL else None
            if formula is not None:
                what = "propensity" if name in network.laws else "rate constant"
                names = some_names([each for each in formula.parameters if each in network.parameters])
                cure = f"scan what it reads: {names}" if names else "write it with a parameter, and scan that"
                raise ValueError(f"the {what} of channel {name!r} is {formula.text}; {cure}")
            return found[0]
        known = [*network.parameters, *network.species]
        known += [each for each in network.channels if each not in network.laws and each not in network.given.rates]
        known += [each for each in network.conserved if _single(network, each)]
        raise ValueError(f"{name!r} is no parameter, species or channel of the model; {nearest(name, known)}")

    def counted(self, name: str) -> Mapping[str, float]:
        """The weights (S,) of the species, or else the observable, with this name."""
        if name in self.network.species_places:
            return {name: 1.0}
        if name not in self.observables:
            known = [*self.network.species, *self.observables]
            raise ValueError(f"{name!r} is neither a species nor an observable; {nearest(name, known)}")
        return self.observables[name]

    @property
    def digest(self) -> str:
        """SHA-256 of all that decides what the model does."""
        network = self.network
        content = [
            network.fingerprint,
            network.known_rates.tolist(),
            network.ways.tolist(),
            network.combinations,
            self.initial.tolist(),
            {name: dict(weights) for name, weights in sorted(self.observables.items())},
        ]
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _single(network: Network, quantity: str) -> str:
    """The first species that holds one of a conserved quantity; "" if there is none."""
    holds = np.flatnonzero(np.asarray(network.conserved.get(quantity, ())) == 1.0)
    return network.species[int(holds[0])] if holds.size else ""
