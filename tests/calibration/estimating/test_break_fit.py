"""Fits of break models to runs with known breaks: bias, coverage, choice, tests with their size, posteriors."""

from dataclasses import replace

import numpy as np
import pytest
from break_studies import JOIN, TANK, by_first_coefficient
from numpy.testing import assert_allclose
from scipy.stats import binom, chi2, ks_2samp
from synthetic_runs import line_network

from calibration import estimate
from calibration.estimating.break_comparison import BreakComparison
from calibration.estimating.break_fit import break_channels, deviance, fit_breaks, log_score, rates_of_fit
from calibration.estimating.shape_posterior import shape_posterior
from kinetics.network import Network, Tank
from kinetics.rates.breaks import BREAK_MODELS, break_model, is_break
from kinetics.runs import BY_SEVERAL, BY_UNKNOWN, BY_WALL, NO_BREAK, JumpPath

COLLISION, WALLS, SPECIES = (break_model(f"collision{suffix}") for suffix in ("", "-wall", "-species"))
FIRST = break_model("first-order")
PLAIN = by_first_coefficient(COLLISION, {"alpha": 1.3}, 1e-5)
WALLED = by_first_coefficient(WALLS, {"alpha": 1.3, "wall": 40.0}, 6e-6)
LARGER = Tank((3.0, 3.0, 4.0))


@pytest.fixture(scope="module")
def plain_runs():
    return PLAIN.runs(40, 60.0, seed=1)


@pytest.fixture(scope="module")
def walled_runs():
    return WALLED.runs(40, 60.0, seed=2, tanks=(TANK, LARGER))


def slow_log_likelihood(truth, law, shape, coefficients, paths):
    """Stretch by stretch from the law's own weights, in plain Python, without the code under test."""
    base, weights = line_network(), law.weights(line_network(), shape)
    broken = np.flatnonzero(is_break(base))
    of = [int(np.flatnonzero(base.reactants[r])[0]) for r in broken]
    total = 0.0
    for path in paths:
        rarer = truth.tank.volume / path.tank.volume
        wall = (path.tank.surface / path.tank.volume) / (truth.tank.surface / truth.tank.volume)
        times = [0.0, *path.times, path.end]
        for i, state in enumerate(path.states):
            rates = []
            for r, x, b in zip(broken, of, coefficients, strict=True):
                others = state - np.eye(4, dtype=int)[x]
                met = rarer * (weights[:4] @ others) + (wall * weights[4] if weights.size > 4 else 0.0)
                rates.append(b * base.ways[r] * state[x] * met)
            total -= sum(rates) * (times[i + 1] - times[i])
            if i < path.channels.size and path.channels[i] in broken:
                total += np.log(rates[broken.tolist().index(path.channels[i])])
    return total


def test_likelihood_is_its_definition(walled_runs):
    """In two tanks: values of the fit and of its profile, by the definition."""
    fit = fit_breaks(WALLS, walled_runs)
    at_best = slow_log_likelihood(WALLED, WALLS, fit.model.shape_values, fit.best.coefficients[0], walled_runs)
    assert fit.log_likelihood == pytest.approx(at_best, rel=1e-12)
    held = fit.likelihood.maximum({"alpha": 0.5})
    by_definition = slow_log_likelihood(WALLED, WALLS, held.model.shape_values, held.coefficients[0], walled_runs)
    assert held.log_likelihood == pytest.approx(by_definition, rel=1e-12)
    assert fit.profile("alpha", 0.5) == pytest.approx(by_definition, rel=1e-9)
    b = fit.parameters["b 4->1+3"]
    evidence = fit.likelihood.evidence(fit.model)
    alone = fit.log_likelihood - evidence[2].mle[1] + evidence[2].log_likelihood(np.array([2 * b]))
    assert alone < fit.profile("b 4->1+3", 2 * b) < fit.log_likelihood


def test_the_search_finds_the_top(walled_runs):
    """None of 3,000 points drawn over the ranges is above it, nor a step of .1 % aside."""
    rng = np.random.default_rng(0)
    for law in BREAK_MODELS:
        fit = fit_breaks(law, walled_runs)
        if not fit.model.shape:
            continue
        units = rng.uniform(size=(3000, len(fit.model.shape)))
        values = [[p.value(u) for p, u in zip(fit.model.shape, row, strict=True)] for row in units]
        aside = [
            np.array(fit.model.values) * (1 + 1e-3 * step) for step in rng.choice([-1, 1], size=(8, units.shape[1]))
        ]
        for row in [*values, *aside]:
            shape = dict(zip((p.name for p in fit.model.shape), row, strict=True))
            found = fit.likelihood.mixed(fit.best.events).mle(fit.model.with_shape(shape).mixture())[0]
            assert found <= fit.log_likelihood + 1e-6


