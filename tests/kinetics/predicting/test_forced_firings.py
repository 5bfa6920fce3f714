import re
from pathlib import Path

import numpy as np
import pytest
from accuracy_questions import sampled
from numpy.testing import assert_allclose
from scipy.linalg import expm
from scipy.stats import binom

from kinetics import Auto, Model, Network, predict
from kinetics.predicting import AskedAccuracy, Job, forced_firings, predict_job, tuning
from kinetics.predicting.first_runs import SeenRates, first_runs
from kinetics.predicting.forced_firings import force_firings
from kinetics.predicting.observables import Observables
from kinetics.predicting.tuning import LEVEL
from kinetics.sampling.statistics import Tally, kept_pairs

FALSE_ALARM = 1e-6
BURST = Network.from_text("burst: G -> G + 100 M, 0.001\nwaver: 0 -> A, 5\nA -> 0, 1")
TIMES = np.array([2.0, 4.0, 6.0])
SWITCH = Network.from_text("on: G -> H, 0.0006\nH -> G, 0.02\nH -> H + M, 100\nM -> 0, 1")


def forced(network, start, times, most=64, needed=16.0, weights=None, seed=1):
    """Forced firings beside the first runs of a network, and these as a tally."""
    state = network.state(start)
    method = Auto().choose(network, state)
    source = method.source(network, state, seed)
    first = first_runs(network, method, source, times, times.size, np.inf)
    tally = Tally(network, times, kept_pairs(len(network.species), False))
    tally.add(first.counts)
    return force_firings(network, source, first.seen, times, most, seed, tally, needed), tally


def test_a_burst_that_no_run_has_shown_enters_the_moments_by_its_chance():
    found, tally = forced(BURST, {"G": 1, "A": 5}, TIMES)
    mean = (tally.sums / tally.runs).astype(float)
    added = found.moments(tally, mean, 4)
    burst, waver = BURST.index("M"), BURST.index("A")
    # at the last time a burst has come by the chance 0.006; earlier the share of those so early counts
    for power in (1, 2, 3, 4):
        assert_allclose(added[power, -1, burst], 0.006 * 100.0**power, rtol=1e-9)
    assert np.all(np.diff(added[2, :, burst]) >= 0)
    assert added[2, :, waver].max() < 1e-3 * 5  # of its variance: some forced runs are far out, too
    assert not added[0].any()
    assert found.note.startswith("'burst' (0.006 firings a run) was forced to fire")


def test_the_chance_of_early_times_is_right_on_average():
    shares = [found.moments(tally, 0.0 * tally.low, 2)[2, 0, 1] for found, tally in map(at_seed, range(200))]
    assert np.mean(shares) == pytest.approx(0.002 * 100**2, rel=0.1)  # sd of the mean .02 at most


def at_seed(seed):
    return forced(BURST, {"G": 1, "A": 5}, TIMES, seed=seed)


def test_what_runs_have_shown_is_not_added():
    found, tally = forced(BURST, {"G": 1, "A": 5}, TIMES)
    before = found.moments(tally, 0.0 * tally.low, 3)
    shown = np.zeros((1, TIMES.size, len(BURST.species)), dtype=np.int64)
    shown[0, :, BURST.index("M")] = 100
    tally.add(shown)  # one of 17: more than the chance of 0.006
    after = found.moments(tally, 0.0 * tally.low, 3)
    burst = BURST.index("M")
    assert before[2, -1, burst]
    assert not after[:, :, burst].any()
    tally.add(np.zeros((300, TIMES.size, len(BURST.species)), dtype=np.int64))  # one of 317: less
    part = found.moments(tally, 0.0 * tally.low, 2)[2, -1, burst]
    assert part == pytest.approx((0.006 - 1 / 317) * 100**2)
    tally.add(np.repeat(shown, tuning.SHOWN, axis=0))
    assert not found.moments(tally, 0.0 * tally.low, 3)[:, :, burst].any()


def test_channels_that_fire_often_or_never_are_not_made_to():
    found, _ = forced(BURST, {"G": 1, "A": 5}, TIMES)
    assert {each.channel for each in found.made} == {"burst"}
    often, _ = forced(BURST, {"G": 1, "A": 5}, TIMES, needed=1e5)  # enough runs show 600 bursts
    never, _ = forced(BURST, {"G": 1, "A": 5}, TIMES, needed=1.0)
    assert often.made == never.made == ()
    assert often.left_out == never.left_out == 0


