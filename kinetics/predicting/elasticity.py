"""Elasticities of predictions: what each parameter of a rates file does to them, and which is worth more runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.markov import Chain, Sensitivity, sensitivity_to
from kinetics.network import Model, Network
from kinetics.predicting.over_draws import DrawMeans
from kinetics.rates.applied import AppliedRates
from kinetics.rates.posterior import Posterior
from kinetics.support import plots
from kinetics.support.arrays import Counts, Floats, divided, rising_times
from kinetics.support.intervals import student_quantile
from kinetics.support.shown import ResultTable, Shown, on_axes

if TYPE_CHECKING:
    from kinetics.predicting.observables import Observables

EXACT_STATES = 5000  # with more reachable states than these, elasticities of counts come from draws
EXACT_SECONDS = 60.0  # estimated for one time, likewise

Gradients = tuple[Floats, Floats]


@dataclass(frozen=True, eq=False, repr=False)
class Elasticities(Shown):
    """Elasticities of predictions of shape (...) to each of P parameters: d ln(prediction) / d ln(parameter).

    parameters : names (P,): channels, for their rates (of a break its coefficient), then shape parameters
    is_rate : (P,); for a shape parameter the value is d ln(prediction) / d parameter instead, with each coefficient
        moving so that as many breaks would have been expected where they were counted
    prediction : (...) to which they belong
    value, standard_error : (P, ...); nan if not known. The error is 0 for an exact solution
    share : (P, ...) of the variance that the rates leave in the prediction, to first order; nan if they leave none
    quantile : how far a 95 % interval reaches beyond the value, in standard errors, by Student's t
    is_exact : exact derivatives at the posterior mean of each parameter; else averaged over the posterior

    >>> from kinetics import ChannelRate, Convention, Network, Rates
    >>> from kinetics.predicting import passage_elasticities
    >>> steps = Network.from_text('''first: A -> B, 1
    ... second: B -> C, 4''')
    >>> measured = {name: ChannelRate(rate=k, ways=1) for name, k in zip(steps.channels, (1, 4))}
    >>> rates = Rates(convention=Convention(combinations="distinct"), channels=measured)
    >>> found = passage_elasticities(steps, rates, {"A": 1}, "C")
    >>> found.parameters, found.value[:, 0].round(9).tolist(), found.is_exact  # 1 and 1/4 of 5/4
    (('first', 'second'), [-0.8, -0.2], True)
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
        """A line for people on how the elasticities were found."""
        how = (
            "exact derivatives at the posterior mean of each parameter"
            if self.is_exact
            else "averages over the posterior, from a regression on draws of the rates"
        )
        if np.isnan(self.share).all():
            return f"elasticities are {how}; no shares of variance: the rates have no evidence, or change nothing"
        return f"elasticities are {how}; more runs pay most for the rate with the largest share"

    @property
    def headline(self) -> str:
        """One line: the numbers of figures and parameters."""
        kind = "exact" if self.is_exact else "from draws of the rates"
        return f"elasticities of {self.prediction.size} figures to {len(self.parameters)} parameters, {kind}"

    def summary(self) -> ResultTable:
        """Smallest and largest elasticity and share of each parameter."""
        rows = []
        for p, name in enumerate(self.parameters):
            values, share = self.value[p].ravel(), self.share[p].ravel()
            known = share[np.isfinite(share)]
            rows.append((name, *_range(values[np.isfinite(values)]), f"{known.max():.0%}" if known.size else ""))
        return ResultTable(self.headline, ("parameter", "smallest", "largest", "largest share"), rows, [self.note])

    def to_dict(self) -> dict[str, Any]:
        """The elasticities, without the prediction, ready for JSON; arrays are (P, ...)."""
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

    @on_axes
    def plot(self, ax: Any, names: tuple[str, ...]) -> Any:
        """Bars with intervals for the last time, one colour for each of the S names of the last axis; returns `ax`."""
        values, low, high = (
            each.reshape(len(each), -1, len(names))[:, -1] for each in (self.value, self.low, self.high)
        )
        return plots.grouped_bars(ax, self.parameters, names, values, low, high, "elasticity of the mean")


def _range(values: Floats) -> tuple[str, str]:
    """Smallest and largest value; nothing if there is none."""
    return (f"{values.min():.3g}", f"{values.max():.3g}") if values.size else ("", "")


