"""The fit of a model of rates to paths: estimates, profile-likelihood intervals, tests, tables and figures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from calibration import plots
from calibration.estimating.exposure import sojourns
from calibration.estimating.grouping import Grouping
from calibration.estimating.likelihood import Maximum, PathLikelihood
from calibration.estimating.rate_model import RateModel
from kinetics.rates.breaks import ShapeParameter
from kinetics.runs import JumpPath
from kinetics.support.arrays import Floats
from kinetics.support.packages import optimize, special
from kinetics.support.shown import ResultTable, Shown, on_axes
from kinetics.support.tables import figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes


CLOSE = 2.0  # of AIC: within it of the smallest, the fit with the fewest parameters is taken
Fit = TypeVar("Fit", bound="RateFit")


class ImpossibleEventError(ValueError):
    """An event happened that the model calls impossible."""


class LikelihoodRatio(NamedTuple):
    """A likelihood-ratio test: twice the gain in log-likelihood by `freedom` more parameters, and its p-value.

    >>> from calibration import MassActionRates, Weibull, fit_rates
    >>> from kinetics import JumpPath, Network
    >>> decay = Network.from_text("decay: A -> 0, 1")
    >>> paths = [JumpPath(decay, {"A": 1}, [wait], [0], end=wait) for wait in (0.9, 1.0, 1.1)]
    >>> ratio = fit_rates(Weibull(), paths).test_against(fit_rates(MassActionRates(), paths))
    >>> ratio.freedom, ratio.p_value < 0.05  # waits so much alike are not exponential
    (1, True)
    """

    statistic: float
    freedom: int
    p_value: float


@dataclass(frozen=True, eq=False, repr=False)
class RateFit(Shown):
    """A model of rates fitted by maximum likelihood.

    likelihood : likelihood of the paths to which it was fitted
    fixed : shape parameters that were held, by name
    best : the largest likelihood, and the model and coefficients that have it

    >>> from calibration import MassActionRates, fit_rates
    >>> from kinetics import JumpPath, Network
    >>> decay = Network.from_text("decay: A -> 0, 1")
    >>> fit = fit_rates(MassActionRates(), [JumpPath(decay, {"A": 1}, [2.0], [0], end=2.0)])
    >>> fit.parameters, round(fit.log_likelihood, 6)  # log 0.5 - 0.5 * 2
    ({'k decay': 0.5}, -1.693147)
    >>> [round(limit, 4) for limit in fit.interval("k decay")]
    [0.0285, 2.2015]
    """

    likelihood: PathLikelihood
    fixed: dict[str, float]
    best: Maximum

    @property
    def headline(self) -> str:
        """Which model, of how many channels, and how likely."""
        return f"{self.model.name} on {len(self.channels)} channels; log-likelihood {self.log_likelihood:.6g}"

    def summary(self) -> ResultTable:
        """One row a parameter, with its profile-likelihood limits."""
        rows = []
        for row in self.table():
            limits = row["note"] or f"[{figure(row['low'], '.3g')}, {figure(row['high'], '.3g')}]"
            events = "" if row["events"] is None else str(row["events"])
            rows.append((row["parameter"], figure(row["estimate"]), limits, events))
        notes = [f"{self.free_parameters} free parameters; AIC {self.aic:.6g}"]
        return ResultTable(self.headline, ("parameter", "estimate", "95 % interval", "events"), rows, notes)

    @property
    def model(self) -> RateModel:
        """The model that was fitted, with the shape of largest likelihood."""
        return self.best.model

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the fitted channels, or of the constants that they share."""
        return self.likelihood.grouping.keys

    @cached_property
    def parameters(self) -> dict[str, float]:
        """All parameters by name: `k 1+1->2`, a coefficient of a channel (nan: not measured), then the shape."""
        coefficients = {name: float(self.best.coefficients[place]) for name, place in self._places.items()}
        return coefficients | self.model.shape_values

    @cached_property
    def _places(self) -> dict[str, tuple[int, int]]:
        """Coefficient -> its term and the position of its channel."""
        return {
            f"{term} {channel}": (p, i)
            for i, channel in enumerate(self.channels)
            for p, term in enumerate(self.model.terms)
        }

    @property
    def log_likelihood(self) -> float:
        """Natural logarithm of the likelihood, with densities in events per tu."""
        return self.best.log_likelihood

    @property
    def free_parameters(self) -> int:
        """Number of coefficients that were measured and of shape parameters that were not held."""
        shape = [parameter for parameter in self.model.shape if parameter.name not in self.fixed]
        return int(np.isfinite(self.best.coefficients).sum()) + len(shape)

    @property
    def aic(self) -> float:
        """Akaike's information criterion (1974, doi:10.1109/TAC.1974.1100705).

        The smaller is the better; differences below 2 mean little.
        """
        return 2 * self.free_parameters - 2 * self.log_likelihood

    def profile(self, parameter: str, value: float) -> float:
        """Largest log-likelihood with one parameter held at a value, all others fitted anew."""
        near = self.model.shape_values
        if parameter in self._places:
            return self.likelihood.maximum(self.fixed, (*self._places[parameter], value), near).log_likelihood
        self._check_known(parameter)
        return self.likelihood.maximum(self.fixed | {parameter: value}, near=near).log_likelihood

    def interval(self, parameter: str, level: float = 0.95) -> tuple[float, float]:
        """Profile-likelihood limits: where twice the loss of log-likelihood is the quantile of chi-square (1 df).

        The level is approximate, with an error of order 1 / events; unlike a standard error the limits respect that
        parameters are not negative. They are (0, inf) for a parameter that was not measured, and end with the range of
        a shape parameter. If a channel has one term and no shape is fitted, `exact_limits` is the better choice.
        """
        if not 0 < level < 1:
            raise ValueError(f"level = {level}; expected a number between 0 and 1, such as 0.95")
        self._check_known(parameter)
        best = self.parameters[parameter]
        if np.isnan(best):
            return 0.0, float("inf")
        if parameter in self.fixed:
            return best, best
        loss = float(special.chdtri(1, 1 - level)) / 2
        if parameter in self._places:
            (p, i), low, high = self._places[parameter], 0.0, float("inf")
            evidence = self.likelihood.evidence(self.model)[i]
            step = max(best, 1 / evidence.exposure[p]) / np.sqrt(len(evidence.at_events) + 1)
        else:
            (of,) = (each for each in self.model.shape if each.name == parameter)
            return self._shape_limits(of, loss)

        def spare(value: float) -> float:
            return self._spare(parameter, value, loss)

        return _crossing(spare, best, low, -step), _crossing(spare, best, high, step)

    def _shape_limits(self, parameter: ShapeParameter, loss: float) -> tuple[float, float]:
        """Looked for among the quantiles of the prior, where a weight moves by ratios."""
        best = self.parameters[parameter.name]
        unit = parameter.unit(best)

        def at(u: float) -> float:
            return {unit: best, 0.0: parameter.low, 1.0: parameter.high}.get(u, float(parameter.value(u)))

        def spare(u: float) -> float:
            return self._spare(parameter.name, at(u), loss)

        return at(_crossing(spare, unit, 0.0, -0.01)), at(_crossing(spare, unit, 1.0, 0.01))

    def _spare(self, parameter: str, value: float, loss: float) -> float:
        """Above 0 within the interval. Bounded below, where an event becomes impossible."""
        return max(loss - (self.log_likelihood - self.profile(parameter, value)), -50.0)

    def test_against(self, smaller: RateFit) -> LikelihoodRatio:
        """Likelihood-ratio test of a special case of this model with fewer parameters, fitted to the same paths.

        The p-value is by the chi-square distribution (Wilks 1938, doi:10.1214/aoms/1177732360). For one parameter on
        the boundary of its range, such as a coefficient of 0, it is up to twice too large.
        """
        freedom = self.free_parameters - smaller.free_parameters
        if freedom < 1:
            raise ValueError(
                f"{smaller.model.name} has {smaller.free_parameters} free parameters, {self.model.name} has "
                f"{self.free_parameters}; expected the smaller model"
            )
        mine, other = self.likelihood, smaller.likelihood
        if mine.grouping.keys != other.grouping.keys or [*map(id, mine.paths)] != [*map(id, other.paths)]:
            raise ValueError("the two models were fitted to other paths or channels; fit both to the same ones")
        statistic = max(2 * (self.log_likelihood - smaller.log_likelihood), 0.0)
        return LikelihoodRatio(statistic, freedom, float(special.chdtrc(freedom, statistic)))

    def score(self, paths: Iterable[JumpPath]) -> float:
        """Log-likelihood of other paths, such as held-out ones, at these estimates; -inf if impossible."""
        others = PathLikelihood(self.model, tuple(paths), self.likelihood.grouping)
        return others.value(self.best.coefficients)

    def integrated_hazards(self, path: JumpPath) -> Floats:
        """Expected events (E + 1, R') of each fitted channel in each stretch of a path."""
        begin, end, origin = sojourns(path)
        waits = self.model.elapsed(begin, end, origin)
        terms = self.model.in_terms(path)
        chosen = list(self.likelihood.channels)
        known = np.nan_to_num(self.best.coefficients) * (path.network.ways * path.open_channels)[chosen]
        return np.asarray(waits[:, None] * sum(k * h[:, chosen] for k, h in zip(known, terms, strict=True)))

    def table(self, level: float = 0.95) -> list[dict[str, Any]]:
        """One row per parameter: estimate, profile-likelihood limits, and the events of a coefficient's channel."""
        evidence = self.likelihood.evidence(self.model)
        rows = []
        for name, value in self.parameters.items():
            low, high = self.interval(name, level)
            place = self._places.get(name)
            events = None if place is None else len(evidence[place[1]].at_events)
            note = "held" if name in self.fixed else "not measured" if np.isnan(value) else ""
            rows.append(
                {"parameter": name, "events": events, "estimate": value, "low": low, "high": high, "note": note}
            )
        return rows

    @on_axes
    def plot(self, ax: Axes, level: float = 0.95) -> Axes:
        """Forest plot of the coefficients, the shape in the title; returns `ax`."""
        rows = self.table(level)
        coefficients = [row for row in rows if row["parameter"] in self._places]
        shape = [f"{row['parameter']} = {row['estimate']:.3g}" for row in rows if row not in coefficients]
        limited = plots.Limited(*([row[key] for row in coefficients] for key in ("estimate", "low", "high")))
        sets = {f"estimate, {100 * level:g} % interval": limited}
        plots.forest(ax, [row["parameter"] for row in coefficients], sets, "coefficient")
        ax.set_title(", ".join([self.model.name, *shape]))
        return ax

    def _check_known(self, parameter: str) -> None:
        if parameter not in self.parameters:
            raise ValueError(f"unknown parameter {parameter!r}; {self.model.name} has {', '.join(self.parameters)}")