def test_beyond_is_half_the_range_that_runs_have_shown():
    found, tally = forced(BURST, {"G": 1, "A": 5}, TIMES)
    waver, width = BURST.index("A"), tally.high - tally.low
    assert width[:, waver].min() > 2
    np.testing.assert_array_equal(found.inner[0], tally.low - np.ceil(width / 2))
    np.testing.assert_array_equal(found.inner[1], tally.high + np.ceil(width / 2))


def test_channels_are_forced_at_all_times_that_runs_were_seen():
    """The last of these but one is 5.45."""
    made = [forced(BURST, {"G": 1, "A": 5}, np.array([2.0, 5.3, 6.0]), seed=seed)[0].made for seed in range(10)]
    assert {each.first for found in made for each in found} == {0, 1, 2}


def test_what_could_not_fire_at_a_time_fires_at_the_next():
    network, times = Network.from_text("A -> 0, 1"), np.array([0.0, 1.0, 2.0, 3.0])
    states = np.array([[0, 4, 6, 8]])[:, :, None]
    seen = SeenRates(times, states, states.astype(float))
    for at, begin, left in ((0, 1.0, 3), (1, 1.0, 3), (2, 2.0, 5)):
        when, state = forced_firings._after_firing(network, seen, 0, at, np.random.default_rng(1))
        assert (when, state.tolist()) == (begin, [left])


def many_bursts(n, chance):
    return Network.from_text("\n".join(f"c{i}: G -> G + 100 M, {chance / n / 6:g}" for i in range(n)))


def test_forced_runs_take_no_more_memory_than_is_allowed(monkeypatch):
    monkeypatch.setattr(tuning, "FORCED_COUNTS", 40 * TIMES.size * 2)
    found, _ = forced(many_bursts(30, 0.012), {"G": 1}, TIMES, most=2000)
    assert 20 < sum(len(each.counts) for each in found.made) <= 40
    monkeypatch.setattr(tuning, "FORCED_COUNTS", 0)
    found, _ = forced(many_bursts(30, 0.012), {"G": 1}, TIMES, most=2000)
    assert sum(len(each.counts) for each in found.made) == 16


def test_where_there_are_just_as_many_each_is_sent_once():
    found, _ = forced(many_bursts(16, 0.012), {"G": 1}, TIMES, most=16)
    assert {each.channel for each in found.made} == {f"c{i}" for i in range(16)}
    assert found.left_out == 0
    assert found.note.count("firings a run") == 3
    assert " and 13 more were forced to fire" in found.note
    assert " more " not in forced(many_bursts(3, 0.012), {"G": 1}, TIMES)[0].note
    found, _ = forced(many_bursts(16, 0.012), {"G": 1}, TIMES, most=4, needed=400.0)
    assert sum(len(each.counts) for each in found.made) == 96  # as many as go evenly into a quarter of those needed


def test_the_likeliest_are_followed_and_others_counted():
    chances = [1e-3 * (1 + i) for i in range(20)]
    lines = [f"c{i}: G -> G + 100 M, {chance / 6:g}" for i, chance in enumerate(chances)]
    found, _ = forced(Network.from_text("\n".join(lines)), {"G": 1}, TIMES, most=16)
    assert {each.channel for each in found.made} == {f"c{i}" for i in range(4, 20)}
    assert found.left_out == 4
    assert " more were forced to fire, and the effect is included; 4 rare channels left out" in found.note


def test_channels_that_are_rare_alone_are_not_left_out_if_they_are_not_together():
    found, _ = forced(many_bursts(200, 0.006), {"G": 1}, TIMES, most=2000)  # each fires 0.0005 times in 16 runs
    assert len({each.channel for each in found.made}) == len(found.made) > 150  # at one time each


@pytest.mark.parametrize(
    "text", ["k: 0 -> A, 2e-4\nA -> 2 A, 100", "k: 0 -> P, 2e-4\nP -> P + Q, 1e6\nQ -> Q + W, 1e6"]
)
def test_explosions_are_not_followed_and_refuse_nothing(text):
    network = Network.from_text(text + "\n0 -> X, 5\nX -> 0, 1")
    found, _ = forced(network, {"X": 5}, TIMES)
    assert (found.made, found.left_out) == ((), 1)
    made = predict_job(
        Job(Model(network, {"X": 5}), np.array([6.0]), Observables.of(network, {"X": {"X": 1}})), method="10%"
    )
    assert abs(made.mean[0, 0] - 5) < 0.5
    assert "1 rare channel left out, as too many or too expensive to follow" in str(made.notes)


