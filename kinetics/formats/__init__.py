"""Formats of network files: readers and writers for other programs.

To add one, write its class in a file of its own, after `Format` in `kinetics.formats.base`, and import it here.
Commands, messages and the contract in tests/contracts/test_formats.py read the tuple.
"""

# ruff: noqa: F401, I001 - the imports are the list, in this order

from __future__ import annotations

from pathlib import Path

from kinetics.network import Model
from kinetics.formats.base import Format
from kinetics.formats.proving import check_written
from kinetics.support.families import members
from kinetics.support.output import write_whole

from kinetics.formats.bionetgen import BioNetGen
from kinetics.formats.sbml import Sbml
from kinetics.formats.rxn import ReactionLines
from kinetics.formats.antimony import Antimony
from kinetics.formats.bngl import Bngl

__all__ = ["FORMATS", "SUFFIXES", "WRITTEN", "Format", "read", "write"]

FORMATS: tuple[Format, ...] = tuple(kind() for kind in members(globals(), Format))
SUFFIXES = tuple(suffix for kind in FORMATS for suffix in kind.suffixes)
WRITTEN = tuple(suffix for kind in FORMATS if kind.is_written for suffix in kind.suffixes)


def read(path: str | Path, copies_per_unit: float | None = None) -> Model:
    """Read the model in a network file, whose suffix gives the format.

    copies_per_unit : how many copies one unit of the file's amounts is; None if it is one. The rate equations stay
        what they are, and the noise is that of so many copies.
    ValueError: there is no such file, its suffix is not known, or it is damaged

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from kinetics.formats import read
    >>> with TemporaryDirectory() as folder:
    ...     _ = Path(folder, "binding.rxn").write_text("A + B -> AB, 0.1")
    ...     print(read(f"{folder}/binding.rxn").network.species)
    ('A', 'B', 'AB')
    """
    file = Path(path)
    kind = _kind_of(file, SUFFIXES)
    if not file.exists():
        raise ValueError(f"network file {path} does not exist")
    return kind.model(file, copies_per_unit)


def write(model: Model, path: str | Path) -> None:
    """Write a network file, whose suffix gives the format, whole or not at all.

    Before it takes its name it is read back and compared with the model, at the cost of reading it (see `proving`).
    ValueError: the suffix is not known, the format cannot hold all of the model, or the file would say something else

    >>> from tempfile import TemporaryDirectory
    >>> from kinetics import Model, Network
    >>> from kinetics.formats import read, write
    >>> model = Model(Network.from_text("A + B -> AB, 0.1"), {"A": 5, "B": 4})
    >>> with TemporaryDirectory() as folder:
    ...     write(model, f"{folder}/binding.net")
    ...     print(read(f"{folder}/binding.net").initial.tolist())
    [5, 4, 0]
    """
    kind = _kind_of(Path(path), WRITTEN)
    text = kind.text(model)
    check_written(kind, model, text, Path(path))
    write_whole(path, text)


def _kind_of(file: Path, suffixes: tuple[str, ...]) -> Format:
    suffix = file.suffix.lower()
    if suffix not in suffixes:
        raise ValueError(f"{file} is not a network file of a known format; its name must end in {', '.join(suffixes)}")
    return next(kind for kind in FORMATS if suffix in kind.suffixes)
