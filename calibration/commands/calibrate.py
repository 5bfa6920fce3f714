"""The command `wellmixed calibrate`: rates by channel or by class, from mechanics runs or from data of others."""

from __future__ import annotations

from typing import Any

import click

from calibration.commands.from_data import COUNTED, FITTED, KINDS, data_options, fit_data, is_fit
from calibration.commands.shared import (
    given_options,
    leave,
    out_option,
    refuse_what_a_plan_fixes,
    report_option,
    seed_option,
    sizes_option,
    time_option,
)
from calibration.commands.tables import breaks_table, class_rates_table, rates_table
from calibration.estimating.study import CalibrationStudy, ClassStudy
from calibration.observed.study import observed_study
from calibration.pipeline.calibration_study import check_measurable, run_calibration, run_class_calibration
from calibration.pipeline.study_runs import StudyRuns
from calibration.reporting.overview import calibration_report
from kinetics.commands.models import is_network_file, network_of_book
from kinetics.formats import read
from kinetics.network import Tank
from kinetics.rates.breaks import break_model
from kinetics.rates.crowding import crowding_model
from kinetics.support.cli.completion import shipped
from kinetics.support.cli.declared import count_option, default_option
from kinetics.support.cli.options import HEADING, NumbersCommand, echo_json, heading, json_option
from kinetics.support.cli.study_folder import PLAN, RATES, RUNS, or_study_folder
from mechsim.commands.options import engine_option, run_options
from mechsim.runs.record import book_of

MODES = ("channels", "classes")
DATA = tuple(KINDS)
# Options that mean something in some modes only
MODES_OF = {
    "group_by": ("classes",),
    "run_table": ("events",),
    "tank": ("events",),
    "report": ("channels", *DATA),
    "crowding": ("channels",),
    "observed": COUNTED,
    "initial": COUNTED,
    **dict.fromkeys(FITTED, DATA),
}
# Options that mean something where no runs are made
OF_DATA = frozenset({"words", "out", "as_json", "report", *DATA})
OF_EVENTS = OF_DATA | {"cubes", "run_table", "tank"}
OF_FIT = {"seed", *FITTED}
FILES = or_study_folder(PLAN, {"runs_folder": RUNS, "out": RATES, "report": "calibration.html"})


def _words(ctx: click.Context, param: click.Parameter, words: tuple[str, ...]) -> tuple[str, ...]:
    """The mode, "" where none is named, and what it is to read; a folder stands for its plan."""
    kinds = [kind for kind in DATA if ctx.params.get(kind)]  # these options are eager, too, and come before
    if len(kinds) > 1:
        raise click.UsageError(f"--{kinds[0]} and --{kinds[1]}: one kind of data at a time", ctx)
    mode, *sources = (*kinds, *words) if kinds or words[0] in MODES else ("", *words)
    if sources and not kinds:
        sources[0] = FILES["callback"](ctx, param, sources[0])
    wanted = "MODEL" if kinds else "SCENE|PLAN|FOLDER"
    if not sources or (mode != "classes" and len(sources) > 1):
        asked = ("calibrate", "" if kinds else mode, wanted + (" ..." if mode == "classes" else ""))
        told = f"expected {' '.join(filter(None, asked))}{f' --{mode} FILE' if kinds else ''}; {' '.join(words)} came"
        raise click.UsageError(told, ctx)
    return (mode, *sources)


