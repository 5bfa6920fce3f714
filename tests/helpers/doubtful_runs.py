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
from kinetics.assembly import RuleBook, derive
from kinetics.network import Network
from kinetics.runs import RESTART, JumpPath
from kinetics.sampling import sample_path

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


def rebinding_run(network: Network, cubes: int, end: float, share: float, delay: float, rng):
    """A run of lines of up to four from single cubes by Gillespie's direct method, and the bonds (E, 2) of its events.

    After a break its pieces rebind with probability `share`, `delay` tu later on average, unless one of them has
    reacted meanwhile.
    """
    change = network.stoichiometry
    parts = [np.repeat([1, 2, 3, 4], np.maximum(np.sign(row.sum()) * row, 0)).tolist() for row in change]
    inverse = [next((j for j in range(len(change)) if (change[j] == -row).all()), -1) for row in change]
    constants = network.known_rates * network.ways
    pieces = [[], [(cube,) for cube in range(cubes)], [], [], []]  # by length
    now, pending, times, channels, bonds = 0.0, [], [], [], []
    while True:
        counts = [len(each) for each in pieces]
        h = [
            counts[sum(p)] if row.sum() > 0 else counts[p[0]] * (counts[p[1]] - (p[0] == p[1])) / (1 + (p[0] == p[1]))
            for p, row in zip(parts, change, strict=True)
        ]
        total = np.cumsum(constants * h)
        then = now + rng.exponential() / total[-1]
        due = min(pending, default=(np.inf,))
        if min(then, due[0]) > end:
            path = JumpPath(network, [cubes, 0, 0, 0], times, channels, end)
            return path, np.array(bonds, dtype=int).reshape(-1, 2)
        if due[0] < then:
            pending.remove(due)
            now, fired, left, right = due
            if left not in pieces[len(left)] or right not in pieces[len(right)]:
                continue
            pieces[len(left)].remove(left)
            pieces[len(right)].remove(right)
            pieces[len(left) + len(right)].append(left + right)
        else:
            now, fired = then, int(np.searchsorted(total, rng.random() * total[-1]))
            if change[fired].sum() > 0:
                whole = _taken(pieces[sum(parts[fired])], rng)
                left, right = whole[: parts[fired][0]], whole[parts[fired][0] :]
                pieces[len(left)].append(left)
                pieces[len(right)].append(right)
                if rng.random() < share:
                    pending.append((now + rng.exponential(delay), inverse[fired], left, right))
            else:
                left, right = (_taken(pieces[length], rng) for length in parts[fired])
                pieces[len(left) + len(right)].append(left + right)
        times.append(now)
        channels.append(fired)
        bonds.append((left[-1], right[0]))


def _taken(pieces, rng):
    return pieces.pop(int(rng.integers(len(pieces))))


@dataclass(frozen=True)
class Case:
    """A diagnostic, runs that it must pass, runs that it must fail, in words too, and the variant that is judged.

    Runs come as paths, or as paths and the bonds of their events.
    """

    diagnostic: object
    sound: object
    doubtful: object
    words: str
    variant: str = ""

    def p_value(self, make, rng) -> float:
        """Of the first result of the variant: one channel, or all breaks."""
        runs = make(rng)
        paths, bonds = runs if isinstance(runs, tuple) else (runs, None)
        found = diagnose(paths, bonds=bonds, seed=int(rng.integers(2**31)), tests=[self.diagnostic])
        return next(test.p_value for test in found.results if self.variant in test.variant)


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
        Rebinding(), lambda rng: broken(0.0, rng)[0], lambda rng: broken(0.04, rng)[0],
        "4 % of 500 breaks undone after 1 tu on average",
    ),
    "identity": Case(
        Rebinding(), lambda rng: broken(0.0, rng), lambda rng: broken(0.04, rng),
        "the same, the cubes of each event being known", "within 2 tu, same pieces",
    ),
}  # fmt: skip


def t5_runs(rates, rng, runs=40, end=2000.0):
    """Assemblies of the T of five (25 channels) from 60 cubes, as calibration makes them; joins at 3e-5 and breaks at
    4e-5 per tu, times `rates`, which the runs take in turn."""
    network = derive(RuleBook.load("t5")).network
    slow = np.where(network.reactants.sum(axis=1) == 2, 3e-5, 4e-5)
    starts = np.where(np.array(network.species) == "monomer", 60, 0)
    made = []
    for i in range(runs):
        known = network.with_rates(slow * rates[i % len(rates)])
        drawn = sample_path(known, starts, end, seed=int(rng.integers(2**31)))
        made.append(JumpPath(network, drawn.initial, drawn.times, drawn.channels, end))
    return made


def broken(share, rng, runs=34):
    """Held-out runs of the line of four, some 500 breaks in all, and the bonds of their events."""
    network = line4(3.0)
    made = [rebinding_run(network, 100, 2000.0, share, 1.0, rng) for _ in range(runs)]
    return tuple(map(list, zip(*made, strict=True)))
