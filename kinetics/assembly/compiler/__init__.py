"""The compiler: from a target structure to a verified rule book."""

from kinetics.assembly.compiler.compiling import all_books, compile_book
from kinetics.assembly.compiler.result import Compiled, InfeasibleError, UndecidedError
from kinetics.assembly.compiler.target import Target

__all__ = ["Compiled", "InfeasibleError", "Target", "UndecidedError", "all_books", "compile_book"]
