"""Runs between calls of a kernel: the same bits however often it returns, Ctrl-C, and runs that would never end."""

import os
import signal
import threading
from dataclasses import replace

import numpy as np
import pytest
from known_systems import line, network
from numpy.testing import assert_array_equal
from sampled_networks import MIXED, THIRD_ORDER

from kinetics import Model, Network, predict, simulate, simulate_statistics
from kinetics.kernels import outcomes
from kinetics.runs import TruncatedRunsError
from kinetics.sampling import SAMPLING_METHODS, Leaping, exposures_of_draws, simulate_posterior, watch
from kinetics.sampling.outlook import Outlook
from kinetics.sampling.watch import FIRST_RUNS, Watch

METHODS = [method() for method in SAMPLING_METHODS]
LEAPS_ALONE = Leaping(fewest=0.0)  # no single events: it leaps 1e13 times a unit of time where a rate may be 1e13
named = pytest.mark.parametrize("method", [*METHODS, LEAPS_ALONE], ids=repr)
HOT = Network.from_text("0 -> A, 1e300\nA -> 0, 1e300")
EXPLOSION = Network.from_text("2 A -> 3 A, 0.01\nA -> 0, 0.1")
YULE = Network.from_text("A -> 2 A, 1")
LOGISTIC = Network.from_text("A -> 2 A, 1\n2 A -> A, 1e-3")
LEAPED = Network.from_text("A -> B, 1\nB -> A, 2\nA + B -> B, 1e-4")
STILL = Network.from_text("late: B -> 2000 A, 1\nfall: A -> 0, 1e13")
JUMP = network(("A", "B"), {"jump": ((1, 0), (1, 2**62))}, [1.0])
CASES = {
    "line": (line(), [60, 0, 0, 0], 100.0),
    "mixed": (MIXED, [30, 10, 20], 0.3),
    "third order": (THIRD_ORDER, [11, 2], 2.0),
    "leaps": (LEAPED, [20_000, 3_000], 0.02),
    "a clock that stands still at times": (STILL, [1, 0], 1.5),
}


def hasty(monkeypatch, events):
    """Kernels that return after so many events."""
    monkeypatch.setattr(Watch, "most_events", events)
    monkeypatch.setattr(Watch, "pause", lambda self, _: self.hear())


@pytest.mark.parametrize("name", CASES)
@named
def test_runs_are_the_same_however_often_kernels_return(method, name, monkeypatch):
    net, initial, end = CASES[name]
    if not method.supports(net) or (method == LEAPS_ALONE and net is STILL):
        pytest.skip(method.unsupported_reason(net) or "it leaps for ever")
    times = np.linspace(0.0, end, 5)
    expected = method.simulate(net, initial, times, runs=20, seed=3, first_run=4).counts
    path = method.sample_path(net, initial, end, seed=3, run=6)
    hasty(monkeypatch, 7)
    assert_array_equal(method.simulate(net, initial, times, runs=20, seed=3, first_run=4).counts, expected)
    again = method.sample_path(net, initial, end, seed=3, run=6)
    assert_array_equal(again.times, path.times)
    assert_array_equal(again.channels, path.channels)
    assert_array_equal(path.at(times), expected[2])


def test_draws_are_the_same_however_often_kernels_return(monkeypatch):
    net, initial = line(), [60, 0, 0, 0]
    constants = np.outer([1.0, 2.0], net.known_rates)

    def everything():
        counts = list(simulate_posterior(Model.of(net, initial), constants, [10.0, 100.0], runs=9, seed=3, threads=2))
        both = list(exposures_of_draws(Model.of(net, initial), constants, 100.0, runs=9, seed=3))
        return [*counts, *(table for pair in both for table in pair)]

    expected = everything()
    hasty(monkeypatch, 7)
    for one, other in zip(everything(), expected, strict=True):
        assert_array_equal(one, other)


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_a_wait_that_does_not_move_the_clock_is_an_event(method):
    """Some 2,000 waits near t = 1, of which most are below half a unit in its last place."""
    counts = method.simulate(STILL, [1, 0], [50.0], runs=30, seed=2).counts
    assert_array_equal(counts[:, 0], 0)
    path = method.sample_path(STILL, [1, 0], 50.0, seed=2)
    assert path.times.size == 2001
    assert (np.diff(path.times) == 0).sum() > 500


