"""What a network file holds: reactions with their rates, counts at time 0, and sums of counts worth watching."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Protocol

from kinetics.arrays import Ints
from kinetics.network import Network

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True, eq=False)
class Model:
    """A network ready to run.

    network : with its rate constants
    initial : (S,) counts at time 0
    observables : name -> weight of each species that counts in the sum
    notes : what the file says that the network does not
    """

    network: Network
    initial: Ints
    observables: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        _ = self.network.known_rates
        object.__setattr__(self, "initial", self.network.state(self.initial))
        species = set(self.network.species)
        for name, weights in self.observables.items():
            unknown = [each for each in weights if each not in species]
            if unknown:
                raise ValueError(f"observable {name!r} counts {unknown[0]!r}, which is not a species of the network")


class Format(Protocol):
    """A kind of network file. `suffixes` are what its names end in, in small letters."""

    name: ClassVar[str]
    suffixes: ClassVar[tuple[str, ...]]

    def read(self, path: Path) -> Model:
        """The file's model; a ValueError that names file and line where it cannot be had."""

    def text(self, model: Model) -> str:
        """What a file of this kind holds for a model; a ValueError where it cannot say all of it."""
