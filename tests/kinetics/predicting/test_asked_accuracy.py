import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from accuracy_questions import question, sampled, share_of_accuracy
from known_systems import bare_line, line
from numpy.testing import assert_array_equal
from scipy.stats import binom, norm, t

from kinetics import Auto, Model, Network, Transient, predict, simulate_statistics, solve
from kinetics.predicting import AskedAccuracy, adaptive, predict_job, stopping_rule, tuning
from kinetics.predicting.accuracy import CostForecast
from kinetics.predicting.adaptive import adaptive_prediction
from kinetics.predicting.first_runs import first_runs
from kinetics.predicting.job import Job
from kinetics.predicting.observables import Observables
from kinetics.predicting.sampled_way import RunsUntil, runs_for_distributions
from kinetics.predicting.solved_ways import error_reached, is_endless, largest_counts, tolerance_for
from kinetics.predicting.stopping_rule import InterimLook
from kinetics.predicting.tuning import FIRST_RUNS, LEVEL, MOST_FIRST, ROWS
from kinetics.predicting.ways import AccuracyWay, Attained
from kinetics.rates import ChannelRate, Convention, Rates
from kinetics.sampling import statistics
from kinetics.sampling.cost_model import NetworkSize
from kinetics.sampling.statistics import Tally, kept_pairs

FALSE_ALARM = 1e-6
DECAY = Network.from_text("A -> 0, 0.1")
TIMES = np.array([5.0, 10.0, 20.0])


def failures(asked, network, start, times, truth, repeats, with_forced=True):
    """How often the accuracy was not kept."""
    made = (sampled(asked, network, start, times, n, with_forced=with_forced).statistics for n in range(repeats))
    return sum(share_of_accuracy(asked, each, truth) > 1 for each in made)


def allowed(repeats):
    """As many failures as happen with a chance above the false-alarm rate."""
    return int(binom(repeats, 1 - LEVEL).isf(FALSE_ALARM))


CASES = {
    "mean": (AskedAccuracy(0.8), "A -> 0, 0.1", {"A": 100}, TIMES, 60),
    "sd": (AskedAccuracy(0.1, True, "sd"), "0 <-> A, 2, 0.5", {"A": 0}, np.array([1.0, 8.0]), 40),
    "rare": (AskedAccuracy(0.02), "0 -> A, 0.02", {"A": 0}, np.array([1.0]), 60),
    "bursts": (AskedAccuracy(0.3), "0 -> 10 A, 0.1", {"A": 0}, np.array([1.0]), 60),
    "distribution": (AskedAccuracy(0.08, False, "distribution"), "A -> 0, 0.1", {"A": 100}, TIMES, 60),
}


@pytest.fixture
def truth_of():
    def find(text, start, times):
        return solve(Network.from_text(text), "fsp", start, times)

    return find


@pytest.mark.parametrize("case", CASES)
def test_runs_keep_the_accuracy_as_often_as_they_say(case, truth_of):
    asked, text, start, times, repeats = CASES[case]
    missed = failures(asked, Network.from_text(text), start, times, truth_of(text, start, times), repeats)
    assert missed <= allowed(repeats)


def test_looks_that_are_satisfied_too_soon_are_seen(monkeypatch, truth_of):
    monkeypatch.setattr(stopping_rule, "chance_at", lambda *_: 8 * tuning.ALLOWED * (1 - LEVEL))
    asked, text, start, times, repeats = CASES["mean"]
    missed = failures(asked, Network.from_text(text), start, times, truth_of(text, start, times), repeats)
    assert missed > allowed(repeats)