def fit_rates(
    model: RateModel,
    paths: Iterable[JumpPath],
    channels: Sequence[str] | None = None,
    fixed: Mapping[str, float] | None = None,
) -> RateFit:
    """Fit a model of rates by maximum likelihood to runs of one network.

    paths : one per run, from any initial states, restarted or not, with any channels closed
    channels : channels to fit, such as the breaks, so that they have a shape of their own; None: all
    fixed : shape parameters to hold, by name
    ValueError: no runs, an unknown channel or parameter, or (`ImpossibleEventError`) an event that the model excludes

    Cost: one pass over the runs, or where the shape does more than weight parts, one at each step of its search.

    >>> from calibration import MassActionRates, fit_rates
    >>> from kinetics import Network, sample_path
    >>> turnover = Network.from_text("0 <-> A, 5, 1")
    >>> fit = fit_rates(MassActionRates(), [sample_path(turnover, {"A": 0}, end=100.0, seed=1)])
    >>> [low < true < high for true, (low, high) in zip((5, 1), map(fit.interval, fit.parameters))]
    [True, True]
    """
    runs = tuple(paths)
    if not runs:
        raise ValueError("no runs to fit; give at least one path")
    names = runs[0].network.channels
    chosen = tuple(names if channels is None else channels)
    for name in chosen:
        if name not in names:
            raise ValueError(f"unknown channel {name!r}; channels are {', '.join(names)}")
    if not chosen or len(set(chosen)) < len(chosen):
        raise ValueError(f"channels = {list(chosen)}; expected one or more, each once")
    ranges = {parameter.name: parameter for parameter in model.shape}
    for name, value in (fixed or {}).items():
        if name not in ranges:
            raise ValueError(f"unknown shape parameter {name!r}; {model.name} has {', '.join(ranges) or 'none'}")
        if not ranges[name].low <= value <= ranges[name].high:
            raise ValueError(f"{name} = {value}; expected {ranges[name].low:g} to {ranges[name].high:g}")
    likelihood = PathLikelihood(model, runs, Grouping.by_channel(runs[0].network, chosen))
    best = likelihood.maximum(fixed)
    if not np.isfinite(best.log_likelihood):
        raise ImpossibleEventError(f"an event happened that {model.name} calls impossible; take another model of rates")
    return RateFit(likelihood, dict(fixed or {}), best)


