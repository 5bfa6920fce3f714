"""Methods as `--method` takes them; those that solve are imported only if one is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from kinetics.predicting.methods import method_of, names
from kinetics.sampling.methods import BY_NAME

if TYPE_CHECKING:
    from kinetics.markov.transient import SolvingMethod
    from kinetics.predicting.mean_field import MeanField
    from kinetics.sampling import SamplingMethod


def within_budget(name: str, seconds: float) -> SamplingMethod | SolvingMethod | MeanField:
    """The method of this name; one that forecasts its work refuses what is forecast to take more CPU time, s."""
    method: Any = method_of(name)
    return method_of(replace(method, max_seconds=seconds) if hasattr(method, "max_seconds") else method)


class MethodName(click.Choice[str]):
    """The name of a sampling or solving method, or of the mean field."""

    case_sensitive = True

    def __init__(self) -> None:
        """The methods to choose from."""

    @property
    def choices(self) -> Sequence[str]:  # type: ignore[override]
        """The names of the methods, in the order of the help."""
        return names()

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The name itself; the error of `click.Choice` for any other."""
        return value if value in BY_NAME else super().convert(value, param, ctx)
