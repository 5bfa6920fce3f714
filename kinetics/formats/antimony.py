"""The format Antimony, .ant: read as the SBML that Antimony's own library makes of it. Smith et al. (2009),
doi:10.1093/bioinformatics/btp401.

The library is C++ and trusts its input, so it runs in a process of its own, with limits.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import ClassVar

from kinetics.formats.model import Format, NetworkModel
from kinetics.formats.outside import Program
from kinetics.formats.sbml import model_in
from kinetics.support.extras import require
from kinetics.support.limits import text_in

MAX_BYTES = 4 * 2**20
IMPORT = re.compile(r'\bimport\s*"')
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

    def read(self, path: Path, copies_per_unit: float | None = None) -> NetworkModel:
        """The file's main model, the one marked by * or the last; as for SBML, amounts are copies.

        Cost: a process of some .3 s.
        """
        text = text_in(path, MAX_BYTES)
        if IMPORT.search(text):
            raise ValueError(f"{path} imports another file, which is not read; put both into one")
        require("antimony")
        library = Program(
            "Antimony", (sys.executable, "-P", "-c", LIBRARY), 20, 2**30, "a smaller model, or SBML, can be read"
        )
        document = library.translated(path, text, "model.ant", "model.xml").encode()
        return model_in(path.with_name(f"{path.name} (as SBML)"), document, copies_per_unit)
