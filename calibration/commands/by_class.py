"""`calibrate` and `validate` for rates by class."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from calibration.commands.shared import leave
from calibration.estimating.class_spread import flagged
from calibration.pipeline.plan import StudyPlan, is_plan
from calibration.pipeline.study_runs import assembly_specs
from calibration.validating.growth_curves import GROUPS, MOST_GROUPS
from kinetics.rates import ClassRates
from kinetics.support import plots
from kinetics.support.cli.options import echo_json
from kinetics.support.output import write_whole
from kinetics.support.packages import pd
from kinetics.support.tables import figure, text_table
from mechsim.runs.record import book_of
from mechsim.scene import Scene

if TYPE_CHECKING:
    from calibration.pipeline.class_study import ClassStudy, GrowthStudy
    from mechsim.commands.options import ShardWork
    from mechsim.runs.executors import Executor
    from mechsim.runs.record import RunSpec


def is_seeded(scene: str) -> bool:
    """Whether the book of a scene, or of a plan's, grows from a seed."""
    path = StudyPlan.load(scene).scene if is_plan(scene) else scene
    return book_of(Scene.load(path).rules)[0].seed_letter is not None


def calibrate_by_class(
    sources: Sequence[str],
    target: Path,
    cubes: tuple[int, ...],
    runs: int,
    duration: float,
    breaks: str | None,
    share: str,
    runs_folder: str,
    workers: Executor,
    part: ShardWork | None,
    progress: bool | None,
    seed: int,
    as_json: bool,
) -> None:
    """Make or read the runs of all scenes and plans, and write the rates of their classes."""
    from calibration.pipeline.class_study import run_class_calibration

    specs: list[RunSpec] = []
    settings: dict[str, Any] = {"seeds": [], "plans": {}}
    asked = breaks
    for source in dict.fromkeys(sources):
        if is_plan(source):
            plan = StudyPlan.load(source)
            specs += plan.specs(plan.calibration)
            settings["plans"][plan.name] = plan.fingerprint
            settings["seeds"].append(plan.calibration.seed)
            asked = asked or plan.breaks
        else:
            specs += assembly_specs(Scene.load(source), cubes, runs, duration, seed)
            settings["seeds"].append(seed)
    settings["seeds"] = list(dict.fromkeys(settings["seeds"]))
    if part is not None:
        part.make(specs, runs_folder, workers, progress, as_json)
        return
    study = run_class_calibration(
        specs, settings, runs_folder, breaks=asked or "auto", share=share, workers=workers, progress=progress
    )
    study.rates.save(target)
    if as_json:
        echo_json(
            {
                "out": str(target),
                "classes": study.calibration.table(),
                "not_measured": study.calibration.not_measured,
                "fits": study.calibration.fits_table(),
                "spreads": [spread.to_dict() for spread in study.spreads],
                "breaks": {"model": study.rates.breaks.model, "shape": study.rates.breaks.shape},
                "evidence": study.rates.evidence,
                "problems": study.problems,
            }
        )
    else:
        click.echo(_rates_table(study))
        click.echo(f"rates written to {target}")
    leave(study.problems)


def validate_by_class(
    specs: Sequence[RunSpec],
    rates_name: str,
    csv_files: tuple[str, ...],
    plot_files: tuple[str, ...],
    groups: int | None,
    runs_folder: str,
    workers: Executor,
    progress: bool | None,
    as_json: bool,
) -> None:
    """Compare held-out growth with network-free runs under draws of the class rates."""
    from calibration.pipeline.class_study import run_growth_validation

    rates = ClassRates.load(rates_name)
    number = MOST_GROUPS if groups is None else groups
    study = run_growth_validation(
        specs, rates, runs_folder, groups=min(GROUPS, number), most_groups=number, workers=workers, progress=progress
    )
    for csv_file in csv_files:
        curves = pd.concat([comparison.to_dataframe() for comparison in study.comparisons])
        write_whole(csv_file, curves.to_csv(index=False))
    for plot_file in plot_files:
        _plot(study, plot_file)
    if as_json:
        echo_json(
            {
                "rates": rates_name,
                "is_consistent": study.is_consistent,
                "comparisons": [comparison.to_dict() for comparison in study.comparisons],
                "digest": study.outcome.digest,
                "problems": study.problems,
            }
        )
    else:
        click.echo(_growth_tables(study))
    leave(study.problems)


def _rates_table(study: ClassStudy) -> str:

    rows = [
        (
            row["class"],
            figure(row["rate"], ".3g"),
            f"{figure(row['low'], '.3g')} to {figure(row['high'], '.3g')}",
            f"{row['events']:.3g}",
            f"{row['exposure']:.4g}",
        )
        for row in study.calibration.table()
    ]
    lines = [text_table(("class", "rate (1/tu)", "95 % interval", "events", "exposure (tu)"), rows)]
    lines += [f"{kind}: {reason}" for kind, reason in study.calibration.reasons.items()]
    shape = ", ".join(f"{name} = {value:.3g}" for name, value in study.rates.breaks.shape.items())
    lines.append(f"break model: {study.rates.breaks.model}{f' ({shape})' if shape else ''}")
    missed = study.calibration.not_measured
    if missed:
        lines.append(f"{len(missed)} classes were not present to be measured; a more general entry replaces them")
    off = flagged(study.spreads)
    said = "; ".join(spread.sentence for spread in off) if off else "none detected by these runs at 1 %"
    lines.append(f"rates that differ within a constant ({len(study.spreads)} tests): {said}")
    return "\n".join([*lines, study.source])


def _plot(study: GrowthStudy, name: str) -> None:
    """One figure of all comparisons, above each other."""

    def draw(figure: Any) -> None:
        figure.get_layout_engine().set(w_pad=0.1, h_pad=0.1)  # inches; titles keep off the frame
        parts = figure.subfigures(len(study.comparisons), 1, squeeze=False)
        for part, comparison in zip(parts.flat, study.comparisons, strict=True):
            comparison.plot(part)

    rows = sum(-(-len(comparison.curves) // 3) for comparison in study.comparisons)
    plots.save_figure(name, draw, (9.0, 0.6 + 2.1 * rows))


def _growth_tables(study: GrowthStudy) -> str:
    parts = []
    for comparison in study.comparisons:
        parts += [comparison.table(), comparison.sentence, ""]
    return "\n".join(parts[:-1])
