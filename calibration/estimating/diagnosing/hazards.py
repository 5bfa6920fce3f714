"""The hazards by which diagnostics judge runs: those of mass action, of a fitted model, or of rates in use.

Each is known up to a factor a channel. A channel to which the model gives no rate, having seen no event, keeps its
shape: only its size is unknown, and the tests do not use it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from calibration.estimating.exposure import Sojourns, require_same
from calibration.estimating.rate_fit import RateFit
from kinetics.network import Network, Tank
from kinetics.rates import Rates
from kinetics.runs import JumpPath
from kinetics.support.arrays import Floats

Hazard = Callable[[JumpPath], Floats]
Elapsed = Callable[[Floats, Floats], Floats]


def hazard_of(fit: RateFit | Rates | None, network: Network, tank: Tank | None) -> Hazard:
    """The hazard (E + 1, R) of each channel in each state of a path, per unit of what `elapsed_of` integrates.

    fit : a model fitted to all channels or some, of which the others follow mass action; rates; or None for mass action
    tank : in which rates are taken to hold that do not state one; in others bodies meet as the volumes say
    """
    if isinstance(fit, Rates):
        return _of_rates(fit, network, tank)
    mass_action = _of_mass_action(network, tank)
    return mass_action if fit is None else _of_fit(fit, network, mass_action)


def elapsed_of(fit: RateFit | Rates | None, stretches: Sojourns, network: Network) -> Elapsed:
    """The integral of the model's speed between two moments of each stretch, (E + 1, 1) or (E + 1, R)."""
    if not isinstance(fit, RateFit):
        return lambda begin, end: (end - begin)[:, None]
    model, chosen = fit.model, _fitted(fit, network)
    return lambda begin, end: np.where(
        chosen, model.elapsed(begin, end, stretches.origin)[:, None], (end - begin)[:, None]
    )


def _of_mass_action(network: Network, tank: Tank | None) -> Hazard:
    needed = network.sparse_reactants
    order = np.bincount(needed.rows, needed.copies, minlength=len(network.channels))

    def hazard(path: JumpPath) -> Floats:
        h = np.asarray(network.ways * network.combinations_of(path.states))
        if path.tank == tank:
            return h
        if tank is None or path.tank is None:
            raise ValueError("some runs state their tank and others do not; state it for all of them, or for none")
        return np.asarray(h * tank.dilution(path.tank) ** (order - 1))

    return hazard


def _of_rates(rates: Rates, network: Network, tank: Tank | None) -> Hazard:
    """The hazards of channels; those by which one structure breaks are summed if breaks have partners."""
    expansion = rates.expansion(network)
    known = expansion.base.known_rates
    constants = expansion.constants(np.where(known > 0, known, 1.0), rates.breaks.weights(expansion.base))
    rates_here = expansion.network.ways * constants

    def hazard(path: JumpPath) -> Floats:
        scales = expansion.scales(rates.measured_in or tank, path.tank)
        crowded = rates.crowded(expansion, path.tank or tank).network
        each = crowded.combinations_of(path.states) * rates_here * scales
        found = np.zeros((len(each), len(network.channels)))
        np.add.at(found.T, expansion.base_of, each.T)
        return found

    return hazard


def _of_fit(fit: RateFit, network: Network, others: Hazard) -> Hazard:
    coefficients = np.nan_to_num(fit.best.coefficients)
    if len(coefficients) == 1:
        coefficients = np.where(coefficients > 0, coefficients, 1.0)
    is_known = coefficients.any(axis=0)  # of several terms the shape is unknown too: mass action
    places = np.flatnonzero(_fitted(fit, network))[is_known]

    def hazard(path: JumpPath) -> Floats:
        found = others(path)
        terms = np.array(fit.model.in_terms(path))[:, :, places]
        found[:, places] = network.ways[places] * np.einsum("pr,per->er", coefficients[:, is_known], terms)
        return found

    return hazard


def _fitted(fit: RateFit, network: Network) -> NDArray[np.bool_]:
    """Which channels (R,) a fit holds, in the network's order."""
    require_same(network, fit.likelihood.paths[0].network)
    chosen = np.zeros(len(network.channels), bool)
    chosen[list(fit.likelihood.channels)] = True
    return chosen
