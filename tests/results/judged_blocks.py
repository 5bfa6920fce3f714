"""What a study's held-out runs showed: blocks of its pages."""

from __future__ import annotations

from functools import cache

import numpy as np
import pandas as pd

from calibration.pipeline.bars import WORDS
from kinetics.network import Tank
from kinetics.rates import Rates
from kinetics.runs import BY_SEVERAL, BY_WALL, NO_BREAK
from mechsim.inspection.poses import record_at
from mechsim.runs.record import book_of
from mechsim.runs.store import RunStore
from mechsim.scene import Scene
from tests.results.paper_estimator import paper_estimate
from tests.results.studies import ROOT, Study, bullets, cubes_in, listed, paragraph, ratio, table

MIDDLE = "4->2+2"
SHOWN = 5  # rows of single channels
PAPER_FIRST_LINE = {"mechanics": 89.42, "Gillespie": 93.84}  # tu, means of ten runs each; section VI of the paper


def made_so_far(study: Study) -> str:
    """How many of the planned held-out runs the page rests on."""
    wanted = sum(t.runs for t in study.plan.held_out.tanks)
    runs = sum(row["runs"] for row in study.summaries)
    hours = sum(row["cpu_mechanics_s"] for row in study.summaries) / 3600
    return f"{runs} of {wanted} held-out runs, {hours:.1f} h of CPU time."


def in_one_sentence(study: Study) -> str:
    """Joins and breaks over all sizes, and which rules were kept."""
    rows = study.events[study.events["size"] == "all sizes"].set_index("group")
    found = study.stored("validation.json")["rules"]
    joins, breaks = (
        f"{rows.loc[group, 'seen'] / rows.loc[group, 'expected']:.2f} times as frequent as predicted"
        for group in ("joins", "breaks")
    )
    broken = [row["rule"] for row in found if row["is_kept"] is False]
    kept = sum(row["is_kept"] is True for row in found)
    told = f"broken: {'; '.join(broken)}" if broken else "none is broken"
    return paragraph(
        f"Over all sizes, joins are {joins} and breaks {breaks}. Of the plan's {len(found)} rules {kept} are kept; "
        f"{told}."
    )


def event_table(study: Study) -> str:
    """Joins and breaks, a line a kind of run, from events.csv."""
    rows = study.events
    runs = {row["label"]: row["runs"] for row in study.summaries}
    runs["all sizes"] = sum(runs.values())
    lines = []
    for size in dict.fromkeys(rows["size"]):
        engine = rows[rows["size"] == size].get("engine", pd.Series([""])).iloc[0]
        cells = [size, {"pybullet": "PyBullet", "own": "own"}.get(engine, ""), str(runs[size])]
        for group in ("joins", "breaks"):
            (row,) = rows[(rows["size"] == size) & (rows["group"] == group)].to_dict("records")
            cells += [ratio(row["seen"], row["expected"]), f"{row['p']:.2g}", f"{row['p_scatter']:.2g}"]
        lines.append(cells)
    titles = ("held out", "engine", "runs", "joins: seen / expected", "p", "p of their scatter")
    return table((*titles, "breaks: seen / expected", "p", "p of their scatter"), lines)


def joins_by_mass_action(study: Study) -> str:
    """Joins seen over those expected by the rates of the control without crowding, in all held-out runs."""
    folder, network = study.folder / "runs", book_of(study.plan.scene)[1].network
    rates, ratios = Rates.load(study.folder / "uncrowded.toml"), {}
    total = np.zeros(2)
    for tanks, label in zip(study.plan.held_out.tanks, (row["label"] for row in study.summaries), strict=True):
        scene, found = study.plan.scene_of(tanks), np.zeros(2)
        specs = [spec for spec in study.plan.specs(study.plan.held_out) if spec.scene == scene]
        specs = [spec for spec in specs if spec.composition == tanks.composition]
        model = rates.expected(network, Tank(scene.tank.size))
        is_join = np.array(["+" in name.split("->")[0] for name in model.channels])
        for spec in specs:
            path = record_at(str(folder / f"{spec.key}.run"), folder).path
            times = np.minimum(path.times, spec.duration)  # a run ends with a whole step, a little later
            waits = np.diff(np.concatenate([[0.0], times, [spec.duration]]))
            fired = path.channels[path.times <= spec.duration].tolist()
            seen = sum("+" in network.channels[channel].split("->")[0] for channel in fired)
            found += seen, (waits @ model.propensities(path.states))[is_join].sum()
        ratios[label] = found[0] / found[1]
        total += found
    least, most = min(ratios, key=ratios.__getitem__), max(ratios, key=ratios.__getitem__)
    return paragraph(
        f"With the rates of the control without crowding, joins seen / expected are {ratio(total[0], total[1])} over "
        f"all sizes, from {ratios[least]:.2f} ({least}) to {ratios[most]:.2f} ({most})."
    )


