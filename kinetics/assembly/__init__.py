"""Self-assembly of cubes: faces, structures, rule books, and the reaction networks that they give.

The names below are imported when they are first used, so that importing one package here does not import all others.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.support.lazy_names import lazy_names

if TYPE_CHECKING:
    from kinetics.assembly.checking.checker import check
    from kinetics.assembly.checking.findings import Finding, Report
    from kinetics.assembly.deriving.derive import Derivation, derive
    from kinetics.assembly.deriving.explore import Exploration, StructureEvent, explore
    from kinetics.assembly.deriving.ways import RateClass
    from kinetics.assembly.faces import FACE_NORMALS, ROTATIONS, SCHEMES, FaceScheme, compose, inverse
    from kinetics.assembly.rules.conditions import Semantics, Senses
    from kinetics.assembly.rules.rule_book import LivelockError, RuleBook, View
    from kinetics.assembly.structure import Placement, Structure, placements

_HOMES = {
    "kinetics.assembly.checking.checker": ("check",),
    "kinetics.assembly.checking.findings": ("Finding", "Report"),
    "kinetics.assembly.deriving.derive": ("Derivation", "derive"),
    "kinetics.assembly.deriving.explore": ("Exploration", "StructureEvent", "explore"),
    "kinetics.assembly.deriving.ways": ("RateClass",),
    "kinetics.assembly.faces": ("FACE_NORMALS", "ROTATIONS", "SCHEMES", "FaceScheme", "compose", "inverse"),
    "kinetics.assembly.rules.conditions": ("Semantics", "Senses"),
    "kinetics.assembly.rules.rule_book": ("LivelockError", "RuleBook", "View"),
    "kinetics.assembly.structure": ("Placement", "Structure", "placements"),
}

__all__ = [
    "FACE_NORMALS",
    "ROTATIONS",
    "SCHEMES",
    "Derivation",
    "Exploration",
    "FaceScheme",
    "Finding",
    "LivelockError",
    "Placement",
    "RateClass",
    "Report",
    "RuleBook",
    "Semantics",
    "Senses",
    "Structure",
    "StructureEvent",
    "View",
    "check",
    "compose",
    "derive",
    "explore",
    "inverse",
    "placements",
]

__getattr__, __dir__ = lazy_names(__name__, __all__, _HOMES)
