"""The numbers of the studies' pages, from their stored files: blocks of docs/line_of_four.md and results/*/README.md.

    python -m tests.results.study_pages

writes them anew, each between a line `<!-- STUDY: NAME -->` and a line `<!-- end -->`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import Any

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
from tests.results.studies import ROOT, STUDIES, Study, bullets, cubes_in, listed, one, paragraph, ratio, table

PAGES = (
    *(ROOT / "docs" / f"{name}.md" for name in ("line_of_four", "crowding")),
    *(folder / "README.md" for folder in STUDIES.values()),
)
BLOCK = re.compile(rf"(<!-- ({'|'.join(STUDIES)}): (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
PAPER_FIRST_LINE = {"mechanics": 89.42, "Gillespie": 93.84}  # tu, means of ten runs each; section VI of the paper


# What the plan fixed


def planned(study: Study) -> str:
    """Runs, sizes, seeds and rules."""
    ours, held, rules = study.plan.calibration, study.plan.held_out, study.plan.verdict
    times = sorted({f"{t.along:g}" for t in ours.tanks if t.along is not None}, key=float)
    kinds = {tuple(sorted(t.composition.items())) for t in ours.tanks}
    watched = sorted({cubes_in(t.composition) for t in ours.tanks})
    calibration = (
        f"Calibration, seed {ours.seed}, by PyBullet: {sum(t.runs for t in ours.tanks)} runs of "
        f"{one(t.duration for t in ours.tanks)} tu in {len(kinds)} tanks, of {listed(watched)} cubes in the "
        f"states that earlier rates predict at {listed(times)} tu."
    )
    by = {engine: [t for t in held.tanks if (t.engine or "pybullet") == engine] for engine in ("pybullet", "own")}
    said = {
        engine: listed(
            [
                f"{t.runs} of {cubes_in(t.composition)} cubes"
                + ("" if t.tank is None else f" in {' x '.join(f'{edge:g}' for edge in t.tank)}")
                for t in tanks
            ]
        )
        for engine, tanks in by.items()
    }
    lengths = sorted({(cubes_in(t.composition), t.duration) for t in held.tanks if t.duration != 2000.0})
    held_out = (
        f"Held out, seed {held.seed}, {sum(t.runs for t in held.tanks)} runs of 2,000 tu from single cubes "
        f"({listed([f'{cubes} cubes: {time:,.0f} tu' for cubes, time in lengths])}): by PyBullet {said['pybullet']}; "
        f"by our own engine {said['own']}."
    )
    low, high = rules.pooled_breaks or rules.pooled_ratio
    verdict = (
        f"Verdict: p of every row of events at least {rules.p_row:g}; seen / expected from {rules.ratio[0]:g} to "
        f"{rules.ratio[1]:g} wherever {rules.from_events:g} events are expected; over all sizes from "
        f"{rules.pooled_ratio[0]:g} to {rules.pooled_ratio[1]:g} for joins and from {low:g} to {high:g} for breaks; "
        f"p of all single runs above {rules.p_pit:g}; and two controls fail: `{rules.control}` breaks, and the same "
        f"break model without crowding."
    )
    return bullets([calibration, held_out, verdict])


# What the calibration runs showed


def made(study: Study) -> str:
    """Runs, events and cost of the calibration."""
    known = study.rates.evidence
    channels = study.stored("calibration.json")["channels"]
    joins = [row["events"] for row in channels if "+" in row["channel"].split("->")[0]]
    breaks = [row["events"] for row in channels if "+" not in row["channel"].split("->")[0]]
    added = re.search(r"The last \w+ calibration runs were added[^.]*\.", study.plan.purpose)
    return paragraph(
        f"The {known['runs']} calibration runs took {known['cpu_seconds'] / 3600:.1f} h of CPU time; "
        f"{known['runs_left_out'] or 'none'} had to be left out. They contain {sum(joins):,} joins, at least "
        f"{min(joins)} per channel, and {sum(breaks):,} breaks, at least {min(breaks)}. {added[0] if added else ''}"
    )


def rate_table(study: Study) -> str:
    """Rates beside the paper's. Those of breaks are means over the calibration tanks."""
    paper = Rates.load("table3").channels
    rows = []
    for row in study.stored("calibration.json")["channels"]:
        name, ways = row["channel"], row["ways"]
        cells = [f"{1e5 * row[key]:.2f}" for key in ("rate", "low", "high")]
        theirs = paper[name]
        rows.append(
            (
                name.replace("->", "→"), f"{ways:g}", cells[0], f"{cells[1]} to {cells[2]}", str(row["events"]),
                f"{1e5 * row['rate'] * ways:.1f}", f"{1e5 * theirs.rate * theirs.ways:.1f}",
            )
        )  # fmt: skip
    titles = ("channel", "N", "rate (1e-5/tu)", "95 % interval", "events")
    return table((*titles, "k·N per combination", "paper's, as read in `table3`"), rows)


