"""Posteriors of rates as ArviZ's InferenceData."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from kinetics.support.arrays import Floats, whole_number
from kinetics.support.packages import extra


class DrawnPosterior(Protocol):
    """The part of a `RatesPosterior` that is drawn."""

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters (P,), rates first."""
        ...

    @property
    def rate_names(self) -> tuple[str, ...]:
        """The names of the parameters that are rates."""
        ...

    @property
    def events(self) -> tuple[float | None, ...]:
        """Events behind each rate."""
        ...

    @property
    def exposure(self) -> tuple[float | None, ...]:
        """The exposure behind each rate, tu."""
        ...

    def draw(self, rng: np.random.Generator, n: int) -> Floats:
        """Draws (n, P)."""
        ...


def inference_data(posterior: DrawnPosterior, draws: int = 1000, chains: int = 4, seed: int = 0) -> Any:
    """Independent draws of rates and shape parameters, and the evidence, as `arviz.InferenceData`.

    posterior : group `posterior`, with `rate` (chain, draw, channel), 1/tu, and each shape parameter (chain, draw);
        group `constant_data` has `events` and `exposure` (channel), nan if a rate is taken as known
    """
    arviz = _arviz()
    n, m = whole_number("draws", draws, 1), whole_number("chains", chains, 1)
    table = posterior.draw(np.random.default_rng(whole_number("seed", seed, 0)), n * m).reshape(m, n, -1)
    rates = len(posterior.rate_names)
    shapes = {name: table[..., rates + k] for k, name in enumerate(posterior.names[rates:])}
    return arviz.from_dict(
        posterior={"rate": table[..., :rates], **shapes},
        constant_data={"events": _known(posterior.events), "exposure": _known(posterior.exposure)},
        coords={"channel": list(posterior.rate_names)},
        dims={"rate": ["channel"], "events": ["channel"], "exposure": ["channel"]},
        attrs={"seed": seed},
    )


def _known(values: Sequence[float | None]) -> ArrayLike:
    return np.array([np.nan if value is None else value for value in values], dtype=float)


def _arviz() -> Any:
    """ArviZ, without the warning by which it announces its next version at its import."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", category=FutureWarning, module="arviz")
        warnings.filterwarnings("ignore", message="\\nArviZ is undergoing", category=FutureWarning)
        return extra("arviz")
