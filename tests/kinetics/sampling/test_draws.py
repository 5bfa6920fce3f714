"""Runs under many draws of the rate constants are those of the network with these constants."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from known_systems import line

from kinetics.network import Crowding, Model, Network
from kinetics.sampling import (
    Auto,
    Direct,
    General,
    Lockstep,
    PartialPropensities,
    exposures_of_draws,
    simulate_posterior,
)

TIMES = np.array([0.0, 100.0, 700.0, 2000.0])
START = [60, 0, 0, 0]
N_CHANNELS = 8


def draws_of(n, seed=0):
    """Powers of two times the constants, so that rounding is the same in whichever order factors are taken."""
    powers = np.random.default_rng(seed).integers(-1, 2, size=(n, N_CHANNELS))
    return line().known_rates * 2.0**powers


def three_of_one_kind():
    return Network.from_reactions(
        {"join": ({"A": 3}, {"B": 1}), "break": ({"B": 1}, {"A": 3})}, [0.01, 0.5], ways=[2.0, 1.0]
    )


@pytest.mark.parametrize("method", [Direct(), Lockstep(), PartialPropensities(), General(), Auto()])
@pytest.mark.parametrize("runs", [3, 20])  # lockstep makes few runs one by one
def test_runs_are_those_of_each_network(method, runs):
    constants = draws_of(4)
    made = list(simulate_posterior(Model.of(line(), START), constants, TIMES, runs, seed=5, method=method, first_run=7))
    for d, (counts, drawn) in enumerate(zip(made, constants, strict=True)):
        expected = method.simulate(line().with_rates(drawn), START, TIMES, runs, seed=5, first_run=7 + d * runs)
        np.testing.assert_array_equal(counts, expected.counts)
    assert not np.array_equal(made[0], made[1])


def test_draws_may_come_in_parts_and_in_threads():
    constants = draws_of(40)
    whole = list(simulate_posterior(Model.of(line(), START), constants, TIMES, 3, seed=5))
    later = list(simulate_posterior(Model.of(line(), START), constants[30:], TIMES, 3, seed=5, first_run=30 * 3))
    threads = list(simulate_posterior(Model.of(line(), START), constants, TIMES, 3, seed=5, threads=2))
    np.testing.assert_array_equal(whole[30:], later)
    np.testing.assert_array_equal(whole, threads)
    other = list(simulate_posterior(Model.of(line(), START), constants, TIMES, 3, seed=6))
    assert not np.array_equal(whole, other)


def test_only_the_draws_asked_for_are_made():
    """Ctrl-C, or a reader that stops, keeps what was made."""
    assert len(list(islice(simulate_posterior(Model.of(line(), START), draws_of(10**5), TIMES, 2), 3))) == 3


def test_sums_of_counts():
    weights = np.array([[1, 1], [2, 0], [3, 0], [4, 0]])
    plain = next(simulate_posterior(Model.of(line(), START), draws_of(1), TIMES, 3))
    (sums,) = simulate_posterior(Model.of(line(), START), draws_of(1), TIMES, 3, weights=weights)
    np.testing.assert_array_equal(sums, plain @ weights)
    assert (sums[:, :, 0] == 60).all()


def line_in_a_crowd():
    """The line of four, whose joins and breaks a crowd makes several times as frequent."""
    rows = [[1.0, 0, 0, 0]] * 2 + [[0.0, 1.0, 3.0, 1.5]] * 3 + [[0.5, 0.5, 2.0, 0.0]] * 3
    surfaces, volumes = np.array([6, 10, 14, 18]) / 400, np.array([1, 2, 3, 4]) / 600
    return replace(line(), crowding=Crowding(surfaces, volumes, rows))


NETWORKS = {
    "pairs": (line(), START, 500.0),
    "triples": (three_of_one_kind(), [30, 2], 2.0),
    "crowd": (line_in_a_crowd(), START, 500.0),
}


@pytest.mark.parametrize(("network", "start", "end"), NETWORKS.values(), ids=NETWORKS)
def test_events_and_exposures_are_those_of_the_paths(network, start, end):
    constants = network.known_rates * np.array([[1.0], [2.0]])
    runs = 2
    made = exposures_of_draws(Model.of(network, start), constants, end, runs, 3, first_run=9)
    for d, (events, exposures) in enumerate(made):
        for i in range(runs):
            drawn = network.with_rates(constants[d])
            path = Direct().sample_path(drawn, start, end, seed=3, run=9 + d * runs + i)
            waits = np.diff(np.concatenate([[0.0], path.times, [end]]))
            assert path.channels.size > 5
            np.testing.assert_array_equal(events[i], np.bincount(path.channels, minlength=len(network.channels)))
            combinations = network.uncrowded.combinations_of(path.states)
            if network.crowding is not None:
                combinations = combinations * network.crowding.factors(path.states)
            expected = network.ways * (waits @ combinations)
            np.testing.assert_allclose(exposures[i], expected, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("network", [line(), line_in_a_crowd()], ids=["alone", "crowd"])
def test_exposures_meet_the_events_on_average(network):
    """Events less rate times exposure is a martingale: its mean over 4,000 runs is 0 within 5 of its errors."""
    constants = np.tile(network.known_rates, (200, 1))
    made = list(exposures_of_draws(Model.of(network, START), constants, 2000.0, 20, seed=1))
    events, exposures = (np.concatenate(part) for part in zip(*made, strict=True))
    for factor, is_right in ((1.0, True), (1.1, False)):
        off = events - factor * network.known_rates * exposures
        z = off.mean(axis=0) / (off.std(axis=0, ddof=1) / np.sqrt(len(off)))
        assert (np.abs(z) < 5).all() == is_right


def test_bad_input():
    for constants, message in (
        (np.ones(8), "constants has shape"),
        (np.ones((2, 7)), r"expected \(any, 8\)"),
        (np.full((1, 8), np.nan), "finite"),
        (np.full((1, 8), -1.0), "at least 0"),
    ):
        with pytest.raises(ValueError, match=message):
            next(simulate_posterior(Model.of(line(), START), constants, TIMES, 2))
    with pytest.raises(ValueError, match="runs = 0"):
        next(simulate_posterior(Model.of(line(), START), draws_of(1), TIMES, 0))
    with pytest.raises(ValueError, match="times is empty"):
        next(simulate_posterior(Model.of(line(), START), draws_of(1), [], 1))
    with pytest.raises(ValueError, match="weights has shape"):
        next(simulate_posterior(Model.of(line(), START), draws_of(1), TIMES, 1, weights=np.ones((3, 1))))
    law = Network.from_reactions({"grow": ({}, {"A": 1})}, ["1 + A"])
    with pytest.raises(ValueError, match="mass action"):
        next(exposures_of_draws(Model.of(law, [0]), [[1.0]], 1.0, 1))
    assert next(simulate_posterior(Model.of(law, [0]), [[1.0]], [1.0], 2)).shape == (2, 1, 1)