@click.command(cls=NumbersCommand)
@click.argument(
    "words",
    metavar="[channels|classes] SCENE|PLAN|FOLDER|MODEL",
    nargs=-1,
    required=True,
    shell_complete=shipped("scene"),
    callback=_words,
    is_eager=True,
)
@out_option("The rates file to write (TOML).")
@sizes_option(
    "--cubes",
    "Numbers of cubes of the runs. For events one number: it is checked, and if the table gives no initial counts, all "
    "cubes start single.",
    default=(60,),
)
@count_option("--runs", default=20, help="Number of calibration runs at each number of cubes.")
@time_option("--duration", 1000.0, "Simulated time of a run, tu.")
@click.option(
    "--break-model",
    "breaks",
    metavar="auto|NAME",
    help="How bonds break: a break model such as first-order or collision, or auto for the one that the runs "
    "choose. For events, no break model is fitted unless one is named here.  [default: the plan's, or auto]",
)
@click.option(
    "--crowding",
    metavar="auto|NAME",
    help="How breaks by bodies and by walls depend on the crowd: a model of crowding (none, linear, hard-bodies, "
    "three-body), or auto for those that logged hits choose, for breaks and for joins; none without logged hits.  "
    "[default: the plan's, or none]",
)
@heading("For rates by class")
@default_option(
    "--group-by",
    type=click.Choice(["auto", "event", "touched", "faces", "sizes"]),
    default="auto",
    help="What classes must have in common to share one constant: the event (join or break), also the number of "
    "cubes touched, also the faces, or also the sizes. With auto the runs choose, for joins and for breaks.",
)
@heading("For data of others: MODEL is a network file or a rule book")
@data_options
@heading("How runs are made")
@engine_option
@run_options
@heading(HEADING)
@report_option
@seed_option(1)
@json_option
def calibrate(words: tuple[str, ...], out: str, report: str | None, as_json: bool, **how: Any) -> None:
    """Estimate reaction rates, with 95 % intervals: by channel or by class from mechanics runs, or from events.

    A rate is events over exposure, pooled over all runs; waits that the end of a run cuts short (censoring) count in
    full. Runs are assemblies from single cubes, not restarted, so that rates are measured along the path on which they
    are used. A channel without events is named: for it the runs give only an upper bound. A channel whose reactants no
    run held gets a prior from the others of its kind, and the rates file marks it. Exit code 4: some runs were stopped
    by the guard or given up; the rates come from the others.

    A PLAN, a file written by `wellmixed study plan`, states scene, tanks, runs and seed. A FOLDER, made by `wellmixed
    new`, holds the plan; rates, report and runs are written there.

    `calibrate classes SCENE|PLAN ...` gives rates by class, which belong to the number of cubes that a place touches,
    to pairs of faces and to sizes, as far as the runs distinguish them, and serve `rules grow`, `rules rank`, `predict`
    and `validate` for any book. Runs of several scenes and plans are pooled. For books that grow from a seed these are
    the only rates, and the word may be left out: see docs/class_rates.md.

    With data of others no runs are made. `calibrate MODEL --events FILE` reads every event with its time: rates are
    events over exposure, as from mechanics. `--counts FILE` reads counts at some times, with nothing known of what
    happened in between, and `--snapshots FILE` independent copies that were counted once each: parameters of largest
    likelihood, and profile-likelihood intervals; so do events if one of --free, --fix, --bounds, --prior, --per-group,
    --against, --posterior or --starts is given. The log-likelihood comes with bounds, and with whether they are proven.
    A parameter that the data cannot tell is null. `predict MODEL --rates FILE` takes what is written, with its
    uncertainty. See docs/your_data.md.
    """

    if how["breaks"] not in (None, "auto"):
        break_model(how["breaks"])
    if how["crowding"] not in (None, "auto"):
        crowding_model(how["crowding"])
    mode, *sources = words
    study: CalibrationStudy | ClassStudy
    if mode in DATA and is_fit(mode, given_options()):
        refuse_for(mode)
        fit_data(mode, sources[0], out, report, as_json, how | {"cubes_given": "cubes" in given_options()})
        return
    if mode == "events":
        refuse_for(mode)
        study, seed = observed(sources[0], how), None
    else:
        parts = runs_of(sources, how)
        mode = mode or ("classes" if is_seeded(parts[0]) else "channels")
        refuse_for(mode)
        seed = parts[0].seed
        if (found := of_runs(mode, parts, how, as_json)) is None:
            return
        study = found
    study.rates.save(out)
    if report and isinstance(study, CalibrationStudy):
        calibration_report(study).write(report, data=True)
    if as_json:
        echo_json({"out": out} | study.to_dict() | ({} if isinstance(study, ClassStudy) else {"seed": seed}))
    else:
        click.echo(class_rates_table(study) if isinstance(study, ClassStudy) else rates_table(study))
        if isinstance(study, CalibrationStudy) and study.shown_breaks is not None:
            click.echo(breaks_table(study.shown_breaks))
        if isinstance(study, CalibrationStudy) and study.crowding_models is not None:
            click.echo(f"{study.crowding_models}")
        click.echo(f"rates written to {out}")
    leave(study.problems)


