"""Break models fitted to the same runs, compared, and the choice that the data make."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from calibration.estimating.break_fit import (
    admits,
    break_channels,
    breaks_seen,
    can_be_compared,
    deviance,
    fit_breaks,
    log_score,
    rates_of_fit,
)
from calibration.estimating.double_breaks import DoubleBreaks, double_breaks
from calibration.estimating.estimate import Calibration
from calibration.estimating.exposure import Crowd
from calibration.estimating.rate_fit import (
    CLOSE,
    ImpossibleEventError,
    LikelihoodRatio,
    RateFit,
    compare_fits,
    simplest,
)
from kinetics.rates.breaks import ALONE, BREAK_MODELS, BreakModel, break_model
from kinetics.runs import JumpPath
from kinetics.support.cli.progress import stage
from kinetics.support.shown import ResultTable, Shown
from kinetics.support.tables import counted

if TYPE_CHECKING:
    from kinetics.rates import CrowdingTerms, Rates

FOLDS = 5


@dataclass(frozen=True, eq=False, repr=False)
class BreakComparison(Shown):
    """Break models fitted to the same runs.

    The breaks alone say whether others break a structure: all models are compared by their likelihood (`fits`). Where
    the runs name the partner of each break, the models with partners are compared by the likelihood of who broke what
    (`fits_by_partner`), and the chosen one's rates come from that fit.

    fits : in the order of `BREAK_MODELS`
    fits_by_partner : those of them that call no break impossible that was seen; none if no partners were recorded
    within : tu, longest time between the two breaks of one collision; None if the runs do not resolve it

    >>> from dataclasses import replace
    >>> from calibration import BreakComparison
    >>> from kinetics import Network, sample_path
    >>> pairs = replace(Network.from_text("2 A <-> AA, 0.01, 0.1"), conserved={"cubes": [1, 2]})
    >>> paths = [sample_path(pairs, {"A": 10 + 10 * (run % 3)}, end=50.0, seed=1, run=run) for run in range(12)]
    >>> compared = BreakComparison.of(paths)
    >>> [fit.model.name for fit in compared.fits], compared.chosen.model.name
    (['first-order', 'collision', 'collision-wall', 'collision-species'], 'first-order')
    """

    fits: tuple[RateFit, ...]
    fits_by_partner: tuple[RateFit, ...] = ()
    within: float | None = None

    @classmethod
    def of(
        cls,
        paths: Iterable[JumpPath],
        models: Sequence[BreakModel] = BREAK_MODELS,
        within: float | None = None,
        crowd: Crowd | None = None,
    ) -> BreakComparison:
        """Fit all models that the network admits and the breaks can tell apart, with the factors of the crowd on all.

        Models with more parameters than breaks were seen are left out; see `can_be_compared`.
        """
        stage("fitting break models")
        runs = tuple(paths)
        held = [model for model in models if can_be_compared(model, runs)]
        fits = tuple(fit_breaks(model, runs, crowd=crowd) for model in held)
        return cls(fits, tuple(_fits_by_partner(held, runs, crowd)), within)

    @classmethod
    def asked_for(
        cls, name: str, paths: Iterable[JumpPath], within: float | None = None, crowd: Crowd | None = None
    ) -> BreakComparison | None:
        """Fit one break model, or all of them for `auto`; None if nothing breaks.

        For `auto` also None if no break was seen, or too few to compare models: breaks are then of first order, as
        counted. ValueError: an unknown model, or one that this network does not admit.
        """
        runs = tuple(paths)
        if not break_channels(runs[0].network):
            return None
        if name == "auto":
            admitted = [model for model in BREAK_MODELS if admits(model, runs[0].network)]
            held = [model for model in admitted if can_be_compared(model, runs)]
            is_open = not breaks_seen(runs).any() or len(held) < min(2, len(admitted))
            return None if is_open else cls.of(runs, within=within, crowd=crowd)
        model = break_model(name)
        return cls((fit_breaks(model, runs, crowd=crowd),), tuple(_fits_by_partner([model], runs, crowd)), within)

    @property
    def headline(self) -> str:
        """Which models were fitted to how many channels."""
        return f"break models {', '.join(fit.model.name for fit in self.fits)}, fitted to the same runs"

    def summary(self) -> ResultTable:
        """One row a model; the choice below."""
        rows = [
            (row["model"], str(row["free_parameters"]), f"{row['log_likelihood']:.6g}", f"{row['aic_above_least']:.3g}")
            for row in compare_fits(self.fits)
        ]
        titles = ("break model", "free parameters", "log-likelihood", "AIC above the smallest")
        return ResultTable(self.headline, titles, rows, [f"chosen: {self.chosen.model.name}"])

    def __getitem__(self, name: str) -> RateFit:
        for fit in self.fits:
            if fit.model.name == name:
                return fit
        raise ValueError(f"no fit of break model {name!r}; there are {', '.join(fit.model.name for fit in self.fits)}")

    @cached_property
    def chosen(self) -> RateFit:
        """The fit with the fewest parameters whose AIC is within 2 of the smallest; of two alike, the smaller AIC.

        Where partners were recorded and the breaks alone ask for a model that has some, the choice among those is by
        who broke what.
        """
        chosen = simplest(self.fits)
        return simplest(self.fits_by_partner) if self._asks_for_partners(chosen) else chosen

    def _asks_for_partners(self, chosen: RateFit) -> bool:
        named = {fit.model.name for fit in self.fits_by_partner}
        return bool(named) and ALONE not in break_model(chosen.model.name).partners(chosen.likelihood.paths[0].network)

    @property
    def reason(self) -> str:
        """Why that one was chosen, in a sentence."""
        first = simplest(self.fits)
        if not self._asks_for_partners(first):
            return _why(first, self.fits)
        by_partner = _why(self.chosen, self.fits_by_partner, "allows all that was seen")
        return f"{_why(first, self.fits)}; by who broke what, {by_partner}"

    def ratio(self, fit: RateFit) -> LikelihoodRatio | None:
        """Likelihood-ratio test of a fit against the model that it extends; None if there is none here."""
        nested = getattr(fit.model, "breaks").nested  # noqa: B009 - only fits of break models are held here
        known = {each.model.name: each for each in self.fits}
        return fit.test_against(known[nested]) if nested in known else None

    @cached_property
    def scores(self) -> dict[str, float]:
        """Log score of each model on runs left out, a fifth of the runs at a time; the larger is the better."""
        runs = range(len(self.fits[0].likelihood.paths))
        if len(runs) < FOLDS:
            return {fit.model.name: float("nan") for fit in self.fits}
        return {fit.model.name: sum(_score_of_fold(fit, fold) for fold in range(FOLDS)) for fit in self.fits}

    @cached_property
    def doubles(self) -> DoubleBreaks | None:
        """Breaks that came in pairs, beside what the chosen model gives by chance; None without `within`."""
        if self.within is None:
            return None
        fit = self[self.chosen.model.name]
        return double_breaks(fit, fit.likelihood.paths, self.within)

    def to_dict(self) -> dict[str, Any]:
        """The name of the chosen model, the reason, the table, and the breaks that came in pairs, ready for JSON."""
        return {
            "chosen": self.chosen.model.name,
            "reason": self.reason,
            "models": self.table(),
            "double_breaks": None if self.doubles is None else self.doubles.to_dict(),
        }

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


def _fits_by_partner(models: Sequence[BreakModel], runs: Sequence[JumpPath], crowd: Crowd | None) -> list[RateFit]:
    """Fits to who broke what, of the models that have partners and call nothing impossible that was seen."""
    if any(run.partners is None for run in runs):
        return []
    found = []
    for model in models:
        if ALONE not in model.partners(runs[0].network):
            with contextlib.suppress(ImpossibleEventError):
                found.append(fit_breaks(model, runs, by_partner=True, crowd=crowd))
    return found


def _why(chosen: RateFit, fits: Sequence[RateFit], alone: str = "was fitted") -> str:
    """Why that one of these, in a sentence; `alone` says what sets it apart where it is the only one."""
    best = min(fits, key=lambda fit: fit.aic)
    others = sorted((fit for fit in fits if fit is not chosen), key=lambda fit: fit.aic)
    if not others:
        return f"{chosen.model.name} is the only break model that {alone}"
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
    rest = fit.likelihood.subset([i for i in numbers if i % FOLDS != fold])
    refit = RateFit(rest, fit.fixed, rest.maximum(fit.fixed, near=fit.model.shape_values))
    return log_score(refit, fit.likelihood.subset([i for i in numbers if i % FOLDS == fold]))


def too_few(breaks: int) -> str:
    """Why no break model was chosen, in words: there were no breaks, or too few."""
    if not breaks:
        return "no breaks were seen: each rate is an upper limit (95 %)"
    return f"{counted(breaks, 'break')} {'was' if breaks == 1 else 'were'} seen, too few to compare break models"


def shape_in_words(shape: Mapping[str, Mapping[str, Any]]) -> str:
    """The shape parameters of a row of the table, with their intervals."""
    parts = [
        f"{name} {value['estimate']:.3g} [{value['interval'][0]:.3g}, {value['interval'][1]:.3g}]"
        for name, value in shape.items()
    ]
    return "; ".join(parts) or "none"


def rates_with_breaks(
    calibration: Calibration,
    compared: BreakComparison | None,
    evidence: Mapping[str, Any] | None = None,
    crowding: CrowdingTerms | None = None,
) -> Rates:
    """The rates of joins as measured, and of breaks by the chosen break model, fitted to the same runs.

    compared : break models, of which the evidence states the choice; None: breaks are of first order, as counted
    crowding : under which all were measured; None for mass action
    """
    if compared is None:
        return calibration.rates(evidence).replace(crowding=crowding)
    return rates_of_fit(calibration, compared.chosen, {"break_model": compared.reason} | dict(evidence or {}), crowding)
