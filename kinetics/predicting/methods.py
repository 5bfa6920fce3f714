"""Methods by name: those that solve are imported only if one is asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.sampling.base import SamplingMethod
from kinetics.sampling.methods import BY_NAME as SAMPLING

if TYPE_CHECKING:
    from kinetics.markov.transient import SolvingMethod


def names() -> tuple[str, ...]:
    """The names of all methods, those that sample first."""
    from kinetics.markov.transient.methods import BY_NAME

    return (*SAMPLING, *BY_NAME)


def method_of(method: SamplingMethod | SolvingMethod | str) -> SamplingMethod | SolvingMethod:
    """The method of this name, with its default settings; a method itself as it is.

    ValueError: no such name

    >>> method_of("ssa"), method_of("transient").name
    (Direct(), 'transient')
    """
    if not isinstance(method, str):
        return method
    if method in SAMPLING:
        return SAMPLING[method]()
    from kinetics.markov.transient.methods import BY_NAME

    if method in BY_NAME:
        return BY_NAME[method]()
    raise ValueError(f"unknown method {method!r}; methods are {', '.join(names())}")
