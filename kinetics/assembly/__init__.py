"""What can stick to what: faces, structures, rule books, and the networks they make."""

# Not lazy: `derive` is the function here and a module below, so the function has to be bound last.
from kinetics.assembly.derive import Derivation, derive
from kinetics.assembly.faces import FACE_NORMALS, ROTATIONS, SCHEMES, FaceScheme, compose, inverse
from kinetics.assembly.rules import LivelockError, RuleBook, Semantics, Senses, View
from kinetics.assembly.structure import Placement, Structure, placements

__all__ = [
    "FACE_NORMALS",
    "ROTATIONS",
    "SCHEMES",
    "Derivation",
    "FaceScheme",
    "LivelockError",
    "Placement",
    "RuleBook",
    "Semantics",
    "Senses",
    "Structure",
    "View",
    "compose",
    "derive",
    "inverse",
    "placements",
]