def chance_to_be_wrong(first, needed, chains=20_000):
    """Of a mean of normal figures that takes so many runs, by the looks made here; exact but for the variances drawn.

    The mean is independent of all variances, so that each chain counts with its chance to be wrong when it stops. The
    variances of `chains` chains are drawn, which leaves an error below 0.001.
    """
    rng = np.random.default_rng(1)
    variance = needed / norm.isf((1 - LEVEL) / 2) ** 2  # for a tolerance of 1
    runs = np.full(chains, first)
    squares = variance * rng.chisquare(first - 1, chains)
    wrong = 0.0
    chance = stopping_rule.chance_at(first, True)
    while runs.size:
        seen = squares / (runs - 1)
        factor = t.isf(chance / 2, runs - 1)
        ends = factor**2 * seen <= runs
        wrong += 2 * norm.sf(np.sqrt(runs[ends] / variance)).sum()
        runs, squares, seen = runs[~ends], squares[~ends], seen[~ends]
        more = norm.isf(chance / 2) ** 2 * seen
        aim = np.minimum(tuning.MARGIN * more, tuning.GROWTH * runs)
        more = np.ceil(np.maximum(aim, tuning.LEAST_GROWTH * runs)).astype(int) - runs
        squares = squares + variance * rng.chisquare(more)
        runs = runs + more
    return wrong / chains


@pytest.mark.parametrize("first", [16, 40, 256])
def test_looks_at_normal_figures_are_wrong_no_more_often_than_they_say(first):
    for ratio in (0.8, 1.0, 1.3, 1.6, 2.0, 3.0, 5.0, 8.0, 20.0):
        assert chance_to_be_wrong(first, ratio * first) < 1 - LEVEL


def test_a_chance_twice_as_large_would_be_seen(monkeypatch):
    monkeypatch.setattr(tuning, "ALLOWED", 2 * tuning.ALLOWED)
    assert max(chance_to_be_wrong(64, ratio * 64) for ratio in (1.0, 1.6, 2.0)) > 1 - LEVEL


def test_correlated_figures_count_once_and_independent_ones_each():
    rng = np.random.default_rng(1)
    same = np.repeat(rng.standard_normal((64, 1)), 50, axis=1)[:, :, None]
    own = rng.standard_normal((64, 50))[:, :, None]
    one, all_same, all_own = (
        np.quantile(stopping_rule.largest_errors(values, np.ones(values.shape[1:]), 3), 0.95)
        for values in (same[:, :1], same, own)
    )
    assert all_same == pytest.approx(one, rel=0.15)
    assert one == pytest.approx(1.96, rel=0.15)
    assert all_own > 1.3 * one
    seldom = np.zeros((64, 1, 50))  # of species that differ in one run alone, all in the same
    seldom[0] = 1.0
    assert np.quantile(stopping_rule.largest_errors(seldom, np.ones((1, 50)), 3), 0.95) == pytest.approx(one, rel=0.15)


@pytest.mark.parametrize("of", ["mean", "sd"])
def test_what_a_look_says_of_one_figure_by_hand(of):
    """By Bernstein: the variance of what is averaged, and its skewness times the tolerance, both over the runs."""
    counts = np.random.default_rng(1).poisson(np.repeat([3.0, 40.0], [56, 8]))
    tally = Tally(DECAY, np.array([1.0]), kept_pairs(1, False))
    tally.add(counts[:, None, None])
    look = InterimLook(AskedAccuracy(0.5, False, of), tally, counts[:, None, None], np.zeros((1, 1), bool), 1)
    away = counts - counts.mean()
    values, sd = away if of == "mean" else away**2 - (away**2).mean(), counts.std(ddof=1)
    tolerance = 0.5 if of == "mean" else sd**2 - (sd - 0.5) ** 2
    spread = sd**2 if of == "mean" else (values**2).mean()
    skew = (values**3).mean() / spread
    assert skew > 1
    assert look.ratios[0, 0] == pytest.approx(np.sqrt((spread + skew * tolerance) / 64) / tolerance)


