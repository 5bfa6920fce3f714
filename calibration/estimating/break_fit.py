"""Fits of one break model to runs: likelihood, score on other runs, deviance, and the rates that they give."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from calibration.estimating.break_rates import BreaksBySpecies
from calibration.estimating.estimate import Calibration, prior_of
from calibration.estimating.exposure import Crowd, require_tanks
from calibration.estimating.likelihood import PathLikelihood
from calibration.estimating.rate_fit import LikelihoodRatio, RateFit, can_hold, fit_rates
from calibration.estimating.shape_posterior import shape_posterior
from kinetics.network import Network
from kinetics.rates import CrowdingTerms, Rates
from kinetics.rates.breaks import BreakModel, is_break
from kinetics.runs import RESTART, JumpPath
from kinetics.support.arrays import Ints
from kinetics.support.intervals import exact_limits
from kinetics.support.packages import special
from kinetics.support.settings import validated

if TYPE_CHECKING:
    from collections.abc import Mapping


def break_channels(network: Network) -> tuple[str, ...]:
    """The channels by which structures break."""
    return tuple(np.array(network.channels, dtype=object)[is_break(network)])


def breaks_seen(paths: Iterable[JumpPath]) -> Ints:
    """Breaks (B,) of each channel by which structures break, over all runs of one network."""
    runs = tuple(paths)
    fired = np.concatenate([path.channels[path.channels != RESTART] for path in runs])
    return np.bincount(fired, minlength=len(runs[0].network.channels))[is_break(runs[0].network)]


def fit_breaks(
    model: BreakModel,
    paths: Iterable[JumpPath],
    fixed: Mapping[str, float] | None = None,
    by_partner: bool = False,
    crowd: Crowd | None = None,
) -> RateFit:
    """Fit a break model by maximum likelihood to all breaks of runs of one network, in the tank of the first run.

    fixed : shape parameters to hold, by name
    by_partner : whether the likelihood is that of who broke what, where the runs name the partner, which says far more
        of the weights; such a likelihood can be compared only among models that have partners
    crowd : factors on propensities in an expanded network and tank; None for mass action

    Cost: one pass over the runs, then milliseconds. ValueError: no runs, no breaks, or some runs with a tank and some
    without

    >>> from calibration import fit_breaks
    >>> from kinetics import Network, break_model, sample_path
    >>> pairs = Network.from_text("pair: 2 A <-> AA, 0.01, 0.1")
    >>> paths = [sample_path(pairs, {"A": 20}, end=50.0, seed=1, run=run) for run in range(10)]
    >>> fit = fit_breaks(break_model("first-order"), paths)
    >>> low, high = fit.interval("b pair backward")
    >>> fit.channels, low < 0.1 < high
    (('pair backward',), True)
    """
    runs = tuple(paths)
    if not runs:
        raise ValueError("no runs to fit; give at least one path")
    network = runs[0].network
    channels = break_channels(network)
    if not channels:
        raise ValueError("no channel of this network is a break, so there is no break model to fit")
    require_tanks(runs)
    return fit_rates(BreaksBySpecies.of(model, network, runs[0].tank, by_partner, crowd), runs, channels, fixed)


def admits(model: BreakModel, network: Network) -> bool:
    """Whether the model can be asked of this network: weights by size need sizes."""
    try:
        model.weights(network, {parameter.name: parameter.start for parameter in model.parameters(network)})
    except ValueError:
        return False
    return True


def can_be_compared(model: BreakModel, paths: Sequence[JumpPath]) -> bool:
    """Whether the network admits the model, and the breaks outnumber its parameters; one without shape needs none."""
    network = paths[0].network
    if not admits(model, network):
        return False
    shape = len(model.parameters(network))
    return not shape or can_hold(breaks_seen(paths), shape)


def log_score(fit: RateFit, others: PathLikelihood) -> float:
    """Log-likelihood of the breaks of held-out runs under rates from a fit to other runs.

    The coefficients are the posterior means under Jeffreys' prior, (events + 1/2) / exposure, because a largest
    likelihood of 0 would call every break of a channel impossible that the fit has not seen. -inf if a break
    happened to which the fit had no exposure.
    """
    seen = fit.likelihood.evidence(fit.model)
    means = [(len(e.at_events) + 0.5) / e.exposure[0] if e.exposure[0] > 0 else np.nan for e in seen]
    held_out = others.evidence(fit.model)
    return sum(e.log_likelihood(np.array([mean])) for e, mean in zip(held_out, means, strict=True))


def deviance(fit: RateFit) -> LikelihoodRatio:
    """Breaks seen and expected by channel and group of runs alike in tank and initial counts: does one model fit all?

    The p-value is by the chi-square distribution, for which a group should expect a few breaks. A channel without any
    break fits by itself: it adds neither to the statistic nor to the degrees of freedom. Where none are left, as for
    runs that are all alike, freedom is 0, and statistic and p-value are nan: any model would fit.
    """
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
    statistic = 2 * float(
        (special.xlogy(n[possible], n[possible] / mean[possible]) - n[possible] + mean[possible]).sum()
    )
    shape = sum(parameter.name not in fit.fixed for parameter in fit.model.shape)
    freedom = int(possible.sum()) - int(possible.any(axis=0).sum()) - shape
    if freedom < 1:
        return LikelihoodRatio(float("nan"), 0, float("nan"))
    return LikelihoodRatio(statistic, freedom, float(special.chdtrc(freedom, statistic)))


def rates_of_fit(
    calibration: Calibration,
    fit: RateFit,
    evidence: Mapping[str, Any] | None = None,
    crowding: CrowdingTerms | None = None,
) -> Rates:
    """The rates of joins as measured, and of breaks by the fit of a break model to the same runs.

    crowding : under which both were measured; None for mass action
    """
    plain = calibration.rates(evidence)
    model = fit.model
    if not isinstance(model, BreaksBySpecies):
        raise ValueError(f"{model.name} is no break model; give the result of `fit_breaks`")
    parts = fit.likelihood
    exposures = [evidence.exposure for evidence in parts.parts(model)]
    channels = {name: channel.as_dict(none=False) for name, channel in plain.channels.items()}
    weights = model.mixture()[0]
    seen, observed = np.zeros(len(plain.channels)), np.zeros(len(plain.channels))
    places = [calibration.network.channel_places[name] for name in fit.channels]
    seen[places] = calibration.total.events[places]
    observed[places] = [weights @ exposure for exposure in exposures]
    for i, name in enumerate(fit.channels):
        if observed[places[i]] <= 0:
            channels[name] |= prior_of(name, calibration.network, seen, observed)
            continue
        # without events the likelihood's limit is one of 85 %: exp(-1.92); the exact one, at this shape, is of 97.5 %
        low, high = fit.interval(f"b {name}") if seen[places[i]] else exact_limits(0, observed[places[i]])
        b = float(fit.best.coefficients[0, i])
        channels[name] |= {
            "rate": b,
            "low": min(float(low), b),
            "high": max(float(high), b),
            "exposure": float(weights @ exposures[i]),
            "exposures": tuple(exposures[i].tolist()),
        }
    posterior = shape_posterior(fit)
    breaks: dict[str, Any] = {"model": model.name, "shape": model.shape_values}
    if posterior is not None:
        breaks["posterior"] = posterior.as_dict()
    crowded = {} if crowding is None else {"crowding": crowding.as_dict(none=False)}
    content = plain.as_dict(none=False) | {"channels": channels, "breaks": breaks} | crowded
    return validated(Rates, content, "fitted rates")