def turn(share):
    """Of a rare event's outcomes, one of many copies is this likely; and the true means of these copies."""
    network = Network.from_text(
        f"on: G -> H, 0.01\nside: H -> W, {20 * (1 - share)}\nturn: H -> B, {20 * share}\n"
        "B -> B + M, 1000\nM -> 0, 1\nwaver: 0 -> A, 5\nA -> 0, 1"
    )
    rates = np.array([[-0.01, 0, 0, 0], [0.01, -20, 0, 0], [0, 20 * share, 0, 0], [0, 0, 1000, -1]])
    return network, np.array([expm(rates * t)[3, 0] for t in TIMES])


def off_by_too_much(share, repeats):
    """How many answers about the copies of an unlikely turn are off by more than was asked."""
    network, true = turn(share)
    copies = network.index("M")
    means = (
        predict(Model(network, {"G": 1, "A": 5}), None, TIMES, method="20%", seed=seed, threads=1).mean[:, copies]
        for seed in range(repeats)
    )
    return sum(bool((abs(mean - true) > 0.2 * true.max()).any()) for mean in means)


@pytest.mark.parametrize(("share", "word"), [(0.05, "1/20"), pytest.param(0.01, "1/100", marks=pytest.mark.validate)])
def test_unlikely_turns_after_a_rare_event(share, word):
    """One in twenty is found; one in a hundred, the page says, is not. Last digits may end a few answers elsewhere."""
    repeats = 40
    missed = off_by_too_much(share, repeats)
    page = (Path(__file__).parents[3] / "docs" / "accuracy.md").read_text(encoding="utf-8")
    assert abs(missed - int(re.search(rf"{word}, (\d+) of 40", page)[1])) <= 3
    assert share < 0.05 or missed <= binom(repeats, 1 - LEVEL).isf(FALSE_ALARM)


@pytest.mark.validate
def test_few_forced_runs_miss_unlikely_turns(monkeypatch):
    monkeypatch.setattr(tuning, "FORCED_RUNS", 4)
    monkeypatch.setattr(tuning, "SELDOM", 10.0)
    assert off_by_too_much(0.05, 40) > binom(40, 1 - LEVEL).isf(FALSE_ALARM)


def test_those_that_would_cost_far_more_than_runs_are_left_out():
    expensive = Network.from_text("on: G -> H, 0.001\nH -> H + M, 1e9")
    found, _ = forced(expensive, {"G": 1}, TIMES)
    assert (found.made, found.left_out) == ((), 1)
    assert found.note == "1 rare channel left out, as too many or too expensive to follow"


def test_the_more_events_the_runs_have_the_more_forced_ones_may_have():
    text, busy = "on: G -> H, 2e-6\nH -> H + M, 5e4\n", "0 -> X, 1e4\nX -> 0, 5"
    alone, beside = (forced(Network.from_text(text + more), {"G": 1}, TIMES, needed=4000)[0] for more in ("", busy))
    assert (alone.left_out, beside.left_out) == (1, 0)


def test_a_channel_fires_in_runs_that_have_its_reactants():
    found, _ = forced(Network.from_text("A -> B, 0.1\nrare: B -> 100 M, 1e-3"), {"A": 1}, TIMES)
    fired = [each for each in found.made if each.channel == "rare"]
    assert len(fired) == 3
    assert found.left_out == 0
    assert all((each.counts == [0, 0, 100]).all() for each in fired)


def test_counts_are_those_so_long_after_it_fired():
    """A switch that makes 100 copies in a unit of time, within the two until the next time that is asked for."""
    found, _ = forced(Network.from_text("on: G -> H, 0.001\nH -> H + M, 100"), {"G": 1}, TIMES)
    assert len(found.made) == 3
    for each in found.made:
        assert 0 < each.counts[:, 0, 2].mean() < 220
        assert_allclose(np.diff(each.counts[:, :, 2].mean(axis=0)), 200, rtol=0.1)


