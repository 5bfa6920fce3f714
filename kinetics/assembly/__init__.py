"""Self-assembly of cubes: faces, structures, rule books, and the reaction networks that they give."""

# Not lazy: `derive` and `explore` are functions here and modules below, so the functions have to be bound last.
from kinetics.assembly.checking.checker import Finding, Report, check
from kinetics.assembly.deriving.derive import Derivation, derive
from kinetics.assembly.deriving.explore import Exploration, StructureEvent, explore
from kinetics.assembly.deriving.ways import RateClass
from kinetics.assembly.faces import FACE_NORMALS, ROTATIONS, SCHEMES, FaceScheme, compose, inverse
from kinetics.assembly.rules.rule_book import LivelockError, RuleBook, Semantics, Senses, View
from kinetics.assembly.structure import Placement, Structure, placements

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