def count_elasticities(
    model: Model | Network,
    rates: AppliedRates,
    initial: Counts | None,
    times: ArrayLike,
    drawn: DrawMeans | None = None,
    observables: Observables | None = None,
    exact_states: int = EXACT_STATES,
) -> Elasticities:
    """Elasticities (P, T, S) of the mean counts at `times` (T,), tu.

    initial : counts at time 0 that go before the model's; None for these
    drawn : of a prediction for these times and observables, in the tank of the model
    exact_states : up to so many reachable states they are solved for, by one pass forwards a time and one backwards a
        count, for all parameters; else they come from `drawn`, at no further cost
    ValueError: no rate has evidence where draws are needed, or there are fewer than two draws for a parameter.

    >>> from kinetics import ChannelRate, Convention, Network, Rates
    >>> from kinetics.predicting import count_elasticities
    >>> decay = Network.from_text("decay: A -> 0, 1")
    >>> measured = {"decay": ChannelRate(rate=0.1, ways=1)}
    >>> rates = Rates(convention=Convention(combinations="distinct"), channels=measured)
    >>> count_elasticities(decay, rates, {"A": 10}, [5.0]).value.round(6).tolist()  # -k t
    [[[-0.5]]]
    """
    given = Model.of(model, initial)

    def solved(network: Network) -> Gradients:
        chain = Chain.of(network, given.initial, max_states=exact_states)
        counts = np.asarray(chain.counts, dtype=float)
        values: Floats = (counts if observables is None else counts @ observables.weights.astype(float)).T
        asked = Sensitivity(chain)
        found = [asked.means(values, float(t), EXACT_SECONDS) for t in rising_times(times)]
        means = np.array([[each.answer.value for each in row] for row in found])
        return means, np.moveaxis(np.array([[each.value for each in row] for row in found]), -1, 0)

    try:
        return exact_elasticities(rates.posterior(given.network, given.tank), solved)
    except ValueError as refusal:  # too many states, or too stiff
        if drawn is None:
            raise ValueError(
                f"elasticities need an exact solution, or draws of the rates, which rates without evidence (events and "
                f"exposure) do not have; {refusal}"
            ) from refusal
        return elasticities_of_draws(drawn)


def passage_elasticities(
    model: Model | Network,
    rates: AppliedRates,
    initial: Counts | None,
    species: str,
    copies: int = 1,
) -> Elasticities:
    """Elasticities (P, 1) of the mean time to `copies` of a species, solved for; ValueError if it is infinite.

    >>> from kinetics import ChannelRate, Convention, Network, Rates
    >>> from kinetics.predicting import passage_elasticities
    >>> decay = Network.from_text("decay: A -> B, 1")
    >>> measured = {"decay": ChannelRate(rate=0.1, events=40, exposure=400.0, ways=1)}
    >>> rates = Rates(convention=Convention(combinations="distinct"), channels=measured)
    >>> found = passage_elasticities(decay, rates, {"A": 1}, "B")
    >>> found.value.round(9).tolist(), found.share.round(9).tolist()
    ([[-1.0]], [[1.0]])
    """
    given = Model.of(model, initial)

    def solved(network: Network) -> Gradients:
        asked, goal = sensitivity_to(network, given.initial, species, copies)
        found = asked.passage(goal)
        return np.array([found.answer.value]), found.value[:, None]

    return exact_elasticities(rates.posterior(given.network, given.tank), solved)


def exact_elasticities(posterior: Posterior, solved: Callable[[Network], Gradients]) -> Elasticities:
    """Elasticities by the chain rule: derivatives of predictions by rate constants, times those by the parameters.

    solved : of a network, its predictions (...) and their derivatives (R', ...) by the logarithm of each rate constant
    The share of a parameter is that of the linear propagation of errors. Cost: that of `solved`, once.
    """
    middle, slopes = posterior.slopes()
    at, by_constant = solved(middle)
    slope = np.tensordot(slopes, by_constant, axes=1)
    moved = np.tensordot(_relative_covariance(posterior), slope, axes=1)
    return Elasticities(
        posterior.names,
        posterior.is_rate,
        at,
        divided(slope, at, np.nan),
        np.zeros_like(slope),
        divided(slope * moved, (slope * moved).sum(axis=0), np.nan),
        0.0,
        True,
    )


def elasticities_of_draws(drawn: DrawMeans) -> Elasticities:
    """Elasticities by linear regression of means under single draws on the parameters, each over its posterior mean.

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
    is_rate = posterior.is_rate
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
        value[p] = divided(slope[p], average, np.nan)
        ratio = influence - np.nan_to_num(value[p]) * (means - average) / n
        error[p] = divided(np.sqrt((ratio**2).sum(axis=0)), average, np.nan)
    known = np.nan_to_num(slope)
    explained = known * (covariance @ known) - np.diag(covariance)[:, None] * np.nan_to_num(slope_error) ** 2
    explained = np.maximum(explained, 0.0)
    variance = means.var(axis=0, ddof=1) - drawn.noise.reshape(n, -1).mean(axis=0)
    share = divided(explained, np.maximum(variance, explained.sum(axis=0)), np.nan)
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


def _relative_covariance(posterior: Posterior) -> Floats:
    """Posterior covariance (P, P) of rates over their means, and of shape parameters."""
    scale = posterior.mean.copy()
    scale[~posterior.is_rate] = 1.0
    scale[scale == 0] = 1.0  # a rate that is known to be 0 does not vary
    return posterior.covariance / np.outer(scale, scale)
