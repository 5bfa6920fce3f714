"""Joins and breaks by size fitted to two runs of another group's simulator, and a third run predicted (results/nerdss).

    python -m tests.results.nerdss              # judges run 3 by the stored fits; writes scores, figure and page
    python -m tests.results.nerdss fit          # weights, fits and predictions anew first, some 30 minutes of CPU;
                                                # with names of fits behind it, these fits alone
    python -m tests.results.nerdss check        # how many events stay hidden between frames, some 2 minutes
    python -m tests.results.nerdss judge TABLE  # judges all runs of another table of the same form; writes nothing

The plan is results/nerdss/plan.toml. The table of runs is not ours and is not shipped; it is looked for in
shared/outside beside the checkout, or beside a folder above it.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy import optimize

from calibration import fit_model
from kinetics.markov.panels import PanelData, PanelLikelihood
from kinetics.network import Model
from kinetics.sampling import simulate, simulate_posterior
from tests.results.nerdss_judge import BAND, TIMES, Judge, lost_of
from tests.results.nerdss_models import COLUMNS, MAX_STATES, Candidate, candidates, panel_of, read_runs
from tests.results.nerdss_shapes import INPUT_B, INPUT_K, SIZES, Shapes, Weights, as_table, weights_of
from tests.results.studies import ROOT

FOLDER = ROOT / "results" / "nerdss"
_PLACES = [parent / "shared" / "outside" / "nerdss_dodecahedron_counts.csv" for parent in ROOT.parents]
TABLE = next((place for place in _PLACES if place.exists()), _PLACES[0])
WEIGHTS, FITS, RATES, PREDICTED, LOST, SCORES, HELD_OUT, CHECK = (
    FOLDER / name
    for name in (
        "weights.csv",
        "fits.json",
        "rates.csv",
        "predicted.csv",
        "lost.csv",
        "scores.json",
        "held_out.json",
        "check.csv",
    )
)
GRID = np.unique(np.concatenate([np.geomspace(1, 1000, 40).round().astype(int), TIMES]))  # ms, of what is drawn
JUDGED = np.searchsorted(GRID, TIMES)
RUNS, SEED = 4000, 3
MOST_PROFILED = 4  # parameters with intervals from the profile, which costs hundreds of likelihoods for more
CHECKS = 4  # simulated runs


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


def fit(candidate: Candidate, data: PanelData) -> dict[str, Any]:
    """Maximum likelihood: intervals by profile likelihood if parameters are few, else by curvature, for speed."""
    began = time.process_time()
    if len(candidate.start) <= MOST_PROFILED:
        found = fit_model(PanelLikelihood(candidate.model, data), list(candidate.start), starts=1)
        if found.fit.covariance is None or found.fit.notes:
            raise RuntimeError(f"no clean maximum: {found.fit.notes}")
        kept: dict[str, Any] = {
            "parameters": found.fit.to_dict(),
            "log_likelihood": found.log_likelihood.value,
            "error": found.log_likelihood.error,
            "covariance_of_logarithms": found.fit.covariance.tolist(),
            "intervals": "profile likelihood",
        }
    else:
        best, scored = maximum(candidate.model, data, candidate.start)
        names, half = tuple(candidate.start), 1.96 * np.sqrt(np.diag(best.covariance))
        low, high = best.value * np.exp(-half), best.value * np.exp(half)
        kept = {
            "parameters": {
                name: {"value": best.value[p], "low": low[p], "high": high[p]} for p, name in enumerate(names)
            },
            "log_likelihood": scored,
            "covariance_of_logarithms": best.covariance.tolist(),
            "intervals": "curvature",
        }
    kept["aic"] = 2.0 * len(candidate.start) - 2.0 * kept["log_likelihood"]
    return {**kept, "cpu_seconds": round(time.process_time() - began, 1)}


def maximum(model: Model, data: PanelData, start: Mapping[str, float]) -> tuple[Fitted, float]:
    """The largest likelihood, near a start, with the covariance of the logarithms from the curvature there."""
    asked, names = PanelLikelihood(model, data, MAX_STATES), tuple(start)

    def downhill(logs: np.ndarray) -> tuple[float, np.ndarray]:
        found = asked.scored(dict(zip(names, np.exp(logs).tolist(), strict=True)), names)
        return -found.answer.value, -found.gradient

    first = np.log(np.array(list(start.values())))
    best = optimize.minimize(downhill, first, jac=True, method="L-BFGS-B", options={"gtol": 1e-3})
    shifted = best.x + 1e-3 * np.eye(first.size)
    curvature = np.array([downhill(logs)[1] - best.jac for logs in shifted]) / 1e-3
    return Fitted(names, np.exp(best.x), np.linalg.inv((curvature + curvature.T) / 2)), -float(best.fun)


def chosen(fits: dict[str, dict[str, Any]]) -> str:
    """The model of smallest AIC on runs 1 and 2."""
    return min((name for name in fits if fits[name]["runs"] == [1, 2]), key=lambda name: fits[name]["aic"])


def fit_all(only: Sequence[str] = ()) -> None:
    """Weights, fits to runs 1 and 2, and the supplement's fits of the docking model to two other runs.

    only : names of the fits that are made anew; all, and the weights, if there are none
    """
    if not only:
        as_table(weights_of(Shapes())).to_csv(WEIGHTS, index=False)
    models, runs = candidates(stored_weights()), read_runs(TABLE)
    asked = {name: (name, [1, 2]) for name in models}
    for left_out in (1, 2):
        asked[f"docking without run {left_out}"] = "docking", [run for run in (1, 2, 3) if run != left_out]
    for name, (model, those) in asked.items():
        if only and name not in only:
            continue
        frames = panel_of([runs[run] for run in those], models["control"].model)
        found = {"runs": those, **fit(models[model], frames)}
        sys.stdout.write(f"{name}: {json.dumps(found)}\n")
        known = {**(stored_fits() if FITS.exists() else {}), name: found}
        known = {each: known[each] for each in asked if each in known}
        FITS.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    rows = [
        (name, key, *row.values()) for name, each in stored_fits().items() for key, row in each["parameters"].items()
    ]
    table = pd.DataFrame(rows, columns=["fit", "parameter", "per_s", "low", "high"])
    table.to_csv(RATES, index=False, float_format="%.6g")


# Predictions


def predicted(model: Model, fitted: Fitted, runs: int = RUNS, seed: int = SEED) -> np.ndarray:
    """Counts (runs, T, S) at the times of GRID, each run under its own draw; rates are linear in the parameters."""
    none = dict.fromkeys(fitted.names, 0.0)
    unit = np.array([model.at({**none, name: 1.0}).network.known_rates for name in fitted.names])
    constants = fitted.drawn(runs, seed) @ unit
    return np.concatenate(list(simulate_posterior(model, constants, GRID * 1e-3, runs=1, seed=seed)))


def by_size(counts: np.ndarray, shapes: Shapes) -> np.ndarray:
    """Counts (runs, T, 12) of each size from those of all shapes."""
    return np.stack([counts[..., shapes.sizes == size].sum(axis=-1) for size in SIZES], axis=-1)


def predictions() -> dict[str, np.ndarray]:
    """Counts (RUNS, T, 12) that each fit predicts, and a tenth as many of the supplement's network of shapes."""
    models, fits, shapes = candidates(stored_weights()), stored_fits(), Shapes()
    found = {name: predicted(models[name.split()[0]].model, fitted_of(fits[name]))[..., :12] for name in fits}
    network = shapes.network(INPUT_K, INPUT_B)
    at_inputs = Fitted(("k", "b"), np.array([INPUT_K, INPUT_B]), np.zeros((2, 2)))
    found["shapes, fitted"] = by_size(predicted(network, fitted_of(fits["docking"]), RUNS // 10), shapes)
    found["shapes, inputs"] = by_size(predicted(network, at_inputs, RUNS // 10), shapes)
    return found


# Scores


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


def held_out() -> dict[str, float]:
    """Log-likelihood of all frames of run 3 at the constants that each fit to runs 1 and 2 gave."""
    models, fits = candidates(stored_weights()), stored_fits()
    data = panel_of([read_runs(TABLE)[3]], models["control"].model)
    values = {name: dict(zip(*fitted_of(fits[name])[:2], strict=True)) for name in fits if fits[name]["runs"] == [1, 2]}
    return {
        name: round(PanelLikelihood(models[name].model, data, MAX_STATES).value(at).value, 3)
        for name, at in values.items()
    }


# The estimator, where the truth is known


def check() -> None:
    """Events of simulated runs at the docking model's constants, beside those that the fewest breaks allow."""
    models, truth = candidates(stored_weights()), fitted_of(stored_fits()["docking"])
    model = models["docking"].model.at(dict(zip(truth.names, truth.value.tolist(), strict=True)))
    made = simulate(model, "ssa", times=1e-3 * np.arange(1001), runs=CHECKS, seed=100).counts
    place, rows = list(COLUMNS).index("broken"), []
    for run, counts in enumerate(made):
        found = sum(int(each.seen[0, place]) for each in panel_of([counts[:, :12]], models["control"].model).runs)
        true, lost = int(counts[-1, 12]), int(lost_of(counts[-1, :12]))
        rows.append((run, true + lost, true, found))
        pd.DataFrame(rows, columns=["run", "joins", "breaks", "fewest_breaks"]).to_csv(CHECK, index=False)


def main(words: Sequence[str]) -> None:
    from tests.results.nerdss_page import write_page

    match list(words):
        case ["check"]:
            check()
            return
        case ["judge", path]:
            sys.stdout.write(json.dumps(judged(predictions(), read_runs(Path(path))), indent=1) + "\n")
            return
        case ["fit", *names]:
            fit_all(names)
            if names:
                return
        case []:
            pass
        case _:
            raise SystemExit(f"unknown arguments {words}; say nothing, fit, check, or judge TABLE")
    made = predictions()
    sizes, lost = summary(made)
    sizes.to_csv(PREDICTED, index=False)
    lost.to_csv(LOST, index=False)
    SCORES.write_text(json.dumps(judged(made, read_runs(TABLE)), indent=1) + "\n", encoding="utf-8")
    HELD_OUT.write_text(json.dumps(held_out(), indent=1) + "\n", encoding="utf-8")
    write_page()


if __name__ == "__main__":
    main(sys.argv[1:])
