"""Self-assembly of cubes: faces, structures, rule books, and the reaction networks that they give.

The names below are imported when they are first used, so that importing one package here does not import all others.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.support.lazy_names import lazy_names

if TYPE_CHECKING:
    from kinetics.assembly.checking.checker import check as check
    from kinetics.assembly.checking.findings import Finding as Finding
    from kinetics.assembly.checking.findings import Report as Report
    from kinetics.assembly.deriving.derive import Derivation as Derivation
    from kinetics.assembly.deriving.derive import derive as derive
    from kinetics.assembly.deriving.explore import Exploration as Exploration
    from kinetics.assembly.deriving.explore import StructureEvent as StructureEvent
    from kinetics.assembly.deriving.explore import explore as explore
    from kinetics.assembly.deriving.ways import RateClass as RateClass
    from kinetics.assembly.faces import FACE_NORMALS as FACE_NORMALS
    from kinetics.assembly.faces import ROTATIONS as ROTATIONS
    from kinetics.assembly.faces import SCHEMES as SCHEMES
    from kinetics.assembly.faces import FaceScheme as FaceScheme
    from kinetics.assembly.faces import compose as compose
    from kinetics.assembly.faces import inverse as inverse
    from kinetics.assembly.rules.conditions import Semantics as Semantics
    from kinetics.assembly.rules.conditions import Senses as Senses
    from kinetics.assembly.rules.rule_book import LivelockError as LivelockError
    from kinetics.assembly.rules.rule_book import RuleBook as RuleBook
    from kinetics.assembly.rules.rule_book import View as View
    from kinetics.assembly.structure import Placement as Placement
    from kinetics.assembly.structure import Structure as Structure
    from kinetics.assembly.structure import placements as placements

__getattr__, __dir__ = lazy_names(__name__)