def test_errors_of_variances_count_once_where_distances_from_the_mean_are_alike():
    """Whichever side of it each count is on."""
    rng, names = np.random.default_rng(2), [f"S{i}" for i in range(40)]
    network = Network.from_text("\n".join(f"{name} -> 0, 1" for name in names))
    needed = []
    for far in (rng.integers(1, 20, (32, 1)), rng.integers(1, 20, (32, 40))):
        away = far * rng.choice([-1, 1], (32, 40))
        rows = 100 + np.concatenate([away, -away])[:, None]
        tally = Tally(network, np.array([1.0]), kept_pairs(40, False))
        tally.add(rows)
        look = InterimLook(AskedAccuracy(0.5, False, "sd"), tally, rows, np.zeros((1, 40), bool), 1)
        needed.append(look.fixed(0.05) / look.ratios.max() ** 2)
    assert needed[1] > 1.7 * needed[0]


def test_wide_bins_neither_hide_nor_add_an_error():
    """Of 20,000 runs without a copy and 100 with about 50,000: bins of 16 counts, of which 0 is in the first."""
    model, rng = Network.from_text("A -> 0, 1"), np.random.default_rng(4)
    counts = np.append(np.zeros(20_000, np.int64), rng.integers(40_000, 60_000, 100))[:, None, None]
    tally, asked = Tally(model, [1.0], kept_pairs(1)), AskedAccuracy(0.1, True)
    tally.add(counts)
    assert tally.shift.min() == 4
    look = InterimLook(asked, tally, counts[-64:], np.zeros((1, 1), bool), 1)
    mean, variance, third = counts.mean(), counts.var(ddof=1), np.mean((counts - counts.mean()) ** 3)
    tolerance = asked.tolerances(np.array([[mean]]))[0]
    error = np.sqrt((variance + third / variance * tolerance) / len(counts))
    assert look.ratios[0, 0] == pytest.approx(error / tolerance, rel=1e-3)


def test_a_spread_within_a_bin_counts(monkeypatch):
    """One run far out makes bins of 16,384 counts where there are few; most of the variance is within the first."""
    monkeypatch.setattr(statistics, "MOST_BINS", statistics.FEWEST_BINS)
    model, rng = Network.from_text("A -> 0, 1"), np.random.default_rng(5)
    counts = np.append(rng.integers(0, 16_000, 200_000), 10**6)[:, None, None]
    tally, asked = Tally(model, [1.0], kept_pairs(1)), AskedAccuracy(10.0, False)
    tally.add(counts)
    assert tally.shift.min() == 14
    ratio = InterimLook(asked, tally, counts[:64], np.zeros((1, 1), bool), 1).ratios[0, 0]
    assert ratio > np.sqrt(counts.var() / len(counts)) / 10


def test_figures_that_never_differ_count_once_a_species():
    times, species = (
        stopping_rule.largest_errors(np.zeros((16, *shape)), np.ones(shape), 1) for shape in ((8, 1), (1, 8))
    )
    assert np.mean(times) == pytest.approx(np.sqrt(2 / np.pi), rel=0.1)
    assert np.mean(species) > 1.5


def test_figures_that_never_differ_need_as_many_runs_as_could_have_shown_it():
    never = Network.from_text("A -> B, 1e-12")
    made = sampled(AskedAccuracy(0.01), never, {"A": 1}, np.array([1.0]), 1)
    assert made.statistics.pairs.tolist() == [[0, 1], [0, 1]]  # no covariances, which nothing here needs
    assert made.statistics.runs >= np.log(0.05) / np.log(0.99)  # a chance of 1 % would have shown itself
    assert made.error <= 0.01


@pytest.mark.parametrize("number", [2, 4, 9, 12, 14, 20, 22, 30])
def test_small_questions_keep_the_accuracy(number):
    _, network, start, times, asked = question(number)
    made = predict(Model(network, start), None, times, method=asked, seed=number, threads=1)
    truth = solve(network, Transient(), start, times)
    assert made.reached.is_reached
    assert share_of_accuracy(asked, made.result, truth) <= 1


