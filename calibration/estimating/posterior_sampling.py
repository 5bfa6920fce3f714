"""Draws from the posterior of fitted parameters, by emcee.

emcee (Foreman-Mackey et al. 2013, doi:10.1086/670067) is a small and well-kept package that runs many chains at once
and takes moves of one's own. Most moves here are proposed from a Student distribution around the estimates, with the
covariance of the fit: on logarithms a posterior is seldom far from normal, so most are accepted and draws hardly depend
on each other. The others are differences between two chains (ter Braak 2006, doi:10.1007/s11222-006-8769-1), which
reach what the fit does not describe.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from calibration.estimating.model_fit import ModelFit
from kinetics.network.checks import some_names
from kinetics.rates.fitted import PosteriorDraws
from kinetics.rates.inference import convergence
from kinetics.support.arrays import Floats, whole_number
from kinetics.support.cli.progress import stage
from kinetics.support.packages import extra

FREEDOM = 5.0  # of the Student distribution that proposes: its tails must be the heavier ones
PROPOSED = 0.8  # share of moves by it
FIRST = 0.2  # share of further steps, at the beginning, that are not kept
CONVERGED = 1.01  # R-hat up to which chains are called one (Vehtari et al. 2021)
UNTOLD = 1.5  # standard deviation of a logarithm of which the fit gives none


def sample_posterior(fit: ModelFit, draws: int = 1000, seed: int = 0) -> PosteriorDraws:
    """Draws from the posterior of the free parameters of a fit.

    draws : how many are kept, of all chains together; draws of one chain depend on each other a little. After Ctrl-C
        those made so far are kept, if any
    The priors are those of the fit; a parameter without one has a flat prior on its logarithm.

    Cost: some 1.2 values of the likelihood for each draw. Needs the extra `inference`.
    ValueError: a parameter that the data cannot tell and that has no prior: its posterior is no distribution

    >>> from calibration import fit_model, sample_posterior
    >>> from kinetics import Model, Network
    >>> from kinetics.markov.panels import PanelData, PanelLikelihood, PanelRun
    >>> decay = Model.of(Network.from_text("A -> B, k", k=1))
    >>> data = PanelData({"A": {"A": 1}}, [PanelRun([100, 0], [2.0], [[37]])])
    >>> drawn = sample_posterior(fit_model(PanelLikelihood(decay, data)), draws=200, seed=1)
    >>> drawn.table.shape, bool(abs(drawn.table.mean() - 0.5) < 0.03)
    ((200, 1), True)
    """
    found = fit.fit
    for p, name in enumerate(found.names):
        is_told = found.low[p] > 0.0 and np.isfinite(found.high[p])
        is_within = found.least[p] > 0.0 and np.isfinite(found.most[p])
        if not (is_told or is_within or name in fit.priors):
            raise ValueError(
                f"the data do not bound {name} on both sides, and it has no prior; give one, as in --prior "
                f"{name}=0.01:10"
            )
    emcee = extra("emcee")
    size = len(found.names)
    chains = max(8, 2 * size + 2)
    steps = -(-whole_number("draws", draws, 2) // chains)
    first = max(4, int(FIRST * steps))
    proposal = _Proposal(np.log(found.at), _scale(fit))
    moves = [
        (emcee.moves.MHMove(proposal.proposed), PROPOSED),
        (emcee.moves.DEMove(), 1.0 - PROPOSED),
    ]
    sampler = emcee.EnsembleSampler(chains, size, fit.log_posterior, moves=moves)
    rng = np.random.RandomState(whole_number("seed", seed, 0))
    begin = proposal.inside(chains, rng, fit)
    state = emcee.State(begin, random_state=rng.get_state())
    done = 0
    try:
        for _ in sampler.sample(state, iterations=first + steps):
            done += 1
            stage(f"draw {done * chains} of {(first + steps) * chains} from the posterior", done / (first + steps))
    except KeyboardInterrupt:
        if done <= first:
            raise
    kept = sampler.get_chain()[first:done]  # (steps, chains, P)
    table = np.exp(kept.reshape(-1, size)[:draws])
    r_hat, effective = convergence(np.swapaxes(kept, 0, 1)) if len(kept) >= chains else (np.full(size, np.nan),) * 2
    return PosteriorDraws(
        how="sampled",
        names=found.names,
        draws=tuple(map(tuple, table.tolist())),
        seed=seed,
        r_hat=_named(found.names, r_hat),
        effective=_named(found.names, effective),
    )


def about(drawn: PosteriorDraws) -> str:
    """A sentence on chains that have not come together; "" if they have, or nothing was sampled."""
    if drawn.how == "sampled" and not drawn.r_hat:
        return "too few draws from the posterior to see whether the chains have come together"
    apart = [name for name, value in (drawn.r_hat or {}).items() if not value <= CONVERGED]
    if not apart:
        return ""
    return f"the chains of {some_names(apart)} have not come together (R-hat above {CONVERGED}): ask for more draws"


def _named(names: tuple[str, ...], values: Floats) -> dict[str, float]:
    return {name: float(value) for name, value in zip(names, values, strict=True) if np.isfinite(value)}


def _scale(fit: ModelFit) -> Floats:
    """Covariance (P, P) of the logarithms for proposals."""
    if fit.fit.covariance is not None:
        return fit.fit.covariance
    spread = [fit.priors[name].sd if name in fit.priors else UNTOLD for name in fit.fit.names]
    return np.diag(np.square(spread))


class _Proposal:
    """A Student distribution around the estimates, on logarithms."""

    def __init__(self, middle: Floats, covariance: Floats) -> None:
        self._middle, self._factor = middle, np.linalg.cholesky(covariance)

    def drawn(self, n: int, rng: Any) -> Floats:
        """Logarithms (n, P)."""
        normal = rng.randn(n, self._middle.size) @ self._factor.T
        return np.asarray(self._middle + normal / np.sqrt(rng.chisquare(FREEDOM, size=n) / FREEDOM)[:, None])

    def log_density(self, logs: Floats) -> Floats:
        """Up to a constant, (n,)."""
        off = np.linalg.solve(self._factor, (logs - self._middle).T)
        size = self._middle.size
        return np.asarray(-0.5 * (FREEDOM + size) * np.log1p((off**2).sum(axis=0) / FREEDOM))

    def proposed(self, now: Floats, rng: Any) -> tuple[Floats, Floats]:
        """New logarithms (n, P) and the factors (n,) that keep the balance of a move that ignores where it begins."""
        new = self.drawn(len(now), rng)
        return new, self.log_density(now) - self.log_density(new)

    def inside(self, n: int, rng: Any, fit: ModelFit) -> Floats:
        """Where chains begin (n, P): draws whose posterior is not 0."""
        found: list[Floats] = []
        for _ in range(100 * n):
            (logs,) = self.drawn(1, rng)
            if np.isfinite(fit.log_posterior(logs)):
                found.append(logs)
            if len(found) == n:
                return np.array(found)
        raise ValueError("no draw near the estimates has a posterior above 0; look at the fit first")
