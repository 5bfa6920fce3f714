"""Fits with bounds, priors and groups, models compared, draws from the posterior, residuals: against closed forms."""

import importlib.util

import numpy as np
import pytest
from scipy.stats import binom, gamma, kstest

from calibration import compare_models, fit_model, quantile_residuals, sample_posterior
from calibration.estimating.priors import LogNormalPrior
from kinetics import JumpPath, Model, Network, sample_path, simulate
from kinetics.markov.panels import EventData, EventLikelihood, JointLikelihood, PanelData, PanelLikelihood, PanelRun
from kinetics.markov.panels.observations import Detected

DECAY = Model.of(Network.from_text("A -> B, k", k=1.0))
HAS_SAMPLER = importlib.util.find_spec("emcee") is not None and importlib.util.find_spec("arviz") is not None


def waits(n=20, each=3.0):
    """n events, each after a wait of so long: the likelihood of k is Gamma(n + 1, n each), of ln k flat times that."""
    paths = [JumpPath(DECAY.network, {"A": 1}, [each], [0], each) for _ in range(n)]
    return EventLikelihood(DECAY, EventData(paths))


def test_the_estimate_is_events_over_exposure():
    found = fit_model(waits())
    assert found.fit.value[0] == pytest.approx(1 / 3, rel=1e-7)
    assert found.fit.covariance[0, 0] == pytest.approx(1 / 20, rel=1e-5)


def test_bounds_are_kept_and_no_posterior_is_made_up_there():
    found = fit_model(waits(), bounds={"k": (0.5, 2.0)}, starts=2)
    assert found.fit.value[0] == pytest.approx(0.5)
    assert found.fit.low[0] == pytest.approx(0.5)
    assert 0.5 < found.fit.high[0] < 0.7
    assert found.fit.covariance is None
    with pytest.raises(ValueError, match="k between 2 and 1; expected two rising numbers"):
        fit_model(waits(), bounds={"k": (2.0, 1.0)})


def test_a_prior_is_worth_data():
    """A strong prior holds the estimate; a wide one leaves it."""
    strong = fit_model(waits(), priors={"k": LogNormalPrior(0.99, 1.01)})
    wide = fit_model(waits(), priors={"k": LogNormalPrior(1e-6, 1e6)})
    assert strong.fit.value[0] == pytest.approx(1.0, rel=0.01)
    assert wide.fit.value[0] == pytest.approx(1 / 3, rel=0.01)
    assert strong.log_likelihood.value < wide.log_likelihood.value
    assert "likelihood times prior was maximised" in strong.fit.notes[-1]
    with pytest.raises(ValueError, match="k has a prior, but it is not free"):
        fit_model(fading(0.7, 0.8, 1, cells=3), ["A"], priors={"k": LogNormalPrior(1.0, 2.0)})


def test_a_prior_tells_what_data_cannot():
    """Of rates k and l to one place only the sum is known; with a prior on one, the other is too."""
    both = Model.of(Network.from_text("dies: A -> 0, k\nleaves: A -> 0, l", k=0.2, l=0.2))
    paths = [JumpPath(both.network, {"A": 1}, [2.0], [0], 2.0) for _ in range(30)]
    asked = EventLikelihood(both, EventData(paths, [("dies", "leaves")], [np.zeros(1, dtype=int)] * 30))
    alone = fit_model(asked, starts=1)
    assert alone.fit.low[0] == 0.0
    known = fit_model(asked, priors={"l": LogNormalPrior(0.0999, 0.1001)}, starts=1)
    assert known.fit.value.tolist() == pytest.approx([0.4, 0.1], rel=1e-3)


def test_the_ratio_test_has_its_size_and_power():
    """Exponential waits: of models with k held at the truth, 5 % are rejected at 5 %; at twice it, most are."""
    rejected, found = 0, 0
    for seed in range(60):
        path = sample_path(DECAY, {"A": 25, "B": 0}, end=50.0, seed=seed)
        asked = EventLikelihood(DECAY, EventData([path]))
        free = fit_model(asked, starts=1)
        for held in (1.0, 2.0):
            rows = compare_models({"free": free, "held": _held(asked, held)})
            if held == 1.0:
                rejected += rows[1].p_ratio < 0.05
            else:
                found += rows[1].p_ratio < 0.05
    assert binom.cdf(rejected, 60, 0.05) > 1e-6
    assert binom.sf(rejected - 1, 60, 0.05) > 1e-6
    assert found > 45