def compare_fits(fits: Sequence[RateFit]) -> list[dict[str, Any]]:
    """One row per fit to the same paths: parameters, likelihood, AIC, and its excess over the smallest AIC.

    ValueError: no fits

    >>> from calibration import MassActionRates, Weibull, compare_fits, fit_rates
    >>> from kinetics import JumpPath, Network
    >>> decay = Network.from_text("decay: A -> 0, 1")
    >>> paths = [JumpPath(decay, {"A": 1}, [wait], [0], end=wait) for wait in (0.9, 1.0, 1.1)]
    >>> rows = compare_fits([fit_rates(model, paths) for model in (MassActionRates(), Weibull())])
    >>> [(row["model"], row["free_parameters"], round(row["aic_above_least"], 2)) for row in rows]
    [('mass-action', 1, 7.19), ('weibull', 2, 0.0)]
    """
    if not fits:
        raise ValueError("no fits to compare; give at least one")
    least = min(fit.aic for fit in fits)
    return [
        {
            "model": fit.model.name,
            "free_parameters": fit.free_parameters,
            "log_likelihood": fit.log_likelihood,
            "aic": fit.aic,
            "aic_above_least": fit.aic - least,
        }
        for fit in fits
    ]


def can_hold(events: ArrayLike, shape: int) -> bool:
    """Whether events (K,) of K constants outnumber what is fitted to them.

    These are the constants of which any event was seen, and `shape` parameters. Where they are as many, every model
    fits, and an AIC compares nothing.

    >>> from calibration.estimating.rate_fit import can_hold
    >>> can_hold([0, 0], 0), can_hold([2, 0], 1), can_hold([3, 0], 1)
    (False, False, True)
    """
    seen = np.asarray(events)
    return bool(seen.sum() > np.count_nonzero(seen) + shape)


def simplest(fits: Sequence[Fit]) -> Fit:
    """The fit with the fewest parameters whose AIC is within 2 of the smallest; of two alike, the smaller AIC.

    ImpossibleEventError: every fit calls something impossible that was seen.
    """
    possible = [fit for fit in fits if np.isfinite(fit.aic)]
    if not possible:
        raise ImpossibleEventError("an event happened that every break model calls impossible; take another one")
    least = min(fit.aic for fit in possible)
    return min((fit for fit in possible if fit.aic <= least + CLOSE), key=lambda fit: (fit.free_parameters, fit.aic))


def _crossing(spare: Callable[[float], float], best: float, bound: float, step: float) -> float:
    """The zero of `spare`, which is above 0 at `best`, on the way to `bound`; `bound` if there is none."""
    inside = best
    while inside != bound:
        outside = best + step
        if (outside - bound) * step >= 0:
            outside = bound
        if spare(outside) < 0:
            return float(optimize.brentq(spare, inside, outside, xtol=1e-9 * abs(outside - inside), rtol=1e-9))
        inside, step = outside, 2 * step
    return bound
