"""Fits of break models to runs, their comparison, and the choice that the data make."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from calibration.estimating.break_rates import BreakRates
from calibration.estimating.estimate import Calibration
from calibration.estimating.likelihood import PathLikelihood
from calibration.estimating.rate_fit import ImpossibleEventError, LikelihoodRatio, RateFit, fit_rates
from calibration.estimating.shape_posterior import shape_posterior
from kinetics.breaks import ALONE, BREAK_MODELS, BreakModel, break_model, is_break
from kinetics.network import Network
from kinetics.runs import JumpPath

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kinetics.rates import Rates

FOLDS = 5
CLOSE = 2.0  # of AIC: within it of the smallest, the model with the fewest parameters is taken


def break_channels(network: Network) -> tuple[str, ...]:
    """The channels by which structures break."""
    return tuple(np.array(network.channels, dtype=object)[is_break(network)])


def fit_breaks(
    law: BreakModel,
    paths: Iterable[JumpPath],
    fixed: Mapping[str, float] | None = None,
    by_partner: bool = False,
) -> RateFit:
    """Fit a break model by maximum likelihood to all breaks of runs of one network, in the tank of the first run.

    fixed : shape parameters to hold, by name
    by_partner : whether the likelihood is that of who broke what, where the runs name the partner, which says far more
        of the weights; such a likelihood can be compared only among models that have partners

    Cost: one pass over the runs, then milliseconds.
    """
    runs = tuple(paths)
    if not runs:
        raise ValueError("no runs to fit; give at least one path")
    network = runs[0].network
    channels = break_channels(network)
    if not channels:
        raise ValueError("no channel of this network is a break, so that there is no break model to fit")
    if len({run.tank is None for run in runs}) > 1:
        raise ValueError("some runs state their tank and others do not; state it for all of them, or for none")
    return fit_rates(BreakRates.of(law, network, runs[0].tank, by_partner), runs, channels, fixed)


def log_score(fit: RateFit, others: PathLikelihood) -> float:
    """Log-likelihood of the breaks of held-out runs under rates from a fit to other runs.

    The coefficients are the posterior means under Jeffreys' prior, (events + 1/2) / exposure, because a largest
    likelihood of 0 would call every break of a channel impossible that the fit has not seen. -inf where a break
    happened to which the fit had no exposure.
    """
    seen = fit.likelihood.evidence(fit.model)
    means = [(len(e.at_events) + 0.5) / e.exposure[0] if e.exposure[0] > 0 else np.nan for e in seen]
    held_out = others.evidence(fit.model)
    return sum(e.log_likelihood(np.array([mean])) for e, mean in zip(held_out, means, strict=True))


@dataclass(frozen=True, eq=False)
class BreakComparison:
    """Break models fitted to the same runs.

    The breaks alone say whether others break a structure: all models are compared by their likelihood (`fits`). Where
    the runs name the partner of each break, the models with partners are compared by the likelihood of who broke what
    (`fits_by_partner`), and the chosen one's rates come from that fit.

    fits : in the order of `BREAK_MODELS`
    fits_by_partner : the same without those that call a break impossible that was seen; none where nobody watched
    """

    fits: tuple[RateFit, ...]
    fits_by_partner: tuple[RateFit, ...] = ()

    @classmethod
    def of(cls, paths: Iterable[JumpPath], models: Sequence[BreakModel] = BREAK_MODELS) -> BreakComparison:
        """Fit all models that the network admits."""
        runs = tuple(paths)
        admitted = [law for law in models if admits(law, runs[0].network)]
        return cls(tuple(fit_breaks(law, runs) for law in admitted), tuple(_fits_by_partner(admitted, runs)))

    @classmethod
    def asked_for(cls, name: str, paths: Iterable[JumpPath]) -> BreakComparison | None:
        """Fit one break model, or all of them for `auto`; None where nothing breaks.

        ValueError: an unknown model, or one that this network does not admit.
        """
        runs = tuple(paths)
        if not break_channels(runs[0].network):
            return None
        if name == "auto":
            return cls.of(runs)
        law = break_model(name)
        return cls((fit_breaks(law, runs),), tuple(_fits_by_partner([law], runs)))

    def __getitem__(self, name: str) -> RateFit:
        for fit in self.fits:
            if fit.model.name == name:
                return fit
        raise ValueError(f"no fit of break model {name!r}; there are {', '.join(fit.model.name for fit in self.fits)}")

    @cached_property
    def chosen(self) -> RateFit:
        """The fit with the fewest parameters whose AIC is within 2 of the smallest; of two alike, the smaller AIC.

        Where partners were watched and the breaks alone ask for a model that has some, the choice among those is by
        who broke what.
        """
        chosen = _simplest(self.fits)
        return _simplest(self.fits_by_partner) if self._asks_for_partners(chosen) else chosen

    def _asks_for_partners(self, chosen: RateFit) -> bool:
        laws = {fit.model.name for fit in self.fits_by_partner}
        return bool(laws) and ALONE not in break_model(chosen.model.name).partners(chosen.likelihood.paths[0].network)

    @property
    def reason(self) -> str:
        """Why that one was chosen, in a sentence."""
        first = _simplest(self.fits)
        if not self._asks_for_partners(first):
            return _why(first, self.fits)
        return f"{_why(first, self.fits)}; by who broke what, {_why(self.chosen, self.fits_by_partner)}"

    def ratio(self, fit: RateFit) -> LikelihoodRatio | None:
        """Likelihood-ratio test of a fit against the model that it extends; None where there is none here."""
        nested = getattr(fit.model, "law").nested  # noqa: B009 - only fits of break models are held here
        known = {each.model.name: each for each in self.fits}
        return fit.test_against(known[nested]) if nested in known else None

    @cached_property
    def scores(self) -> dict[str, float]:
        """Log score of each model on runs left out, a fifth of the runs at a time; the larger is the better."""
        runs = range(len(self.fits[0].likelihood.paths))
        if len(runs) < FOLDS:
            return {fit.model.name: float("nan") for fit in self.fits}
        return {fit.model.name: sum(_score_of_fold(fit, fold) for fold in range(FOLDS)) for fit in self.fits}

    def to_dict(self) -> dict[str, Any]:
        """The name of the chosen model, the reason, and the table, ready for JSON."""
        return {"chosen": self.chosen.model.name, "reason": self.reason, "models": self.table()}

    def table(self) -> list[dict[str, Any]]:
        """One row a model: parameters, log-likelihood, AIC above the smallest, test against the model it extends,
        log score on runs left out, deviance of the breaks by group of runs with its p-value, shape with intervals."""
        least = min(fit.aic for fit in self.fits)
        named = {fit.model.name: fit for fit in self.fits_by_partner}
        least_named = min((fit.aic for fit in named.values()), default=float("nan"))
        rows = []
        for fit in self.fits:
            ratio = self.ratio(fit)
            fits_data = deviance(fit)
            told = named.get(fit.model.name)
            shaped = fit if told is None else told
            rows.append(
                {
                    "model": fit.model.name,
                    "is_chosen": fit.model.name == self.chosen.model.name,
                    "free_parameters": fit.free_parameters,
                    "log_likelihood": fit.log_likelihood,
                    "aic_above_least": fit.aic - least,
                    "aic_by_partner": None if told is None else told.aic - least_named,
                    "p_against_nested": None if ratio is None else ratio.p_value,
                    "log_score": self.scores[fit.model.name],
                    "deviance": fits_data.statistic,
                    "freedom": fits_data.freedom,
                    "p_deviance": fits_data.p_value,
                    "shape": {
                        name: {"estimate": value, "interval": list(shaped.interval(name))}
                        for name, value in shaped.model.shape_values.items()
                    },
                }
            )
        return rows


def _fits_by_partner(laws: Sequence[BreakModel], runs: Sequence[JumpPath]) -> list[RateFit]:
    """Fits to who broke what, of the models that have partners and call nothing impossible that was seen."""
    if any(run.partners is None for run in runs):
        return []
    found = []
    for law in laws:
        if ALONE not in law.partners(runs[0].network):
            with contextlib.suppress(ImpossibleEventError):
                found.append(fit_breaks(law, runs, by_partner=True))
    return found


def _simplest(fits: Sequence[RateFit]) -> RateFit:
    """The fit with the fewest parameters whose AIC is within 2 of the smallest; of two alike, the smaller AIC."""
    least = min(fit.aic for fit in fits)
    return min((fit for fit in fits if fit.aic <= least + CLOSE), key=lambda fit: (fit.free_parameters, fit.aic))


def _why(chosen: RateFit, fits: Sequence[RateFit]) -> str:
    """Why that one of these, in a sentence."""
    best = min(fits, key=lambda fit: fit.aic)
    others = sorted((fit for fit in fits if fit is not chosen), key=lambda fit: fit.aic)
    if not others:
        return f"{chosen.model.name} is the only break model that was fitted"
    if chosen is best:
        return (
            f"{chosen.model.name} has the smallest AIC, {others[0].aic - chosen.aic:.1f} below that of "
            f"{others[0].model.name}"
        )
    return (
        f"{chosen.model.name} has the fewest parameters of the models within {CLOSE:g} of the smallest AIC: "
        f"{chosen.aic - best.aic:.1f} above {best.model.name}, which has "
        f"{best.free_parameters - chosen.free_parameters} more"
    )


def _score_of_fold(fit: RateFit, fold: int) -> float:
    """Log score on a fifth of the runs of a fit to the others."""
    numbers = range(len(fit.likelihood.paths))
    rest = fit.likelihood.among([i for i in numbers if i % FOLDS != fold])
    refit = RateFit(rest, fit.fixed, rest.maximum(fit.fixed, near=fit.model.shape_values))
    return log_score(refit, fit.likelihood.among([i for i in numbers if i % FOLDS == fold]))


def shape_in_words(shape: Mapping[str, Mapping[str, Any]]) -> str:
    """The shape parameters of a row of the table, with their intervals."""
    parts = [
        f"{name} {value['estimate']:.3g} [{value['interval'][0]:.3g}, {value['interval'][1]:.3g}]"
        for name, value in shape.items()
    ]
    return "; ".join(parts) or "none"


def admits(law: BreakModel, network: Network) -> bool:
    """Whether the model can be asked of this network: weights by size need sizes."""
    try:
        law.weights(network, {parameter.name: parameter.start for parameter in law.parameters(network)})
    except ValueError:
        return False
    return True


def deviance(fit: RateFit) -> LikelihoodRatio:
    """Breaks seen and expected by channel and group of runs alike in tank and initial counts: does one model fit all?

    The p-value is by the chi-square distribution, for which a group should expect a few breaks. A channel without any
    break fits by itself: it adds neither to the statistic nor to the degrees of freedom.
    """
    from scipy.special import chdtrc, xlogy

    groups: dict[tuple[object, ...], list[JumpPath]] = {}
    for path in fit.likelihood.paths:
        groups.setdefault((path.tank, *path.initial.tolist()), []).append(path)
    seen, expected = [], []
    chosen = list(fit.likelihood.channels)
    width = max(chosen) + 1
    for paths in groups.values():
        expected.append(sum(fit.integrated_hazards(path).sum(axis=0) for path in paths))
        seen.append(sum(np.bincount(path.channels[path.channels >= 0], minlength=width)[chosen] for path in paths))
    n, mean = np.array(seen, dtype=float), np.array(expected, dtype=float)
    possible = mean > 0
    statistic = 2 * float((xlogy(n[possible], n[possible] / mean[possible]) - n[possible] + mean[possible]).sum())
    shape = sum(parameter.name not in fit.fixed for parameter in fit.model.shape)
    freedom = int(possible.sum()) - int(possible.any(axis=0).sum()) - shape
    return LikelihoodRatio(statistic, freedom, float(chdtrc(freedom, statistic)) if freedom > 0 else float("nan"))


def rates_with_breaks(
    calibration: Calibration, compared: BreakComparison | None, evidence: Mapping[str, Any] | None = None
) -> Rates:
    """The rates of joins as measured, and of breaks by the chosen break model, fitted to the same runs.

    compared : break models, of which the evidence states the choice; None: breaks are of first order, as counted
    """
    if compared is None:
        return calibration.rates(evidence)
    return rates_of_fit(calibration, compared.chosen, dict(evidence or {}) | {"break_model": compared.reason})


def rates_of_fit(calibration: Calibration, fit: RateFit, evidence: Mapping[str, Any] | None = None) -> Rates:
    """The rates of joins as measured, and of breaks by the fit of a break model to the same runs."""
    from kinetics.rates import Rates

    plain = calibration.rates(evidence)
    model = fit.model
    if not isinstance(model, BreakRates):
        raise ValueError(f"{model.name} is no break model; give the result of `fit_breaks`")
    parts = fit.likelihood
    exposures = [evidence.exposure for evidence in parts.parts(model)]
    channels = {name: channel.model_dump(exclude_none=True) for name, channel in plain.channels.items()}
    weights = model.mixture()[0]
    for i, name in enumerate(fit.channels):
        low, high = fit.interval(f"b {name}")
        b = float(fit.best.coefficients[0, i])
        channels[name] |= {
            "rate": b,
            "low": min(low, b),
            "high": max(high, b),
            "exposure": float(weights @ exposures[i]),
            "exposures": tuple(exposures[i].tolist()),
        }
    posterior = shape_posterior(fit)
    breaks: dict[str, Any] = {"model": model.name, "shape": model.shape_values}
    if posterior is not None:
        breaks["posterior"] = posterior.model_dump()
    return Rates.model_validate(plain.model_dump(exclude_none=True) | {"channels": channels, "breaks": breaks})
