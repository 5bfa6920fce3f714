"""Limits that are called proven, against exact fractions: `python -m tests.helpers.fraction_campaign`.

Random chains of few states, rates over 24 decades: the probability of a state in the end, that of one of two ends, and
the mean time to them. Keeps in results/fractions.json how many limits were asked for and proven, and how many of those
do not hold the exact value. The control: the same by LU in doubles, which the limits must not hold each time. The exit
code is 1 where a limit does not hold.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from fractions import Fraction

import numpy as np

from kinetics import Chain
from tests.helpers.exact_fractions import solved
from tests.helpers.limited import ROOT

STORED = ROOT / "results/fractions.json"
CHAINS, SEED = 2000, 1
DECADES = 12  # each way


def random_rates(rng):
    """Of four to seven states; the last two are ends, which every other state may reach."""
    n = int(rng.integers(4, 8))
    rates = 10.0 ** rng.uniform(-DECADES, DECADES, (n, n)) * (rng.random((n, n)) < 0.6)
    rates[:, -2:] = 10.0 ** rng.uniform(-DECADES, DECADES, (n, 2))
    rates[-2:] = 0.0
    np.fill_diagonal(rates, 0.0)
    return rates


def leaving(rates, number):
    """-Q of the states that are no ends, in numbers of some kind."""
    inner = range(len(rates) - 2)
    return [[sum(map(number, rates[i])) if i == j else -number(rates[i][j]) for j in inner] for i in inner]


def answers(rates):
    """Of each question: the limits, the exact value, and what LU in doubles gives."""
    n = len(rates)
    given = rates.tolist()
    begins = replace(Chain(rates, initial=0), rewards={"time": np.ones(n)})
    ends = np.arange(n) >= n - 2
    for right, asked in (
        ([row[-1] for row in given[:-2]], begins.until(np.arange(n) == n - 1)),
        ([1.0] * (n - 2), begins.reward("time", until=ends)),
    ):
        exact = solved(leaving(given, Fraction), list(map(Fraction, right)))[0]
        yield asked, exact, float(np.linalg.solve(np.array(leaving(given, float)), right)[0])
    back = rates.copy()
    back[-2:, :2] = 10.0 ** np.array([[3.0, -3.0], [-3.0, 3.0]])
    shares = solved(*balance(back.tolist(), Fraction))
    plain = np.linalg.solve(*map(np.array, balance(back.tolist(), float)))
    yield Chain(back, initial=0).steady_state(np.arange(n) == 1), shares[1], float(plain[1])


def balance(rates, number):
    """p Q = 0 with a sum of 1 in the place of the last equation."""
    n = len(rates)
    exits = [sum(map(number, row)) for row in rates]
    matrix = [[number(rates[i][j]) if i != j else -exits[i] for i in range(n)] for j in range(n - 1)]
    return [*matrix, [number(1.0)] * n], [number(0.0)] * (n - 1) + [number(1.0)]


def run(chains, seed):
    """What came of all of them."""
    told = {"seed": seed, "chains": chains, "limits": 0, "proven": 0, "outside": 0, "widest": 0.0, "doubles_outside": 0}
    for number in range(chains):
        for asked, exact, plain in answers(random_rates(np.random.default_rng([seed, number]))):
            told["limits"] += 1
            if not asked.is_bound:
                continue
            told["proven"] += 1
            low, high = Fraction(asked.low), Fraction(asked.high)
            told["outside"] += not low <= exact <= high
            told["widest"] = max(told["widest"], float((high - low) / exact))
            told["doubles_outside"] += not low <= Fraction(plain) <= high
    return told


def main() -> int:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description="Hold proven limits of random chains against exact fractions.")
    parser.add_argument("--chains", type=int, default=CHAINS, help=f"Draw so many chains ({CHAINS}).")
    parser.add_argument("--seed", type=int, default=SEED, help="Draw them by this seed.")
    asked = parser.parse_args()
    told = run(asked.chains, asked.seed)
    STORED.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    sys.stdout.write(f"{told}\n")
    return int(told["outside"] > 0)


if __name__ == "__main__":
    sys.exit(main())
