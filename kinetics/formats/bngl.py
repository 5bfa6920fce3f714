"""The format BNGL: rules for molecules with sites, whose network BioNetGen itself generates, by its program BNG2.pl.

Only the blocks that say what the model is are handed to it: actions may read and write files, and are not carried out.
Faeder, Blinov & Hlavacek (2009), doi:10.1007/978-1-59745-525-1_5.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

from kinetics.formats.bionetgen import model_in
from kinetics.formats.model import Format, NetworkModel
from kinetics.formats.outside import Program
from kinetics.support.extras import require
from kinetics.support.limits import text_in

MAX_BYTES = 4 * 2**20
BLOCKS = ("parameters", "compartments", "molecule types", "seed species", "species", "observables", "functions",
          "energy patterns", "population maps", "reaction rules")  # fmt: skip
LINE = re.compile(r"\s*(begin|end)\s+(\w+(?:\s+\w+)*)\s*(?:#.*)?")
FROM_A_FILE = re.compile(r"\btfun\b", re.IGNORECASE)
FOLDERS = {"linux": "bng-linux", "darwin": "bng-mac", "win32": "bng-win"}
SECONDS, MEMORY = 120, 2**31


class Bngl(Format):
    """The reader of BNGL files."""

    name: ClassVar[str] = "bngl"
    suffixes: ClassVar[tuple[str, ...]] = (".bngl",)
    is_written: ClassVar[bool] = False

    def read(self, path: Path, copies_per_unit: float | None = None) -> NetworkModel:
        """The network that the rules generate, as `.net` files are read.

        Cost: BioNetGen's, which grows with the network: some .5 s for small ones, at most 120 s of processor time.
        """
        blocks, has_actions = model_blocks(path, text_in(path, MAX_BYTES))
        generator = Program(
            "BioNetGen",
            (_perl(path), str(_program()), "model.bngl"),
            SECONDS,
            MEMORY,
            "generate the network yourself and read its .net file",
        )
        text = "\n".join(("begin model", *blocks, "end model", "generate_network({overwrite=>1})", ""))
        network = generator.translated(path, text, "model.bngl", "model.net")
        model = model_in(path.with_name(f"{path.name} (its network)"), network, copies_per_unit)
        note = "actions of the file are not carried out: say with options what is to be done"
        return replace(model, notes=(*model.notes, note)) if has_actions else model


def model_blocks(path: Path, text: str) -> tuple[list[str], bool]:
    """The lines of the blocks that say what the model is, and whether there are actions beside them."""
    kept: list[str] = []
    inside, has_actions = "", False
    for number, line in enumerate(text.splitlines(), 1):
        border = LINE.fullmatch(line)
        name = " ".join(border[2].split()) if border else ""
        if name == "model":
            continue
        if border:
            expected = f"end {inside}" if inside else f"begin {name}"
            if f"{border[1]} {name}" != expected:
                raise ValueError(f"{path}, line {number}: {line.strip()!r}; expected {expected!r}")
            if name not in (*BLOCKS, "actions"):
                raise ValueError(f"{path}, line {number}: unknown block {name!r}; expected one of {', '.join(BLOCKS)}")
            inside = "" if inside else name
        content = line.partition("#")[0].strip()
        if (border or inside) and "actions" not in (name, inside):
            if FROM_A_FILE.search(content):
                raise ValueError(f"{path}, line {number}: a function from a file (tfun), which is not read")
            kept.append(line)
        else:
            has_actions |= bool(content)
    if inside:
        raise ValueError(f"{path}: block {inside!r} has no end")
    if not kept:
        raise ValueError(f"{path} has no block of a model; expected 'begin reaction rules' and the like")
    return kept, has_actions


def _program() -> Path:
    """BNG2.pl: in the folder that BNGPATH names, as BioNetGen's users have it, or of the package bionetgen."""
    if stated := os.environ.get("BNGPATH"):
        program = Path(stated).resolve() / "BNG2.pl"
        if not program.is_file():
            raise ValueError(f"BNGPATH is {stated}, where there is no BNG2.pl; expected the folder of BioNetGen")
        return program
    return Path(require("bionetgen")).resolve().parent / FOLDERS.get(sys.platform, "bng-linux") / "BNG2.pl"


def _perl(path: Path) -> str:
    found = shutil.which("perl")
    if found is None:
        raise ValueError(f"{path}: BioNetGen is a Perl program, and there is no perl here; install it, or read .net")
    return found
