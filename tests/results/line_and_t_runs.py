"""The rate of the last docking of a T against that of two free cubes, in mechanics, by how faces latch and collide.

    python -m tests.results.line_and_t_runs              # what results/line_and_t/runs.csv lacks; two minutes a scene
    python -m tests.results.line_and_t_runs --workers 2

In scene `t5` without breaking, by our own engine: 24 free cubes and nine Ls of four, 60 cubes in all, put back to new
places after each join. So the exposure is always the same, and the ratio of two rates is that of two counts.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from calibration.estimating.exposure import count, pooled
from kinetics.support.cli.progress import stage
from kinetics.support.output import write_whole
from mechsim.runs.ensemble import run_all
from mechsim.runs.record import RunSpec
from mechsim.runs.store import RunStore
from mechsim.scene import Scene

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "results" / "line_and_t"
COMPOSITION = {"monomer": 24, "quadmer.a": 4, "quadmer.b": 5}
RUNS, DURATION, SEED = 24, 300.0, 77  # of each candidate; tu
LAST, FIRST = ("1+quadmer.a->5", "1+quadmer.b->5"), "1+1->dimer.a"


class Candidate(NamedTuple):
    """A change of one setting of the scene, and how a page calls it."""

    title: str
    effect: str
    settings: dict[str, object]


def delay(rate: float) -> dict[str, object]:
    """A latch that waits."""
    return {"latch": {"kind": "delay", "rate": rate}}


def meeting(probability: float) -> dict[str, object]:
    """A latch by meetings."""
    return {"latch": {"kind": "encounter", "probability": probability}}


CANDIDATES = {
    "as it is": Candidate("as it is", "", {}),
    "latch-19": Candidate("a meeting latches with probability .19 (.09)", "bonding", meeting(0.19)),
    "latch-100": Candidate("every meeting latches", "bonding", meeting(1.0)),
    "delay-1": Candidate("random delay of 1 tu", "bonding", delay(1.0)),
    "delay-01": Candidate("random delay of .1 tu", "bonding", delay(10.0)),
    "distance-5": Candidate("capture distance .005 (.02)", "bonding", {"capture_distance": 0.005}),
    "distance-40": Candidate("capture distance .04", "bonding", {"capture_distance": 0.04}),
    "angle-120": Candidate("capture angle 120° (135°)", "bonding", {"capture_angle": 120.0}),
    "angle-160": Candidate("capture angle 160°", "bonding", {"capture_angle": 160.0}),
    "restitution-0": Candidate("restitution 0 (.3)", "contact", {"restitution": 0.0}),
    "restitution-9": Candidate("restitution .9", "contact", {"restitution": 0.9}),
    "friction-0": Candidate("friction 0 (.3)", "contact", {"friction": 0.0}),
}


def scene_of(candidate: Candidate) -> Scene:
    """The scene in which a candidate is measured."""
    scene = Scene.load("t5").without("breaking").by("own")
    return scene.changed(candidate.effect, **candidate.settings) if candidate.effect else scene


def specs_of(candidate: Candidate, runs: int = RUNS, duration: float = DURATION) -> list[RunSpec]:
    """Its runs; those of all candidates have the same places and the same agitation."""
    scene = scene_of(candidate)
    return [RunSpec(scene, COMPOSITION, duration, SEED, run, restart=True) for run in range(runs)]


def measured(candidate: Candidate, workers: int, runs: int = RUNS, duration: float = DURATION) -> dict[str, float]:
    """Events and exposure, way times pair times tu, of the first and of the last docking."""
    with tempfile.TemporaryDirectory() as folder:
        outcome = run_all(specs_of(candidate, runs, duration), RunStore(folder), workers=workers, progress=True)
    if outcome.quarantined or len(outcome.records) < runs:
        raise RuntimeError(f"{candidate.title}: {len(outcome.records)} of {runs} runs were made")
    found = pooled(count(record.path) for record in outcome.records)
    places = found.network.channel_places
    last = [places[name] for name in LAST]
    return {
        "first_events": int(found.events[places[FIRST]]),
        "first_exposure": float(found.exposure[places[FIRST]]),
        "last_events": int(found.events[last].sum()),
        "last_exposure": float(found.exposure[last].sum()),
        "other_events": int(found.events.sum() - found.events[[places[FIRST], *last]].sum()),
        "cpu_seconds": round(sum(record.cost["cpu_seconds"] for record in outcome.records), 1),
    }


def main() -> None:
    """Measure what is missing, one candidate after the other."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--workers", type=int, default=1)
    given = parser.parse_args()
    FOLDER.mkdir(exist_ok=True)
    table = FOLDER / "runs.csv"
    rows = pd.read_csv(table).to_dict("records") if table.exists() else []
    for name, candidate in CANDIDATES.items():
        if name not in {row["candidate"] for row in rows}:
            rows.append({"candidate": name, **measured(candidate, given.workers)})
            write_whole(table, pd.DataFrame(rows).to_csv(index=False))
            stage(f"{len(rows)} of {len(CANDIDATES)} scenes", len(rows) / len(CANDIDATES))


if __name__ == "__main__":
    main()
