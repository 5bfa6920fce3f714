"""The command `wellmixed runs render`: pictures, films and interactive views of a run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from kinetics.support.cli.declared import count_option, default_option
from kinetics.support.cli.options import PICTURES, echo_json, in_a_folder, json_option
from kinetics.support.cli.progress import progress_line
from kinetics.support.packages import require
from mechsim.commands.options import progress_option, runs_option
from mechsim.inspection.poses import Poses, record_at

if TYPE_CHECKING:
    from mechsim.inspection.pictures.tank import Paint

FILMS = (".mp4", ".gif")
WANTS = {".mp4": "imageio_ffmpeg", ".html": "plotly"}  # others matplotlib alone
MOST = {".html": 60, ".mp4": 300, ".gif": 120}  # frames, where --frames does not say; pictures: 5


def out_of(ctx: click.Context, param: click.Parameter, value: str) -> str:
    """A file of a kind that we make, in a folder that is there."""
    kinds = (*PICTURES, *FILMS, ".html")
    if Path(value).suffix.lower() not in kinds:
        raise click.BadParameter(f"{value} must end in {', '.join(kinds)}", ctx, param)
    require(WANTS.get(Path(value).suffix.lower(), "matplotlib"))
    return str(in_a_folder(ctx, param, value))


@click.command()
@click.argument("run")
@click.option(
    "--out",
    required=True,
    metavar="FILE",
    callback=out_of,
    help="The file to write: a strip of pictures (.png .pdf .svg), a film (.mp4 .gif), or an interactive view (.html).",
)
@count_option("--frames", help="Largest number of frames.  [default: 5 in a strip, up to 300 in a film]")
@click.option("--faces", is_flag=True, help="Colour faces by type instead of structures by size.")
@default_option(
    "--fps", metavar="RATE", type=click.FloatRange(min=0.1, max=60), default=15.0, help="Frames per second of a film."
)
@runs_option
@progress_option
@json_option
def render(
    run: str,
    out: str,
    frames: int | None,
    faces: bool,
    fps: float,
    runs_folder: str,
    progress: bool | None,
    as_json: bool,
) -> None:
    """Show a stored RUN from its recorded poses: a strip of pictures, a film, or a 3-D view in one HTML file.

    RUN is a .run file, or the beginning of a key in the runs folder. The run must have been made with --poses.
    """
    poses = Poses.of(record_at(run, runs_folder))
    kind = Path(out).suffix.lower()
    shown = poses.spread(frames or MOST.get(kind, 5)).tolist()
    paint: Paint = "type" if faces else "size"
    if kind in FILMS:
        from mechsim.inspection.pictures import movie

        save = movie.save_mp4 if kind == ".mp4" else movie.save_gif
        with progress_line(progress) as line:
            n = len(shown)
            save(movie.images(poses, shown, paint, lambda done: line(f"{done} of {n} frames", done / n)), out, fps)
    elif kind == ".html":
        from mechsim.inspection.pictures.interactive import save_html

        save_html(poses, out, shown, paint)
    else:
        from mechsim.inspection.pictures.movie import save_strip

        save_strip(poses, out, shown, paint)
    if as_json:
        echo_json({"out": out, "frames": len(shown), "times": poses.times[shown]})
    else:
        click.echo(f"{out}: {len(shown)} of {len(poses.times)} recorded frames")
