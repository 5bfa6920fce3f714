"""The rules of results/nerdss/plan.toml: what predicted runs say of a run that was seen."""

from __future__ import annotations

from typing import Any

import numpy as np

TIMES = np.array([1, 10, 100, 1000])  # ms
BAND = (0.025, 0.975)
RATIOS = (0.85, 1.15)  # of complexes lost, seen / expected
LEVEL = 0.05


def lost_of(counts: np.ndarray) -> np.ndarray:
    """Complexes lost since all faces were single: joins less breaks."""
    return np.asarray(200 - counts.sum(axis=-1))


class Judge:
    """What predicted runs (RUNS, T, 12) at the judged times say of a run that was seen."""

    def __init__(self, counts: np.ndarray) -> None:
        self.counts = counts
        self.low, self.high = np.quantile(counts, BAND, axis=0, method="inverted_cdf")
        self.mean, self.scale = counts.mean(axis=0), counts.var(axis=0) + 1 / 12
        self.usual_outside, self.usual_misfit = self.outside(counts), self.misfit(counts)

    def is_outside(self, seen: np.ndarray) -> np.ndarray:
        return np.asarray((seen < self.low) | (seen > self.high))

    def outside(self, seen: np.ndarray) -> np.ndarray:
        return np.asarray(self.is_outside(seen).sum(axis=(-2, -1)))

    def misfit(self, seen: np.ndarray) -> np.ndarray:
        return np.asarray(((seen - self.mean) ** 2 / self.scale).sum(axis=(-2, -1)))

    def verdict(self, seen: np.ndarray) -> dict[str, Any]:
        """Scores of a run (T, 12), by the rules of the plan."""
        expected = lost_of(self.counts)
        lost, mean = lost_of(seen), expected.mean(axis=0)
        spread = np.quantile(expected, BAND, axis=0)
        outside, allowed = int(self.outside(seen)), int(np.quantile(self.usual_outside, 0.95, method="inverted_cdf"))
        p = float((self.usual_misfit >= self.misfit(seen)).mean())
        ratios = lost / mean
        below, at = (self.counts < seen).mean(axis=0), (self.counts == seen).mean(axis=0)
        kept = {
            "outside": outside <= allowed,
            "misfit": p >= LEVEL,
            "lost": bool(((ratios[1:] >= RATIOS[0]) & (ratios[1:] <= RATIOS[1])).all()),
        }
        where = np.argwhere(self.is_outside(seen))
        return {
            "outside": outside,
            "outside_expected": round(float(self.usual_outside.mean()), 2),
            "outside_allowed": allowed,
            "outside_where": [f"n{size + 1} at {TIMES[t]} ms" for t, size in where.tolist()],
            "misfit": round(float(self.misfit(seen)), 2),
            "misfit_expected": round(float(self.usual_misfit.mean()), 2),
            "misfit_p": round(p, 4),
            "lost_seen": lost.tolist(),
            "lost_expected": mean.round(2).tolist(),
            "lost_ratio": ratios.round(3).tolist(),
            "ratio_low": (lost / spread[1]).round(3).tolist(),
            "ratio_high": (lost / spread[0]).round(3).tolist(),
            "mid_pit": (below + at / 2).round(4).tolist(),
            "rules": kept,
            "holds": all(kept.values()),
        }
