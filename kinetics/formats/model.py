"""The contents of a network file: reactions with their rates, counts at time 0, and observables."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

from kinetics.network import Network
from kinetics.network.laws.expression import Expression
from kinetics.support.arrays import Ints
from kinetics.support.limits import check_names, check_visible

if TYPE_CHECKING:
    from pathlib import Path

USED = ("species", "channels", "laws", "events", "known_rates", "combinations")  # of a network, by those that take one
CLOSE = 1e-9  # an amount this near, relatively, to a whole number is meant to be it


@dataclass(frozen=True, eq=False)
class NetworkModel:
    """The contents of a network file: a network with its rates, its initial counts and its observables.

    network : the network, with its rate constants
    initial : (S,) counts at time 0
    observables : name -> weight of each species in the sum
    notes : remarks on how the file was read, and on contents that the network does not hold
    formulas : name in the file -> what it stands for, as text: a formula over the species' amounts in the file's units

    >>> from kinetics import Network
    >>> from kinetics.formats import NetworkModel
    >>> binding = Network.from_text("A + B -> AB, 0.1")
    >>> model = NetworkModel(binding, {"A": 5, "B": 4}, observables={"all A": {"A": 1, "AB": 1}})
    >>> model.initial.tolist()
    [5, 4, 0]
    """

    network: Network
    initial: Ints
    observables: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    formulas: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _ = self.network.known_rates
        object.__setattr__(self, "initial", self.network.state(self.initial))
        species = set(self.network.species)
        for name, weights in self.observables.items():
            unknown = [each for each in weights if each not in species]
            if unknown:
                raise ValueError(f"observable {name!r} counts {unknown[0]!r}, which is not a species of the network")

    if not TYPE_CHECKING:  # a type checker sees the mistake without this

        def __getattr__(self, name: str) -> None:
            """An AttributeError that points at the network, for which a model is easily taken."""
            hint = "; its network has: give model.network" if hasattr(Network, name) or name in USED else ""
            raise AttributeError(f"a NetworkModel, as a file is read, has no {name!r}{hint}")

    def with_parameters(self, /, **values: float) -> NetworkModel:
        """The same model with other values of these parameters; rates, laws and counts at time 0 follow."""
        network = self.network.with_parameters(**values)
        initial = self.initial.copy()
        for name, amount in network.given.initial.items():
            if isinstance(amount, Expression) and amount.parameters:
                initial[network.index(name)] = network.given.count(name)
        chosen = ", ".join(f"{name} = {value:g}" for name, value in values.items())
        return replace(self, network=network, initial=initial, notes=(*self.notes, f"chosen: {chosen}"))


class Format(ABC):
    """A format of network files.

    name : name of the format in tests and messages, in lower case
    suffixes : suffixes of its files, in lower case, with the dot
    is_written : whether models are written in it, and not only read

    >>> from kinetics.formats import FORMATS
    >>> {each.name: each.suffixes for each in FORMATS}["sbml"]
    ('.xml', '.sbml')
    """

    name: ClassVar[str]
    suffixes: ClassVar[tuple[str, ...]]
    is_written: ClassVar[bool] = True

    @abstractmethod
    def read(self, path: Path, copies_per_unit: float | None = None) -> NetworkModel:
        """The file's model; a ValueError that names the file, and the line if there is one, where it is damaged.

        copies_per_unit : how many copies one unit of the file's amounts is; None where it is one, and fractions of a
            copy are a mistake
        """

    def model(self, path: Path, copies_per_unit: float | None = None) -> NetworkModel:
        """`read`, and a ValueError where a name holds characters that cannot be seen."""
        model = self.read(path, copies_per_unit)
        network = model.network
        names = (*network.species, *network.channels, *network.given.given, *model.observables, *model.formulas)
        check_names(path, names)
        check_visible(f"{path} has a time unit", network.time_unit)
        return model

    def text(self, model: NetworkModel) -> str:
        """The text of a file for a model; a ValueError where the format cannot hold all of it."""
        sizes = f"{len(model.network.species)} species and {len(model.network.channels)} channels"
        raise ValueError(f"files of the format {self.name!r} are read, not written; write the {sizes} in another one")
