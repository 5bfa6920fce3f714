"""The base of all formats of network files."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

from kinetics.network import Model
from kinetics.support.limits import check_names, check_visible

if TYPE_CHECKING:
    from pathlib import Path

CLOSE = 1e-9  # an amount this near, relatively, to a whole number is meant to be it


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
    def read(self, path: Path, copies_per_unit: float | None = None) -> Model:
        """The file's model; a ValueError that names the file, and the line if there is one, if it is damaged.

        copies_per_unit : how many copies one unit of the file's amounts is; None if it is one, and fractions of a
            copy are a mistake
        """

    def model(self, path: Path, copies_per_unit: float | None = None) -> Model:
        """`read`, and ValueError if a name holds characters that cannot be seen."""
        model = self.read(path, copies_per_unit)
        network = model.network
        names = (*network.species, *network.channels, *network.given.given, *model.observables, *model.formulas)
        check_names(path, names)
        check_visible(f"{path} has a time unit", network.time_unit)
        return model

    def text(self, model: Model) -> str:
        """The text of a file for a model; ValueError if the format cannot hold all of it."""
        sizes = f"{len(model.network.species)} species and {len(model.network.channels)} channels"
        raise ValueError(f"files of the format {self.name!r} are read, not written; write the {sizes} in another one")