def test_a_solution_that_is_off_is_seen_and_a_loose_bound_is_not_taken():
    _, network, start, times, asked = question(9)
    truth = solve(network, Transient(), start, times)
    mixed = replace(truth, probabilities=0.9 * truth.probabilities + 0.1 * truth.probabilities[:, ::-1])
    assert share_of_accuracy(asked, mixed, truth) > 1
    tops = truth.space.states.max(axis=0)
    assert error_reached(asked, truth, tops) < 1e-9
    assert error_reached(asked, replace(truth, error=0.1), tops) > asked.value
    assert error_reached(asked, replace(truth, is_bound=False), tops) == np.inf


@pytest.mark.parametrize("of", ["mean", "sd", "distribution"])
def test_a_bound_on_probabilities_bounds_every_figure(of):
    """At worst all of the error is on the largest count: moved there, no figure is farther off than is claimed."""
    truth = solve(DECAY, Transient(), {"A": 30}, [1.0, 20.0])
    for error in (1e-6, 1e-3):
        moved = truth.probabilities.copy()
        moved[:, np.argmax(truth.probabilities[0])] -= error / 2
        moved[:, 0] += error / 2
        off = replace(truth, probabilities=moved, error=error)
        asked = AskedAccuracy(1.0, False, of)
        assert share_of_accuracy(asked, off, truth) <= error_reached(asked, off, np.array([30.0]))
        needed = tolerance_for(AskedAccuracy(1e-3, False, of), np.array([30.0]))
        assert error_reached(AskedAccuracy(1e-3, False, of), replace(truth, error=needed / 2), np.array([30.0])) <= 1e-3


def test_distributions_take_as_many_runs_as_dvoretzky_kiefer_wolfowitz_and_massart_say():
    assert runs_for_distributions(0.05, 1) == int(np.ceil(np.log(2 / 0.05) / (2 * 0.05**2)))
    made = sampled(AskedAccuracy(0.1, False, "distribution"), DECAY, {"A": 20}, TIMES, 1)
    assert made.statistics.runs == runs_for_distributions(0.1, 3)
    assert made.error == pytest.approx(0.1)
    assert begun(AskedAccuracy(0.1, False, "distribution"), 0).forecast() == made.statistics.runs


def test_what_was_chosen_is_the_cheaper_and_is_told():
    cheap = predict(Model(line(), [60, 0, 0, 0]), None, [500.0], method="20%", seed=1)
    dear = predict(Model(line(), [60, 0, 0, 0]), None, [500.0], method="0.01%", seed=1)
    assert cheap.method == "auto (lockstep)"
    assert dear.method == "transient"
    for made in (cheap, dear):
        seconds = {each.method: each.seconds for each in made.reached.candidates if each.seconds is not None}
        assert made.method in seconds
        assert any(note.startswith("ten times the accuracy: about") for note in made.notes)
        assert made.reached.headline in made.headline
        assert f"chosen: {made.method}" in str(made.notes)
    assert dear.reached.is_proven
    assert cheap.reached.confidence == LEVEL
    assert cheap.reached.tenfold.seconds > 0


def test_the_same_seed_gives_the_same_for_any_number_of_threads():
    one, two = (
        predict(Model(line(), [300, 0, 0, 0]), None, [100.0, 900.0], method="2%", seed=4, threads=n) for n in (1, 2)
    )
    assert one.runs == two.runs
    assert_array_equal(one.mean, two.mean)
    assert one.reached == two.reached
    other = predict(Model(line(), [300, 0, 0, 0]), None, [100.0, 900.0], method="2%", seed=5)
    assert (other.mean != one.mean).any()


def test_relative_is_to_the_largest_mean_of_the_species_or_one_copy():
    asked = AskedAccuracy(0.1, is_relative=True)
    figures = np.array([[50.0, 0.0, 0.2], [20.0, 0.0, 0.1]])
    # less by a factor 1.1, so that no more than a tenth of the true ones is meant
    assert asked.tolerances(figures).tolist() == pytest.approx([5 / 1.1, 0.1 / 1.1, 0.1 / 1.1])
    assert AskedAccuracy(0.5).tolerances(figures).tolist() == [0.5] * 3