def _held(asked, value):
    """The model with k at a value; the rate of no other channel is free either, but for one that never fires."""
    from dataclasses import replace

    free = fit_model(asked, starts=1)
    return replace(
        free,
        fit=replace(free.fit, names=(), value=np.zeros(0), low=np.zeros(0), high=np.zeros(0), at=np.zeros(0)),
        fixed={"k": value},
        log_likelihood=asked.value({"k": value}),
    )


def test_fits_of_other_data_are_not_compared():
    with pytest.raises(ValueError, match="other was fitted to other data"):
        compare_models({"one": fit_model(waits(20)), "other": fit_model(waits(21))})


def test_groups_differ_or_do_not():
    def of(k, seed):
        return EventLikelihood(DECAY, EventData([sample_path(DECAY.at({"k": k}), {"A": 40, "B": 0}, 9.0, seed)]))

    for rate, is_same in ((1.0, True), (3.0, False)):
        parts = {"warm": of(1.0, 1), "cold": of(rate, 2)}
        apart, alike = (fit_model(JointLikelihood(parts, own), starts=1) for own in (["k"], []))
        assert apart.fit.names == ("k[warm]", "k[cold]")
        assert (2 * (apart.log_likelihood.value - alike.log_likelihood.value) < 3.84) is is_same


@pytest.mark.skipif(not HAS_SAMPLER, reason="the sampler is an extra")
def test_draws_are_those_of_the_posterior():
    """With a prior flat in ln k, the posterior of 20 waits of 3 is Gamma(20, 60): the whole distribution, at 1e-6."""
    drawn = sample_posterior(fit_model(waits()), draws=4000, seed=2)
    assert drawn.r_hat["k"] < 1.01
    assert 1500 < drawn.effective["k"] <= 6000
    thin = drawn.table[::3, 0]  # nearly independent
    assert kstest(thin, gamma(20, scale=1 / 60).cdf).pvalue > 1e-6
    assert kstest(thin, gamma(22, scale=1 / 60).cdf).pvalue < 1e-6  # the control
    again = sample_posterior(fit_model(waits()), draws=4000, seed=2)
    assert drawn.draws == again.draws
    whole = drawn.to_arviz()
    assert whole.posterior["k"].shape == (1, 4000)
    assert float(whole.posterior["k"].mean()) == drawn.table.mean()


@pytest.mark.skipif(not HAS_SAMPLER, reason="the sampler is an extra")
def test_draws_keep_to_the_bounds():
    """The posterior of 20 waits of 3 reaches from .2 to .5; both bounds cut into it."""
    drawn = sample_posterior(fit_model(waits(), bounds={"k": (0.3, 0.4)}), draws=600, seed=1).table
    assert 0.3 <= drawn.min() < 0.31
    assert 0.39 < drawn.max() <= 0.4


@pytest.mark.skipif(not HAS_SAMPLER, reason="the sampler is an extra")
def test_an_interrupt_leaves_the_draws_made_so_far(monkeypatch):
    found, calls = fit_model(waits()), []

    def stopped(text, share):
        calls.append(text)
        if len(calls) == 60:
            raise KeyboardInterrupt

    monkeypatch.setattr("calibration.estimating.posterior_sampling.stage", stopped)
    drawn = sample_posterior(found, draws=800, seed=2)
    assert 0 < len(drawn.draws) < 800
    monkeypatch.undo()
    whole = sample_posterior(found, draws=800, seed=2)
    assert whole.draws[: len(drawn.draws)] == drawn.draws
    calls.clear()
    monkeypatch.setattr(
        "calibration.estimating.posterior_sampling.stage", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt)
    )
    with pytest.raises(KeyboardInterrupt):
        sample_posterior(found, draws=800, seed=2)


@pytest.mark.skipif(not HAS_SAMPLER, reason="the sampler is an extra")
def test_no_posterior_without_a_prior_of_what_the_data_cannot_tell():
    path = JumpPath(DECAY.network, {"A": 1}, [], [], 5.0)
    found = fit_model(EventLikelihood(DECAY, EventData([path])), starts=1)
    with pytest.raises(ValueError, match="the data do not bound k on both sides, and it has no prior"):
        sample_posterior(found, draws=10)
    known = fit_model(EventLikelihood(DECAY, EventData([path])), priors={"k": LogNormalPrior(0.01, 1.0)}, starts=1)
    assert sample_posterior(known, draws=50, seed=1).table.shape == (50, 1)


