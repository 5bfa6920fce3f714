"""Paths drawn from any model of rates, and the likelihood of paths by its definition: slow, and written another way."""

from dataclasses import replace

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from calibration import RateModel
from kinetics.network import Network
from kinetics.runs import RESTART, JumpPath


def pair_network() -> Network:
    """A + A -> B, four ways, and back."""
    return Network(("A", "B"), ("join", "break"), [[2, 0], [0, 1]], [[-2, 1], [2, -1]], [4, 1])


def known_parameters(model, network, initial, rate=1.0):
    """The model with its shape a tenth of the way up from where it starts, and coefficients (P, R) under which each
    term of each channel gives the same share of `rate` in the initial state."""
    shape = {p.name: (s := getattr(model, p.name)) + 0.1 * (p.high - s) for p in model.shape}
    true = replace(model, **shape)
    h = np.array([term[0] for term in true.combinations(standing(network, initial))])
    per_unit = np.where(h > 0, h, 1.0) * network.ways
    return true, rate / (len(model.terms) * per_unit)


def standing(network, state, end=1.0):
    """A path on which nothing happens."""
    return JumpPath(network, state, [], [], end)


def drawn_path(model, coefficients, network, initial, end, rng, restarts=True, open_channels=None):
    """A path under a model: each event when the integrated propensities reach an exponential number."""
    is_open = np.ones(len(network.channels), bool) if open_channels is None else np.array(open_channels)
    now, origin, state = 0.0, 0.0, np.array(initial)
    times, channels, seen = [], [], {}
    while True:
        if tuple(state) not in seen:
            terms = model.combinations(standing(network, state))
            seen[tuple(state)] = (
                network.ways * sum(k * h[0] for k, h in zip(coefficients, terms, strict=True)) * is_open
            )
        rates, goal = seen[tuple(state)], rng.exponential()

        def left(then, goal, now, origin, total):
            return goal - total * model.elapsed(*(np.array([t]) for t in (now, then, origin)))[0]

        given = (goal, now, origin, rates.sum())
        if left(end, *given) >= 0:
            return JumpPath(network, initial, times, channels, end, is_open)
        is_steady = type(model).elapsed is RateModel.elapsed
        now = now + goal / rates.sum() if is_steady else brentq(left, now, end, args=given)
        fired = rng.choice(rates.size, p=rates / rates.sum())
        times.append(now)
        channels.append(fired)
        state = state + network.stoichiometry[fired]
        if restarts:
            times.append(now)
            channels.append(RESTART)
            state, origin = np.array(initial), now


def slow_log_likelihood(model, coefficients, paths):
    """Stretch by stretch: log propensity at each event, less the integral of all propensities by quadrature."""
    total = 0.0
    for path in paths:
        network, state, now, origin = path.network, path.initial.copy(), 0.0, 0.0
        for moment, channel in [*zip(path.times, path.channels, strict=True), (path.end, RESTART)]:
            h = [term[0] for term in model.combinations(standing(network, state))]
            rates = network.ways * sum(k * term for k, term in zip(coefficients, h, strict=True)) * path.open_channels
            speed = lambda age: model.speed(np.array([age]))[0]  # noqa: E731
            if moment > now and rates.sum() > 0:
                area = quad(speed, now - origin, moment - origin, epsabs=0, epsrel=1e-12, limit=200)[0]
                total -= rates.sum() * area
            if channel == RESTART:
                state, origin = path.initial.copy(), moment
            else:
                total += np.log(rates[channel] * speed(moment - origin)) if rates[channel] > 0 else -np.inf
                state = state + network.stoichiometry[channel]
            now = moment
    return total
