"""Methods by name: those that solve are imported only if one is asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.predicting.mean_field import MeanField
from kinetics.sampling.base import SamplingMethod
from kinetics.sampling.methods import BY_NAME as SAMPLING

if TYPE_CHECKING:
    from kinetics.markov.transient import SolvingMethod


def names() -> tuple[str, ...]:
    """The names of all methods: those that sample, those that solve the master equation, and the mean field."""
    from kinetics.markov.transient.methods import BY_NAME

    return (*SAMPLING, *BY_NAME, MeanField.name)


def method_of(method: SamplingMethod | SolvingMethod | MeanField | str) -> SamplingMethod | SolvingMethod | MeanField:
    """The method of this name, with its default settings; a method itself as it is.

    ValueError: no such name

    >>> method_of("ssa"), method_of("transient").name
    (Direct(), 'transient')
    """
    if not isinstance(method, str):
        return method
    if method in SAMPLING:
        return SAMPLING[method]()
    if method == MeanField.name:
        return MeanField()
    from kinetics.markov.transient.methods import BY_NAME

    if method in BY_NAME:
        return BY_NAME[method]()
    raise ValueError(f"unknown method {method!r}; methods are {', '.join(names())}")