def test_observables_alone_are_held_to_the_accuracy():
    network = bare_line().with_rates(line().rate_constants)
    sums = Observables.of(network, {"monomer": {"monomer": 1}})
    times = np.array([0.0, 20.0])
    made = predict_job(Job(Model(network, [300, 0, 0, 0]), times, sums, seed=2), method="1%")
    truth = simulate_statistics(network, "auto", [300, 0, 0, 0], times, 40_000, seed=9)
    assert made.network.species == ("monomer",)
    assert abs(made.mean[1, 0] - truth.mean()[1, 0]) < 0.01 * 300
    all_shown = predict(Model(network, [300, 0, 0, 0]), None, times, method="1%", seed=2)
    assert all_shown.runs > made.runs


def test_with_evidence_the_interval_stands_beside_what_was_asked():
    measured = ChannelRate(rate=0.1, events=40, exposure=400.0, ways=1)
    rates = Rates(convention=Convention(combinations="distinct"), channels={"decay": measured})
    network = Network.from_text("decay: A -> 0, 1")
    made = predict(Model(network, {"A": 100}), rates, [10.0], method="1%", seed=1, draws=50)
    constant = rates.expected(network).rate_constants[0]
    assert made.mean[0, 0] == pytest.approx(100 * np.exp(-10 * constant), rel=0.01)
    assert made.low[0, 0] < made.mean[0, 0] < made.high[0, 0]
    assert made.high[0, 0] - made.low[0, 0] > 10  # not what was asked for, and not mixed with it
    assert "mean, sd and band are those at the posterior mean of each rate constant" in made.notes


def test_ctrl_c_keeps_the_runs_and_the_accuracy_reached():
    lines = []

    def interrupt(text):
        lines.append(text)
        if "about" in text and text.endswith("runs") and len(lines) > 6:
            raise KeyboardInterrupt

    made = predict(Model(line(), [1000, 0, 0, 0]), None, [50.0], method="0.1%", seed=1, progress=interrupt)
    assert not made.is_complete
    assert made.runs > 10
    assert made.reached.error > 0.001
    assert "NOT reached" in str(made.notes)


def test_ctrl_c_ends_the_prediction_and_not_its_first_part_alone():
    """Draws of the rates, which would come next, are not begun."""

    def interrupt(text):
        assert "draws" not in text
        if text.startswith("trying a projection"):
            raise KeyboardInterrupt

    network = Network.from_text("decay: A -> 0, 1")
    measured = ChannelRate(rate=0.1, events=40, exposure=400.0, ways=1)
    rates = Rates(convention=Convention(combinations="distinct"), channels={"decay": measured})
    made = predict(Model(network, {"A": 3000}), rates, [10.0], method="0.1%", seed=1, draws=10**6, progress=interrupt)
    assert not made.is_complete
    assert (made.low, made.high) == (None, None)
    assert "no interval: interrupted before the draws of the rates" in made.notes


@pytest.mark.parametrize("with_forced", [True, False])
def test_first_runs_that_are_enough_are_all(with_forced):
    made = sampled(AskedAccuracy(30.0), DECAY, {"A": 100}, TIMES, 1, with_forced=with_forced)
    assert made.statistics.runs == FIRST_RUNS


def begun(asked, runs, run_seconds=np.inf):
    """Runs of the decay until they are enough, of which so many were made."""
    source = Auto().source(DECAY, np.array([100]), 1)
    first = source.counts(TIMES, runs, threads=1) if runs else None
    job = Job(Model(DECAY, {"A": 100}), TIMES, seed=1, threads=1)
    return RunsUntil(job, asked, source, run_seconds=run_seconds, first=first)


def test_two_runs_that_were_made_are_kept_and_one_is_not():
    """An interrupt as early as it can come: one run has no variance."""
    assert begun(AskedAccuracy(1.0), 2).interrupted().result.runs == 2
    with pytest.raises(KeyboardInterrupt):
        begun(AskedAccuracy(1.0), 1).interrupted()


