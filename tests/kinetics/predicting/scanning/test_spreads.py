"""Variances, standard deviations and quantiles of counts against binomial and Poisson laws, solved and sampled."""

import numpy as np
import pytest
from scipy.stats import binom, nbinom, poisson

from kinetics import Chain, Model, Network, scan
from kinetics.markov import ask
from kinetics.support.answer import CONFIDENCE
from kinetics.support.estimates import mean_estimate, quantile_estimate, sd_estimate, variance_estimate

RATES, COPIES, TIME = np.array([0.1, 0.5, 2.0]), np.array([3, 10]), 0.7
QUANTILES = (0.05, 0.5, 0.9, 0.999)
ASKED = [f"var[A] @ {TIME}", f"sd[A] @ {TIME}", *(f"q{q}[A] @ {TIME}" for q in QUANTILES)]


def decay():
    return Network.from_text("A -> 0, k\nA = 10", k=1.0)


def births():
    """From none, the count is Poisson's, of mean b (1 - exp(-t))."""
    return Network.from_text("0 -> A, b\nA -> 0, 1\nA = 0", b=2.0)


def truths(law):
    """The answers to all that is asked (..., Q), of a law with any shape."""
    return np.stack([law.var(), law.std(), *(law.ppf(q) for q in QUANTILES)], axis=-1)


def binomial(rates=RATES):
    return truths(binom(COPIES, np.exp(-TIME * rates)[:, None]))


def test_solved_answers_of_a_decay_are_binomial():
    found = scan(decay(), {"k": RATES, "A": COPIES}, ASKED)
    value, low, high = (found.numbers(what) for what in ("value", "low", "high"))
    np.testing.assert_allclose(value, binomial(), rtol=1e-12)
    assert (found.words("kind") == "proven").all()
    assert ((low <= binomial() * (1 + 1e-14)) & (binomial() * (1 - 1e-14) <= high)).all()
    assert (high - low <= 1e-9 * binomial()).all()
    other = binomial(1.05 * RATES)
    assert ((other < low) | (other > high))[..., :2].all()  # the control: rates that are 5 % higher


def test_solved_quantiles_of_a_truncated_chain_are_those_of_poisson():
    over = {"b": [0.5, 2.0, 8.0]}
    law = poisson(np.array(over["b"]) * (1 - np.exp(-TIME)))
    found = scan(births(), over, ASKED[2:], truncate="A < 60")
    np.testing.assert_array_equal(found.numbers("value"), truths(law)[:, 2:])
    np.testing.assert_array_equal(found.numbers("low"), found.numbers("high"))
    assert (found.words("kind") == "proven").all()
    spread = scan(births(), over, ASKED[:2], truncate="A < 60")
    assert all("truncated" in why for why in spread.words("why").ravel())


def test_bounds_of_a_quantile_hold_for_any_behaviour_outside():
    small = Chain.of(births(), truncate="A < 2")
    for q, low in ((0.05, 0.0), (0.9, 1.0)):
        answer = ask(small, f"q{q}[A] @ {TIME}")
        assert answer.low <= poisson(2.0 * (1 - np.exp(-TIME))).ppf(q) <= answer.high
        assert (answer.low, answer.is_bound) == (low, True)
    assert ask(small, f"q0.99[A] @ {TIME}").high == np.inf


def test_a_median_between_two_values_has_both_as_bounds():
    half = Chain.of(Network.from_text("A -> B, 1"), {"A": 1})
    answer = ask(half, f"q0.5[A] @ {float(np.log(2.0))!r}")
    assert (answer.low, answer.high) == (0.0, 1.0)
    assert ask(half, "q0.5[A] @ 0.6").low == 1.0  # the control


def test_a_count_that_is_certain_has_no_spread():
    found = scan(decay(), {"A": [4]}, ["var[A] @ 0", "sd[A] @ 0", "q0.5[A] @ 0"])
    assert found.numbers("value").ravel().tolist() == [0.0, 0.0, 4.0]
    sampled = scan(decay(), {"A": [4]}, ["var[A] @ 0", "sd[A] @ 0", "q0.5[A] @ 0"], max_states=0, runs=100)
    assert sampled.numbers("value").ravel().tolist() == [0.0, 0.0, 4.0]
    assert np.isnan(sampled.numbers("low").ravel()).tolist() == [True, True, False]  # all runs are alike


