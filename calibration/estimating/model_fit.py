"""Parameters of a model from data of any kind, by maximum likelihood."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibration.estimating.likelihood_fit import ParameterFit, fit_parameters
from calibration.estimating.priors import LogNormalPrior
from kinetics.markov.panels import Likelihood
from kinetics.network import Model
from kinetics.network.checks import some_names
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats
from kinetics.support.packages import special
from kinetics.support.tables import text_table


@dataclass(frozen=True, eq=False)
class ModelFit:
    """Estimates of the parameters of a model, ready to be shown and used.

    fit : estimates, intervals and notes
    log_likelihood : at the estimates, with its bounds; without what priors add
    fixed : what was held, by name
    likelihood : of the data that were fitted
    priors : by name, of the parameters that have one

    >>> from calibration import fit_model
    >>> from kinetics import JumpPath, Model, Network
    >>> from kinetics.markov.panels import EventData, EventLikelihood
    >>> decay = Model.of(Network.from_text("A -> B, k", k=1))
    >>> path = JumpPath(decay.network, {"A": 2}, times=[1.0], channels=[0], end=4.0)
    >>> found = fit_model(EventLikelihood(decay, EventData([path])), starts=1)  # one event in 5 tu
    >>> round(found.point["k"], 6), round(found.aic, 4)
    (0.2, 5.8326)
    """

    fit: ParameterFit
    log_likelihood: Answer
    fixed: Mapping[str, float]
    likelihood: Likelihood
    priors: Mapping[str, LogNormalPrior]

    @property
    def point(self) -> dict[str, float]:
        """All parameters at their estimates, those held too; what the data cannot tell is where the search began."""
        return {**self.fixed, **dict(zip(self.fit.names, self.fit.at.tolist(), strict=True))}

    @property
    def model(self) -> Model:
        """The model at the estimates."""
        known = self.likelihood.observed
        return self.likelihood.model.at({name: value for name, value in self.point.items() if name not in known})

    @property
    def aic(self) -> float:
        """Akaike's criterion: twice the number of free parameters, less twice the log-likelihood."""
        return 2.0 * len(self.fit.names) - 2.0 * self.log_likelihood.value

    def log_posterior(self, logs: Floats) -> float:
        """Log-likelihood and log-density of the priors at logarithms (P,) of the parameters; -inf where it is 0.

        Parameters without a prior have a flat one on their logarithm.
        """
        values = np.exp(logs)
        if not np.isfinite(logs).all() or (values > self.fit.most).any() or (values < self.fit.least).any():
            return -np.inf
        point = dict(zip(self.fit.names, values.tolist(), strict=True))
        try:
            found = self.likelihood.value({**self.fixed, **point}).value
        except ValueError:  # this cannot be at such rates
            return -np.inf
        return found + sum(prior.scored(np.log(point[name]))[0] for name, prior in self.priors.items())

    def __str__(self) -> str:
        rows = [
            (name, *(f"{each[p]:.6g}" for each in (self.fit.value, self.fit.low, self.fit.high)))
            for p, name in enumerate(self.fit.names)
        ]
        table = text_table(["parameter", "estimate", "95 % from", "to"], rows)
        return "\n".join([table, f"log-likelihood {self.log_likelihood}; AIC {self.aic:.6g}", *self.fit.notes])


def fit_model(
    likelihood: Likelihood,
    free: Sequence[str] | None = None,
    *,
    fixed: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    priors: Mapping[str, LogNormalPrior] | None = None,
    starts: int = 3,
    seed: int = 0,
) -> ModelFit:
    """The parameters of largest likelihood, with 95 % profile-likelihood intervals.

    free : names of parameters, of channels (for their rate constants) or of columns (for the parameter of their
        observation); None: all parameters of the network, or, if it has none, all channels
    fixed : parameters that are held at other values than the model's
    bounds : smallest and largest value of a free parameter; by default it may be any number above 0
    priors : of free parameters; likelihood times prior then takes the place of the likelihood
    starts, seed : how many times the search begins, and the seed that scatters the later beginnings

    Cost: some thirty values of the likelihood for each start, and some ten for each end of an interval.
    ValueError: unknown names, a start that is not above 0, or data that cannot be

    >>> from calibration import fit_model
    >>> from kinetics import Model, Network
    >>> from kinetics.markov.panels import PanelData, PanelLikelihood, PanelRun
    >>> decay = Model.of(Network.from_text("A -> B, k", k=1))
    >>> data = PanelData({"A": {"A": 1}}, [PanelRun([100, 0], [2.0], [[37]])])
    >>> fit = fit_model(PanelLikelihood(decay, data)).fit
    >>> fit.value.round(5).tolist(), fit.low.round(3).tolist(), fit.high.round(3).tolist()  # -ln(.37) / 2
    ([0.49713], [0.381], [0.637])
    """
    held, known = dict(fixed or {}), likelihood.parameters
    asked = likelihood.usually_free if free is None else dict.fromkeys(free)
    names = [name for name in asked if free is not None or name not in held]
    if not names:
        raise ValueError("nothing is free: every parameter is fixed")
    for name in (*names, *held):
        if name not in known:
            raise ValueError(f"unknown parameter {name!r}; expected one of {some_names(list(known))}")
    for name in held:
        if name in names:
            raise ValueError(f"{name} is both free and fixed; leave one out")
    for what, given in (("bounds", bounds or {}), ("a prior", priors or {})):
        for name in given:
            if name not in names:
                raise ValueError(f"{name} has {what}, but it is not free; free are {some_names(names)}")
    least, most = (np.array([_limit(likelihood, bounds or {}, name, side) for name in names]) for side in (0, 1))
    begin = np.array([known[name] for name in names])
    for p, name in enumerate(names):
        if not 0.0 < begin[p] < np.inf:
            raise ValueError(f"{name} = {begin[p]:g}; a free parameter starts above 0: set it, or fix it")
        begin[p] = min(max(begin[p], least[p]), most[p])

    def scored(logs: Floats) -> tuple[float, Floats]:
        found = likelihood.scored({**held, **dict(zip(names, np.exp(logs).tolist(), strict=True))}, names)
        total, gradient = found.answer.value, found.gradient.copy()
        for name, prior in (priors or {}).items():
            value, slope = prior.scored(float(logs[names.index(name)]))
            total, gradient[names.index(name)] = total + value, gradient[names.index(name)] + slope
        return total, gradient

    fit = fit_parameters(scored, names, begin, least=least, most=most, starts=starts, seed=seed)
    point = {**held, **dict(zip(names, fit.at.tolist(), strict=True))}
    if priors:
        said = f"likelihood times prior was maximised; priors of {some_names(list(priors))}"
        fit = replace(fit, notes=(*fit.notes, said))
    return ModelFit(fit, likelihood.value(point), held, likelihood, dict(priors or {}))


