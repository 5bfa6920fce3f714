"""The trials, the figure and the tables of docs/engines.md: what depends on the engine of contacts.

    python -m tests.results.engines_page              # figure and tables anew, from results/engines
    python -m tests.results.engines_page --measure    # the trials, too: a quarter of an hour of CPU time

Both engines get the same tanks of line4, each with a seed of its own, so that errors of the two are independent. Rates
are those of every thirtieth calibration run of results/line4, made again by our own engine, beside all of PyBullet's.
"""

from __future__ import annotations

import argparse
import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import chi2

from calibration import estimate
from calibration.pipeline.plan import StudyPlan
from kinetics.support.plots import colour, save_figure
from mechsim.runs.record import execute
from mechsim.scene import Scene
from tests.results.engine_trials import MIXED, SINGLE, by_engine, measure, names

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "engines.md"
FOLDER = ROOT / "results" / "engines"
STUDY = ROOT / "results" / "line4"
TANKS = {"single cubes": (SINGLE, 100), "a mixture": (MIXED, 250)}  # and how many blocks are measured
COMPARED = ("pybullet", "own")
BLOCK = 10.0  # tu
EVERY = 30  # of the study's calibration runs, which one is made again
BLOCKS = re.compile(r"(<!-- engines: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
GROUPS = {  # how names of quantities begin -> what the page calls them
    "speed": "mean speed, by size of the body",
    "spin": "mean spin, by size",
    "meetings": "rate of meetings, by pair of sizes",
    "impulse": "impulses a tu, on walls and on bodies",
    "hits above 0.25": "hits above a quarter of the load that breaks, by size",
    "hits above 0.5": "hits above half of it",
    "hits above 1": "hits that would break",
    "cubes": "cubes near walls, by distance",
    "pairs": "pairs of cubes, by distance, at walls and elsewhere",
}


def trials(share: float = 1.0, tanks: dict[str, tuple[dict[str, int], int]] | None = None) -> pd.DataFrame:
    """Mean and standard error of each quantity in each tank, by engine; share : of the blocks."""
    scene, rows = Scene.load("line4"), []
    for tank, (composition, most) in (tanks or TANKS).items():
        blocks = max(2, round(share * most))
        for number, engine in enumerate(COMPARED):
            seen = pd.DataFrame(
                list(measure(by_engine(scene, engine), composition, blocks, BLOCK, seed=1 + number)),
                columns=names(composition),
            ).fillna(0.0)
            for name in seen:
                values = seen[name].to_numpy()
                error = values.std(ddof=1) / np.sqrt(len(values))
                rows.append((tank, name, engine, values.mean(), error, blocks * BLOCK))
    return pd.DataFrame(rows, columns=["tank", "quantity", "engine", "mean", "error", "tu"])


def changes(stored: pd.DataFrame) -> pd.DataFrame:
    """By tank and quantity: what our own engine makes of it, relative to the first, and the standard error (of the
    difference, so that it holds for counts of a few as well)."""
    first, other = (stored[stored["engine"] == engine].set_index(["tank", "quantity"]) for engine in COMPARED)
    error = np.hypot(other["error"], first["error"]) / first["mean"]
    return pd.DataFrame({"change": other["mean"] / first["mean"] - 1, "error": error}).loc[first.index].reset_index()


def rates() -> pd.DataFrame:
    """Rate constants of the study by PyBullet, and of every thirtieth of its calibration runs by our own engine."""
    plan = StudyPlan.load(STUDY / "plan.toml")
    specs = plan.specs(plan.calibration)[::EVERY]
    ours = estimate([execute(replace(spec, scene=by_engine(spec.scene, "own"))).path for spec in specs])
    rows = []
    for row in pd.read_csv(STUDY / "calibration_rates.csv").to_dict("records"):
        own = ours[row["channel"]]
        low, high = own.interval()
        rows.append((row["channel"], row["rate"], row["events"], own.rate, low, high, own.events))
    return pd.DataFrame(rows, columns=["channel", "pybullet", "pybullet_events", "own", "low", "high", "events"])


def table(stored: pd.DataFrame) -> str:
    """A line a group: how many quantities, their mean change, the largest, and the chance of such ones by scatter."""
    found = changes(stored)
    rows = ["| what | quantities | mean change (%) | largest change (%) | p |", "|---|---|---|---|---|"]
    for begin, title in GROUPS.items():
        group = found[found["quantity"].str.startswith(begin + " ") & np.isfinite(found["error"])]
        weight = 1 / group["error"] ** 2
        mean, error = (group["change"] * weight).sum() / weight.sum(), weight.sum() ** -0.5
        most = group.loc[group["change"].abs().idxmax()]
        p = chi2.sf(((group["change"] / group["error"]) ** 2).sum(), len(group))
        rows.append(
            f"| {title} | {len(group)} | {signed(mean)} ± {100 * error:.2f} | {signed(most['change'])} ± "
            f"{100 * most['error']:.2f} | {p:.2g} |"
        )
    return "\n".join(rows) + "\n"


def rates_table(stored: pd.DataFrame) -> str:
    """A line a channel; breaks as first order, on the same mixture of tanks."""
    rows = ["| channel | PyBullet | own engine | 95 % | events |", "|---|---|---|---|---|"]
    rows += [
        f"| `{row['channel']}` | {row['pybullet']:.3g} | {row['own']:.3g} | {row['low']:.3g} to {row['high']:.3g} "
        f"| {row['pybullet_events']}; {row['events']} |"
        for row in stored.to_dict("records")
    ]
    return "\n".join(rows) + "\n"


def signed(share: float) -> str:
    """A share in per cent."""
    return f"{100 * share:+.2f}".replace("-", "−")


def draw(stored: pd.DataFrame, figure: Any) -> None:
    """The change of each quantity with its 95 % interval, and the two per cent that were asked for."""
    found = changes(stored)
    found = found[np.isfinite(found["error"]) & (found["error"] < 0.1)]
    ax = figure.add_subplot()
    ax.axvspan(-2, 2, color="0.92")
    ax.axvline(0, color="0.5", linewidth=0.8)
    for k, tank in enumerate(TANKS):
        which = np.flatnonzero((found["tank"] == tank).to_numpy())
        here = found.iloc[which]
        ax.errorbar(
            100 * here["change"], which, xerr=196 * here["error"], fmt="o", markersize=3, color=colour(k), label=tank
        )
    ax.set_yticks(range(len(found)), found["quantity"], fontsize=6)
    ax.set_ylim(len(found), -1)
    ax.set_xlabel("own engine against PyBullet (%), 95 % interval")
    ax.legend(frameon=False, loc="upper right")


def written(text: str) -> str:
    """The page with its tables made anew; ValueError: it has not the blocks for them."""
    stored, tables = pd.read_csv(FOLDER / "line4.csv"), {}
    tables["trials"] = table(stored)
    tables["rates"] = rates_table(pd.read_csv(FOLDER / "rates.csv"))
    if sorted(found[2] for found in BLOCKS.finditer(text)) != sorted(tables):
        raise ValueError(f"{PAGE.name} has not one block <!-- engines: ... --> for each of {', '.join(tables)}")
    return BLOCKS.sub(lambda found: found[1] + tables[found[2]] + found[3], text)


def main() -> None:
    """Measure, if asked to; draw and write."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--measure", action="store_true")
    if options.parse_args().measure:
        trials().to_csv(FOLDER / "line4.csv", index=False, float_format="%.8g")
        rates().to_csv(FOLDER / "rates.csv", index=False, float_format="%.8g")
    stored = pd.read_csv(FOLDER / "line4.csv")
    save_figure(str(FOLDER / "line4.svg"), partial(draw, stored), (7.0, 9.0))
    PAGE.write_text(written(PAGE.read_text("utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
