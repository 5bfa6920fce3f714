"""Makes the runs of docs/engines.md, one by one: a killed run loses the one it was at, the next call goes on.

    python -m tests.results.engine_runs                 # all that is missing of the plan; CPU time: an hour and a half
    python -m tests.results.engine_runs --minutes 10    # as much of it as this long allows
    python -m tests.results.engine_runs --anew own      # all runs by this engine; those by the other stay

The plan: the tanks of `engine_trials`, and every fifth of the calibration runs of results/line4, made again by our own
engine. Whatever is furthest behind its plan comes next, so that a part of the plan is a part of each of its tanks.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from itertools import product
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


def runs_of(tank: str, engines: tuple[str, ...] = COMPARED) -> pd.DataFrame:
    """What was seen in the runs of a tank made by all of these engines; index (engine, seed)."""
    if not file_of(tank).exists():
        return pd.DataFrame(columns=["engine", "seed", *names(TANKS[tank])]).set_index(["engine", "seed"])
    rows = pd.read_csv(file_of(tank))
    rows = rows[rows["engine"].isin(engines)].drop_duplicates(["seed", "engine"], keep="last")
    is_whole = rows.groupby("seed")["engine"].nunique() == len(engines)
    return rows[rows["seed"].map(is_whole)].set_index(["engine", "seed"]).sort_index()


def specs() -> list[RunSpec]:
    """The calibration runs that are made again."""
    plan = StudyPlan.load(STUDY / "plan.toml")
    return [replace(spec, scene=by_engine(spec.scene, "own")) for spec in plan.specs(plan.calibration)[::EVERY]]


def planned(tank: str) -> list[tuple[int, str]]:
    """Seeds and engines of the plan, in order."""
    seeds = range(FIRST_SEED, FIRST_SEED + TANKS[tank].runs)
    return sorted(product(seeds, COMPARED))


def missing(tank: str) -> list[tuple[int, str]]:
    """Seeds and engines of the plan that no stored run has, in order."""
    known = set()
    if file_of(tank).exists():
        stored = pd.read_csv(file_of(tank), usecols=["seed", "engine"])
        known = set(stored.itertuples(index=False, name=None))
    return [run for run in planned(tank) if run not in known]


def forget(engine: str) -> None:
    """Take an engine's runs out of the files: another version of it made them."""
    for tank in TANKS:
        if file_of(tank).exists():
            lines = file_of(tank).read_text("utf-8").splitlines(keepends=True)
            kept = [line for line in lines if line.split(",")[1] != engine]
            file_of(tank).write_text("".join(kept), encoding="utf-8")
    if engine == "own":
        file_of("rates").unlink(missing_ok=True)


def _append(rows: pd.DataFrame, file: Path) -> None:
    text = rows.to_csv(header=not file.exists(), index=False, float_format="%.6g", lineterminator="\n")
    with file.open("a", encoding="utf-8") as open_file:
        open_file.write(text)  # at once: a kill leaves all of a run or none


def make_trial(tank: str, seed: int, engines: tuple[str, ...] = COMPARED) -> None:
    """One run by each of these engines."""
    rows = [{"seed": seed, "engine": engine} | measure(TANKS[tank], engine, seed) for engine in engines]
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
    options.add_argument("--anew", choices=COMPARED, help="an engine whose runs are made again")
    given = options.parse_args()
    end = time.monotonic() + 60 * given.minutes
    FOLDER.mkdir(exist_ok=True)
    if given.anew:
        forget(given.anew)
    again = specs()
    known = set(pd.read_csv(file_of("rates"))["run"]) if file_of("rates").exists() else set()
    # From all over the list: the tanks of the plan follow each other in it.
    left = sorted(
        (spec for spec in again if spec.run not in known), key=lambda spec: (spec.run // EVERY * 13) % len(again)
    )
    ahead = {tank: missing(tank) for tank in TANKS}
    while time.monotonic() < end:
        shares = {tank: 1 - len(ahead[tank]) / len(planned(tank)) for tank in TANKS}
        shares["rates"] = 1 - len(left) / len(again)
        behind = min(shares, key=lambda name: shares[name])
        if shares[behind] >= 1:
            break
        if behind == "rates":
            make_calibration(left.pop(0))
        else:
            seed, engine = ahead[behind].pop(0)
            make_trial(behind, seed, (engine,))


if __name__ == "__main__":
    main()
