"""Joins and breaks by size fitted to two runs of another group's simulator, and a third run predicted (results/nerdss).

    python -m tests.results.nerdss              # judges run 3 by the stored fits; writes scores, figure and page
    python -m tests.results.nerdss fit          # weights, fits and predictions anew first, some 30 minutes of CPU
    python -m tests.results.nerdss check        # the estimator on runs simulated at known constants, some 20 minutes
    python -m tests.results.nerdss judge TABLE  # judges all runs of another table of the same form; writes nothing

The plan is results/nerdss/plan.toml. The table of runs is not ours and is not shipped: see `TABLE`.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy import optimize

from calibration.estimating.panel_fit import PanelFit, fit_panel
from kinetics.markov.panels import PanelLikelihood
from kinetics.network import Model
from kinetics.sampling import simulate, simulate_posterior
from tests.results.nerdss_models import MAX_STATES, Candidate, candidates, panel_of, read_runs
from tests.results.nerdss_shapes import INPUT_B, INPUT_K, SIZES, Shapes, Weights, as_table, weights_of
from tests.results.studies import ROOT

FOLDER = ROOT / "results" / "nerdss"
TABLE = ROOT.parent / "shared" / "outside" / "nerdss_dodecahedron_counts.csv"
WEIGHTS, FITS, RATES, PREDICTED, LOST, SCORES, CHECK = (
    FOLDER / name
    for name in ("weights.csv", "fits.json", "rates.csv", "predicted.csv", "lost.csv", "scores.json", "check.csv")
)
TIMES = np.array([1, 10, 100, 1000])  # ms, of what is judged
GRID = np.unique(np.concatenate([np.geomspace(1, 1000, 40).round().astype(int), TIMES]))  # ms, of what is drawn
JUDGED = np.searchsorted(GRID, TIMES)
RUNS, SEED = 4000, 3
BAND = (0.025, 0.975)
RATIOS = (0.85, 1.15)
LEVEL = 0.05
CHECKS = 10  # pairs of simulated runs


class Fitted(NamedTuple):
    """Parameters (P,) of a model, 1/s, and the covariance (P, P) of their logarithms."""

    names: tuple[str, ...]
    value: np.ndarray
    covariance: np.ndarray

    def drawn(self, runs: int, seed: int) -> np.ndarray:
        """Parameters (runs, P) of normal logarithms."""
        draws = np.random.default_rng(seed).multivariate_normal(np.log(self.value), self.covariance, runs)
        return np.exp(draws)


def stored_weights() -> Weights:
    """The means over shapes, from their file."""
    docked, held = np.zeros((2, 13, 13))
    for row in pd.read_csv(WEIGHTS).itertuples(index=False):
        docked[row.i, row.j] = docked[row.j, row.i] = row.dockings
        held[row.i, row.j] = row.bridges
    return Weights(docked, held)


def stored_fits() -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = json.loads(FITS.read_text(encoding="utf-8"))
    return found


def fitted_of(stored: dict[str, Any]) -> Fitted:
    values = np.array([each["value"] for each in stored["parameters"].values()])
    return Fitted(tuple(stored["parameters"]), values, np.array(stored["covariance_of_logarithms"]))


# Fits


def fit(candidate: Candidate, runs: Sequence[np.ndarray], anything: Model) -> tuple[PanelFit, float]:
    """Maximum likelihood from all frames of the runs, and its CPU seconds.

    anything : a model in which every join and every break happens, by which the fewest breaks are found
    """
    began = time.process_time()
    found = fit_panel(candidate.model, panel_of(runs, anything), list(candidate.start), starts=1)
    return found, time.process_time() - began


def as_stored(found: PanelFit, cpu: float, runs: Sequence[int]) -> dict[str, Any]:
    covariance = found.fit.covariance
    return {
        "runs": list(runs),
        "parameters": found.fit.to_dict(),
        "log_likelihood": found.log_likelihood.value,
        "error": found.log_likelihood.error,
        "aic": found.aic,
        "covariance_of_logarithms": None if covariance is None else covariance.tolist(),
        "notes": list(found.fit.notes),
        "evaluations": found.fit.evaluations,
        "cpu_seconds": round(cpu, 1),
    }


def chosen(fits: dict[str, dict[str, Any]]) -> str:
    """The model of smallest AIC on runs 1 and 2."""
    return min((name for name in fits if fits[name]["runs"] == [1, 2]), key=lambda name: fits[name]["aic"])


def fit_all() -> None:
    """Weights, fits to runs 1 and 2, and the supplement's fits of the chosen model to two other runs."""
    as_table(weights_of(Shapes())).to_csv(WEIGHTS, index=False)
    models, runs = candidates(stored_weights()), read_runs(TABLE)
    fits: dict[str, dict[str, Any]] = {}

    def add(name: str, model: str, those: Sequence[int]) -> None:
        found, cpu = fit(models[model], [runs[run] for run in those], models["control"].model)
        sys.stdout.write(f"{name}, {cpu:.0f} s CPU\n{found}\n")
        fits[name] = as_stored(found, cpu, those)
        FITS.write_text(json.dumps(fits, indent=1) + "\n", encoding="utf-8")

    for name in models:
        add(name, name, [1, 2])
    best = chosen(fits)
    for left_out in (1, 2):
        add(f"{best} without run {left_out}", best, [run for run in (1, 2, 3) if run != left_out])
    rows = [(name, key, *row.values()) for name in fits for key, row in fits[name]["parameters"].items()]
    pd.DataFrame(rows, columns=["fit", "parameter", "per_s", "low", "high"]).to_csv(
        RATES, index=False, float_format="%.6g"
    )