def test_estimates_have_no_bias_and_intervals_cover(request):
    """40 studies, 1,000 with --validate, of 110 breaks each: false alarms of 1e-6 by the binomial of misses.

    The mean of alpha lies within 5 standard errors, and likelihood ratios of the truth are chi-square.
    """
    studies = 1000 if request.config.getoption("--validate") else 40
    misses = {"alpha": 0, "posterior": 0, "b 4->2+2": 0}
    alphas, rates = [], []
    for study in range(studies):
        runs = PLAIN.runs(8, 40.0, seed=100 + study)
        fit = fit_breaks(COLLISION, runs)
        for name, true in (("alpha", 1.3), ("b 4->2+2", PLAIN.coefficients[3])):
            low, high = fit.interval(name)
            misses[name] += not low <= true <= high
        posterior = shape_posterior(fit)
        below = np.array(posterior.weights)[np.array(posterior.points)[:, 0] < 1.3].sum()
        misses["posterior"] += not 0.025 <= below <= 0.975
        alphas.append(fit.parameters["alpha"])
        rates.append(fit.profile("alpha", 1.3) - fit.log_likelihood)
    assert abs(np.mean(alphas) - 1.3) < 5 * np.std(alphas, ddof=1) / np.sqrt(studies)
    for name, missed in misses.items():
        assert binom.sf(missed - 1, studies, 0.06) > 1e-6, (name, missed)
        assert binom.cdf(missed, studies, 0.04) > 1e-6, (name, missed)
    assert chi2.sf(-2 * np.sum(rates), studies) > 1e-6


def test_runs_in_two_tanks_are_pooled(walled_runs):
    """Control: without the tanks' scaling the coefficients come out wrong by far more than their error."""
    fit = fit_breaks(WALLS, walled_runs, fixed={"alpha": 1.3, "wall": 40.0})
    nowhere = [replace(path, tank=None) for path in walled_runs]
    wrong = fit_breaks(WALLS, nowhere, fixed={"alpha": 1.3, "wall": 40.0})
    events = np.array([len(e.at_events) for e in fit.likelihood.evidence(fit.model)])
    assert events.min() > 80
    off = (fit.best.coefficients[0] / WALLED.coefficients - 1) * np.sqrt(events)
    off_control = (wrong.best.coefficients[0] / WALLED.coefficients - 1) * np.sqrt(events)
    assert chi2.sf((off**2).sum(), 4) > 1e-6
    assert chi2.sf((off_control**2).sum(), 4) < 1e-6
    total = estimate(walled_runs).total
    assert total.tank == TANK
    joins = total.events[:4] / total.exposure[:4]
    assert_allclose(joins, JOIN, rtol=5 / np.sqrt(total.events[:4].min()))
    with pytest.raises(ValueError, match="some runs state their tank and others do not"):
        fit_breaks(WALLS, [walled_runs[0], nowhere[1]])
    with pytest.raises(ValueError, match="some runs state their tank and others do not"):
        _ = estimate([walled_runs[0], nowhere[1]]).total


def test_the_data_choose(plain_runs):
    """Of 10 studies of 330 breaks each, none chooses first order, and at least 8 choose the truth."""
    chosen = []
    for study in range(10):
        comparison = BreakComparison.of(PLAIN.runs(24, 40.0, seed=300 + study), (FIRST, COLLISION, WALLS))
        chosen.append(comparison.chosen.model.name)
    assert "first-order" not in chosen
    assert chosen.count("collision") >= 8
    comparison = BreakComparison.of(plain_runs)
    assert comparison.chosen.model.name != "first-order"
    assert f"{comparison.chosen.model.name} has" in comparison.reason
    assert max(comparison.scores, key=comparison.scores.__getitem__) != "first-order"
    rows = {row["model"]: row for row in comparison.table()}
    assert list(rows) == [law.name for law in BREAK_MODELS]
    assert rows["first-order"]["p_deviance"] < 1e-6 < rows["collision"]["p_deviance"]
    assert rows["collision-wall"]["p_against_nested"] > 1e-6
    assert rows["first-order"]["p_against_nested"] is None
    with pytest.raises(ValueError, match="no fit of break model 'double'"):
        comparison["double"]


