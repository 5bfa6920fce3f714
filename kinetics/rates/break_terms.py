"""The dependence of breaks on their partners in a rates file: the break model, its shape, and their posterior."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta, field
from numpy.typing import ArrayLike

from kinetics.network import Network
from kinetics.rates.breaks import BreakModel, ShapeParameter, SizeWeights, break_model
from kinetics.support.arrays import Floats, Ints
from kinetics.support.settings import Settings


class ShapePosterior(Settings):
    """The posterior of the shape parameters on a grid, given the coefficients' own prior.

    points : (G, K) values of the K shape parameters, in the order of `shape`
    weights : (G,) probabilities

    >>> from kinetics.rates import ShapePosterior
    >>> posterior = ShapePosterior(points=((0.5,), (1.5,)), weights=(0.25, 0.75))
    >>> sum(weight * alpha for (alpha,), weight in zip(posterior.points, posterior.weights))
    1.25
    """

    points: Annotated[tuple[tuple[float, ...], ...], Meta(min_length=1)]
    weights: Annotated[tuple[float, ...], Meta(min_length=1)]

    def __post_init__(self) -> None:
        if len(self.points) != len(self.weights) or len({len(point) for point in self.points}) != 1:
            raise ValueError(
                f"{len(self.points)} points and {len(self.weights)} weights; expected one weight per point, and "
                f"points of equal length"
            )
        if min(self.weights) < 0 or not np.isclose(sum(self.weights), 1, rtol=1e-6):
            raise ValueError(f"weights add up to {sum(self.weights):g}; expected probabilities, which add up to 1")


class BreakTerms(Settings):
    """The break model of a rates file.

    model : name of a break model
    shape : its shape parameters at their largest likelihood
    posterior : what the evidence leaves of them; None if they are taken as known
    like_pairs : how a pair of like bodies is counted

    >>> from kinetics.rates import BreakTerms
    >>> BreakTerms(model="collision", shape={"alpha": 2.0}).by_size([1, 2, 3]).bodies.tolist()
    [1.0, 4.0, 9.0]
    """

    model: str = "first-order"
    shape: dict[str, float] = field(default_factory=dict)
    posterior: ShapePosterior | None = None
    like_pairs: Literal["either copy may break: x (x - 1)"] = "either copy may break: x (x - 1)"

    def __post_init__(self) -> None:
        break_model(self.model)
        if self.posterior is not None and len(self.posterior.points[0]) != len(self.shape):
            known = ", ".join(self.shape) or "none"
            raise ValueError(f"points of {len(self.posterior.points[0])} shape parameters; expected {known}")

    @property
    def break_model(self) -> BreakModel:
        """The break model of these terms."""
        return break_model(self.model)

    def check(self, network: Network) -> None:
        """ValueError if the shape parameters are not those of the model in this network."""
        wanted = {parameter.name: parameter for parameter in self.break_model.parameters(network)}
        self._check_shape(wanted)

    def _check_shape(self, wanted: Mapping[str, ShapeParameter]) -> None:
        """ValueError if the shape parameters are not these, or out of their ranges."""
        if list(self.shape) != list(wanted):
            raise ValueError(
                f"break model {self.model!r} has the shape parameters {', '.join(wanted) or 'none'}; "
                f"{', '.join(self.shape) or 'none'} came"
            )
        for name, value in self.shape.items():
            low, high = wanted[name].low, wanted[name].high
            if not low <= value <= high:
                raise ValueError(f"{name} = {value:g} of break model {self.model!r}; expected {low:g} to {high:g}")

    def weights(self, network: Network) -> Floats:
        """Weights (P,) of the partners at the largest likelihood."""
        return self.break_model.weights(network, self.shape)

    def by_size(self, sizes: ArrayLike) -> SizeWeights:
        """Weights of bodies of these sizes (n,), of the wall and of the structure alone, at the largest likelihood.

        ValueError: the model weights partners by more than their size, or the shape is not that of the model.
        """
        of = np.asarray(sizes, dtype=float)
        model = self.break_model
        wanted = {parameter.name: parameter for parameter in model.size_parameters}
        if wanted or not self.shape:
            self._check_shape(wanted)
        return model.by_size(of, self.shape)

    def at_shapes(self, network: Network) -> Floats | None:
        """Weights (G, P) at each point of the posterior of the shape; None if there is no posterior."""
        if self.posterior is None:
            return None
        shapes = [dict(zip(self.shape, point, strict=True)) for point in self.posterior.points]
        return np.array([self.break_model.weights(network, shape) for shape in shapes])

    def shape_draws(self, rng: np.random.Generator, n: int) -> tuple[Ints, list[BreakTerms]]:
        """Draws from the posterior of the shape: numbers (n,) of its points, and the terms with each shape as known."""
        if self.posterior is None:
            return np.zeros(n, dtype=np.int64), [self] * n
        share = np.array(self.posterior.weights)
        drawn = rng.choice(share.size, size=n, p=share / share.sum())
        known = [
            self.replace(shape=dict(zip(self.shape, point, strict=True)), posterior=None)
            for point in self.posterior.points
        ]
        return drawn, [known[i] for i in drawn]