# Predictions


def predicted(model: Model, fitted: Fitted, seed: int = SEED) -> np.ndarray:
    """Counts (RUNS, T, S) at the times of GRID, each run under its own draw; rates are linear in the parameters."""
    none = dict.fromkeys(fitted.names, 0.0)
    unit = np.array([model.at({**none, name: 1.0}).network.known_rates for name in fitted.names])
    constants = fitted.drawn(RUNS, seed) @ unit
    return np.concatenate(list(simulate_posterior(model, constants, GRID * 1e-3, runs=1, seed=seed)))


def by_size(counts: np.ndarray, shapes: Shapes) -> np.ndarray:
    """Counts (runs, T, 12) of each size from those of all shapes."""
    return np.stack([counts[..., shapes.sizes == size].sum(axis=-1) for size in SIZES], axis=-1)


def predictions() -> dict[str, np.ndarray]:
    """Counts (RUNS, T, 12) that each fit predicts, and those of the supplement's network of shapes."""
    models, fits, shapes = candidates(stored_weights()), stored_fits(), Shapes()
    found = {name: predicted(models[name.split()[0]].model, fitted_of(fits[name]))[..., :12] for name in fits}
    network = shapes.network(INPUT_K, INPUT_B)
    at_inputs = Fitted(("k", "b"), np.array([INPUT_K, INPUT_B]), np.zeros((2, 2)))
    found["shapes, fitted"] = by_size(predicted(network, fitted_of(fits["docking"])), shapes)
    found["shapes, inputs"] = by_size(predicted(network, at_inputs), shapes)
    return found


def lost_of(counts: np.ndarray) -> np.ndarray:
    """Complexes lost since all faces were single: joins less breaks."""
    return np.asarray(200 - counts.sum(axis=-1))


# The judge


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


def summary(made: dict[str, np.ndarray]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """What is stored of predictions: each size at the judged times, and complexes lost at all times of GRID."""
    sizes, lost = [], []
    for name, counts in made.items():
        judge = Judge(counts[:, JUDGED])
        for t, size in np.ndindex(judge.mean.shape):
            spread = counts[:, JUDGED[t], size].std()
            row = judge.mean[t, size], spread, judge.low[t, size], judge.high[t, size]
            sizes.append((name, TIMES[t], size + 1, *row))
        gone = lost_of(counts)
        lost += zip([name] * GRID.size, GRID, gone.mean(axis=0), *np.quantile(gone, BAND, axis=0), strict=True)
    return (
        pd.DataFrame(sizes, columns=["fit", "time_ms", "size", "mean", "sd", "low", "high"]).round(4),
        pd.DataFrame(lost, columns=["fit", "time_ms", "mean", "low", "high"]).round(3),
    )


def judged(made: dict[str, np.ndarray], runs: dict[int, np.ndarray]) -> dict[str, Any]:
    """Scores by fit and run: each fit judges the runs that it has not seen."""
    fits = stored_fits()
    found: dict[str, Any] = {}
    for name, counts in made.items():
        judge, used = Judge(counts[:, JUDGED]), fits.get(name, {"runs": []})["runs"]
        if name == "shapes, fitted":
            used = [1, 2]
        found[name] = {str(run): judge.verdict(seen[TIMES]) for run, seen in runs.items() if run not in used}
    return found


# The estimator, where the truth is known


def check() -> None:
    """The docking model fitted to pairs of runs simulated at its own fitted constants: estimate over truth."""
    models, truth = candidates(stored_weights()), fitted_of(stored_fits()["docking"])
    model = models["docking"].model.at(dict(zip(truth.names, truth.value.tolist(), strict=True)))
    rows = []
    for pair in range(CHECKS):
        made = simulate(model, "ssa", times=1e-3 * np.arange(1001), runs=2, seed=100 + pair).counts[..., :12]
        asked = PanelLikelihood(model, panel_of(made, models["control"].model), MAX_STATES)

        def downhill(logs: np.ndarray, asked: PanelLikelihood = asked) -> tuple[float, np.ndarray]:
            found = asked.scored(dict(zip(truth.names, np.exp(logs).tolist(), strict=True)), truth.names)
            return -found.answer.value, -found.gradient

        best = optimize.minimize(downhill, np.log(truth.value), jac=True, method="L-BFGS-B")
        rows.append((pair, *(np.exp(best.x) / truth.value), float(downhill(np.log(truth.value))[0] - best.fun)))
        sys.stdout.write(f"{rows[-1]}\n")
        pd.DataFrame(rows, columns=["pair", "k", "b", "fall"]).round(4).to_csv(CHECK, index=False)


def main(words: Sequence[str]) -> None:
    from tests.results.nerdss_page import write_page

    match list(words):
        case ["check"]:
            check()
            return
        case ["judge", path]:
            sys.stdout.write(json.dumps(judged(predictions(), read_runs(Path(path))), indent=1) + "\n")
            return
        case ["fit"]:
            fit_all()
        case []:
            pass
        case _:
            raise SystemExit(f"unknown arguments {words}; say nothing, fit, check, or judge TABLE")
    made = predictions()
    sizes, lost = summary(made)
    sizes.to_csv(PREDICTED, index=False)
    lost.to_csv(LOST, index=False)
    SCORES.write_text(json.dumps(judged(made, read_runs(TABLE)), indent=1) + "\n", encoding="utf-8")
    write_page()


if __name__ == "__main__":
    main(sys.argv[1:])
