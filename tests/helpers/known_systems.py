"""Networks whose behaviour is known, and assertions on samples with a stated false-alarm rate."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from kinetics.network import Network
from kinetics.rates import Rates

FALSE_ALARM = 1e-6

LINE_REACTIONS = {
    "1+1->2": ((2, 0, 0, 0), (0, 1, 0, 0)),
    "1+2->3": ((1, 1, 0, 0), (0, 0, 1, 0)),
    "1+3->4": ((1, 0, 1, 0), (0, 0, 0, 1)),
    "2+2->4": ((0, 2, 0, 0), (0, 0, 0, 1)),
    "2->1+1": ((0, 1, 0, 0), (2, 0, 0, 0)),
    "3->1+2": ((0, 0, 1, 0), (1, 1, 0, 0)),
    "4->1+3": ((0, 0, 0, 1), (1, 0, 1, 0)),
    "4->2+2": ((0, 0, 0, 1), (0, 2, 0, 0)),
}


def network(species, reactions, rates, combinations="distinct", conserved=None) -> Network:
    """Reactions as {channel: (copies needed, copies made)}, one way each."""
    needed = np.array([before for before, _ in reactions.values()])
    made = np.array([after for _, after in reactions.values()])
    ways = np.ones(len(reactions))
    return Network(tuple(species), tuple(reactions), needed, made - needed, ways, rates, combinations, conserved or {})


def bare_line() -> Network:
    """The paper's line of four, with N from geometry and without rates."""
    species = ("monomer", "dimer", "trimer", "quadmer")
    needed = np.array([before for before, _ in LINE_REACTIONS.values()])
    made = np.array([after for _, after in LINE_REACTIONS.values()])
    ways = [4, 4, 4, 4, 1, 2, 2, 1]
    laws = {"cubes": [1, 2, 3, 4]}
    return Network(species, tuple(LINE_REACTIONS), needed, made - needed, ways, conserved=laws, time_unit="tu")


def line(table="table3") -> Network:
    """The line of four with a shipped table of rates."""
    return Rates.load(table).apply(bare_line())


def decay(rate=1.0) -> Network:
    """X -> nothing."""
    return network(("X",), {"decay": ((1,), (0,))}, [rate])


def switch(forward=1.0, backward=2.0) -> Network:
    """A <-> B, every copy on its own."""
    reactions = {"forward": ((1, 0), (0, 1)), "backward": ((0, 1), (1, 0))}
    return network(("A", "B"), reactions, [forward, backward], conserved={"copies": [1, 1]})


def walk(n, up=1.0, down=2.0) -> Network:
    """One walker on places 0..n."""
    species = tuple(f"place{i}" for i in range(n + 1))
    here = np.eye(n + 1, dtype=int)
    reactions = {f"up{i}": (here[i], here[i + 1]) for i in range(n)}
    rates = [up] * n
    if down:
        reactions |= {f"down{i}": (here[i + 1], here[i]) for i in range(n)}
        rates = rates + [down] * n
    return network(species, reactions, rates)


def assert_follows_cdf(sample, cdf, false_alarm=FALSE_ALARM):
    """The sample may come from this law: Dvoretzky-Kiefer-Wolfowitz with Massart's constant, for any law.

    Sees every law that differs by more than twice sqrt(log(2 / false_alarm) / (2 n)) somewhere.
    """
    values, counts = np.unique(sample, return_counts=True)
    at = np.cumsum(counts) / len(sample)
    before = at - counts / len(sample)
    law = cdf(values)
    # Left limits of a law on whole numbers are its values one below.
    below = cdf(values - 1) if np.issubdtype(values.dtype, np.integer) else law
    gap = max(np.abs(at - law).max(), np.abs(before - below).max())
    allowed = np.sqrt(np.log(2 / false_alarm) / (2 * len(sample)))
    assert gap < allowed, f"the laws differ by {gap:.4f}; up to {allowed:.4f} is chance"


def assert_follows_table(observed, probabilities, false_alarm=FALSE_ALARM):
    """Observed counts of the cells may come from these probabilities: chi-square, rare cells taken together."""
    expected = np.asarray(probabilities) * np.sum(observed)
    order = np.argsort(expected)
    observed, expected = np.asarray(observed)[order], expected[order]
    rare = int(np.searchsorted(np.cumsum(expected), 10.0)) + 1
    observed = np.append(observed[rare:], observed[:rare].sum())
    expected = np.append(expected[rare:], expected[:rare].sum())
    distance = ((observed - expected) ** 2 / expected).sum()
    allowed = chi2.isf(false_alarm, len(expected) - 1)
    assert distance < allowed, f"chi-square {distance:.1f}; up to {allowed:.1f} is chance"
