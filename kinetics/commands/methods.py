"""Methods by name, as `--method` takes them; those that solve are imported only where one is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from kinetics.sampling.methods import SAMPLING_METHODS

if TYPE_CHECKING:
    from kinetics.sampling import SamplingMethod
    from kinetics.solving import SolvingMethod

SAMPLING = {method.name: method for method in SAMPLING_METHODS}


def _solving() -> dict[str, type[SolvingMethod]]:
    from kinetics.solving import SOLVING_METHODS

    return {method.name: method for method in SOLVING_METHODS}


def method_of(name: str) -> SamplingMethod | SolvingMethod:
    """The method of this name, with its default settings."""
    return SAMPLING[name]() if name in SAMPLING else _solving()[name]()


class MethodName(click.Choice[str]):
    """The name of a sampling or solving method."""

    case_sensitive = True

    def __init__(self) -> None:
        """All of them."""

    @property
    def choices(self) -> Sequence[str]:  # type: ignore[override]
        """Their names, in the order of the help."""
        return (*SAMPLING, *_solving())

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The name itself; the error of `click.Choice` for any other."""
        return value if value in SAMPLING else super().convert(value, param, ctx)
