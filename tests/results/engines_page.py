"""The figure and the tables of docs/engines.md: what depends on the engine of contacts.

    python -m tests.results.engine_runs     # the runs, or what is missing of them
    python -m tests.results.engines_page    # figure and tables anew, from results/engines

The errors of the trials are those of the difference, from the scatter of pairs of runs by the two engines. Rates are
those of some of the calibration runs of results/line4, made again by our own engine, beside all of PyBullet's.
"""

from __future__ import annotations

import re
from functools import cache, partial
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import beta, chi2

from calibration import Exposure, count, pooled
from calibration.pipeline.plan import StudyPlan
from kinetics.support.plots import colour, save_figure
from mechsim.inspection.poses import record_at
from tests.results.engine_runs import COMPARED, FOLDER, ROOT, STUDY, file_of, runs_of, specs
from tests.results.engine_trials import TANKS

PAGE = ROOT / "docs" / "engines.md"
BLOCKS = re.compile(r"(<!-- engines: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
GROUPS = {  # how names of quantities begin -> what the page calls them
    "speed": "mean speed, by size of the body",
    "spin": "mean spin, by size",
    "meetings": "rate of meetings, by pair of sizes",
    "impulse": "impulses a tu, on walls and on bodies",
    "hits above 0.25": "hits above a quarter of the load that breaks, by size",
    "hits above 0.5": "hits above half of it",
    "hits above 1": "hits that break",
    "hits above 1.5": "hits above 1.5 times the load that breaks",
    "cubes": "cubes near walls, by distance",
    "pairs": "pairs of cubes, by distance, at walls and elsewhere",
}


def changes() -> pd.DataFrame:
    """By tank and quantity: what our own engine makes of it, relative to the first, the standard error of that, and the
    number of events by the first engine (nan where it is a mean)."""
    found = []
    for name, tank in TANKS.items():
        seen = runs_of(name)
        if seen.empty:
            continue
        first, own = seen.loc["pybullet"], seen.loc["own"]
        mean = first.mean().where(lambda values: values > 0)
        table = pd.DataFrame({
            "tank": name,
            "change": (own - first).mean() / mean,
            "error": (own - first).std(ddof=1) / len(first) ** 0.5 / mean,
            "events": mean * len(first) * tank.length,
            "runs": len(first),
        })  # fmt: skip
        found.append(table.rename_axis("quantity").reset_index())
    return pd.concat(found, ignore_index=True)


def of_group(found: pd.DataFrame, begin: str) -> pd.DataFrame:
    """The quantities of a group that were seen at all."""
    return found[found["quantity"].str.startswith(begin + " ") & (found["error"] > 0)]


def table(found: pd.DataFrame) -> str:
    """A line a tank and group: how many quantities, their mean change, the largest change, the largest error, and the
    chance of such changes by scatter."""
    titles = "| what | tank | quantities | mean change (%) | largest change (%) | errors up to (%) | p |"
    rows = [titles, "|---|---|---|---|---|---|---|"]
    for begin, title in GROUPS.items():
        for tank, group in of_group(found, begin).groupby("tank", sort=False):
            weight = 1 / group["error"] ** 2
            mean, error = (group["change"] * weight).sum() / weight.sum(), weight.sum() ** -0.5
            most = group.loc[group["change"].abs().idxmax()]
            p = chi2.sf(((group["change"] / group["error"]) ** 2).sum(), len(group))
            rows.append(
                f"| {title} | {tank} | {len(group)} | {signed(mean)} ± {100 * error:.2f} | {signed(most['change'])} ± "
                f"{100 * most['error']:.2f} | {100 * group['error'].max():.1f} | {p:.2g} |"
            )
    return "\n".join(rows) + "\n"


def single_lines(found: pd.DataFrame) -> str:
    """A line a pair of sizes, and a size for loads, where each is known best."""
    rows = ["| what | tank | change (%) | events |", "|---|---|---|---|"]
    for begin, tank in (
        ("meetings", "crowded"), ("hits above 0.25", "crowded"), ("hits above 0.5", "crowded"),
        ("hits above 1", "shaken"), ("hits above 1", "unlimited"), ("hits above 1.5", "unlimited"),
    ):  # fmt: skip
        rows += [
            f"| {row['quantity']} | {tank} | {signed(row['change'])} ± {100 * row['error']:.2f} | {row['events']:.0f} |"
            for row in of_group(found[found["tank"] == tank], begin).to_dict("records")
        ]
    return "\n".join(rows) + "\n"


def progress() -> str:
    """What was run of the plan."""
    rows = ["| tank | bodies | runs planned | made | tu of each | shaking |", "|---|---|---|---|---|---|"]
    for name, tank in TANKS.items():
        made = len(runs_of(name)) // len(COMPARED)
        shaking = f"{tank.shaking} times, steps {tank.shaking} times finer" if tank.shaking > 1 else "the study's"
        shaking += "" if tank.is_limited else "; no limit on spins"
        bodies = ", ".join(f"{count} {what}s" for what, count in tank.composition.items())
        rows.append(f"| {name} | {bodies} | {tank.runs} | {made} | {tank.length:g} | {shaking} |")
    again = pd.read_csv(file_of("rates"))["run"].nunique()
    rows.append(f"| calibration of line4 | as in its plan | {len(specs())} | {again} | 500 | the study's |")
    return "\n".join(rows) + "\n"


@cache
def first_engine() -> Exposure:
    """Events and exposures of all calibration runs by PyBullet, under mass action."""
    plan, folder = StudyPlan.load(STUDY / "plan.toml"), STUDY / "runs"
    keys = [spec.key for spec in plan.specs(plan.calibration)]
    return pooled(count(record_at(str(folder / f"{key}.run"), folder).path) for key in keys)


def rates() -> pd.DataFrame:
    """By channel: events and rates by both engines, and the exact 95 % interval of their ratio.

    Given all events of two Poisson processes, those of one are binomial; its limits (Clopper and Pearson) are the
    ratio's.
    """
    again = pd.read_csv(file_of("rates")).groupby("channel")[["events", "exposure"]].sum()
    rows, found = [], first_engine()
    for channel, first, known in zip(
        found.network.channels, found.events.tolist(), found.exposure.tolist(), strict=True
    ):
        own, exposure = int(again.loc[channel, "events"]), again.loc[channel, "exposure"]
        low = beta.ppf(0.025, own, first + 1) if own else 0.0
        high = beta.ppf(0.975, own + 1, first)
        limits = [share / (1 - share) * known / exposure for share in (low, high)]
        rate = first / known
        rows.append((channel, rate, first, own / exposure, own, own / exposure / rate, *limits))
    return pd.DataFrame(
        rows, columns=["channel", "pybullet", "pybullet_events", "own", "events", "ratio", "low", "high"]
    )


def rates_table(found: pd.DataFrame) -> str:
    """A line a channel; breaks as first order, on nearly the same mixture of tanks."""
    rows = ["| channel | PyBullet | own engine | events | own / PyBullet | 95 % |", "|---|---|---|---|---|---|"]
    rows += [
        f"| `{row['channel']}` | {row['pybullet']:.3g} | {row['own']:.3g} | {row['pybullet_events']}; {row['events']} "
        f"| {row['ratio']:.2f} | {row['low']:.2f} to {row['high']:.2f} |"
        for row in found.to_dict("records")
    ]
    return "\n".join(rows) + "\n"


def signed(share: float) -> str:
    """A share in per cent."""
    return f"{100 * share:+.2f}".replace("-", "−")


def draw(found: pd.DataFrame, figure: Any) -> None:
    """The change of each quantity with its 95 % interval, a panel a tank, and the two per cent that were asked for."""
    found = found[np.isfinite(found["error"]) & (found["error"] > 0) & (found["error"] < 0.06)]
    heights = [(found["tank"] == name).sum() for name in TANKS]
    panels = figure.subplots(len(TANKS), 1, sharex=True, height_ratios=heights)
    for k, (ax, (name, tank)) in enumerate(zip(panels, TANKS.items(), strict=True)):
        here = found[found["tank"] == name]
        places = np.arange(len(here))
        ax.axvspan(-2, 2, color="0.92")
        ax.axvline(0, color="0.5", linewidth=0.8)
        ax.errorbar(100 * here["change"], places, xerr=196 * here["error"], fmt="o", markersize=3, color=colour(k))
        ax.set_yticks(places, here["quantity"], fontsize=6)
        ax.set_ylim(len(here), -1)
        ax.set_title(f"{name}: {tank.title}", fontsize=8, loc="left")
    panels[-1].set_xlabel("own engine minus PyBullet (%), 95 % interval")


def written(text: str) -> str:
    """The page with its tables made anew; ValueError: it has not the blocks for them."""
    found = changes()
    tables = {
        "plan": progress(),
        "trials": table(found),
        "single": single_lines(found),
        "rates": rates_table(rates()),
    }
    if sorted(block[2] for block in BLOCKS.finditer(text)) != sorted(tables):
        raise ValueError(f"{PAGE.name} has not one block <!-- engines: ... --> for each of {', '.join(tables)}")
    return BLOCKS.sub(lambda block: block[1] + tables[block[2]] + block[3], text)


def main() -> None:
    """Draw and write."""
    save_figure(str(FOLDER / "line4.svg"), partial(draw, changes()), (7.0, 15.0))
    PAGE.write_text(written(PAGE.read_text("utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