@pytest.mark.parametrize("threads", [pytest.param(1, marks=pytest.mark.validate), 2])
@named
def test_ctrl_c_is_heard_within_a_run(method, threads, monkeypatch):
    """A run that would never end, without any forecast of that: it comes back at all, and all threads with it."""
    monkeypatch.setattr(Outlook, "events", lambda *_: np.nan)
    before, most = threading.active_count(), 10**15
    makers = [
        lambda: method.simulate(HOT, [1], [1.0], runs=40, threads=threads, max_events=most),
        lambda: simulate_statistics(HOT, method, [1], [1.0], runs=40, threads=threads, max_events=most),
        lambda: method.sample_path(HOT, [1], 1.0, max_events=most),
    ]
    for make in makers if threads == 1 else makers[:2]:
        timer = threading.Timer(0.2, os.kill, [os.getpid(), signal.SIGINT])
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            make()
        timer.join()
    assert threading.active_count() == before


@named
def test_the_runs_that_are_finished_are_kept(method, monkeypatch):
    """Ctrl-C once three runs are done: the statistics are those of the first runs that are."""

    def interrupts(self, *_):
        if self.complete.get(0, 0) >= 3:
            raise KeyboardInterrupt

    hasty(monkeypatch, 7)
    monkeypatch.setattr(Watch, "pause", interrupts)
    monkeypatch.setattr(Watch, "hear", interrupts)
    found = simulate_statistics(line(), method, [60, 0, 0, 0], [100.0], runs=80, seed=3, threads=1)
    assert 3 <= found.runs < 80
    assert not found.is_complete
    monkeypatch.undo()
    expected = simulate_statistics(line(), method, [60, 0, 0, 0], [100.0], runs=found.runs, seed=3)
    assert_array_equal(found.mean(), expected.mean())


@named
@pytest.mark.parametrize("threads", [1, 2])
def test_figures_end_before_the_first_truncated_run(method, threads):
    """Whatever the threads: the same times, the same counts, and the same words."""
    grid = [0.0, 0.5, 1.0, 2.0, 40.0, 50.0]
    runs = method.simulate(YULE, [10], grid, runs=60, seed=1, threads=threads, max_events=2000)
    assert_array_equal(runs.times, grid[:4])
    assert_array_equal(runs.counts, method.simulate(YULE, [10], grid[:4], runs=60, seed=1).counts)
    said = runs.truncated
    assert (said.truncated, said.among, said.until, said.beyond, said.channel) == (20, FIRST_RUNS, 2.0, 40.0, "r1")
    assert said == method.simulate(YULE, [10], grid, runs=60, seed=1, max_events=2000).truncated
    assert "figures end at 2" in str(said)
    with pytest.raises(TruncatedRunsError, match="raise max_events"):
        method.simulate(YULE, [10], [40.0], runs=2, seed=1, max_events=2000)
    with pytest.raises(TruncatedRunsError, match=r"run 1: (it made|its rate equations)"):
        method.sample_path(YULE, [10], 40.0, seed=1, run=1, max_events=2000)


@named
def test_runs_that_never_end_are_seen_early(method):
    runs = method.simulate(HOT, [1], [0.0, 1.0], runs=3, seed=1)
    assert_array_equal(runs.counts, np.ones((3, 1, 1)))
    assert runs.truncated.reason == "forecast"
    assert runs.truncated.events > 1e10


def test_lanes_are_truncated_as_single_runs_are():
    one, other = (simulate(EXPLOSION, name, [20], [1.0, 5.0, 20.0], runs=40, seed=4) for name in ("ssa", "lockstep"))
    assert_array_equal(one.counts, other.counts)
    assert one.truncated == other.truncated
    assert one.truncated.reason == "forecast"
    assert 0 < one.truncated.share < 1