def rules(study: Study) -> str:
    """The plan's rules, and what came."""
    words = WORDS | {False: "**broken**"}
    found = study.stored("validation.json")["rules"]
    return table(("rule", "", "result"), [(row["rule"], words[row["is_kept"]], row["came"]) for row in found])


def verdict(study: Study) -> str:
    """The verdict of `validate` over all its checks."""
    return paragraph(f"`validate` says: {study.stored('validation.json')['verdict']}.")


def missed(study: Study) -> str:
    """Rows of events that a rule on their ratio does not allow, to one digit more than the rules show."""
    allowed, least = study.plan.verdict.ratio, study.plan.verdict.from_events
    rows = study.events
    shown = rows[rows["group"].isin(("joins", "breaks")) & (rows["expected"] >= least) & (rows["size"] != "all sizes")]
    off = shown[~(shown["seen"] / shown["expected"]).between(*allowed)]
    if off.empty:
        return "No row misses its rule."
    told = [
        f"{row['group']} of {row['size']} are {row['seen'] / row['expected']:.3f} times as frequent as expected (p = "
        f"{row['p']:.2g}; {row['seen']} were seen, {row['low']:.0f} to {row['high']:.0f} predicted, which is "
        f"{row['low'] / row['expected']:.2f} to {row['high'] / row['expected']:.2f} times what is expected)"
        for row in off.to_dict("records")
    ]
    return paragraph(f"The rule from {allowed[0]:g} to {allowed[1]:g} is missed: {listed(told)}.")


def parts(study: Study) -> str:
    """Whom walls break where, and the rows of single channels that are least likely."""
    by_wall = {"calibration": [0, 0], "held-out": [0, 0]}
    for manifest, arrays in RunStore.found(study.folder / "runs").contents():
        kind = "calibration" if manifest["inputs"]["seed"] == study.plan.calibration.seed else "held-out"
        names = np.array([*manifest["facts"]["channels"], ""])[arrays["channels"][arrays["partners"] == BY_WALL]]
        by_wall[kind][0] += int((names == MIDDLE).sum())
        by_wall[kind][1] += int(np.char.startswith(names, "4->").sum())
    told = listed([f"{middle} of {both} in the {kind} runs" for kind, (middle, both) in by_wall.items()])
    rows = study.events[study.events["group"].str.contains("->") & (study.events["size"] != "all sizes")]
    lines = [
        (row["group"].replace("->", "→"), row["size"], ratio(row["seen"], row["expected"]), f"{row['p']:.2g}")
        for row in rows.sort_values("p").head(SHOWN).to_dict("records")
    ]
    first = paragraph(
        f"Breaks of quadmers by a wall that were in the middle: {told}. The {SHOWN} least likely of all {len(rows)} "
        f"rows of single channels (the least p, times their number, is {len(rows) * rows['p'].min():.2g}):"
    )
    return f"{first}\n\n{table(('channel', 'held out', 'seen / expected', 'p'), lines)}"


def several(study: Study) -> str:
    """How many breaks had several partners at once, run by run."""
    known = study.plan
    of: dict[str, dict[tuple[str, str, int], list[int]]] = {"calibration": {}, "held out": {}}
    for manifest, arrays in RunStore.found(study.folder / "runs").contents():
        kind = "calibration" if manifest["inputs"]["seed"] == known.calibration.seed else "held out"
        scene = manifest["inputs"]["scene"]
        engine = scene["numerics"].get("engine", "pybullet")
        size = " x ".join(f"{edge:g}" for edge in scene["tank"]["size"])
        key = engine, size, cubes_in(manifest["inputs"]["composition"])
        counts = of[kind].setdefault(key, [0, 0])
        counts[0] += int((arrays["partners"] == BY_SEVERAL).sum())
        counts[1] += int((arrays["partners"] != NO_BREAK).sum())
    usual = " x ".join(f"{edge:g}" for edge in Scene.load(known.scene).tank.size)
    said = {
        kind: [
            f"{seen} of {breaks} ({seen / breaks:.0%}) at {cubes} cubes"
            + ("" if tank == usual else f" in {tank}")
            + (" by our own engine" if engine == "own" else "")
            for (engine, tank, cubes), (seen, breaks) in sorted(
                counts.items(), key=lambda each: (each[0][0] == "own", each[0][1] != usual, each[0])
            )
        ]
        for kind, counts in of.items()
    }
    return paragraph(
        f"Several partners touched a structure at once in {listed(said['calibration'])} of the calibration runs, and "
        f"in {listed(said['held out'])} of the held-out ones."
    )