def test_all_runs_that_were_made_forecast_how_many_are_needed():
    runs = begun(AskedAccuracy(0.5), 0, run_seconds=1e-5)
    assert runs.forecast() == runs._seen_now().runs_needed()
    assert runs.tally.runs > FIRST_RUNS


@pytest.mark.parametrize(("room", "kept"), [(2**25, ROWS), (20 * 8 * TIMES.size, 20), (0, FIRST_RUNS)])
def test_rows_are_kept_as_far_as_there_is_room(monkeypatch, room, kept):
    monkeypatch.setattr(tuning, "ROW_BYTES", room)
    runs = begun(AskedAccuracy(1.0), 0)
    runs.fixed_from(100)
    assert sum(map(len, runs._rows)) == kept


def test_runs_that_cost_no_more_are_made_as_well():
    """As many as a vector holds; one by one otherwise."""
    ends = [sampled(AskedAccuracy(1.0), DECAY, {"A": 100}, TIMES, seed).statistics.runs for seed in range(6)]
    assert {n % 2 for n in ends} == {0, 1}
    ends = [
        sampled(AskedAccuracy(1.0), DECAY, {"A": 100}, TIMES, seed, together=8).statistics.runs for seed in range(6)
    ]
    assert {n % 8 for n in ends} == {0}


@pytest.mark.parametrize("at", ["trying a projection", "enumerating up to"])
def test_ctrl_c_while_a_solution_is_tried_keeps_the_first_runs(at):
    lines = []

    def interrupt(text):
        lines.append(text)
        if text.startswith(at) and len(lines) > 3:
            raise KeyboardInterrupt

    made = predict(Model(line(), [1000, 0, 0, 0]), None, [50.0], method="0.1%", seed=1, progress=interrupt)
    assert not made.is_complete
    assert made.runs >= 16
    assert made.reached.error > 0.001


def test_runs_that_were_made_to_forecast_are_used_at_once_and_counted():
    made = predict(Model(DECAY, {"A": 10**5}), None, [1.0], method="10%", seed=1, threads=1)
    *solutions, runs = made.reached.candidates
    assert runs.remark == f"about {made.runs} runs"
    assert [each.seconds for each in solutions] == [None, None]
    assert made.is_complete


def test_what_the_budget_ends_is_told():
    made = sampled(AskedAccuracy(0.01), DECAY, {"A": 100}, TIMES, 1, most=500)
    assert made.statistics.runs == 500
    sd = simulate_statistics(DECAY, "ssa", {"A": 100}, TIMES, 4000, 2).sd().max()
    assert 2.0 < made.error / (sd / np.sqrt(500)) < 3.0  # of three figures together


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("0%", "accuracy = 0 %; expected a finite error above 0"),
        ("-1", "accuracy = -1 copies; expected a finite error above 0"),
        (float("nan"), "accuracy = nan copies; expected a finite error above 0"),
        ("inf", "accuracy = inf copies; expected a finite error above 0"),
        (1e-30, "expected at least 1e-12"),
        ("101%", "accuracy = 101 %; expected at most 100 %"),
        ("one", "accuracy 'one'; expected a share such as 1%"),
    ],
)
def test_an_accuracy_that_nothing_reaches_is_refused(given, message):
    with pytest.raises(ValueError, match=message):
        AskedAccuracy.of_text(given) if isinstance(given, str) else AskedAccuracy(given)


def test_runs_together_with_an_accuracy_are_refused():
    with pytest.raises(ValueError, match="runs = 10 together with an accuracy, which chooses the runs itself"):
        predict(Model(DECAY, {"A": 10}), None, [1.0], "1%", runs=10)


def test_an_accuracy_below_the_last_digit_of_the_counts_is_refused():
    with pytest.raises(ValueError, match=r"accuracy = 100 copies of counts up to 4.61e\+18, which double"):
        predict(Model(DECAY, {"A": 2**62}), None, [1.0], method=AskedAccuracy(100.0))


