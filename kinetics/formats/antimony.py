"""The format Antimony, .ant: read as the SBML that Antimony's own library makes of it. Smith et al. (2009),
doi:10.1093/bioinformatics/btp401.

The library is C++ and trusts its input, so it runs in a process of its own, with limits, and gets the text written anew
from its pieces, which open no file.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import ClassVar

from kinetics.formats.base import Format
from kinetics.formats.outside import Program
from kinetics.formats.sbml import model_in
from kinetics.network import Model
from kinetics.support.limits import text_in
from kinetics.support.packages import require

MAX_BYTES = 4 * 2**20
# Pieces as the library's lexer has them: `-o` is one, whatever follows it, and numbers end where words may begin.
TOKEN = re.compile(
    r"""(?P<blank>[ \t]+|\\[ \n]+|//[^\n]*|\#[^\n]*|/\*.*?\*/)
    |(?P<newline>\n)
    |(?P<text>"[^"\n]*(?<!\\)"|```[^`]*```)
    |(?P<word>[A-Za-z_][A-Za-z0-9_]*)
    |(?P<sign>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|--+|-o|/(?!\*)|[!$-.:-@\[\]^{-~])""",
    re.VERBOSE | re.DOTALL,
)
# Species without an amount start from 0, as Tellurium has it: in SBML they would have none.
LIBRARY = """
import antimony, libsbml, sys
if antimony.loadAntimonyString(open("model.ant", encoding="utf-8").read()) < 0:
    sys.exit(antimony.getLastError())
document = libsbml.readSBMLFromString(antimony.getSBMLString(antimony.getMainModuleName()))
model = document.getModel()
for species in model.getListOfSpecies():
    name = species.getId()
    is_set = species.isSetInitialAmount() or species.isSetInitialConcentration()
    if not (is_set or model.getInitialAssignmentBySymbol(name) or model.getAssignmentRuleByVariable(name)):
        species.setInitialAmount(0)
libsbml.writeSBMLToFile(document, "model.xml")
"""


class Antimony(Format):
    """The reader of Antimony files. They are not written: write SBML, which Antimony reads."""

    name: ClassVar[str] = "antimony"
    suffixes: ClassVar[tuple[str, ...]] = (".ant", ".antimony")
    is_written: ClassVar[bool] = False

    def read(self, path: Path, copies_per_unit: float | None = None) -> Model:
        """The file's main model, the one marked by * or the last; as for SBML, amounts are copies.

        Cost: a process of some .3 s.
        """
        text = plain_text(path, text_in(path, MAX_BYTES))
        require("antimony")
        library = Program(
            "Antimony", (sys.executable, "-P", "-c", LIBRARY), 20, 2**30, "a smaller model, or SBML, can be read"
        )
        document = library.translated(path, {"model.ant": text}, "model.xml").encode()
        return model_in(path.with_name(f"{path.name} (as SBML)"), document, copies_per_unit)


def plain_text(path: Path, text: str) -> str:
    """The text written anew from its pieces: without comments, and with every line in one."""
    written: list[str] = []
    place, line, owed, before, may_import = 0, 1, 0, "", False
    text = text.replace("\r\n", "\n").replace("\r", "\n")  # all of them end lines
    if odd := re.search(r"[\0-\x08\x0b-\x1f\x7f]", text):
        raise ValueError(f"{path}: the control character {odd[0]!r} at place {odd.start()}, which no model needs")
    while place < len(text):
        found = TOKEN.match(text, place)
        if found is None:
            came = text[place : place + 9]
            raise ValueError(f"{path}, line {line}: {came!r} is not valid Antimony, or is never closed")
        kind, piece, place = found.lastgroup, found[0], found.end()
        line += piece.count("\n")
        if kind == "blank":
            owed += piece.count("\n")
            written.append(" ")
            continue
        if piece == "import" or (may_import and kind == "text"):
            raise ValueError(f"{path}, line {line}: imports another file, which is not read; merge them into one file")
        may_import = piece.lower() == "import" or (may_import and kind == "newline")
        written.append(piece)
        if kind == "newline" and before != ",":  # behind a comma, the library's grammar has room for one
            written.append("\n" * owed)
            owed = 0
        before = piece if kind != "newline" else before
    return "".join(written)
