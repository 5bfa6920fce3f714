"""The model of a scan: what each scanned name stands for, and the model at one point."""

from __future__ import annotations

import difflib
import hashlib
import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kinetics.formats import NetworkModel
from kinetics.network import Network
from kinetics.network.checks import some_names
from kinetics.predicting.scanning.values import checked_values
from kinetics.support.arrays import Floats, integers
from kinetics.support.tables import of_unit

CUBES = "cubes"
PARAMETER, SPECIES, CHANNEL = "parameter", "species", "channel"


@dataclass(frozen=True, eq=False)
class ScannedModel:
    """A network with rates and counts at time 0, some of which a scan changes.

    model : the network, its counts and its observables
    cube : species that `cubes` counts; "" where there is none

    >>> from kinetics import Network
    >>> from kinetics.predicting.scanning import ScannedModel
    >>> model = ScannedModel.of(Network.from_text("decay: A -> B, k", k=1), {"A": 3})
    >>> model.kind("k"), model.kind("A")
    ('parameter', 'species')
    """

    model: NetworkModel
    cube: str = ""

    @classmethod
    def of(cls, model: Network | NetworkModel | str | Path, initial: Mapping[str, int] | None = None) -> ScannedModel:
        """The model of a network, a network file, or the name of one.

        initial : counts at time 0 that go before those of the model
        """
        if isinstance(model, str | Path):
            from kinetics.formats import read

            model = read(model)
        if isinstance(model, Network):
            model = NetworkModel(model, model.state(model.initial))
        if not isinstance(model, NetworkModel):
            raise TypeError(f"model is of {type(model).__name__}; expected a Network, a NetworkModel or a network file")
        if initial is not None:
            counts = dict(zip(model.network.species, model.initial.tolist(), strict=True)) | dict(initial)
            model = replace(model, initial=model.network.state(counts))
        return cls(model, _single_cube(model.network))

    def kind(self, name: str) -> str:
        """What a name stands for: a parameter, a species or a channel; a ValueError where it is none, or two."""
        network = self.model.network
        kinds: dict[str, Collection[str]] = {
            PARAMETER: network.parameters,
            SPECIES: network.species_places,
            CHANNEL: network.channel_places,
        }
        found = [kind for kind, names in kinds.items() if name in names]
        if name == CUBES and not found and self.cube:
            return SPECIES
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
        fixed = {*network.laws, *network.given.rates}
        known = [each for names in kinds.values() for each in names if names is not kinds[CHANNEL] or each not in fixed]
        known += [CUBES] * bool(self.cube)
        near = difflib.get_close_matches(name, known, n=3, cutoff=0.4)
        hint = f"did you mean {' or '.join(near)}?" if near else f"there are {some_names(known)}"
        raise ValueError(f"{name!r} is no parameter, species or channel of the model; {hint}")

    def checked(self, name: str, values: object) -> Floats:
        """The values (n,) of a name, as its kind allows."""
        found, kind = checked_values(name, values), self.kind(name)  # type: ignore[arg-type]
        if kind == SPECIES:
            integers(f"counts of {name!r}", found, (None,), minimum=1 if name == CUBES else 0)
        elif kind == CHANNEL and found.min() < 0:
            raise ValueError(f"rate constants of {name!r} hold {found.min():g}; expected at least 0")
        return found

    def label(self, name: str) -> str:
        """A title for an axis of a name's values."""
        kind = self.kind(name)
        if kind == CHANNEL:
            unit = self.model.network.time_unit
            return of_unit(f"rate constant of {name}", f"1/{unit}" if unit else "")
        return f"{name} at time 0" if kind == SPECIES and name != CUBES else name

    def at(self, point: Mapping[str, float]) -> NetworkModel:
        """The model at one point of the scan."""
        kinds = {name: self.kind(name) for name in point}
        chosen = {name: value for name, value in point.items() if kinds[name] == PARAMETER}
        model = self.model.with_parameters(**chosen) if chosen else self.model
        network = model.network
        constants = {name: value for name, value in point.items() if kinds[name] == CHANNEL}
        if constants:
            rates = np.array(network.known_rates)
            for name, value in constants.items():
                rates[network.channel_places[name]] = value
            network = network.with_rates(rates)
        counts = np.array(model.initial)
        for name, value in point.items():
            if kinds[name] == SPECIES:
                is_cube = name == CUBES and name not in network.species_places
                counts[network.index(self.cube if is_cube else name)] = value
        return replace(model, network=network, initial=counts, notes=self.model.notes)


def digest_of(model: NetworkModel) -> str:
    """SHA-256 of all that decides what a model does."""
    network = model.network
    content = [
        network.fingerprint,
        network.known_rates.tolist(),
        network.ways.tolist(),
        network.combinations,
        model.initial.tolist(),
        {name: dict(weights) for name, weights in sorted(model.observables.items())},
    ]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _single_cube(network: Network) -> str:
    """The one species of a single cube, in a network that conserves cubes."""
    if CUBES not in network.conserved:
        return ""
    singles = np.flatnonzero(np.asarray(network.conserved[CUBES]) == 1.0)
    return network.species[int(singles[0])] if singles.size == 1 else ""
