import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import binom

from kinetics import Auto, Network, predict
from kinetics.predicting import AskedAccuracy, scouts
from kinetics.predicting.accuracy import LEVEL
from kinetics.predicting.enough_runs import RunsUntil
from kinetics.predicting.observables import Observables
from kinetics.predicting.reaching import AskedCounts
from kinetics.predicting.run_cost import first_runs
from kinetics.predicting.scouts import Scouts, send_scouts
from kinetics.runs.statistics import Tally, kept_pairs

FALSE_ALARM = 1e-6
BURST = Network.from_text("burst: G -> G + 100 M, 0.001\nwaver: 0 -> A, 5\nA -> 0, 1")
TIMES = np.array([2.0, 4.0, 6.0])
SWITCH = Network.from_text("on: G -> H, 0.0006\nH -> G, 0.02\nH -> H + M, 100\nM -> 0, 1")


def sent(network, start, times, most=64, needed=16.0, weights=None, seed=1):
    """Scouts beside the first runs of a network, and these as a tally."""
    state = network.state(start)
    method = Auto().choose(network, state)
    source = method.source(network, state, seed)
    first = first_runs(network, method, source, times, times.size, np.inf)
    found = send_scouts(network, source, first.seen, times, most, seed, needed)
    tally = Tally(network, times, kept_pairs(len(network.species), False))
    tally.add(first.counts)
    return found, tally


def test_a_burst_that_no_run_has_shown_enters_the_moments_by_its_chance():
    found, tally = sent(BURST, {"G": 1, "A": 5}, TIMES)
    mean = (tally.sums / tally.runs).astype(float)
    added = found.moments(tally, mean, 4)
    burst, waver = BURST.index("M"), BURST.index("A")
    # at the last time a burst has come by the chance 0.006; earlier the share of scouts so early counts
    for power in (1, 2, 3, 4):
        assert_allclose(added[power, -1, burst], 0.006 * 100.0**power, rtol=1e-9)
    assert np.all(np.diff(added[2, :, burst]) >= 0)
    assert not added[:, :, waver].any()
    assert not added[0].any()
    assert found.in_words(tally.low, tally.high).startswith("'burst' (0.006 firings a run) was made to fire")


def test_the_chance_of_early_times_is_right_on_average():
    shares = [found.moments(tally, 0.0 * tally.low, 2)[2, 0, 1] for found, tally in map(at_seed, range(200))]
    assert np.mean(shares) == pytest.approx(0.002 * 100**2, rel=0.1)  # sd of the mean .02 at most


def at_seed(seed):
    return sent(BURST, {"G": 1, "A": 5}, TIMES, seed=seed)


def test_what_runs_have_shown_is_not_added():
    found, tally = sent(BURST, {"G": 1, "A": 5}, TIMES)
    shown = np.zeros((1, TIMES.size, len(BURST.species)), dtype=np.int64)
    shown[0, :, BURST.index("M")] = 90  # within half of the range of a burst
    tally.add(shown)
    assert not found.moments(tally, 0.0 * tally.low, 3).any()
    assert found.in_words(tally.low, tally.high) == ""


def test_channels_that_fire_often_or_never_are_not_made_to():
    found, _ = sent(BURST, {"G": 1, "A": 5}, TIMES)
    assert {each.channel for each in found.made} == {"burst"}
    often, _ = sent(BURST, {"G": 1, "A": 5}, TIMES, needed=1e5)  # enough runs show 600 bursts
    never, _ = sent(BURST, {"G": 1, "A": 5}, TIMES, needed=1.0)
    assert often == never == Scouts()


def test_no_more_are_sent_than_allowed_and_those_left_out_are_told():
    many = Network.from_text("\n".join(f"c{i}: G -> G + 100 M{i}, {0.001 + 1e-5 * i:g}" for i in range(10)))
    found, tally = sent(many, {"G": 1}, TIMES, most=4)
    assert [each.channel for each in found.made] == ["c9", "c8", "c7", "c6"]
    assert sum(len(each.counts) for each in found.made) == 4
    assert found.left_out == 6
    told = found.in_words(tally.low, tally.high)
    assert told.endswith("; left out, as too many or too dear to follow: 6 rare channels")
    assert " and 1 more were made to fire" in told
    found, _ = sent(many, {"G": 1}, TIMES, most=60)
    assert sum(len(each.counts) for each in found.made) == 60
    assert found.left_out == 0


