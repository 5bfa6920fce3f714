"""Runs that break one assumption of a well-mixed Markov chain each, beside runs that break none."""

from dataclasses import dataclass

import numpy as np
from synthetic_runs import restarted_run

from calibration import diagnose
from calibration.estimating.diagnosing.ages import Ages
from calibration.estimating.diagnosing.between_runs import BetweenRuns
from calibration.estimating.diagnosing.crowds import Crowds
from calibration.estimating.diagnosing.drift import Drift
from calibration.estimating.diagnosing.rebinding import Rebinding
from calibration.estimating.diagnosing.sizes import Sizes
from calibration.estimating.diagnosing.starts import Starts
from calibration.estimating.diagnosing.waits import Waits
from calibration.pipeline.study import experiments
from kinetics.assembly import RuleBook, derive
from kinetics.network import Network
from kinetics.runs import RESTART, JumpPath

END = 100.0  # tu of each run of one channel


def break_network(rate: float = 1.0) -> Network:
    """B -> 2 A, the only channel, k = `rate` per tu."""
    return Network(("A", "B"), ("break",), [[0, 1]], [[2, -1]], [1], [rate], conserved={"cubes": [1, 2]})


def breaks(events, rates, starts, rng):
    """Runs restarted after each break, of about `events` breaks in all where `rates` (one a run) are 1."""
    k = events / (END * sum(start[1] for start in starts))
    return [
        restarted_like(restarted_run(break_network(k * rate), start, END, rng))
        for rate, start in zip(rates, starts, strict=True)
    ]


def restarted_like(path: JumpPath) -> JumpPath:
    """The same run of the network with k = 1: its true rate is not for the test to know."""
    return JumpPath(break_network(), path.initial, path.times, path.channels, path.end)


def waited(waits, pieces=10):
    """Runs with these waits, cut into several; events beyond their ends are lost, as the last wait of a run is."""
    runs, network = [], break_network()
    for part in np.array_split(waits, pieces):
        moments = np.cumsum(part)
        channels = np.tile([0, RESTART], moments.size - 1)
        runs.append(JumpPath(network, [10, 10], np.repeat(moments[:-1], 2), channels, float(moments[-1])))
    return runs


def line4(scale: float = 1.0) -> Network:
    """The line of four with rates like those of its mechanics, but breaks `scale` times as often."""
    network = derive(RuleBook.load("line4")).network
    return network.with_rates(np.where(network.reactants.sum(axis=1) == 2, 3e-5, 4e-5 * scale))


def rebinding_run(network: Network, initial, end: float, share: float, delay: float, rng) -> JumpPath:
    """Gillespie's direct method; after a break its pieces rebind with probability `share`, `delay` tu later on average.

    A rebinding whose pieces have reacted meanwhile does not happen.
    """
    change = network.stoichiometry
    inverse = [next((j for j in range(len(change)) if (change[j] == -row).all()), -1) for row in change]
    is_break = change.sum(axis=1) > 0
    constants = network.known_rates * network.ways
    like = (network.reactants == 2).any(axis=1)
    first, second = np.array([(np.flatnonzero(row)[0], np.flatnonzero(row)[-1]) for row in network.reactants]).T
    is_pair = network.reactants.sum(axis=1) == 2
    now, state, pending, times, channels = 0.0, np.array(initial), [], [], []
    while True:
        h = np.where(is_pair, state[first] * (state[second] - like) / (1 + like), state[first])
        total = np.cumsum(constants * h)
        then = now + rng.exponential() / total[-1]
        due = min(pending, default=(np.inf, -1))
        if min(then, due[0]) > end:
            return JumpPath(network, initial, times, channels, end)
        if due[0] < then:
            pending.remove(due)
            now, fired = due
            if (state < network.reactants[fired]).any():
                continue
        else:
            now, fired = then, int(np.searchsorted(total, rng.random() * total[-1]))
            if is_break[fired] and rng.random() < share:
                pending.append((now + rng.exponential(delay), inverse[fired]))
        times.append(now)
        channels.append(fired)
        state = state + change[fired]


