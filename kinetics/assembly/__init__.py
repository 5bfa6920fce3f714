"""What can stick to what: faces, structures, rule books, and the networks they make."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from kinetics.assembly.faces import FACE_NORMALS, ROTATIONS, SCHEMES, FaceScheme, compose, inverse
    from kinetics.assembly.rules import LivelockError, RuleBook, View
    from kinetics.assembly.structure import Placement, Structure, placements

_MODULES = {
    "faces": ("FACE_NORMALS", "ROTATIONS", "SCHEMES", "FaceScheme", "compose", "inverse"),
    "rules": ("LivelockError", "RuleBook", "View"),
    "structure": ("Placement", "Structure", "placements"),
}
_HOME = {name: module for module, names in _MODULES.items() for name in names}

__all__ = [
    "FACE_NORMALS",
    "ROTATIONS",
    "SCHEMES",
    "FaceScheme",
    "LivelockError",
    "Placement",
    "RuleBook",
    "Structure",
    "View",
    "compose",
    "inverse",
    "placements",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"kinetics.assembly.{_HOME[name]}"), name)
