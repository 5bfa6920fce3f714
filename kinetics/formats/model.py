"""The contents of a network file: reactions with their rates, counts at time 0, and observables."""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from kinetics.network import Network
from kinetics.support.arrays import Ints

if TYPE_CHECKING:
    from pathlib import Path

CLOSE = 1e-9  # an amount this near, relatively, to a whole number is meant to be it


@dataclass(frozen=True, eq=False)
class NetworkModel:
    """The contents of a network file: a network with its rates, its initial counts and its observables.

    network : the network, with its rate constants
    initial : (S,) counts at time 0
    observables : name -> weight of each species in the sum
    notes : remarks on contents of the file that the network does not hold
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


def whole_counts(path: Path, amounts: Mapping[str, float]) -> Ints:
    """Copies (S,) of amounts by species; a fraction of a copy is rounded, with a warning, what is no count refused."""
    for name, amount in amounts.items():
        if not 0 <= amount < 2.0**63:  # nan, too
            raise ValueError(f"{path}: {amount:g} copies of {name!r}; expected a count from 0 to 2**63 - 1")
    counts = {name: round(amount) for name, amount in amounts.items()}
    off = [name for name, amount in amounts.items() if abs(amount - counts[name]) > CLOSE * max(1.0, amount)]
    if off:
        more = f" and {len(off) - 1} more" if len(off) > 1 else ""
        warnings.warn(f"{path}: copies are whole; rounded {amounts[off[0]]:g} of {off[0]}{more}", stacklevel=2)
    return np.array(list(counts.values()), dtype=np.int64)


class Format(ABC):
    """A format of network files.

    name : name of the format in tests and messages, in lower case
    suffixes : suffixes of its files, in lower case, with the dot
    """

    name: ClassVar[str]
    suffixes: ClassVar[tuple[str, ...]]

    @abstractmethod
    def read(self, path: Path) -> NetworkModel:
        """The file's model; a ValueError that names the file, and the line if there is one, where it is damaged."""

    @abstractmethod
    def text(self, model: NetworkModel) -> str:
        """The text of a file for a model; a ValueError where the format cannot hold all of it."""