def test_who_broke_what_says_more(walled_runs):
    """Partners that the runs name are used: weights come with smaller intervals, and walls are seen at once."""
    compared = BreakComparison.of(walled_runs)
    assert [fit.model.name for fit in compared.fits_by_partner] == ["collision-wall"]  # the others: walls break nothing
    assert compared.chosen is compared.fits_by_partner[0]
    assert "by who broke what" in compared.reason
    plain, named = compared["collision-wall"], compared.chosen
    for name, truth in WALLED.shape.items():
        narrow, wide = named.interval(name), plain.interval(name)
        assert narrow[0] < truth < narrow[1]
        assert narrow[1] - narrow[0] < 0.5 * (wide[1] - wide[0])
    # by hand: breaks by walls over exposure to walls, beside those by single cubes
    breaks = np.concatenate([path.partners[path.partners >= BY_WALL] for path in walled_runs])
    exposures = sum(evidence.exposure * b for evidence, b in zip(
        named.likelihood.parts(named.model), named.best.coefficients[0], strict=True))  # fmt: skip
    rates = np.array([(breaks == partner).sum() for partner in (0, 1, 2, 3, BY_WALL)]) / exposures
    assert_allclose(rates[4] * exposures[4], named.model.shape_values["wall"] * exposures[4], rtol=0.02)
    nobody = [replace(path, partners=None) for path in walled_runs]
    assert not BreakComparison.of(nobody, (FIRST, WALLS)).fits_by_partner
    unknown = [recorded(path, path.partners != NO_BREAK, BY_UNKNOWN) for path in walled_runs]
    blind = fit_breaks(WALLS, unknown, by_partner=True)
    assert_allclose(blind.log_likelihood, plain.log_likelihood, rtol=1e-9)


def recorded(path, which, code):
    """The same run, where these breaks (E,) have another partner on record."""
    return replace(path, partners=np.where(which, code, path.partners))


def with_crowded_breaks(paths, seed, code=BY_SEVERAL, share=0.5):
    """Of breaks by bodies a share, whatever the body, is on record as made by several at once."""
    rng = np.random.default_rng(seed)
    return [recorded(path, (path.partners >= 0) & (rng.random(path.times.size) < share), code) for path in paths]


def test_several_at_once_are_not_the_wall_alone(walled_runs):
    """By hand: such a break counts with all bodies' part of the propensity, one that nobody knows with all of it."""
    named = fit_breaks(WALLS, walled_runs, by_partner=True)
    coefficients, weights = named.best.coefficients, named.model.mixture()[0]
    assert WALLS.partners(line_network())[-1] == "wall"
    first = next(path for path in walled_runs if (path.partners >= 0).any())
    event = int(np.flatnonzero(first.partners >= 0)[0])

    def likelihood(code):
        paths = [recorded(first, np.arange(first.times.size) == event, code)]
        fit = fit_breaks(WALLS, paths, by_partner=True).likelihood
        return sum(e.log_likelihood(c) for e, c in zip(fit.evidence(named.model), coefficients.T, strict=True))

    parts = np.array([part[event, first.channels[event]] for part in named.model.combinations(first)]) * weights
    by_one = likelihood(first.partners[event])
    assert likelihood(BY_SEVERAL) - by_one == pytest.approx(np.log(parts[:4].sum() / parts[first.partners[event]]))
    assert likelihood(BY_UNKNOWN) - by_one == pytest.approx(np.log(parts.sum() / parts[first.partners[event]]))


def test_crowded_breaks_leave_the_weight_of_walls_without_bias(request):
    """24 studies, 400 with --validate, in which half of the breaks by bodies has several at once on record.

    Intervals cover, by the binomial of misses at 1e-6, and the mean log of the weight is within 5 standard errors. The
    control calls the same breaks unknown, so that the walls get their part of them: a weight twice as large.
    """
    studies = 400 if request.config.getoption("--validate") else 24
    truth = WALLED.shape["wall"]
    logs, misses = {BY_SEVERAL: [], BY_UNKNOWN: []}, dict.fromkeys((BY_SEVERAL, BY_UNKNOWN), 0)
    for study in range(studies):
        runs = WALLED.runs(8, 60.0, seed=500 + study)
        for code, found in logs.items():
            fit = fit_breaks(WALLS, with_crowded_breaks(runs, study, code), by_partner=True)
            low, high = fit.interval("wall")
            misses[code] += not low <= truth <= high
            found.append(np.log(fit.parameters["wall"] / truth))
    away = {code: np.mean(of) / (np.std(of, ddof=1) / np.sqrt(studies)) for code, of in logs.items()}
    assert abs(away[BY_SEVERAL]) < 5 < away[BY_UNKNOWN]
    assert binom.sf(misses[BY_SEVERAL] - 1, studies, 0.06) > 1e-6
    assert binom.sf(misses[BY_UNKNOWN] - 1, studies, 0.06) < 1e-6


