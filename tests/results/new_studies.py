"""Blocks of the pages of studies that `wellmixed new` began: what was planned, and what the runs cost."""

from __future__ import annotations

from calibration.planning.allocation import half_width
from tests.results.studies import Study, bullets, listed, only, paragraph


def planned_by_new(study: Study) -> str:
    """Tanks, runs, seeds and rules of a plan that `new` made."""
    ours, held, rules = study.plan.calibration, study.plan.held_out, study.plan.verdict
    tanks = [f"{t.runs} from {listed([f'{n} {name}' for name, n in t.composition.items()])}" for t in ours.tanks]
    sizes = [f"{t.runs} of {sum(t.composition.values())} cubes" for t in held.tanks]
    calibration = (
        f"Calibration, seed {ours.seed}: runs of {only(t.duration for t in ours.tanks):g} tu, {'; '.join(tanks)}."
    )
    held_out = (
        f"Held out, seed {held.seed}: runs of {only(t.duration for t in held.tanks):,g} tu from single cubes, "
        f"{listed(sizes)}."
    )
    verdict = (
        f"Verdict: p of every row of events at least {rules.p_row:g}; seen / expected from {rules.ratio[0]:g} to "
        f"{rules.ratio[1]:g} wherever {rules.from_events:g} events are expected, and from {rules.pooled_ratio[0]:g} to "
        f"{rules.pooled_ratio[1]:g} over all sizes; p of all single runs above {rules.p_pit:g}."
    )
    return bullets([calibration, held_out, verdict])


def purpose(study: Study) -> str:
    """What the plan was to reach, in its own words."""
    return paragraph(f"The plan says: {study.plan.purpose}")


def made_for_new(study: Study) -> str:
    """Runs, events, and the cost of it all."""
    known = study.rates.evidence
    channels = study.stored("calibration.json")["channels"]
    joins = [row["events"] for row in channels if "+" in row["channel"].split("->")[0]]
    breaks = sum(row["events"] for row in channels) - sum(joins)
    prior = study.rates.not_measured
    held = sum(row["cpu_mechanics_s"] for row in study.summaries)
    got, all_breaks = half_width([min(joins), breaks])
    return paragraph(
        f"The {known['runs']} calibration runs took {known['cpu_seconds'] / 60:.1f} min of CPU time, and "
        f"{known['runs_left_out'] or 'none'} had to be left out. They contain {sum(joins)} joins, at least "
        f"{min(joins)} per channel, and {breaks} breaks: half-widths of {got:.0%} or less for joins, and "
        f"{all_breaks:.0%} for all "
        f"breaks together. Channels whose reactants no run held: {listed(prior) if prior else 'none'}. "
        f"The {sum(row['runs'] for row in study.summaries)} held-out runs took {held / 60:.1f} min."
    )