def summary_table(study: Study) -> str:
    """Counts over time, first lines and costs, a line a size."""
    rows = []
    for row in study.summaries:
        spread = "not solved" if row["first_sd"] is None else f"{row['first_sd']:.0f}"
        exact = "" if row["cpu_exact_s"] is None else f"; {row['cpu_exact_s']:.2g}"
        rows.append(
            (
                row["label"], f"{row['coverage']:.0%}", f"{row['p_misfit']:.2g}",
                f"{row['crps']:.2f} ({row['crps_floor']:.2f})", f"{row['p_single_runs']:.2g}",
                f"{row['first_observed']:.0f} [{row['first_low']:.0f}, {row['first_high']:.0f}]",
                f"{row['first_predicted']:.0f}; {spread}", f"{row['p_first']:.2g}",
                f"{row['cpu_mechanics_s']:.0f}", f"{row['cpu_ssa_s']:.2g}{exact}",
            )
        )  # fmt: skip
    titles = ("held out", "means in their band", "p of means", "CRPS (model's own)", "p of single runs")
    titles += ("first target (tu)", "predicted: mean; sd of a run", "p of these")
    return table((*titles, "mechanics (CPU s)", "1,000 SSA runs; exact (CPU s)"), rows)


@cache
def papers_rates(study: Study) -> dict[str, float]:
    """Rates of the study's calibration runs by the paper's estimator, over our own."""
    folder = study.folder / "runs"
    records = [record_at(str(file), folder) for file in sorted(folder.glob("*.run"))]
    ours = [r for r in records if r.spec.seed == study.plan.calibration.seed and r.completed]
    found = paper_estimate([record.path for record in sorted(ours, key=lambda record: record.spec.run)])
    return {row["channel"]: found[row["channel"]] / row["rate"] for row in study.stored("calibration.json")["channels"]}


def beside_the_paper(study: Study) -> str:
    """First lines, first Ts and the estimator beside the paper's."""
    (row,) = [row for row in study.summaries if row["label"] == "60 cubes"]
    points = pd.read_csv(ROOT / "results" / "section5" / "number_points.csv").set_index("number")
    late = [
        f"{point['median_low'] / point['paper_median']:.1f} to {point['median_high'] / point['paper_median']:.1f} "
        f"times as late at {n}"
        for n, point in points[points["paper_median"].notna()].iterrows()
    ]
    line = (
        f"The first line of {row['runs']} runs of 60 cubes forms at {row['first_observed']:.0f} tu (95 %: "
        f"{row['first_low']:.0f} to {row['first_high']:.0f}) in our mechanics (paper: "
        f"{PAPER_FIRST_LINE['mechanics']}), and at {row['first_predicted']:.0f} tu by prediction (paper: "
        f"{PAPER_FIRST_LINE['Gillespie']}). The rate of the first join was fitted."
    )
    first_t = (
        f"First Ts (section V, `results/section5`, measured under physics 1) form later than the paper's: by the 95 "
        f"% intervals of our medians {' and '.join(late)} cubes."
    )
    speeds = pd.read_csv(ROOT / "results" / "section5" / "velocity_points.csv")
    off = (speeds["speed"] / speeds["paper_speed"] - 1).abs().max()
    speed = (
        f"Mean speeds, over the phase of the hold, are within {off:.1%} of the paper's {len(speeds)} "
        "(`results/section5`, physics 1)."
    )
    ratios = papers_rates(study).values()
    estimator = (
        f"The paper's estimator (its eqs 12 to 15: means of waiting times, without the censored one) gives rates "
        f"{min(ratios):.2f} to {max(ratios):.2f} times ours on the calibration runs "
        f"(`tests/results/paper_estimator.py`). It maximises no likelihood, is biased and has no intervals, so it "
        f"is used for nothing else."
    )
    return bullets([line, first_t, speed, estimator])