def test_a_count_that_overflows_is_taken_back():
    runs = simulate(JUMP, "ssa", [1, 0], [0.0, 1e-6, 1e3], runs=5, seed=1)
    assert_array_equal(runs.counts[:, 0], [[1, 0]] * 5)
    assert runs.truncated.reason == "overflow"


@pytest.mark.parametrize("method", ["ssa", "lockstep", "partial", "rejection", "general"])
def test_growth_that_ends_by_itself_is_not_truncated(method, monkeypatch):
    """Looked at early and often, it is forecast to end; a limit below its events truncates it."""
    monkeypatch.setattr(watch, "FIRST_LOOK", 50)
    expected = 1000 * 2 * 20
    runs = simulate(LOGISTIC, method, [5], [20.0], runs=10, seed=1, max_events=2 * expected)
    assert runs.truncated is None
    with pytest.raises(TruncatedRunsError):
        simulate(LOGISTIC, method, [5], [20.0], runs=10, seed=1, max_events=expected // 4)


@pytest.mark.parametrize(
    ("text", "counts", "end", "expected"),
    [
        ("A -> 0, 1", [1000], 50.0, 1000.0),
        ("0 -> A, 50\nA -> 0, 1", [50], 10.0, 1000.0),
        ("A -> 2 A, 1", [10], 5.0, 10 * (np.exp(5.0) - 1)),
        ("0 -> A, 10 * (1 + sin(t))", [0], 2 * np.pi, 20 * np.pi),
        ("A -> B, 5 * A / (2 + A)", [10**6, 0], 10.0, 50.0),
    ],
)
def test_the_outlook_counts_events(text, counts, end, expected):
    assert Outlook(Network.from_text(text)).events(np.array(counts), 0.0, end, 1e9) == pytest.approx(expected, rel=0.05)


def test_an_outlook_that_nobody_knows_is_none():
    undefined = Network.from_text("A -> 0, log(A - 2.5)")
    assert np.isnan(Outlook(undefined).events(np.array([2]), 0.0, 1.0, 1e9))
    assert Outlook(EXPLOSION).events(np.array([10**4]), 0.0, 20.0, 1e9) > 1e10


def test_a_prediction_says_what_it_leaves_out():
    found = predict(Model(YULE, [10]), None, [1.0, 60.0], runs=40, seed=1, threads=1)
    assert_array_equal(found.times, [1.0])
    assert found.truncated.beyond == 60.0
    assert str(found.truncated) in found.notes
    whole = predict(Model(YULE, [10]), None, [1.0], runs=40, seed=1)
    assert whole.truncated is None
    assert_array_equal(found.mean, whole.mean)


def test_a_control_that_must_fail(monkeypatch):
    """A kernel that goes on from other random numbers than it stopped at is seen."""
    net, initial, end = CASES["line"]
    expected = simulate(net, "ssa", initial, [end], runs=20, seed=3).counts
    hasty(monkeypatch, 7)
    from kinetics.native import twins

    made = twins.direct

    def forgets(model, changes, work, *rest):
        go_on = made(model, changes, work, *rest)

        def forgetting(limits, most):
            outcome = go_on(limits, most)
            work.stream[0] ^= np.uint64(outcome == outcomes.UNFINISHED)
            return outcome

        return forgetting

    monkeypatch.setattr(twins, "direct", forgets)
    assert (simulate(net, "ssa", initial, [end], runs=20, seed=3).counts != expected).any()


def test_statistics_of_truncated_runs_merge():
    grid = [1.0, 60.0]
    both = [simulate_statistics(YULE, "ssa", [10], grid, runs=30, seed=seed) for seed in (1, 2)]
    merged = both[0].merged(both[1])
    assert merged.runs == 60
    assert merged.truncated == both[0].truncated
    assert replace(merged, truncated=None).times.tolist() == [1.0]
