"""What a study's plan fixed and its calibration runs showed: blocks of its pages."""

from __future__ import annotations

import re
from collections import Counter
from itertools import pairwise
from typing import Any

import pandas as pd

from kinetics.rates import Rates
from kinetics.runs import BY_SEVERAL, BY_WALL, NO_BREAK
from mechsim.runs.store import RunStore
from tests.results.studies import Study, bullets, cubes_in, listed, one, paragraph, table


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
    densities = sorted({cubes_in(tank.composition) for tank in study.plan.calibration.tanks})
    titles = ("events by", "above", "events", "crowding", "parameter [95 %]", "AIC above the least")
    return table((*titles, f"{listed(densities)} cubes"), rows)


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