def test_what_stays_within_what_runs_have_shown_is_not_spoken_of():
    network = Network.from_text("rare: A -> 0, 1e-4\n0 -> A, 5\nA -> 0, 1")
    found, tally = forced(network, {"A": 5}, TIMES)
    assert {each.channel for each in found.made} == {"rare"}
    assert found.note == ""
    assert not found.moments(tally, 0.0 * tally.low, 3).any()


def test_standard_deviations_of_bursts_are_kept():
    """Of a burst of 100 copies by the chance p the standard deviation is 100 sqrt(p (1 - p)), here about 7.7."""
    true, missed = 100 * np.sqrt(-np.expm1(-0.006) * np.exp(-0.006)), 0
    once, asked = Network.from_text("burst: G -> 100 M, 0.001"), AskedAccuracy(0.1, True, "sd")
    for seed in range(20):
        made = sampled(asked, once, {"G": 1}, TIMES, seed).statistics
        missed += abs(made.sd()[-1, 1] / true - 1) > 0.1
    assert missed <= binom(20, 1 - LEVEL).isf(FALSE_ALARM)


def test_none_are_sent_where_rates_depend_on_time():
    driven = Network.from_text("0 -> A, 0.01 * (1 + sin(t))\nA -> 0, 1")
    assert forced(driven, {"A": 0}, TIMES)[0] is None
    made = predict(Model(driven, {"A": 0}), None, [2.0], method="10%", seed=1)
    assert made.runs >= 64  # more than first runs must say so then
    assert f"rare events: {forced_firings.NOT_FORCED}" in made.notes


def true_mean(times):
    """Of the switch, whose means obey linear equations."""
    a = np.array([[-0.0006, 0.02, 0], [0.0006, -0.02, 0], [0, 100, -1]])
    return np.array([expm(a * t) @ [1, 0, 0] for t in times])


@pytest.mark.parametrize("with_forced", [True, False])
def test_bursts_in_one_of_300_runs_are_not_missed(with_forced):
    """Without forced firings, the control, they are missed by nearly half of the answers."""
    repeats, times = 60, np.array([3.0, 6.0])
    true, missed = true_mean(times), 0
    for seed in range(repeats):
        mean = sampled(
            AskedAccuracy(0.1, True), SWITCH, {"G": 1}, times, seed, with_forced=with_forced
        ).statistics.mean()
        missed += bool((abs(mean - true) > 0.1 * np.maximum(true.max(axis=0), 1.0)).any())
    allowed = binom(repeats, 1 - LEVEL).isf(FALSE_ALARM)
    assert (missed <= allowed) == with_forced
    page = (Path(__file__).parents[3] / "docs" / "accuracy.md").read_text(encoding="utf-8")
    told = re.search(r"Of 60 answers .*?, (\d+) are off .*? without these extra runs (\d+) are", page, re.DOTALL)
    assert missed == int(told[1 if with_forced else 2])


def test_forced_firings_count_observables():
    sums = Observables.of(SWITCH, {"M": {"M": 1}})
    made = predict_job(Job(Model(SWITCH, {"G": 1}), np.array([6.0]), sums, seed=1), method="10%")
    assert made.runs > 2000
    assert "'on' (0.0036 firings a run) was forced to fire" in str(made.notes)
    assert "'on'" in made.reached.to_dict()["rare_events"]


def test_solutions_say_nothing_of_rare_events():
    made = predict(Model(Network.from_text("A -> B, 0.001"), {"A": 2}), None, [1.0], method="10%")
    assert made.method == "transient"
    assert made.reached.rare == ""


@pytest.mark.validate
@pytest.mark.parametrize(
    ("text", "start", "at", "words"),
    [
        ("0 -> 1000 M, 0.1\nM -> 0, 100", {"M": 0}, 10.0, "of 1,000 runs"),
        ("A -> 2 A, 1\nA -> 0, 1", {"A": 1}, 100.0, "dies out"),
    ],
)
def test_what_the_page_says_is_not_found(text, start, at, words):
    """Means of 1 copy, of runs of which nearly all show none."""
    network = Network.from_text(text)
    means = (
        predict(Model(network, start), None, [at], method="10%", seed=n, threads=1).mean[0, 0] for n in range(1, 41)
    )
    missed = sum(abs(mean - 1.0) > 0.1 for mean in means)
    page = (Path(__file__).parents[3] / "docs" / "accuracy.md").read_text(encoding="utf-8")
    assert abs(missed - int(re.search(rf"{words} \((\d+) of 40", page)[1])) <= 4
