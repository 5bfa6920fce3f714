"""Commands of the mechanics: `wellmixed simulate` and `export`."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import click
import numpy as np

from kinetics.options import echo_json, json_option, picture_of, plot_option, seed_option

PARTIAL = 4  # exit code: some runs were stopped by the guard or given up

runs_option = click.option(
    "--runs-folder",
    default="runs",
    show_default=True,
    type=click.Path(file_okay=False),
    help="Where runs are kept; a run that is there is not made again.",
)
workers_option = click.option(
    "--workers", type=click.IntRange(min=1), default=1, show_default=True, help="Runs at the same time."
)
progress_option = click.option("--progress/--quiet", default=None, help="Show progress.  [default: only on a terminal]")


@click.command()
@click.argument("scene")
@click.option("--cubes", type=click.IntRange(min=1), help="Start from so many single cubes.")
@click.option("--initial", metavar="SPECIES=COUNT,...", help="Start from these: monomer=20,dimer=20.")
@click.option("--duration", type=float, default=200.0, show_default=True, help="Of a run, tu.")
@click.option("--runs", type=click.IntRange(min=1), default=1, show_default=True)
@click.option("--restart", is_flag=True, help="Put the tank back to its start after every event.")
@click.option("--without", multiple=True, metavar="EFFECT", help="Leave an effect out of the scene; may be repeated.")
@click.option("--poses", type=float, help="Record the poses of all cubes this often, tu.  [default: not at all]")
@click.option(
    "--picture",
    metavar="FILE",
    callback=picture_of,
    help="Draw the tank at the end of the first run, which is made with poses for it.",
)
@plot_option
@runs_option
@workers_option
@progress_option
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
    picture: str | None,
    plot_file: str | None,
    runs_folder: str,
    workers: int,
    progress: bool | None,
    seed: int,
    as_json: bool,
) -> None:
    """Run the mechanics of SCENE: cubes in an agitated tank that stick together by rules.

    SCENE is a shipped scene (line4) or a TOML file. Every run is kept in the runs folder under the hash of its inputs;
    the same command again makes only what is missing. Exit code 4: some runs were stopped by the guard or given up.
    """
    from mechsim.ensemble import run_all
    from mechsim.preflight import check_starts
    from mechsim.record import RunSpec, book_of
    from mechsim.scene import Scene
    from mechsim.store import RunStore

    described = Scene.load(scene)
    unknown = [name for name in without if described.effect(name) is None]
    if unknown:
        listed = ", ".join(e.effect for e in described.effects)
        raise ValueError(f"--without {unknown[0]}: scene {described.name} lists {listed}")
    described = described.without(*without)
    start = _composition(book_of(described.rules)[1].structures, cubes, initial)
    # A picture needs poses of its run: those at the start and the end, where no others are asked for.
    often = [duration if picture and run == 0 and poses is None else poses for run in range(runs)]
    specs = [RunSpec(described, start, duration, seed, run, restart, often[run]) for run in range(runs)]
    check_starts(specs)
    outcome = run_all(specs, RunStore(runs_folder), workers=workers, progress=progress)
    if picture and outcome.records:
        from kinetics.plots import save
        from mechsim.render import draw_tank

        save(picture, lambda ax: draw_tank(outcome.records[0], ax))
    sound = [record for record in outcome.records if record.completed]
    if plot_file and sound:
        from kinetics.paths import Ensemble
        from kinetics.plots import save

        grid = np.linspace(0.0, duration, 401)
        counts = np.array([record.path.at(grid) for record in sound])
        save(plot_file, Ensemble(sound[0].path.network, grid, counts).plot)
    rows = [_row(record) for record in outcome.records]
    if as_json:
        echo_json(
            {
                "scene": described.name,
                "scene_hash": described.fingerprint,
                "initial": start,
                "duration": duration,
                "seed": seed,
                "species": sound[0].path.network.species if sound else [],
                "runs": rows,
                "quarantined": [{"run": q.spec.title, "reasons": q.reasons} for q in outcome.quarantined],
                "computed": outcome.computed,
                "reused": outcome.reused,
                "digest": outcome.digest,
                "cpu_seconds": sum(record.cost["cpu_seconds"] for record in outcome.records),
            }
        )
    else:
        _print(rows, outcome)
    if outcome.quarantined or len(sound) < len(rows):
        click.get_current_context().exit(PARTIAL)


@click.command()
@click.argument("folder", type=click.Path(exists=True, file_okay=False))
@click.option("--out", required=True, type=click.Path(file_okay=False), help="Folder for the tables.")
@click.option("--format", "formats", multiple=True, type=click.Choice(["parquet", "csv"]), default=("parquet", "csv"))
@seed_option
@json_option
def export(folder: str, out: str, formats: tuple[str, ...], seed: int, as_json: bool) -> None:
    """Write the runs kept in FOLDER as tables: one of runs, one of events.

    Nothing here is random; --seed is taken because every command takes it.
    """
    from mechsim.store import RunStore

    if not (Path(folder) / "format").is_file():
        raise ValueError(f"{folder} holds no runs; expected a folder that --runs-folder has named")
    written = RunStore(folder).export(out, formats)
    if as_json:
        echo_json({"folder": folder, "written": [str(path) for path in written], "seed": seed})
    else:
        for path in written:
            click.echo(str(path))


def _composition(structures: Any, cubes: int | None, initial: str | None) -> dict[str, int]:
    """What the tank holds at the start."""
    from kinetics.options import counts_of

    if (cubes is None) == (initial is None):
        raise ValueError("say what the tank holds at the start by either --cubes 60 or --initial monomer=20,dimer=20")
    if initial is not None:
        return counts_of(initial)
    (single,) = (name for name, structure in structures.items() if len(structure) == 1)
    return {single: int(cubes or 0)}


def _row(record: Any) -> dict[str, Any]:
    """One run for people and programs."""
    path = record.path
    network = path.network
    fired = Counter(network.channels[c] for c in path.channels if c >= 0)
    largest = network.species[-1]
    first = path.first_time(largest)
    return {
        "run": record.spec.run,
        "key": record.spec.key,
        "outcome": record.outcome,
        "end": path.end,
        "events": {name: fired.get(name, 0) for name in network.channels},
        "final": dict(zip(network.species, path.states[-1].tolist(), strict=True)),
        f"first_{largest}": first if np.isfinite(first) else None,
        "digest": record.digest,
        **record.cost,
    }


def _print(rows: list[dict[str, Any]], outcome: Any) -> None:
    from kinetics.network import text_table

    if rows:
        species = list(rows[0]["final"])
        titles = ("run", *species, "events", f"first {species[-1]} (tu)", "CPU (s)", "outcome")
        cells = [
            (
                str(row["run"]),
                *(str(row["final"][name]) for name in species),
                str(sum(row["events"].values())),
                "-" if row[f"first_{species[-1]}"] is None else f"{row[f'first_{species[-1]}']:.4g}",
                f"{row['cpu_seconds']:.1f}",
                row["outcome"],
            )
            for row in rows
        ]
        click.echo(text_table(titles, cells))
    for given_up in outcome.quarantined:
        click.echo(f"given up: {given_up.spec.title}: {given_up.reasons[-1]}")
    click.echo(f"{outcome.computed} runs made, {outcome.reused} found; digest {outcome.digest[:16]}")
