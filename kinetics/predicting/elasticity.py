"""Elasticities of predictions: what each parameter of a rates file does to them, and which is worth more runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.network import Network, Tank
from kinetics.passage import first_passage
from kinetics.predicting.over_draws import DrawMeans
from kinetics.rates import Rates, RatesPosterior
from kinetics.solving import Transient, solve
from kinetics.support.arrays import Floats
from kinetics.support.intervals import student_quantile

if TYPE_CHECKING:
    from kinetics.predicting.observables import Observables

STEP = 1e-3  # relative, or a share of a shape parameter's range: the error of a difference is near 1e-6 of its value
EXACT_STATES = 5000  # with more reachable states than these, elasticities of counts come from draws
EXACT_SECONDS = 60.0  # estimated for one solution, likewise


@dataclass(frozen=True, eq=False)
class Elasticities:
    """Elasticities of predictions of shape (...) to each of P parameters: d ln(prediction) / d ln(parameter).

    parameters : names (P,): channels, for their rates (of a break its coefficient), then shape parameters
    is_rate : (P,); for a shape parameter the value is d ln(prediction) / d parameter instead, with each coefficient
        moving so that as many breaks would have been expected where they were counted
    prediction : (...) to which they belong
    value, standard_error : (P, ...); nan where not known. The error is 0 for an exact solution
    share : (P, ...) of the variance that the rates leave in the prediction, to first order; nan where they leave none
    quantile : how far a 95 % interval reaches beyond the value, in standard errors, by Student's t
    is_exact : solved for by differences at the posterior mean of each parameter; else averaged over the posterior
    """

    parameters: tuple[str, ...]
    is_rate: NDArray[np.bool_]
    prediction: Floats
    value: Floats
    standard_error: Floats
    share: Floats
    quantile: float
    is_exact: bool

    @property
    def low(self) -> Floats:
        """Lower limits (P, ...) of the values, 95 %."""
        return self.value - self.quantile * self.standard_error

    @property
    def high(self) -> Floats:
        """Upper limits (P, ...) of the values, 95 %."""
        return self.value + self.quantile * self.standard_error

    @property
    def note(self) -> str:
        """How they were found, for the reader."""
        how = (
            "exact differences at the posterior mean of each parameter"
            if self.is_exact
            else "averages over the posterior, from a regression on draws of the rates"
        )
        return f"elasticities are {how}; the largest share is the rate most worth more runs"

    def to_dict(self) -> dict[str, Any]:
        """All of it but the prediction; arrays are (P, ...)."""
        return {
            "parameters": self.parameters,
            "is_rate": self.is_rate,
            "value": self.value,
            "low": self.low,
            "high": self.high,
            "standard_error": self.standard_error,
            "share": self.share,
            "exact": self.is_exact,
            "note": self.note,
        }

    def plot(self, ax: Any, names: tuple[str, ...]) -> Any:
        """Bars with intervals for the last time, one colour for each of the S names of the last axis; returns `ax`."""
        from kinetics.support import plots

        values, low, high = (
            each.reshape(len(each), -1, len(names))[:, -1] for each in (self.value, self.low, self.high)
        )
        return plots.grouped_bars(ax, self.parameters, names, values, low, high, "elasticity of the mean")


def count_elasticities(
    network: Network,
    rates: Rates,
    initial: ArrayLike,
    times: ArrayLike,
    drawn: DrawMeans | None = None,
    observables: Observables | None = None,
    tank: Tank | None = None,
    exact_states: int = EXACT_STATES,
) -> Elasticities:
    """Elasticities (P, T, S) of the mean counts at `times` (T,), tu.

    drawn : of a prediction for these times, observables and tank
    exact_states : up to so many reachable states they are solved for, by two solutions a parameter; else they come from
        `drawn`, at no further cost
    ValueError: no rate has evidence where draws are needed, or there are fewer than two draws for a parameter.
    """

    def mean(model: Network) -> Floats:
        solved = solve(model, Transient(max_states=exact_states, max_seconds=EXACT_SECONDS), initial, times)
        return (solved if observables is None else observables.of_distribution(solved)).mean()

    try:
        return exact_elasticities(rates.posterior(network, tank), mean)
    except ValueError as refusal:  # too many states, or too stiff
        if drawn is None:
            raise ValueError(
                f"elasticities need an exact solution, or draws of the rates, which rates without evidence (events and "
                f"exposure) do not have; {refusal}"
            ) from refusal
        return elasticities_of_draws(drawn)


def passage_elasticities(
    network: Network, rates: Rates, initial: ArrayLike, species: str, copies: int = 1, tank: Tank | None = None
) -> Elasticities:
    """Elasticities (P, 1) of the mean time to `copies` of a species, solved for; ValueError where it is infinite."""

    def mean(model: Network) -> Floats:
        found = first_passage(model, initial, species, copies)
        if not found.is_certain:
            raise ValueError(f"the mean time until {found.target} is infinite, so it has no elasticities")
        return np.array([found.mean])

    return exact_elasticities(rates.posterior(network, tank), mean)


def exact_elasticities(posterior: RatesPosterior, mean: Callable[[Network], Floats]) -> Elasticities:
    """By central differences of `mean`, which gives the predictions (...) of a network exactly.

    The share of a parameter is that of the linear propagation of errors. Cost: 2 P + 1 predictions.
    """
    middle = posterior.mean
    is_rate = np.arange(middle.size) < len(posterior.rates)
    low, high = middle * (1 - STEP), middle * (1 + STEP)
    # of parameters that rates do not scale with: a step of the range, no further than its ends
    shape = posterior.breaks.break_model.parameters(posterior.expansion.base)
    for p, of in enumerate(shape, start=len(posterior.rates)):
        step = STEP * min(of.high - of.low, 1.0)
        low[p], high[p] = max(of.low, middle[p] - step), min(of.high, middle[p] + step)
    one = np.eye(middle.size, dtype=bool)
    points = np.vstack([middle, np.where(one, low, middle), np.where(one, high, middle)])
    found = [mean(posterior.expansion.network.with_rates(row)) for row in posterior.constants(points)]
    at = found[0]
    width = np.where(is_rate, 2 * STEP, high - low)
    below, above = np.split(np.array(found[1:]), 2)
    slope = ((above - below).T / width).T
    covariance = _relative_covariance(posterior)
    moved = np.tensordot(covariance, slope, axes=1)
    return Elasticities(
        posterior.names,
        is_rate,
        at,
        _over(slope, at),
        np.zeros_like(slope),
        _over(slope * moved, (slope * moved).sum(axis=0)),
        0.0,
        True,
    )


def elasticities_of_draws(drawn: DrawMeans) -> Elasticities:
    """By linear regression of the means under single draws on the parameters, each over its posterior mean.

    For a rate k with a Gamma posterior the coefficient is E[k d mean / dk], whatever the curvature, because
    Cov(k, f) = E[k f'(k)] / exposure (Stein's identity for the Gamma distribution: Diaconis & Zabell 1991,
    doi:10.1214/ss/1177011699). So the value is that average over the posterior mean of the prediction. Monte-Carlo
    noise has mean 0 whatever the rates, so it does not bias; standard errors are those of White (HC3; MacKinnon & White
    1985, doi:10.1016/0304-4076(85)90158-7) and hold it. Draws are not weighted by their noise: this is estimated from
    the same runs, and where counts are few the smaller means would seem the better known. Shares are freed of the
    squared errors, and the variance to which they refer of the noise. Parameters taken as known have nan.
    """
    posterior = drawn.posterior
    n = len(drawn.means)
    covariance = _relative_covariance(posterior)
    varied = np.flatnonzero(np.diag(covariance) > 0)
    if n < 2 * (varied.size + 1):
        raise ValueError(
            f"{n} draws of the rates for {varied.size} parameters; expected at least {2 * (varied.size + 1)}: ask for "
            "more draws"
        )
    is_rate = np.arange(len(posterior.names)) < len(posterior.rates)
    off = (drawn.parameters - posterior.mean) / np.where(is_rate & (posterior.mean > 0), posterior.mean, 1.0)
    design = np.column_stack([np.ones(n), off[:, varied]])
    inverse = np.linalg.pinv(design)
    means = drawn.means.reshape(n, -1)
    fitted = inverse @ means
    leverage = np.einsum("dp,pd->d", design, inverse)
    residual = (means - design @ fitted) / np.maximum(1 - leverage, 1e-9)[:, None]
    average = means.mean(axis=0)
    slope, value, error, slope_error = np.full((4, len(posterior.names), means.shape[1]), np.nan)
    for place, p in enumerate(varied, start=1):
        slope[p], influence = fitted[place], inverse[place][:, None] * residual
        slope_error[p] = np.sqrt((influence**2).sum(axis=0))
        value[p] = _over(slope[p], average)
        ratio = influence - np.nan_to_num(value[p]) * (means - average) / n
        error[p] = _over(np.sqrt((ratio**2).sum(axis=0)), average)
    known = np.nan_to_num(slope)
    explained = known * (covariance @ known) - np.diag(covariance)[:, None] * np.nan_to_num(slope_error) ** 2
    explained = np.maximum(explained, 0.0)
    variance = means.var(axis=0, ddof=1) - drawn.noise.reshape(n, -1).mean(axis=0)
    share = _over(explained, np.maximum(variance, explained.sum(axis=0)))
    shape = drawn.means.shape[1:]
    return Elasticities(
        posterior.names,
        is_rate,
        average.reshape(shape),
        value.reshape(-1, *shape),
        error.reshape(-1, *shape),
        share.reshape(-1, *shape),
        student_quantile(n - varied.size - 1),
        False,
    )


def _relative_covariance(posterior: RatesPosterior) -> Floats:
    """Posterior covariance (P, P) of rates over their means, and of shape parameters."""
    scale = posterior.mean.copy()
    scale[len(posterior.rates) :] = 1.0
    scale[scale == 0] = 1.0  # a rate that is known to be 0 does not vary
    return posterior.covariance / np.outer(scale, scale)


def _over(numbers: Floats, by: Floats) -> Floats:
    """Numbers over positive ones; nan elsewhere."""
    whole = np.broadcast_to(by, numbers.shape)
    return np.divide(numbers, whole, out=np.full(numbers.shape, np.nan), where=whole > 0)