@dataclass(frozen=True)
class Case:
    """A diagnostic, runs that it must pass, runs that it must fail, and the power there at 5 %, in words and as a
    number."""

    diagnostic: object
    sound: object
    doubtful: object
    words: str

    def p_value(self, make, rng) -> float:
        """Of the first result: one channel, or all breaks within 2 tu."""
        (test,) = diagnose(make(rng), seed=int(rng.integers(2**31)), tests=[self.diagnostic]).results[:1]
        return test.p_value


SAME = [[10, 10]] * 10
TWO = [[10, 10]] * 5 + [[30, 10]] * 5
SIZES = [[60 - 2 * n, n] for n in (10,) * 4] + [[80 - 26, 13]] * 3 + [[120 - 40, 20]] * 3


def _aged(rng):
    """Waits whose rate is half as large again in the first 2 tu, and 1 / 20 tu later; of some 650 events."""
    early, late = 0.075, 0.05
    area = rng.exponential(size=650)
    return np.where(area < 2 * early, area / early, 2 + (area - 2 * early) / late)


CASES = {
    "waits": Case(
        Waits(), lambda rng: waited(rng.exponential(size=300)), lambda rng: waited(rng.weibull(0.8, size=300)),
        "waits of Weibull shape 0.8, 300 events",
    ),
    "drift": Case(
        Drift(), lambda rng: breaks(650, np.ones(10), SAME, rng),
        lambda rng: breaks(650, np.linspace(0.8, 1.2, 10), SAME, rng),
        "a rate that rises by half from the first run to the last, 650 events",
    ),
    "runs": Case(
        BetweenRuns(), lambda rng: breaks(650, np.ones(10), SAME, rng),
        lambda rng: breaks(650, np.tile([0.85, 1.15], 5), SAME, rng),
        "half of 10 runs 35 % above the others, 650 events",
    ),
    "age": Case(
        Ages(), lambda rng: waited(rng.exponential(20.0, size=650)), lambda rng: waited(_aged(rng)),
        "half as many events again in the first 2 tu, 650 events",
    ),
    "start": Case(
        Starts(), lambda rng: breaks(1300, np.ones(10), TWO, rng),
        lambda rng: breaks(1300, np.repeat([1.0, 1.2], 5), TWO, rng),
        "20 % between two compositions, 650 events or more of each",
    ),
    "size": Case(
        Sizes(), lambda rng: breaks(150, np.ones(10), SIZES, rng),
        lambda rng: breaks(150, np.array([start @ np.array([1, 2]) for start in np.array(SIZES)]) / 80, SIZES, rng),
        "a rate in proportion to 60, 80 and 120 cubes, 150 events",
    ),
    "crowd": Case(
        Crowds(), lambda rng: breaks(400, np.ones(10), TWO, rng),
        lambda rng: breaks(400, np.repeat([0.8, 1.2], 5), TWO, rng),
        "half as large again among 40 bodies as among 20, 400 events",
    ),
    "rebinding": Case(
        Rebinding(), lambda rng: broken(0.0, rng), lambda rng: broken(0.04, rng),
        "4 % of 500 breaks undone after 1 tu on average",
    ),
}  # fmt: skip


def t5_runs(rates, rng):
    """Calibration runs of the T of five (25 channels) with 60 cubes, planned like those of the mechanics; joins at 3e-5
    and breaks at 4e-5 per tu, times `rates`, which the runs take in turn."""
    derivation = derive(RuleBook.load("t5"))
    network, runs = derivation.network, []
    is_join = network.reactants.sum(axis=1) == 2
    for tank in experiments(derivation, 60):
        is_open = np.ones(is_join.size, bool) if tank.joins else ~is_join
        for _ in range(2 if tank.joins else 8):
            k = np.where(is_join, 3e-5, 4e-5) * is_open * rates[len(runs) % len(rates)]
            drawn = restarted_run(network.with_rates(k), network.state(tank.composition), 500.0, rng)
            runs.append(JumpPath(network, drawn.initial, drawn.times, drawn.channels, 500.0, is_open))
    return runs


def broken(share, rng, runs=34):
    """Held-out runs of the line of four, some 500 breaks in all."""
    network = line4(3.0)
    return [rebinding_run(network, [100, 0, 0, 0], 2000.0, share, 1.0, rng) for _ in range(runs)]
