"""Rule books from target structures."""

from kinetics.assembly.compiler.result import Compiled, InfeasibleError, UndecidedError
from kinetics.assembly.compiler.target import Target

__all__ = ["Compiled", "InfeasibleError", "Target", "UndecidedError"]
