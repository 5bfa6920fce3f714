"""Draws from posteriors as ArviZ has them, in its versions below 1 and from 1 on."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
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
    """Independent draws of rates and shape parameters, and the evidence, as ArviZ has them; see `arviz_data`.

    posterior : group `posterior`, with `rate` (chain, draw, channel), 1/tu, and each shape parameter (chain, draw);
        group `constant_data` has `events` and `exposure` (channel), nan if a rate is taken as known
    """
    n, m = whole_number("draws", draws, 1), whole_number("chains", chains, 1)
    table = posterior.draw(np.random.default_rng(whole_number("seed", seed, 0)), n * m).reshape(m, n, -1)
    rates = len(posterior.rate_names)
    shapes = {name: table[..., rates + k] for k, name in enumerate(posterior.names[rates:])}
    return arviz_data(
        {"rate": table[..., :rates], **shapes},
        {"events": _known(posterior.events), "exposure": _known(posterior.exposure)},
        coords={"channel": list(posterior.rate_names)},
        dims={"rate": ["channel"], "events": ["channel"], "exposure": ["channel"]},
        attrs={"seed": seed},
    )


def arviz_data(
    posterior: Mapping[str, ArrayLike],
    constant: Mapping[str, ArrayLike],
    coords: Mapping[str, Sequence[str]],
    dims: Mapping[str, Sequence[str]],
    attrs: Mapping[str, Any],
) -> Any:
    """Draws (chains, draws, ...) and constants: an `InferenceData` of ArviZ below 1, a `DataTree` from 1 on."""
    arviz = _arviz()
    named = {"posterior": dict(posterior), **({"constant_data": dict(constant)} if constant else {})}
    if "InferenceData" not in vars(arviz):  # ArviZ from 1 on warns of this name, and has it no more
        return arviz.from_dict(named, coords=coords, dims=dims, attrs={"/": dict(attrs)})
    return arviz.from_dict(**named, coords=dict(coords), dims=dict(dims), attrs=dict(attrs))


def convergence(chains: Floats) -> tuple[Floats, Floats]:
    """Of chains (chains, draws, P): the rank-normalised R-hat (P,), and the effective number of draws (P,).

    Both are ArviZ's (Vehtari et al. 2021, doi:10.1214/20-BA1221); the number is the smaller of bulk and tail.
    """
    arviz = _arviz()
    data = arviz_data({"x": chains}, {}, {}, {"x": ["parameter"]}, {})
    r_hat, bulk, tail = arviz.rhat(data), arviz.ess(data, method="bulk"), arviz.ess(data, method="tail")
    bulk, tail, r_hat = (np.asarray((each if "x" in each else each["posterior"])["x"]) for each in (bulk, tail, r_hat))
    return r_hat, np.minimum(bulk, tail)


def _known(values: Sequence[float | None]) -> ArrayLike:
    return np.array([np.nan if value is None else value for value in values], dtype=float)


def _arviz() -> Any:
    """ArviZ, without the warning by which its last version before 1 announces the next."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", category=FutureWarning, module="arviz")
        warnings.filterwarnings("ignore", message="\\nArviZ is undergoing", category=FutureWarning)
        return extra("arviz")