def test_walls_are_tested_on_the_boundary_of_their_range(request):
    """No walls: the statistic is 0 in about half of the studies, else chi-square. With walls as in the tank, power.

    The p-value given for a weight that is 0 is half that of chi-square (Self & Liang 1987).
    """
    studies = 400 if request.config.getoption("--validate") else 40
    p_values = []
    for study in range(studies):
        runs = PLAIN.runs(8, 40.0, seed=900 + study, tanks=(TANK, LARGER))
        larger, smaller = fit_breaks(WALLS, runs), fit_breaks(COLLISION, runs)
        p_values.append(BreakComparison((smaller, replace(larger, likelihood=larger.likelihood))).ratio(larger).p_value)
    for level in (0.05, 0.2):
        rejected = int((np.array(p_values) <= level).sum())
        assert binom.sf(rejected - 1, studies, level) > 1e-6, (level, rejected)
        assert binom.cdf(rejected, studies, level) > 1e-6, (level, rejected)
    strong = by_first_coefficient(WALLS, {"alpha": 1.3, "wall": 400.0}, 3e-6).runs(
        40, 60.0, seed=7, tanks=(TANK, LARGER)
    )
    fits = BreakComparison.of(strong, (COLLISION, WALLS))
    assert fits.ratio(fits["collision-wall"]).p_value < 1e-3


def test_posterior_grid_is_the_integral_by_brute_force(walled_runs):
    """Moments of both parameters, by a fine grid of the likelihood of all parameters, its coefficients integrated.

    The integral over b of b^(n - 1/2) exp(-b E) E^(1/2) is Gamma(n + 1/2) E^-n; each is done numerically once.
    """
    from scipy.integrate import quad

    n, exposure = 3, 2.5
    by_hand = quad(lambda b: b ** (n - 0.5) * np.exp(-b * exposure) * exposure**0.5, 0, np.inf)[0]
    twice = quad(lambda b: b ** (n - 0.5) * np.exp(-b * 2 * exposure) * (2 * exposure) ** 0.5, 0, np.inf)[0]
    assert by_hand / twice == pytest.approx(2.0**n)

    fit = fit_breaks(WALLS, walled_runs)
    parts = fit.likelihood.parts(fit.model)
    alphas, walls = np.linspace(-0.995, 3.995, 500), np.geomspace(1e-3, 1e4, 700)
    logs = np.zeros((alphas.size, walls.size))
    for i, alpha in enumerate(alphas):
        sizes = np.arange(1, 5) ** alpha
        for e in parts:
            logs[i] += np.log((e.at_events[:, :4] @ sizes)[:, None] + np.outer(e.at_events[:, 4], walls)).sum(axis=0)
            logs[i] -= len(e.at_events) * np.log(e.exposure[:4] @ sizes + e.exposure[4] * walls)
    density = np.exp(logs - logs.max()) * walls / (30 + walls) ** 2  # of (alpha, log wall)
    density /= density.sum()
    posterior = shape_posterior(fit)
    points, weights = np.array(posterior.points), np.array(posterior.weights)
    for values, share, given in (
        (alphas, density.sum(axis=1), points[:, 0]),
        (walls / (30 + walls), density.sum(axis=0), points[:, 1] / (30 + points[:, 1])),
    ):
        mean = share @ values
        sd = np.sqrt(share @ (values - mean) ** 2)
        assert weights @ given == pytest.approx(mean, abs=0.05 * sd)
        assert np.sqrt(weights @ (given - weights @ given) ** 2) == pytest.approx(sd, rel=0.05)