def channel_table(study: Study) -> str:
    """Rates of all channels. Those of breaks are means over the calibration tanks."""
    rows = [
        (
            row["channel"].replace("->", "→"), f"{row['ways']:g}", f"{1e5 * row['rate']:.2f}",
            f"{1e5 * row['low']:.2f} to {1e5 * row['high']:.2f}", str(row["events"]),
        )
        for row in study.stored("calibration.json")["channels"]
    ]  # fmt: skip
    return table(("channel", "N", "rate (1e-5/tu)", "95 % interval", "events"), rows)


def who_broke(study: Study) -> str:
    """Breaks by what broke them, in all runs of the study."""
    counts: Counter[str] = Counter()
    for manifest, arrays in RunStore.found(study.folder / "runs").contents():
        named = dict(enumerate(manifest["facts"]["species"]))
        names = {BY_WALL: "a wall", BY_SEVERAL: "several partners at once"} | named
        counts.update(names[partner] for partner in arrays["partners"].tolist() if partner != NO_BREAK)
    told = [f"{n} by {name}" for name, n in counts.most_common()]
    return paragraph(f"Of the {sum(counts.values())} breaks in all runs, {listed(told)}.")


def model_table(study: Study) -> str:
    """Break models side by side."""
    rows = [
        (
            f"`{row['model']}`" + (" (chosen)" if row["is_chosen"] else ""), str(row["free_parameters"]),
            f"{row['aic_above_least']:.1f}", f"{row['log_score']:.1f}",
            f"{row['deviance']:.1f} ({row['freedom']})" if row["freedom"] else "-",
            f"{row['p_deviance']:.2g}" if row["freedom"] else "-", row["shape"],
        )
        for row in pd.read_csv(study.folder / "calibration_breaks.csv").to_dict("records")
    ]  # fmt: skip
    titles = ("break model", "free parameters", "AIC above the smallest", "log score", "deviance (df)", "p of it")
    return table((*titles, "shape [95 %]"), rows)


def reason(study: Study) -> str:
    """Why one model was chosen, and what its shape means in this tank."""
    found = study.stored("calibration.json")["breaks"]
    text = f"`calibrate` says: {found['reason']}."
    return paragraph(text)


def crowding_chosen(study: Study) -> str:
    """The models of crowding that the calibration runs chose, by the hits that broke a bond and by all joins."""
    found, rows = study.stored("calibration.json")["crowding"], []
    for source, model in found["chosen"].items():
        fits = [fit for fit in found["fits"] if fit["source"] == source]
        hardest = [fit for fit in fits if fit["above"] == max(each["above"] for each in fits)]
        for fit in hardest:
            value = "" if fit["value"] is None else f"{fit['value']:.2f} [{fit['low']:.2f}, {fit['high']:.2f}]"
            ratios = [row["ratio"] for row in fit["tanks"]]
            name = f"`{fit['model']}`" + (" (chosen)" if fit["model"] == model else "")
            above = f"{fit['above']:g}" if fit["above"] else ""
            aic = fit["aic"] - min(each["aic"] for each in hardest)
            rows.append((source, above, f"{fit['events']}", name, value, f"{aic:.1f}", _span(ratios)))
    titles = ("events by", "above", "events", "crowding", "parameter [95 %]", "AIC above the least", "60 and 160 cubes")
    return table(titles, rows)


def _span(ratios: list[float]) -> str:
    return f"{min(ratios):.2f} to {max(ratios):.2f}"


def hits_by_tank(study: Study) -> str:
    """Hits and joins per exposure, least and most of all tanks, under each model of crowding."""
    found = study.stored("crowding.json")
    models = list(dict.fromkeys(fit["model"] for fit in found["fits"]))
    rows = []
    for source, above in dict.fromkeys((fit["source"], fit["above"]) for fit in found["fits"]):
        fits = [fit for fit in found["fits"] if (fit["source"], fit["above"]) == (source, above)]
        cells = []
        for fit in fits:
            ratios = [row["ratio"] for row in fit["tanks"]]
            cells.append(
                f"{min(ratios):.2f} to {max(ratios):.2f}; {fit['chi_square'] / fit['scatter']:.1f} of {fit['freedom']}"
            )
        rows.append((source, f"{above:g}" if above else "", str(fits[0]["events"]), *cells))
    return table(("events by", "above", "events", *models), rows)