def fading(k, p, seed, cells=30):
    """Copies of A that fade at rate k, seen with probability p at three times."""
    runs = simulate(Network.from_text("A -> B, k", k=k), "ssa", {"A": 20}, [0.5, 1, 2], runs=cells, seed=seed)
    seen = np.random.default_rng(seed).binomial(runs["A"], p).astype(float)
    rows = [PanelRun([20, 0], runs.times, row[:, None]) for row in seen]
    return PanelLikelihood(DECAY, PanelData({"A": {"A": 1}}, rows, {"A": Detected(0.8)}))


def test_residuals_are_uniform_where_the_model_holds_and_not_where_it_does_not():
    """All tests of 90 residuals, at the true parameters and at others."""
    right = quantile_residuals(fading(0.7, 0.8, 5), {"k": 0.7, "A": 0.8}, seed=1)
    wrong = quantile_residuals(fading(0.7, 0.8, 5), {"k": 1.4, "A": 0.8}, seed=1)
    assert right.p > 1e-3
    assert wrong.p < 1e-6
    assert "does not describe these data" in wrong.verdict
    assert "what the model expects" in right.verdict


@pytest.mark.validate
def test_the_level_of_the_residual_tests():
    """400 sets of data at the true parameters: rejected at 5 % by Holm's rule in at most 5 %, within 1e-6."""
    rejected = sum(
        quantile_residuals(fading(0.7, 0.8, seed, cells=10), {"k": 0.7, "A": 0.8}, seed=seed).p < 0.05
        for seed in range(400)
    )
    assert binom.sf(rejected - 1, 400, 0.05) > 1e-6


def test_waits_go_on_from_run_to_run():
    """Short runs of one copy, most of which end before the event: waits that end within their run are short."""
    paths = [sample_path(DECAY, {"A": 1, "B": 0}, end=0.3, seed=7, run=run) for run in range(200)]
    whole = quantile_residuals(EventLikelihood(DECAY, EventData(paths)), {"k": 1.0}, seed=1)
    assert whole.p > 1e-3
    each = [quantile_residuals(EventLikelihood(DECAY, EventData([path])), {"k": 1.0}, seed=1) for path in paths]
    assert kstest(np.concatenate([found.of("wait") for found in each]), "uniform").pvalue < 1e-6  # the control


def test_residuals_of_events_with_known_times():
    """A death at a known time, or the stage of a survivor: uniform at the true rates, not at others."""
    chain = Network.from_text("sick: A -> B, 0.5\ndie: B -> C, 0.8\nsudden: A -> C, 0.1")
    runs = []
    for seed in range(120):
        path = sample_path(chain, {"A": 1}, end=30.0, seed=seed)
        dead = path.times[-1]
        visits = np.arange(0.7, dead, 0.7)
        seen = [*path.at(visits)[:, [0, 1]], path.states[-1][[0, 1]]]
        runs.append(PanelRun([1, 0, 0], [*visits, dead], np.array(seen, float), fired=[*[-1] * visits.size, 0]))
    data = PanelData({"A": {"A": 1}, "B": {"B": 1}}, runs, events=[("die", "sudden")])
    right = quantile_residuals(PanelLikelihood(Model.of(chain), data), replicates=50, seed=2)
    wrong = quantile_residuals(
        PanelLikelihood(Model.of(chain), data), {"die": 0.05, "sudden": 2.0}, replicates=50, seed=2
    )
    assert right.columns == ("A", "B")
    assert right.p > 1e-3
    assert wrong.p < 1e-6


def test_bands_hold_what_was_seen_and_not_what_was_not():
    """Means of snapshots in the band of their mean, at the fit and not at another rate; irregular panels have none."""
    from calibration.estimating.predictive_bands import predictive_bands

    seen = simulate(DECAY.network, "ssa", {"A": 30}, [1.0, 2.0], runs=40, seed=3)["A"].astype(float)
    runs = [PanelRun([30, 0], [float(1 + k % 2)], [[row[k % 2]]]) for k, row in enumerate(seen)]
    found = fit_model(PanelLikelihood(DECAY, PanelData({"A": {"A": 1}}, runs)), starts=1)
    (band,) = predictive_bands(found, None, seed=1)
    assert (band.of_means, band.inside) == (True, (2, 2))
    (wrong,) = predictive_bands(_moved(found, 1.5), None, seed=1)
    assert wrong.inside == (0, 2)
    ragged = [PanelRun([30, 0], [0.1 * (k + 1), 2.0], [[29], [5]]) for k in range(8)]
    assert predictive_bands(fit_model(PanelLikelihood(DECAY, PanelData({"A": {"A": 1}}, ragged)), starts=1), None) == []


def _moved(found, factor):
    """A fit whose estimates are others."""
    from dataclasses import replace

    return replace(found, fit=replace(found.fit, at=found.fit.at * factor))
