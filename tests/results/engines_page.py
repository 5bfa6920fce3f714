"""The table, the figure and the blocks of docs/engines.md: what depends on the engine of contacts.

    python -m tests.results.engines_page              # table and figure anew from results/engines
    python -m tests.results.engines_page --measure    # the trials as well; an hour of CPU time

Both engines get the same tanks of line4, each with seeds of its own, so that errors of the two are independent.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from mechsim.scene import Scene
from mechsim.world.engines import ENGINES
from tests.results.engine_trials import MIXED, SINGLE, by_engine, measure, names

ROOT = Path(__file__).parents[2]
STORED = ROOT / "results" / "engines" / "line4.csv"
TANKS = {"single cubes": (SINGLE, 100), "a mixture": (MIXED, 250)}  # and how many blocks are measured
BLOCK = 10.0  # tu


def trials(share: float = 1.0) -> pd.DataFrame:
    """Mean and standard error of each quantity in each tank, by engine; share : of the blocks."""
    scene, rows = Scene.load("line4"), []
    for tank, (composition, most) in TANKS.items():
        blocks = max(2, round(share * most))
        for number, entry in enumerate(ENGINES):
            seen = pd.DataFrame(
                list(measure(by_engine(scene, entry.name), composition, blocks, BLOCK, seed=1 + number)),
                columns=names(composition),
            ).fillna(0.0)
            for name in seen:
                values = seen[name].to_numpy()
                error = values.std(ddof=1) / np.sqrt(len(values))
                rows.append((tank, name, entry.name, values.mean(), error, blocks * BLOCK))
    return pd.DataFrame(rows, columns=["tank", "quantity", "engine", "mean", "error", "tu"])


def main() -> None:
    """Measure, if asked to."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--measure", action="store_true")
    asked = options.parse_args()
    if asked.measure:
        trials().to_csv(STORED, index=False, float_format="%.8g")


if __name__ == "__main__":
    main()