def test_those_that_would_cost_far_more_than_runs_are_left_out():
    dear = Network.from_text("on: G -> H, 0.001\nH -> H + M, 1e9")
    found, tally = sent(dear, {"G": 1}, TIMES)
    assert (found.made, found.left_out) == ((), 1)
    told = found.in_words(tally.low, tally.high)
    assert told == "left out, as too many or too dear to follow: 1 rare channel"


def test_standard_deviations_of_bursts_are_kept():
    """Of a burst of 100 copies by the chance p the standard deviation is 100 sqrt(p (1 - p)), here about 7.7."""
    true, missed = 100 * np.sqrt(-np.expm1(-0.006) * np.exp(-0.006)), 0
    for seed in range(20):
        made = until(
            Network.from_text("burst: G -> 100 M, 0.001"), {"G": 1}, TIMES, AskedAccuracy(0.1, True, "sd"), seed, True
        )
        missed += abs(made.sd()[-1, 1] / true - 1) > 0.1
    assert missed <= binom(20, 1 - LEVEL).isf(FALSE_ALARM)


def test_none_are_sent_where_rates_depend_on_time():
    driven = Network.from_text("0 -> A, 0.01 * (1 + sin(t))\nA -> 0, 1")
    assert sent(driven, {"A": 0}, TIMES)[0] is None
    made = predict(driven, None, {"A": 0}, [2.0], accuracy="10%", seed=1)
    assert made.runs >= 64  # more than first runs must say so then
    assert f"rare events: {scouts.NOT_SENT}" in made.notes


def until(network, start, times, asked, seed, with_scouts):
    state = network.state(start)
    method = Auto().choose(network, state)
    source = method.source(network, state, seed)
    first = first_runs(network, method, source, times, times.size, np.inf)
    scouting = partial(send_scouts, network, source, first.seen, times, 32, seed)
    known = AskedCounts(network, state, times).is_known
    runs = RunsUntil(
        asked, network, source, times, known, seed, 1, lambda _: None, first.seconds, first.counts,
        scouting=scouting if with_scouts else lambda _: None,
    )  # fmt: skip
    runs.foretell()
    return runs.finish(10**8).statistics


def true_mean(times):
    """Of the switch, whose means obey linear equations."""
    from scipy.linalg import expm

    a = np.array([[-0.0006, 0.02, 0], [0.0006, -0.02, 0], [0, 100, -1]])
    return np.array([expm(a * t) @ [1, 0, 0] for t in times])


@pytest.mark.parametrize("with_scouts", [True, False])
def test_bursts_in_one_of_300_runs_are_not_missed(with_scouts):
    """Without scouts, the control, they are missed by nearly half of the answers."""
    repeats, times = 60, np.array([3.0, 6.0])
    true, missed = true_mean(times), 0
    for seed in range(repeats):
        mean = until(SWITCH, {"G": 1}, times, AskedAccuracy(0.1, True), seed, with_scouts).mean()
        missed += bool((abs(mean - true) > 0.1 * np.maximum(true.max(axis=0), 1.0)).any())
    allowed = binom(repeats, 1 - LEVEL).isf(FALSE_ALARM)
    assert (missed <= allowed) == with_scouts
    page = (Path(__file__).parents[3] / "docs" / "accuracy.md").read_text(encoding="utf-8")
    told = re.search(r"Of 60 answers .*?, (\d+) are off .*? without these extra runs (\d+) are", page, re.DOTALL)
    assert missed == int(told[1 if with_scouts else 2])


def test_observables_are_scouted():
    sums = Observables.of(SWITCH, {"M": {"M": 1}})
    made = predict(SWITCH, None, {"G": 1}, [6.0], observables=sums, accuracy="10%", seed=1)
    assert made.runs > 2000
    assert "'on' (0.0036 firings a run) was made to fire" in str(made.notes)
    assert "'on'" in made.reached.to_dict()["rare_events"]


def test_solutions_say_nothing_of_rare_events():
    made = predict(Network.from_text("A -> B, 0.001"), None, {"A": 2}, [1.0], accuracy="10%")
    assert made.method == "exact"
    assert made.reached.seldom == ""