def test_an_accuracy_of_what_is_refused():
    with pytest.raises(ValueError, match="accuracy of 'median'; expected that of mean, sd, distribution"):
        AskedAccuracy(0.1, of="median")
    with pytest.raises(ValueError, match="budget = 0; expected a positive number of seconds"):
        AskedAccuracy(0.1, budget=0.0)


def test_the_cost_beyond_the_budget_is_told_before_the_work_starts():
    lines, asked = [], AskedAccuracy(1e-5, is_relative=True, budget=1.0)
    with pytest.raises(ValueError, match=r"beyond the budget of 1 s of CPU time.* which runs may reach"):
        predict(Model(line(), [1000, 0, 0, 0]), None, [50.0], method=asked, progress=lines.append)
    made = [int(text.split()[0]) for text in lines if "of about" in text]
    assert max(made) <= MOST_FIRST  # those alone that forecast the cost


def test_rates_that_depend_on_time_are_sampled():
    driven = Network.from_text("0 -> A, 5 * (1 + sin(t))\nA -> 0, 1")
    made = predict(Model(driven, {"A": 0}), None, [2.0], method="10%", seed=1)
    assert made.method == "auto (general)"
    assert "depends on the time" in str(made.notes)


def test_events_of_a_run_are_forecast_also_where_they_crowd():
    network, grid = DECAY, np.array([10.0, 1000.0])
    per_event = 1e-9 * Auto().choose(network).cost(NetworkSize.of(network))
    method = Auto().choose(network)
    some, none = (first_runs(network, method, method.source(network, [n], 1), grid, 2, np.inf) for n in (1000, 0))
    assert some.seconds - none.seconds == pytest.approx(1000 * per_event, rel=0.1)


def test_the_first_runs_are_those_of_the_ensemble_and_end_where_they_would_cost_too_much():
    start, grid = np.array([20_000]), np.array([3.0, 50.0])
    method = Auto().choose(DECAY, start)
    source = method.source(DECAY, start, 7)
    made = first_runs(DECAY, method, source, grid, 2, np.inf)
    assert_array_equal(made.counts, method.simulate(DECAY, start, grid, 16, 7, 1).counts)
    assert first_runs(DECAY, method, source, grid, 2, 0.1 * made.seconds).counts is None


def test_conserved_cubes_limit_counts():
    assert largest_counts(line(), np.array([60, 0, 0, 0])).tolist() == [60, 30, 20, 15]


def test_copies_that_nothing_makes_more_limit_counts():
    assert largest_counts(DECAY, np.array([60])).tolist() == [60]
    binding = Network.from_text("A + B -> AB, 1\nA -> 2 C, 1")
    assert largest_counts(binding, np.array([3, 2, 0, 0])).tolist() == [np.inf] * 4
    assert largest_counts(Network.from_text("A + B -> AB, 1"), np.array([3, 2, 0])).tolist() == [5] * 3