def refuse_for(mode: str) -> None:
    """ValueError where an option was given that means nothing in this mode."""
    known = (OF_DATA | {"observed", "initial"}) if mode in COUNTED else OF_EVENTS
    known |= OF_FIT if mode in DATA and is_fit(mode, given_options()) else {"breaks"}
    for name, option in given_options().items():
        modes = MODES_OF.get(name, (*MODES, *DATA))
        if mode not in modes:
            *most, last = map(_named, modes)
            told = f"{', '.join(most)} and {last}" if most else last
            raise ValueError(f"{option} is for {told}, not for {mode}; leave it out")
        if mode in DATA and name not in known:
            raise ValueError(f"{option} applies to mechanics runs, and --{mode} makes none; leave it out")


def _named(mode: str) -> str:
    return f"--{mode}" if mode in DATA else f"calibrate {mode}"


def observed(source: str, how: dict[str, Any]) -> CalibrationStudy:
    """What a table of events says of a rule book or a network file; --cubes counts only where it was given."""

    table = how["events"]
    network, single = (read(source).network, None) if is_network_file(source) else network_of_book(source)
    cubes = how["cubes"] if "cubes" in given_options() else ()
    if len(cubes) > 1:
        raise ValueError(f"--cubes {' '.join(map(str, cubes))}: for events one number, that of the cubes in each run")
    return observed_study(
        source, network, table, how["run_table"], cubes=cubes[0] if cubes else None, single=single,
        tank=how["tank"] and Tank(how["tank"]), breaks=how["breaks"],
    )  # fmt: skip


def runs_of(sources: list[str], how: dict[str, Any]) -> list[StudyRuns]:
    """The runs of each scene or plan. ValueError: an option that the plans state themselves."""

    asked = {"sizes": how["cubes"]} | {name: how[name] for name in ("runs", "duration", "seed", "engine")}
    parts = [StudyRuns.asked_for(source, "calibration", **asked) for source in dict.fromkeys(sources)]
    if all(part.plan is not None for part in parts):
        refuse_what_a_plan_fixes(sources[0], "cubes", "runs", "duration", "seed", "engine")
    return parts


def is_seeded(runs: StudyRuns) -> bool:
    """Whether their book grows from a seed, so that channels are not measured one by one."""

    return book_of(runs.scene.rules)[0].seed_letter is not None


def of_runs(
    mode: str, parts: list[StudyRuns], how: dict[str, Any], as_json: bool
) -> CalibrationStudy | ClassStudy | None:
    """What mechanics runs say; None where only a share of them was to be made, or those missing to be listed."""

    if mode == "channels" and parts[0].plan is None:
        check_measurable(parts[0].scene, parts[0].sizes)
    common = {name: how[name] for name in ("workers", "progress")}
    folder = how["runs_folder"]
    if how["part"] is not None:
        how["part"].make([spec for part in parts for spec in part.specs], folder, as_json=as_json, **common)
        return None
    if mode == "classes":
        return run_class_calibration(parts, folder, breaks=how["breaks"], share=how["group_by"], **common)
    return run_calibration(parts[0], folder, breaks=how["breaks"], crowding=how["crowding"], **common)
