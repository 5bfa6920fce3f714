"""The command `wellmixed runs replay`: a stored run carried out again, with a close look at its end."""

from __future__ import annotations

from pathlib import Path

import click

from kinetics.support.cli.declared import count_option, files_option
from kinetics.support.cli.failures import DIFFERENT
from kinetics.support.cli.options import echo_json, json_option, picture_of
from kinetics.support.plots import save


@click.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False))
@count_option("--last", default=40, help="Number of last steps to look at.")
@click.option("--poses", metavar="FILE", help="Write the poses and motions of all cubes in these steps (.npz).")
@files_option("--picture", "pictures", callback=picture_of, help="Draw the tank at the end; may be repeated.")
@json_option
def replay(file: str, last: int, poses: str | None, pictures: tuple[str, ...], as_json: bool) -> None:
    """Replay the run in FILE (KEY.run of a runs folder) and look at its last steps.

    A stored run, also one that the guard stopped, holds all inputs that decide what happens, so it can be made again.
    The table follows the cube whose body moves and turns most. Exit code 4: the replay differs from the stored run.
    """
    from mechsim.inspection.replay import replay as make_again

    if poses is not None and Path(poses).suffix != ".npz":
        raise ValueError(f"--poses {poses}; expected a file name that ends in .npz")
    again = make_again(file, last)
    if poses is not None:
        again.save(poses)
    for picture in pictures:
        from mechsim.inspection.pictures.tank import draw_tank

        save(picture, lambda ax: draw_tank(again.record, ax))
    if as_json:
        echo_json(again.as_dict())
    else:
        click.echo(str(again))
    if not again.is_same:
        click.get_current_context().exit(DIFFERENT)