def _limit(likelihood: Likelihood, bounds: Mapping[str, tuple[float, float]], name: str, side: int) -> float:
    """The least (side 0) or most (side 1) that a parameter may be."""
    most = likelihood.observed[name].most if name in likelihood.observed else np.inf
    low, high = bounds.get(name, (0.0, most))
    if not 0.0 <= low < high <= most:
        raise ValueError(f"{name} between {low:g} and {high:g}; expected two rising numbers from 0 to {most:g}")
    return (low, high)[side]


@dataclass(frozen=True)
class Compared:
    """One of several models of the same data.

    aic_above_least : its AIC less the smallest
    p_ratio : of the likelihood-ratio test between this model and the first, if one is a special case of the other; else
        None
    """

    name: str
    n_free: int
    log_likelihood: float
    aic_above_least: float
    p_ratio: float | None


def compare_models(fits: Mapping[str, ModelFit]) -> list[Compared]:
    """Models of the same data by AIC, and by likelihood-ratio tests against the first.

    One fit is a special case of another if it has the same model and data, frees fewer parameters, and holds all else
    at the same values. If it is right, and no parameter is at the end of its range, twice the difference of the
    log-likelihoods is about chi-squared (Wilks 1938, doi:10.1214/aoms/1177732360).

    fits : by name
    ValueError: fits of other data

    >>> from calibration import compare_models, fit_model
    >>> from kinetics import Model, Network
    >>> from kinetics.markov.panels import PanelData, PanelLikelihood, PanelRun
    >>> switch = Model.of(Network.from_text("A <-> B, k, l", k=1, l=1))
    >>> runs = [PanelRun([100, 0], [1.0, 2.0], [[50], [41]])]
    >>> asked = PanelLikelihood(switch, PanelData({"A": {"A": 1}}, runs))
    >>> rows = compare_models({"both": fit_model(asked), "l is 1": fit_model(asked, ["k"], fixed={"l": 1.0})})
    >>> [row.n_free for row in rows], round(rows[1].p_ratio, 3)
    ([2, 1], 0.531)
    """
    first = next(iter(fits.values()))
    for name, each in fits.items():
        if each.likelihood.data_digest != first.likelihood.data_digest:
            raise ValueError(f"{name} was fitted to other data; models are compared by the same data")
    least = min(each.aic for each in fits.values())
    return [
        Compared(name, len(each.fit.names), each.log_likelihood.value, each.aic - least, _p_ratio(first, each))
        for name, each in fits.items()
    ]


def _p_ratio(one: ModelFit, other: ModelFit) -> float | None:
    """p of the likelihood-ratio test; None if neither is a special case of the other."""
    small, large = sorted((one, other), key=lambda fit: len(fit.fit.names))
    less, more = small.likelihood, large.likelihood
    ours, theirs = ({each.likelihood.shared(name) for name in each.fit.names} for each in (small, large))
    if len(small.fit.names) == len(large.fit.names) or not ours <= theirs or not set(less.own) <= set(more.own):
        return None
    if not less.is_like(more) or small.priors or large.priors:
        return None
    held, others = (
        {each.likelihood.shared(n): v for n, v in {**each.likelihood.parameters, **each.fixed}.items()}
        for each in (small, large)
    )
    if any(value != held[name] for name, value in others.items() if name not in theirs):
        return None
    gained = max(0.0, 2.0 * (large.log_likelihood.value - small.log_likelihood.value))
    return float(special.gammaincc(0.5 * (len(large.fit.names) - len(small.fit.names)), 0.5 * gained))