def test_observables_have_spreads_too():
    model = Model(decay(), {"A": 5}, {"twice": {"A": 2}})
    found = scan(model, {"k": [1.0]}, ["sd[twice] @ 1", "sd[A] @ 1", "q0.9[twice] @ 1", "q0.9[A] @ 1"])
    twice, once, up, half = found.numbers("value").ravel()
    assert twice == pytest.approx(2 * once, rel=1e-12)
    assert up == 2 * half


@pytest.mark.parametrize("name", ["binomial", "poisson"])
def test_sampled_answers_cover_the_law_and_not_another(name):
    if name == "binomial":
        over, truth = {"k": RATES, "A": COPIES}, binomial()
        found = scan(decay(), over, ASKED, max_states=0, runs=2000, seed=3)
        other = binomial(1.3 * RATES)
    else:
        over = {"b": [0.5, 1.0, 2.0, 4.0, 8.0, 16.0]}
        means = np.array(over["b"]) * (1 - np.exp(-TIME))
        found = scan(births(), over, ASKED, max_states=100, runs=2000, seed=3)
        truth, other = truths(poisson(means)), truths(poisson(1.3 * means))
    assert (found.words("kind") == CONFIDENCE).all()

    def inside(values):
        return (found.numbers("low") <= values) & (values <= found.numbers("high"))

    assert inside(truth).mean() > 0.85
    assert inside(other)[..., :2].mean() < 0.5  # the control
    errors = [float(why.split()[-1]) for why in found.words("why")[..., :2].ravel()]
    away = np.abs(found.numbers("value") - truth)[..., :2].ravel()
    assert (away < 4.5 * np.array(errors)).all()


LAWS = {
    "binomial": binom(10, 0.3),
    "one of two": binom(1, 0.5),  # of all laws, the one whose variance is known best
    "poisson": poisson(5.0),
    "long tail": nbinom(1, 0.2),
}


@pytest.mark.parametrize("name", LAWS)
def test_intervals_cover_as_often_as_they_say(name):
    law, repeats = LAWS[name], 1500
    samples = law.rvs((repeats, 400), random_state=1).astype(float)
    for estimate, truth in ((variance_estimate, law.var()), (sd_estimate, law.std()), (mean_estimate, law.mean())):
        made = [estimate(values, 0.95) for values in samples]
        covered = np.mean([each.low <= truth <= each.high for each in made])
        assert covered > (0.9 if name == "long tail" else 0.92)
        narrow = np.mean([each.low <= 1.25 * truth <= each.high for each in made])
        assert narrow < 0.6 or name == "long tail"  # the control
    for q in (0.1, 0.5, 0.9):
        made = [quantile_estimate(values, q, 0.95) for values in samples]
        assert np.mean([each.low <= law.ppf(q) <= each.high for each in made]) > 0.94
        assert np.mean([each.value == law.ppf(q) for each in made]) > 0.3


def test_standard_errors_are_the_spread_of_estimates():
    law = poisson(5.0)
    samples = law.rvs((3000, 400), random_state=2).astype(float)
    for estimate in (variance_estimate, sd_estimate):
        made = np.array([estimate(values, 0.95) for values in samples])
        assert np.sqrt((made[:, 3] ** 2).mean()) == pytest.approx(made[:, 0].std(), rel=0.06)


def test_a_quantile_that_too_few_runs_reach_has_an_open_end():
    found = quantile_estimate(np.arange(1.0, 101.0), 0.999, 0.95)
    assert (found.value, found.high) == (100.0, np.inf)
    assert quantile_estimate(np.arange(1.0, 101.0), 0.001, 0.95).low == 0.0
    assert np.isfinite(quantile_estimate(np.arange(1.0, 101.0), 0.9, 0.95).high)
