"""Size and power of every diagnostic of runs: the numbers that their `measured` states.

    python -m tests.benchmarks.bench_diagnostics [REPEATS] [T5_REPEATS]

A line a diagnostic: how often it fails at 5 % on runs that are sound and on runs that are doubtful in its own way, and
how often the latter at 0.02 %, which is what the correction for some 50 tests leaves. Then all diagnostics together, on
assemblies of the T of five (25 channels): how often any fails at 1 % after correction, for sound runs and where
half of the runs have three times the rates; and on runs of the line of four whose cubes are known, how often rebinding
fails after correction.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from doubtful_runs import CASES, broken, t5_runs

from calibration import diagnose


def main(repeats: int = 1000, t5_repeats: int = 60) -> None:
    print(f"{repeats} repeats; a share has a standard error of at most {50 / repeats**0.5:.1f} %\n")
    print(f"{'test':10} {'size':>6} {'power':>6} {'at .0002':>8}  against")
    for name, case in CASES.items():
        rng = np.random.default_rng(11)
        sound = np.array([case.p_value(case.sound, rng) for _ in range(repeats)])
        doubtful = np.array([case.p_value(case.doubtful, rng) for _ in range(repeats)])
        shares = (np.mean(sound <= 0.05), np.mean(doubtful <= 0.05), np.mean(doubtful <= 2e-4))
        print(f"{name:10} {shares[0]:6.1%} {shares[1]:6.1%} {shares[2]:8.1%}  {case.words}", flush=True)
    rng = np.random.default_rng(12)
    for words, rates in (("sound", (1.0,)), ("half of the runs at three times the rates", (1.0, 3.0))):
        flagged = sum(bool(diagnose(t5_runs(rates, rng)).doubtful) for _ in range(t5_repeats))
        print(f"T of five, {words}: doubtful in {flagged} of {t5_repeats}", flush=True)
    for words, share in (("sound", 0.0), ("4 % of 500 breaks undone", 0.04)):
        found = []
        for _ in range(t5_repeats):
            paths, bonds = broken(share, rng)
            found.append([name for name in diagnose(paths, bonds=bonds).doubtful if "rebinding" in name])
        same = sum(any("same pieces" in name for name in names) for names in found)
        kind = sum(any("same pieces" not in name for name in names) for names in found)
        print(f"line of four, {words}: rebinding by pieces in {same}, by kind in {kind} of {t5_repeats}", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
