"""The command `wellmixed simulate`: mechanics runs, each stored when it is finished."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from kinetics.support.cli.completion import shipped
from kinetics.support.cli.declared import count_option, default_option, files_option
from kinetics.support.cli.failures import INCOMPLETE
from kinetics.support.cli.options import counts_of, echo_json, json_option, picture_of, plot_option, seed_option
from kinetics.support.cli.study_folder import RUNS, SCENE, is_filled, or_study_folder, start_of
from kinetics.support.plots import save
from mechsim.commands.options import engine_option, run_options
from mechsim.inspection.summary import plot_counts, row, table
from mechsim.runs.ensemble import run_all
from mechsim.runs.preflight import check_starts
from mechsim.runs.record import RunSpec, book_of
from mechsim.runs.species import single_cubes, species_of
from mechsim.runs.store import RunStore
from mechsim.scene import Scene

if TYPE_CHECKING:
    from kinetics.assembly import Derivation
    from mechsim.commands.options import ShardWork
    from mechsim.runs.executors import Executor


@click.command()
@click.argument(
    "scene",
    metavar="SCENE|FOLDER",
    shell_complete=shipped("scene"),
    **or_study_folder(SCENE, {"runs_folder": RUNS, "initial": start_of}),
)
@count_option("--cubes", help="Start from this many single cubes, including the seed if there is one.")
@click.option(
    "--initial",
    metavar="SPECIES=COUNT,...",
    help="Start from these structures: monomer=20,dimer=20, or monomer=100,seed=1.",
)
@default_option("--duration", metavar="T", type=float, default=200.0, help="Simulated time of a run, tu.")
@count_option("--runs", default=1, help="Number of runs.")
@click.option("--restart", is_flag=True, help="Reset the tank to its initial state after every event.")
@click.option("--without", multiple=True, metavar="EFFECT", help="Leave an effect out of the scene; may be repeated.")
@click.option(
    "--poses",
    metavar="T",
    type=float,
    help="Interval at which the poses of all cubes are recorded, tu.  [default: never]",
)
@files_option(
    "--picture",
    "pictures",
    callback=picture_of,
    help="Draw the tank at the end of the first run, whose poses are then recorded; may be repeated.",
)
@files_option(
    "--growth",
    "growth_files",
    callback=picture_of,
    help="Draw how the largest structure of the first run grew, each stage with the time at which it formed; may be "
    "repeated.",
)
@click.option(
    "--preset",
    metavar="NAME",
    help="Numerical settings: draft, standard or reference (or FILE.toml:NAME), whose error and cost were measured for "
    "the scene.  [default: the scene's own step]",
)
@click.option("--cost-profile", "as_profile", is_flag=True, help="Make no runs; report what each part of a step costs.")
@plot_option
@engine_option
@run_options
@seed_option
@json_option
def simulate(
    scene: str,
    cubes: int | None,
    initial: str | None,
    duration: float,
    runs: int,
    restart: bool,
    without: tuple[str, ...],
    poses: float | None,
    pictures: tuple[str, ...],
    growth_files: tuple[str, ...],
    preset: str | None,
    as_profile: bool,
    plot_files: tuple[str, ...],
    engine: str | None,
    runs_folder: str,
    workers: Executor,
    part: ShardWork | None,
    progress: bool | None,
    seed: int,
    as_json: bool,
) -> None:
    """Simulate SCENE by rigid-body mechanics: cubes in an agitated tank that bond by rules.

    SCENE is a shipped scene (line4, t5, pyramid45) or a TOML file; FOLDER is one of `wellmixed new`. Every
    run is kept in the runs folder under the hash of its inputs, and the same command again makes only those that are
    missing. Exit code 4: some runs were stopped by the guard or given up.
    """
    described = Scene.load(scene).by(engine)
    unknown = [name for name in without if described.effect(name) is None]
    if unknown:
        listed = ", ".join(e.effect for e in described.effects)
        raise ValueError(f"--without {unknown[0]}: scene {described.name} lists {listed}")
    known = None
    if preset is not None:
        from mechsim.accuracy.preset import load

        known = load(preset, described, without)
        described = known.scene(described)
    described = described.without(*without)
    derivation = book_of(described.rules)[1]
    start = _composition(derivation, cubes, None if cubes is not None and is_filled("initial") else initial)
    # A picture needs poses of its run: those at the start and the end, where no others are asked for.
    often = [duration if pictures and run == 0 and poses is None else poses for run in range(runs)]
    specs = [RunSpec(described, start, duration, seed, run, restart, often[run]) for run in range(runs)]
    if known is not None:
        expected = known.expected(specs[0].n_cubes, duration * runs)
        click.echo(str(expected), err=True)
    if part is not None:
        if as_profile:
            raise ValueError("--cost-profile makes no runs: leave out --shard and --missing")
        part.make(specs, runs_folder, workers, progress, as_json)
        return
    check_starts(specs)
    if as_profile:
        from mechsim.inspection.cost_profile import profile_run

        profile = profile_run(specs[0])
        if as_json:
            echo_json(profile.as_dict())
        else:
            click.echo(str(profile))
        return
    outcome = run_all(specs, RunStore(runs_folder), workers=workers, progress=progress)
    for picture in pictures if outcome.records else ():
        from mechsim.inspection.pictures.tank import draw_tank

        save(picture, lambda ax: draw_tank(outcome.records[0], ax))
    for growth_file in growth_files if outcome.records else ():
        from mechsim.inspection.pictures.tank import growth

        growth(outcome.records[0]).save(growth_file)
    sound = [record for record in outcome.records if record.completed]
    for plot_file in plot_files if sound else ():
        save(plot_file, lambda ax: plot_counts(ax, sound))
    if as_json:
        network = derivation.network
        echo_json(
            {
                "scene": described.name,
                "scene_hash": described.fingerprint,
                "initial": start,
                "duration": duration,
                "seed": seed,
                "preset": None if known is None else expected.as_dict(),
                "species": network.species,
                "channels": network.channels,
                "target": species_of(derivation, derivation.book.target),
                "runs": [row(record) for record in outcome.records],
                "quarantined": [{"run": q.spec.title, "reasons": q.reasons} for q in outcome.quarantined],
                "computed": outcome.computed,
                "reused": outcome.reused,
                "digest": outcome.digest,
                "cpu_seconds": sum(record.cost["cpu_seconds"] for record in outcome.records),
            }
        )
    else:
        if outcome.records:
            click.echo(table(outcome.records))
        for given_up in outcome.quarantined:
            click.echo(f"given up: {given_up.spec.title}: {given_up.reasons[-1]}")
        click.echo(f"{outcome.computed} runs made, {outcome.reused} found; digest {outcome.digest[:16]}")
    if outcome.quarantined or len(sound) < len(outcome.records):
        click.get_current_context().exit(INCOMPLETE)


def _composition(derivation: Derivation, cubes: int | None, initial: str | None) -> dict[str, int]:
    """Composition of the tank at the start."""
    if (cubes is None) == (initial is None):
        raise ValueError("say what the tank holds at the start by either --cubes 60 or --initial monomer=20,dimer=20")
    return single_cubes(derivation, int(cubes or 0)) if initial is None else counts_of(initial)
