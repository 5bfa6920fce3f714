"""What data of others say of the parameters of a model, ready to be saved and shown."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from calibration.estimating.model_fit import Compared, ModelFit
from calibration.estimating.posterior_sampling import about
from kinetics.markov.panels import Likelihood
from kinetics.rates import FittedParameters, PosteriorDraws
from kinetics.rates.fitted import FittedParameter
from kinetics.support.limits import bytes_in
from kinetics.support.tables import counted, in_unit, text_table

MOST_NUMBERS = 4000  # of draws in a file of rates, which holds 64 KB at most


@dataclass(frozen=True, eq=False)
class FittedStudy:
    """A fit with where its data come from.

    source, table : names of the files of the model and of the data
    kind : of the data: events, counts or snapshots
    sampled : draws from the posterior; None if none were asked for
    compared : other models of the same data
    """

    source: str
    kind: str
    table: str
    found: ModelFit
    sampled: PosteriorDraws | None = None
    compared: Sequence[Compared] = ()

    @property
    def evidence(self) -> dict[str, Any]:
        """Where the estimates come from."""
        return {
            "network": Path(self.source).name,
            f"{self.kind}_file": Path(self.table).name,
            "table_sha256": hashlib.sha256(bytes_in(Path(self.table))).hexdigest(),
            **self.found.likelihood.size,
            "versions": {name: version(name) for name in ("wellmixed", "numpy", "scipy")},
        }

    @property
    def draws(self) -> PosteriorDraws | None:
        """Draws from the posterior, sampled or from the normal distribution on logarithms; None if there are none."""
        return self.rates.draws if self.sampled is None else self.sampled

    @property
    def notes(self) -> tuple[str, ...]:
        """What to know about the estimates."""
        drawn = about(self.sampled) if self.sampled is not None else ""
        return (*self.found.fit.notes, *([drawn] if drawn else []))

    @cached_property
    def rates(self) -> FittedParameters:
        """Estimates, draws and evidence, ready to be saved."""
        fit, answer = self.found.fit, self.found.log_likelihood
        bounds = {key: getattr(answer, key) for key in ("value", "low", "high", "is_bound")}
        estimates = {name: FittedParameter(**row) for name, row in fit.to_dict().items()}
        is_told = fit.covariance is not None and not np.isnan(fit.value).any()
        return FittedParameters(
            parameters=estimates,
            fixed=dict(self.found.fixed),
            observed=tuple(name for name in self.found.likelihood.observed if name in (*fit.names, *self.found.fixed)),
            posterior_draws=None if self.sampled is None else self.sampled.thinned(MOST_NUMBERS // len(fit.names)),
            log_likelihood=bounds,
            aic=self.found.aic,
            covariance_of_logarithms=None if not is_told else fit.covariance.tolist(),  # type: ignore[union-attr]
            notes=self.notes,
            evaluations=fit.evaluations,
            evidence=self.evidence,
        )

    def to_dict(self) -> dict[str, Any]:
        """Parameters, log-likelihood, models and evidence, ready for JSON; draws stand in the file."""
        drawn = self.draws
        told = None if drawn is None else drawn.as_dict(without=("draws",)) | {"size": len(drawn.draws)}
        return self.rates.as_dict(without=("posterior_draws",)) | {
            "parameters": self.found.fit.to_dict(),
            "posterior": told,
            "models": [asdict(each) for each in self.compared],
        }

    def __str__(self) -> str:
        head = f"{Path(self.source).name} from {said_of(self.found.likelihood)}"
        lines = [head, str(self.found)]
        if self.compared:
            lines.append(f"\n{models_table(self.compared)}")
        return "\n".join([*lines, *self.notes[len(self.found.fit.notes) :]])


def said_of(likelihood: Likelihood) -> str:
    """How much was seen, and for how long, as text."""
    size = likelihood.size
    seen = counted(size["looks"], "look") if "looks" in size else counted(size["events"], "event")
    longest = in_unit(f"{likelihood.longest:g}", likelihood.model.network.time_unit)
    groups = f" in {len(likelihood.groups)} groups" if len(likelihood.groups) > 1 else ""
    return f"{seen} at {counted(size['runs'], 'run')}{groups}, up to {longest} each"


def models_table(compared: Sequence[Compared]) -> str:
    """The models of the same data as a table."""
    rows = [
        (
            each.name,
            str(each.n_free),
            f"{each.log_likelihood:.6g}",
            f"{each.aic_above_least:.3g}",
            "" if each.p_ratio is None else f"{each.p_ratio:.2g}",
        )
        for each in compared
    ]
    return text_table(["model", "free", "log-likelihood", "AIC above the least", "p of the ratio test"], rows)
