"""How often several bodies or walls touch a structure in one step, by engine and step: docs/crowding.md.

    python -m tests.results.shared_hits         # what the table lacks, then the page; ten minutes
    python -m tests.results.shared_hits --page  # the page alone

The tank is that of the line of four after 800 tu, at 160 cubes: 3 single cubes, 11 dimers, 17 trimers and 21 quadmers.
Nothing joins and no bond breaks; hits above .004 are logged. Two collisions of a structure in one step count as one hit
that is shared, with one load of both.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from kinetics.support.cli.progress import stage
from kinetics.support.output import write_whole
from kinetics.support.settings import validated
from mechsim.runs.load_log import SHARED
from mechsim.runs.record import RunSpec, execute
from mechsim.scene import Scene
from tests.results.studies import table

ROOT = Path(__file__).parents[2]
TABLE, PAGE = ROOT / "results" / "crowding" / "shared_hits.csv", ROOT / "docs" / "crowding.md"
BLOCK = re.compile(r"(<!-- shared hits -->\n).*?(<!-- end -->)", re.DOTALL)
COMPOSITION = {"monomer": 3, "dimer": 11, "trimer": 17, "quadmer": 21}
LEVELS = (0.004, 0.005, 0.0065)
NEVER = 0.5  # a load that no bond sees
LENGTH, SEED = 100.0, 900  # tu of a run; of the first run


class Case(NamedTuple):
    """An engine, a step as a part of the scene's, and how many runs are made."""

    engine: str
    divisor: int
    runs: int


CASES = (Case("pybullet", 1, 30), Case("pybullet", 2, 20), Case("own", 1, 40), Case("own", 2, 30), Case("own", 4, 20))


def scene_of(case: Case) -> Scene:
    """The scene of the line of four without joins and breaks."""
    scene = Scene.load("line4").without("bonding").by(case.engine)
    scene = scene.changed("breaking", threshold=NEVER, log_above=LEVELS[0])
    data = scene.as_dict()
    data["numerics"]["step"] /= case.divisor
    return validated(Scene, data, f"scene {scene.name} with a finer step")


def counted(case: Case, run: int, length: float = LENGTH) -> dict[str, float]:
    """Hits in one run, alone and shared, above each level."""
    found = execute(RunSpec(scene_of(case), COMPOSITION, length, SEED, run)).arrays
    shared, load = (found["load_flags"] & SHARED) > 0, found["load_value"]
    row: dict[str, float] = {"engine": case.engine, "divisor": case.divisor, "run": run, "tu": length}  # type: ignore[dict-item]
    for level in LEVELS:
        row[f"alone {level:g}"] = int(((load > level) & ~shared).sum())
        row[f"shared {level:g}"] = int(((load > level) & shared).sum())
    return row


def lines() -> str:
    """A line a case: hits per 1,000 tu, and the share of those that several touched, with its standard error."""
    rows = []
    for (engine, divisor), here in pd.read_csv(TABLE).groupby(["engine", "divisor"], sort=False):
        cells = [{"pybullet": "PyBullet", "own": "own"}[str(engine)], "1" if divisor == 1 else f"1/{divisor}"]
        for level in LEVELS:
            alone, shared = (int(here[f"{kind} {level:g}"].sum()) for kind in ("alone", "shared"))
            share = shared / (alone + shared)
            error = (share * (1.0 - share) / (alone + shared)) ** 0.5
            cells += [f"{1000 * alone / here['tu'].sum():.0f}", f"{share:.3f} ± {error:.3f}"]
        rows.append(cells)
    titles = ["engine", "step"]
    for level in LEVELS:
        titles += [f"alone above {level:g}, in 1,000 tu", "share of shared"]
    return table(titles, rows)


def written(text: str) -> str:
    """The page with its table made anew. ValueError: it has no place for it."""
    if len(BLOCK.findall(text)) != 1:
        raise ValueError("expected one block from <!-- shared hits --> to <!-- end -->")
    return BLOCK.sub(lambda found: f"{found[1]}{lines()}\n{found[2]}", text)


def main() -> None:
    """Make the runs that are missing, each kept at once; write the page."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--page", action="store_true", help="make no runs")
    if not options.parse_args().page:
        TABLE.parent.mkdir(exist_ok=True)
        rows = pd.read_csv(TABLE).to_dict("records") if TABLE.exists() else []
        known = {(row["engine"], row["divisor"], row["run"]) for row in rows}
        left = [(case, run) for case in CASES for run in range(case.runs)]
        left = [(case, run) for case, run in left if (case.engine, case.divisor, run) not in known]
        for done, (case, run) in enumerate(left):
            stage(f"{done} of {len(left)} runs", done / len(left))
            rows.append(counted(case, run))
            write_whole(TABLE, pd.DataFrame(rows).to_csv(index=False))
    PAGE.write_text(written(PAGE.read_text("utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