def test_draws_of_constants_are_those_of_an_independent_sampler(plain_runs):
    """Metropolis over alpha and all four coefficients, from the definition: equal in distribution."""
    runs = plain_runs[:6]
    fit = fit_breaks(COLLISION, runs)
    rates = rates_of_fit(estimate(runs), fit)
    drawn = rates.draw_constants(line_network(), np.random.default_rng(0), 4000)
    names = rates.apply(line_network()).channels
    parts = fit.likelihood.parts(fit.model)
    sizes = np.arange(1, 5.0)

    def log_density(at):
        alpha, logs = at[0], at[1:]
        if not -1 <= alpha <= 4:
            return -np.inf
        total = 0.0
        for e, log_b in zip(parts, logs, strict=True):
            exposure = e.exposure @ sizes**alpha
            total += np.log(e.at_events @ sizes**alpha).sum() + len(e.at_events) * log_b - np.exp(log_b) * exposure
            total += 0.5 * (log_b + np.log(exposure))  # Jeffreys' prior of b E, in log b
        return total

    rng = np.random.default_rng(1)
    at = np.array([fit.parameters["alpha"], *np.log(fit.best.coefficients[0])])
    covariance = np.diag([0.0, *(1 / np.array([len(e.at_events) for e in parts]))])
    slope = np.array(
        [1.0, *(-(e.exposure @ (sizes ** at[0] * np.log(sizes))) / (e.exposure @ sizes ** at[0]) for e in parts)]
    )
    low, high = fit.interval("alpha")
    root = np.linalg.cholesky(covariance + ((high - low) / 4) ** 2 * np.outer(slope, slope) + 1e-12 * np.eye(5))
    here, chain = log_density(at), []
    for step in range(30_000):
        there = at + 1.0 * root @ rng.standard_normal(5)
        found = log_density(there)
        if np.log(rng.uniform()) < found - here:
            at, here = there, found
        if step % 20 == 0 and step > 2000:
            chain.append(at)
    chain = np.array(chain)
    for c, partner in ((0, 0), (3, 3), (2, 1)):
        channel = break_channels(line_network())[c]
        name = f"{channel} by {line_network().species[partner]}"
        independent = np.exp(chain[:, 1 + c]) * sizes[partner] ** chain[:, 0]
        assert ks_2samp(independent, drawn[:, names.index(name)]).pvalue > 1e-6, name
        wrong = np.exp(chain[:, 1 + c]) * sizes[partner] ** fit.parameters["alpha"]  # control: alpha taken as known
        if partner:
            assert ks_2samp(wrong, drawn[:, names.index(name)]).pvalue < 1e-6, name


def test_scores_are_of_runs_left_out(plain_runs):
    """By hand: fits anew to the other runs; the fit's own likelihood is higher than its score."""
    comparison = BreakComparison.of(plain_runs[:10], (FIRST, COLLISION))
    total = 0.0
    for fold in range(5):
        rest = [run for i, run in enumerate(plain_runs[:10]) if i % 5 != fold]
        part = [run for i, run in enumerate(plain_runs[:10]) if i % 5 == fold]
        total += log_score(fit_breaks(COLLISION, rest), fit_breaks(COLLISION, part).likelihood)
    assert comparison.scores["collision"] == pytest.approx(total, rel=1e-6)
    assert total < comparison["collision"].log_likelihood
    few = BreakComparison.of(plain_runs[:4], (FIRST,))
    assert np.isnan(few.scores["first-order"])


def test_deviance_is_that_of_poisson_counts(plain_runs):
    """Under the truth about its freedom; under first-order breaks far above."""
    found = deviance(fit_breaks(COLLISION, plain_runs))
    assert found.freedom == 4 * 4 - 5  # four crowds of four breaks each
    assert found.p_value > 1e-6
    assert deviance(fit_breaks(FIRST, plain_runs)).p_value < 1e-6


def test_a_channel_without_breaks_takes_no_freedom():
    """Dimers break in two groups of runs, the trimers that are there do not: two numbers of breaks, one coefficient."""
    network = line_network()
    (breaks,) = (r for r in np.flatnonzero(is_break(network)) if network.reactants[r, 1])
    starts = ([0, 30, 30, 0], [0, 60, 30, 0])
    found = deviance(fit_breaks(FIRST, [JumpPath(network, start, [1, 2, 3], [breaks] * 3, 10.0) for start in starts]))
    assert found.freedom == 1
    assert 0.01 < found.p_value < 1


def test_errors(plain_runs):
    with pytest.raises(ValueError, match="no runs to fit"):
        fit_breaks(COLLISION, [])
    joins = Network(("A", "B"), ("j",), [[2, 0]], [[-2, 1]], [1.0])
    with pytest.raises(ValueError, match="no channel of this network is a break"):
        fit_breaks(COLLISION, [JumpPath(joins, [2, 0], [1.0], [0], 2.0)])
    unsized = Network(("A", "B", "C"), ("b",), [[0, 0, 1]], [[1, 1, -1]], [1.0])
    path = JumpPath(unsized, [0, 0, 9], np.arange(1.0, 9.0), [0] * 8, 10.0)
    with pytest.raises(ValueError, match="weights by size need one conserved quantity"):
        fit_breaks(COLLISION, [path])
    assert [fit.model.name for fit in BreakComparison.of([path]).fits] == ["first-order", "collision-species"]
