"""Parameters of a model from panel data, by maximum likelihood."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calibration.estimating.likelihood_fit import ParameterFit, fit_parameters
from kinetics.markov.panels import PanelData, PanelLikelihood
from kinetics.network import Model, Network
from kinetics.network.checks import some_names
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats
from kinetics.support.tables import text_table


@dataclass(frozen=True, eq=False)
class PanelFit:
    """Estimates from panel data, ready to be shown and used.

    fit : estimates, intervals and notes
    log_likelihood : at the estimates, with its bounds
    fixed : what was held, by name
    model : the model at the estimates
    data : which were fitted
    """

    fit: ParameterFit
    log_likelihood: Answer
    fixed: Mapping[str, float]
    model: Model
    data: PanelData

    @property
    def aic(self) -> float:
        """Akaike's criterion: twice the number of free parameters, less twice the log-likelihood."""
        return 2.0 * len(self.fit.names) - 2.0 * self.log_likelihood.value

    def __str__(self) -> str:
        rows = [
            (name, *(f"{each[p]:.6g}" for each in (self.fit.value, self.fit.low, self.fit.high)))
            for p, name in enumerate(self.fit.names)
        ]
        table = text_table(["parameter", "estimate", "95 % from", "to"], rows)
        return "\n".join([table, f"log-likelihood {self.log_likelihood}; AIC {self.aic:.6g}", *self.fit.notes])


def fit_panel(
    model: Model | Network,
    data: PanelData,
    free: Sequence[str] | None = None,
    *,
    fixed: Mapping[str, float] | None = None,
    starts: int = 3,
    seed: int = 0,
) -> PanelFit:
    """The parameters of largest likelihood, with 95 % profile-likelihood intervals.

    free : names of parameters, of channels (for their rate constants) or of columns (for the parameter of their
        observation); None: all parameters of the network, or, where it has none, all channels
    fixed : parameters that are held at other values than the model's
    starts, seed : how many times the search begins, and the seed that scatters the later beginnings

    Cost: some thirty values of the likelihood for each start, and some ten for each end of an interval.
    ValueError: unknown names, a start that is not above 0, or data that cannot be

    >>> from calibration.estimating.panel_fit import fit_panel
    >>> from kinetics import Network
    >>> from kinetics.markov.panels import PanelData, PanelRun
    >>> decay = Network.from_text("A -> B, k", k=1)
    >>> fit = fit_panel(decay, PanelData({"A": {"A": 1}}, [PanelRun([100, 0], [2.0], [[37]])])).fit
    >>> fit.value.round(5).tolist(), fit.low.round(3).tolist(), fit.high.round(3).tolist()  # -ln(.37) / 2
    ([0.49713], [0.381], [0.637])
    """
    whole = Model.of(model)
    held = dict(fixed or {})
    if held:
        whole = whole.at({name: value for name, value in held.items() if name not in data.observations})
        data = data.with_observed(**{name: value for name, value in held.items() if name in data.observations})
    network = whole.network
    known: dict[str, float] = dict(network.parameters)
    if not known or free is not None:
        known |= dict(zip(network.channels, network.known_rates.tolist(), strict=True))
    seen = {name: each.parameter for name, each in data.observations.items() if each.parameter is not None}
    names = [name for name in known if name not in held] if free is None else list(free)
    values = {**known, **seen}
    for name in names:
        if name not in values:
            raise ValueError(f"unknown parameter {name!r}; expected one of {some_names(list(values))}")
        if name in held:
            raise ValueError(f"{name} is both free and fixed; leave one out")
        if not 0.0 < values[name] < np.inf:
            raise ValueError(f"{name} = {values[name]:g}; a free parameter starts above 0: set it, or fix it")
    if not names:
        raise ValueError("nothing is free: every parameter is fixed")
    asked = PanelLikelihood(whole, data)

    def scored(logs: Floats) -> tuple[float, Floats]:
        found = asked.scored(dict(zip(names, np.exp(logs).tolist(), strict=True)), names)
        return found.answer.value, found.gradient

    begin = np.array([values[name] for name in names])
    most = np.array([data.observations[name].most if name in seen else np.inf for name in names])
    fit = fit_parameters(scored, names, begin, most=most, starts=starts, seed=seed)
    best = dict(zip(names, fit.value.tolist(), strict=True))
    at = {name: values[name] if np.isnan(value) else value for name, value in best.items()}
    model_at = whole.at({name: value for name, value in at.items() if name not in seen})
    return PanelFit(fit, asked.value(at), held, model_at, data)