def hits_of_three(study: Study) -> str:
    """How often third bodies take part, by load."""
    found = study.stored("crowding.json")
    rows = []
    for fit in found["fits"]:
        if fit["parameter"] == "third" and fit["source"] != "joins":
            reach, beyond = (fit["coincidence"][name] for name in ("reach", "beyond"))
            limits = f"{fit['value']:.3f} [{fit['low']:.3f}, {fit['high']:.3f}]"
            shared = f"{fit['shared'] / fit['events']:.0%}"
            rows.append((fit["source"], f"{fit['above']:g}", shared, limits, f"{reach:.3f}", f"{beyond:.2f}"))
    chosen = ", ".join(f"{model} for {source}" for source, model in found["chosen"].items())
    titles = ("hits by", "above", "shared", "third", "reach", "beyond")
    return f"{table(titles, rows)}\n\n{paragraph(f'Chosen: {chosen}.')}"


def pairs(study: Study) -> str:
    """Breaks at one moment, counted in the calibration runs."""
    breaks = together = 0
    for manifest, arrays in RunStore.found(study.folder / "runs").contents():
        if manifest["inputs"]["seed"] == study.plan.calibration.seed:
            joins = [name.split("->")[0].count("+") for name in manifest["facts"]["channels"]]
            times = [t for t, c in zip(arrays["times"], arrays["channels"], strict=True) if c >= 0 and not joins[c]]
            breaks += len(times)
            together += sum(later == earlier for earlier, later in pairwise(times))
    return paragraph(
        f"Of the {breaks} breaks, {together} happen in the same step as the one before: one collision breaks both "
        f"partners. The chain has no such reaction, so its counts of breaks scatter slightly too little."
    )


def diagnostics(study: Study) -> str:
    """What the diagnostics doubt, of the calibration and of the held-out runs."""
    return bullets(
        [
            f"{name}: {doubts(study.stored(file)['diagnostics'])}"
            for name, file in (("Calibration runs", "calibration.json"), ("Held-out runs", "validation.json"))
        ]
    )


def doubts(found: dict[str, Any]) -> str:
    tested = [row for row in found["results"] if row["p"] is not None]
    failed = sorted((row for row in tested if row["doubtful"]), key=lambda row: row["p"])
    if not failed:
        return f"none of {len(tested)} tests fails."
    worst = {row["test"]: row for row in reversed(failed)}
    told = [
        f"The least likely result of `{row['test']}` is for {row['channel']}: {in_prose(row['seen'])}."
        for row in reversed(worst.values())
    ]
    return f"{len(failed)} of {len(tested)} tests fail. {' '.join(told)}"


def in_prose(seen: str) -> str:
    """A stored result of a diagnostic as a sentence of a page."""
    return seen.replace(", same pieces where", " by the same two parts, where")


# What the held-out runs showed


def made_so_far(study: Study) -> str:
    """How many of the planned held-out runs the page rests on."""
    wanted = sum(t.runs for t in study.plan.held_out.tanks)
    runs = sum(row["runs"] for row in study.summaries)
    hours = sum(row["cpu_mechanics_s"] for row in study.summaries) / 3600
    return f"{runs} of {wanted} held-out runs, {hours:.1f} h of CPU time."


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
        f"{row['group']} of {row['size']} are {row['seen'] / row['expected']:.4f} times as frequent as expected "
        f"(p = {row['p']:.2g})"
        for row in off.to_dict("records")
    ]
    return paragraph(f"The rule from {allowed[0]:g} to {allowed[1]:g} is missed: {listed(told)}.")


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


BLOCKS: dict[str, Callable[[Study], str]] = {
    "plan": planned,
    "made": made,
    "rates": rate_table,
    "channels": channel_table,
    "partners": who_broke,
    "models": model_table,
    "reason": reason,
    "crowding": crowding_chosen,
    "hits_by_tank": hits_by_tank,
    "hits_of_three": hits_of_three,
    "pairs": pairs,
    "diagnostics": diagnostics,
    "held": made_so_far,
    "events": event_table,
    "rules": rules,
    "mass_action": joins_by_mass_action,
    "verdict": verdict,
    "missed": missed,
    "several": several,
    "summary": summary_table,
    "paper": beside_the_paper,
}


@cache
def study_of(name: str) -> Study:
    """One study for all blocks, so that its runs are read once."""
    return Study(name)


def filled(text: str) -> str:
    """A page with its blocks made anew."""
    return BLOCK.sub(lambda found: f"{found[1]}{BLOCKS[found[3]](study_of(found[2]))}\n{found[4]}", text)


def numbers(text: str) -> Counter[str]:
    """Numbers of a text outside its blocks, its code and its links."""
    bare = re.sub(r"```.*?```|`[^`]*`|\]\([^)]*\)", " ", BLOCK.sub(" ", text), flags=re.DOTALL)
    return Counter(re.findall(r"\d+(?:[.,]\d+)*(?:e-?\d+)?", bare))


if __name__ == "__main__":
    for page in PAGES:
        page.write_text(filled(page.read_text(encoding="utf-8")), encoding="utf-8")
