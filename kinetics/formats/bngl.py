"""The format BNGL: rules for molecules with sites, whose network BioNetGen itself generates, by its program BNG2.pl.

The file is read here first, line by line, and what BioNetGen gets is written anew from what was read: one line for one
line, blocks and options alone, with actions off. The one action is ours, in a file of its own.
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

from kinetics.formats.base import Format
from kinetics.formats.bionetgen import model_in
from kinetics.formats.bnglactions import Actions
from kinetics.formats.bnglblocks import BLOCKS, parameter
from kinetics.formats.bngltext import BLANKS, BnglLine, lines_of
from kinetics.formats.outside import Program
from kinetics.network import Model
from kinetics.support.limits import text_in
from kinetics.support.packages import require

MAX_BYTES = 4 * 2**20
FOLDERS = {"linux": "bng-linux", "darwin": "bng-mac", "win32": "bng-win"}
SECONDS, MEMORY = 120, 2**31
LAST_ROUND = b"Iteration 100:"  # where BioNetGen cuts a network short that says nothing of max_iter
BORDER = re.compile(rf"(begin|end)[{BLANKS}]+(\w.*)", re.ASCII)
SINGLE = rf"(?i:parameter|param|par)[{BLANKS}]+"  # a parameter outside of its block
CLOSES = re.compile(rf"begin|end(?:[{BLANKS}]|$)")  # what BioNetGen takes for the border of a block


class Bngl(Format):
    """The reader of BNGL files."""

    name: ClassVar[str] = "bngl"
    suffixes: ClassVar[tuple[str, ...]] = (".bngl",)
    is_written: ClassVar[bool] = False

    def read(self, path: Path, copies_per_unit: float | None = None) -> Model:
        """The network that the rules generate, as `.net` files are read.

        Its options, the limits of generate_network and what is set before it hold; other actions are left to the user.
        Cost: BioNetGen's, which grows with the network: some .5 s for small ones, at most 120 s of processor time.
        """
        files, actions = bngl_files(path, text_in(path, MAX_BYTES))
        if actions.concentrations is not None and copies_per_unit is None:
            raise actions.concentrations.wrong(
                "substanceUnits says that amounts are concentrations; state the copies in one unit, as by "
                "--copies-per-unit 1e6 or read(path, copies_per_unit=1e6)"
            )
        generator = Program(
            "BioNetGen",
            (_perl(path), str(_program()), "generate.bngl"),
            SECONDS,
            MEMORY,
            "bound the network by max_agg, max_stoich or max_iter of its generate_network",
            None if actions.ends else LAST_ROUND,
        )
        network = generator.translated(path, files, "model.net")
        model = model_in(path.with_name(f"{path.name} (its network)"), network, copies_per_unit)
        note = "actions of the file are not carried out: say with options what is to be done"
        return replace(model, notes=(*model.notes, note)) if actions.has_others else model


def bngl_files(path: Path, text: str) -> tuple[dict[str, str], Actions]:
    """What BioNetGen gets, name -> text, and what the file's actions say.

    model.bngl has every line where it stands in the file, so that BioNetGen's messages tell its number; generate.bngl
    reads it with actions off.
    """
    written: dict[int, str] = {}
    actions = Actions()
    inside, has_begun, has_ended = "", False, False
    for line in lines_of(path, text):
        border = BORDER.fullmatch(line.text)
        name = " ".join(border[2].split()) if border else ""
        if border and name == "model":
            if inside or (has_begun or has_ended if border[1] == "begin" else has_ended):
                raise line.wrong(f"{line.text!r} stands where it cannot; a file has one model")
            has_begun, has_ended = True, border[1] == "end"
        elif border:
            expected = f"end {inside}" if inside else f"begin {name}"
            if f"{border[1]} {name}" != expected:
                raise line.wrong(f"{line.text!r}; expected {expected!r}")
            inside = "" if inside else name
            if name in ("actions", "protocol"):
                continue
            if name not in BLOCKS:
                raise line.wrong(f"unknown block {name!r}; expected one of {', '.join(BLOCKS)}")
            if has_ended or (inside and actions.is_done):
                raise line.wrong(f"the block {name!r} behind the end of the model, or behind an action that uses it")
            written[line.number] = expected
        elif said := _content(line, inside, actions):
            written[line.number] = said
    if inside:
        raise ValueError(f"{path}: block {inside!r} has no end")
    if not any(said.startswith("begin ") for said in written.values()):
        raise ValueError(f"{path} has no block of a model; expected 'begin reaction rules' and the like")
    model = "\n".join(written.get(number, "") for number in range(1, max(written) + 1))
    limits = "".join(f",{limit}" for limit in actions.limits or [])
    acts = ['readFile({file=>"model.bngl",skip_actions=>1})', *actions.settings]
    acts.append(f'generate_network({{overwrite=>1,prefix=>"model"{limits}}})')
    return {"model.bngl": f"{model}\n", "generate.bngl": "\n".join([*acts, ""])}, actions


def _content(line: BnglLine, inside: str, actions: Actions) -> str:
    """A line that is no border of a block, written anew."""
    if inside in BLOCKS:
        said = BLOCKS[inside](line)
        line.end()
    elif inside == "protocol":
        actions.has_others, said = True, ""
    elif not inside and line.take(SINGLE):
        said = f"parameter {parameter(line)}"
        line.end()
    else:
        said = actions.add(line)
    if CLOSES.match(said):
        raise line.wrong(f"{said!r} begins as a border of a block does")
    return said


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
