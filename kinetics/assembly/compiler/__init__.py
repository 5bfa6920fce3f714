"""Rule books from target structures."""

from kinetics.assembly.compiler.target import Target

__all__ = ["Target"]