def test_a_plain_prediction_imports_nothing_of_it():
    code = (
        "import sys; from kinetics import Network, predict; "
        "predict(Network.from_text('A -> 0, 1\\nA = 5'), None, [1.0], runs=5); "
        "print([m for m in sys.modules if m.split('.')[-1] in "
        "('adaptive', 'ways', 'first_runs', 'sampled_way', 'solved_ways', 'stopping_rule')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_job_is_answered_by_itself():
    answer = adaptive_prediction(Job(Model(DECAY, {"A": 100}), TIMES), AskedAccuracy(0.01, True))
    assert answer.reached.chosen == "transient"
    assert answer.reached.is_reached


@pytest.mark.parametrize(
    ("text", "endless"),
    [
        ("0 -> A, 5\nA -> 0, 1", True),
        ("A -> 2 A, 5\nA -> 0, 1", False),  # not sure: there may be no A
        ("0 -> A, 0\nA -> 0, 1", False),
        ("0 -> A, 5 / (1 + A)\nA -> 0, 1", False),  # a law, of which nothing is known
        ("A + B <-> C, 1, 2", False),
    ],
)
def test_states_without_end_are_not_listed(text, endless):
    network = Network.from_text(text)
    assert is_endless(network) == endless
    made = predict(Model(network, dict.fromkeys(network.species, 1)), None, [1.0], method="20%", seed=1)
    assert ("transient: infinitely many states" in str(made.notes)) == endless


@pytest.mark.parametrize(
    ("text", "start", "times"),
    [
        ("A -> 0, 1\n0 -> B, 1e-300", {"A": 1}, [3000.0]),  # nearly nothing is left to follow
        ("A -> 0, 1\nB -> C, 1e-18", {"A": 5000, "B": 1}, [1000.0]),
        (
            "on: G -> 0, 1e-3\nG -> G + A, 5\nH -> K, 1e-306",
            {"G": 1, "H": 1},
            [5.0],
        ),  # forced, nothing more happens
    ],
)
def test_propensities_next_to_nothing_are_no_fault(text, start, times):
    network = Network.from_text(text)
    made = predict(Model(network, start), None, times, method="10%", seed=1)
    assert made.reached.error <= 0.1
    sampled(AskedAccuracy(0.1, True), network, start, np.array(times), 1)


def test_a_late_explosion_ends_the_figures_of_all_runs():
    """In one run of 300: at times before it, the accuracy holds as if nobody had asked for more."""
    network = Network.from_text("0 -> X, 5\nX -> 0, 1\non: G -> A, 6e-4\nA -> 2 A, 30")
    sums = Observables.of(network, {"X": {"X": 1}})
    start, times = {"X": 5, "G": 1}, [0.5, 1.0, 6.0]
    made = predict_job(Job(Model(network, start), times, sums, 1, threads=1, max_events=10_000), method="2%")
    assert made.truncated.run > FIRST_RUNS
    assert made.times.tolist() == times[: made.times.size]
    assert made.times[-1] == made.truncated.until < made.truncated.beyond
    assert made.mean.shape == made.standard_error.shape == (made.times.size, 1)
    assert made.reached.is_reached
    assert abs(made.mean - 5).max() < 0.1
    assert str(made.truncated) in made.notes


def test_a_solution_of_all_times_goes_before_runs_of_some():
    network = Network.from_text("A -> B, 200\nB -> A, 200")
    made = predict_job(
        Job(Model(network, {"A": 900}), np.array([0.001, 0.2]), seed=1, threads=1, max_events=2000), method="5%"
    )
    assert (made.method, made.truncated, made.times.size) == ("transient", None, 2)


def test_one_more_way_is_one_line(monkeypatch):
    class Oracle(AccuracyWay):
        name = "oracle"

        def forecast(self, rivals):
            self.cost = CostForecast(self.name, 0.0, "asked")
            self.is_settled = rivals < np.inf

        def attempt(self):
            job = self.goal.job
            return Attained(job.distribution(solve(job.model.network, "transient", job.model.initial, job.grid)), 0.0)

    monkeypatch.setattr(adaptive, "WAYS", (*adaptive.WAYS, Oracle))
    made = predict(Model(line(), [60, 0, 0, 0]), None, [500.0], method="1%", seed=1)
    assert (made.method, made.runs) == ("oracle", None)
    assert made.reached.candidates[-1] == ("oracle", 0.0, "asked")


def test_every_tuning_constant_says_what_measured_it():
    text = Path(tuning.__file__).read_text(encoding="utf-8")
    table = [line for line in text.splitlines() if re.match(r"[A-Z_]+(, [A-Z_]+)* = ", line)]
    names = {name for each in table for name in each.partition(" = ")[0].split(", ")}
    assert names == {name for name in vars(tuning) if name.isupper()}
    for each in table:
        assert re.search(r"\b(choice|timed|bench|test)\b", each.partition("#")[2]), each
