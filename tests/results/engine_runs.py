"""Makes the runs of docs/engines.md, one by one: a killed run loses the one it was at, the next call goes on.

    python -m tests.results.engine_runs                 # all that is missing of the plan; half an hour of CPU time
    python -m tests.results.engine_runs --minutes 10    # as much of it as this long allows

The plan: the tanks of `engine_trials`, and every fifth of the calibration runs of results/line4, made again by our own
engine. Whatever is furthest behind its plan comes next, so that a part of the plan is a part of each of its tanks.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import pandas as pd

from calibration import estimate
from calibration.pipeline.plan import StudyPlan
from mechsim.runs.record import RunSpec, execute
from tests.results.engine_trials import TANKS, by_engine, measure, names

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "results" / "engines"
STUDY = ROOT / "results" / "line4"
COMPARED = ("pybullet", "own")
EVERY = 5  # of the study's calibration runs, which one is made again
FIRST_SEED = 1


def file_of(tank: str) -> Path:
    """The runs of a tank: one row a run and engine."""
    return FOLDER / f"{tank}.csv"


def runs_of(tank: str) -> pd.DataFrame:
    """What was seen in the runs of a tank made by both engines; index (engine, seed)."""
    if not file_of(tank).exists():
        return pd.DataFrame(columns=["engine", "seed", *names(TANKS[tank])]).set_index(["engine", "seed"])
    stored = (
        pd.read_csv(file_of(tank))
        .drop_duplicates(["seed", "engine"], keep="last")
        .set_index(["seed", "engine"])
        .unstack("engine")
        .dropna()
    )
    return stored.stack("engine", future_stack=True).swaplevel().sort_index()


def specs() -> list[RunSpec]:
    """The calibration runs that are made again."""
    plan = StudyPlan.load(STUDY / "plan.toml")
    return [replace(spec, scene=by_engine(spec.scene, "own")) for spec in plan.specs(plan.calibration)[::EVERY]]


def _append(rows: pd.DataFrame, file: Path) -> None:
    text = rows.to_csv(header=not file.exists(), index=False, float_format="%.6g", lineterminator="\n")
    with file.open("a", encoding="utf-8") as open_file:
        open_file.write(text)  # at once: a kill leaves all of a run or none


def make_trial(tank: str, seed: int) -> None:
    """One run by each engine."""
    rows = [{"seed": seed, "engine": engine} | measure(TANKS[tank], engine, seed) for engine in COMPARED]
    _append(pd.DataFrame(rows), file_of(tank))


def make_calibration(spec: RunSpec) -> None:
    """One of the study's runs: events and exposure of each channel."""
    found = estimate([execute(spec).path])
    rows = [(spec.run, own.channel, own.events, own.exposure) for own in found.estimates]
    _append(pd.DataFrame(rows, columns=["run", "channel", "events", "exposure"]), file_of("rates"))


def main() -> None:
    """Make what is missing."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--minutes", type=float, default=float("inf"))
    end = time.monotonic() + 60 * options.parse_args().minutes
    FOLDER.mkdir(exist_ok=True)
    again = specs()
    known = set(pd.read_csv(file_of("rates"))["run"]) if file_of("rates").exists() else set()
    # From all over the list: the tanks of the plan follow each other in it.
    left = sorted(
        (spec for spec in again if spec.run not in known), key=lambda spec: (spec.run // EVERY * 13) % len(again)
    )
    done = {tank: len(runs_of(tank)) // len(COMPARED) for tank in TANKS}
    while time.monotonic() < end:
        shares = {tank: done[tank] / TANKS[tank].runs for tank in TANKS}
        shares["rates"] = 1 - len(left) / len(again)
        behind = min(shares, key=lambda name: shares[name])
        if shares[behind] >= 1:
            break
        if behind == "rates":
            make_calibration(left.pop(0))
        else:
            make_trial(behind, FIRST_SEED + done[behind])
            done[behind] += 1


if __name__ == "__main__":
    main()
