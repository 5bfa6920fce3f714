"""The front door: one command whose parts live in the rooms and are loaded only when they are asked for."""

from __future__ import annotations

import sys
import warnings

import click

from kinetics import __version__
from kinetics.support.cli.lazy_commands import mount

# name -> (module, attribute, the line that `--help` shows)
COMMANDS = {
    "simulate": ("mechsim.commands.simulate", "simulate", "Run the mechanics: cubes in an agitated tank."),
    "study": (
        "mechsim.commands.study",
        "study",
        "First times against speed, number and size, cost first.",
    ),
    "calibrate": ("calibration.commands.calibrate", "calibrate", "Estimate the reaction rates from mechanics runs."),
    "predict": ("kinetics.commands.predict", "predict", "Predict the assembly as a Markov chain."),
    "passage": ("kinetics.commands.passage", "passage", "Time until the first copy of a species appears."),
    "rates": ("calibration.commands.rates", "rates", "Estimate the rates at each point of a study."),
    "validate": ("calibration.commands.validate", "validate", "Compare predictions with held-out mechanics runs."),
    "demo": ("calibration.commands.demo", "demo", "Calibrate, predict, validate on a small budget, with a report."),
    "derive": ("kinetics.commands.derive", "derive", "Show the reaction network that a rule book gives."),
    "hardcases": ("kinetics.commands.hardcases", "hardcases", "Ask every method the cases that break methods."),
    "render": ("mechsim.commands.render", "render", "Show a run: pictures, a film, or a view to turn."),
    "replay": ("mechsim.commands.replay", "replay", "Make a stored run again and look at its last steps."),
    "export": ("mechsim.commands.export", "export", "Write stored runs as Parquet and CSV tables."),
    "rules": ("kinetics.commands", "rules", "Check rule books."),
}

# `wellmixed accuracy ...`, a command a room
ACCURACY = {
    "kinetics": ("kinetics.commands.accuracy", "kinetics", "Error of every prediction method against CPU time."),
    "mechanics": ("mechsim.commands.accuracy", "mechanics", "Error of mean speed and encounter rate against CPU time."),
}

# package that a command may lack -> the extra that brings it
EXTRAS = {
    "pybullet": "mech",
    "pandas": "data",
    "pyarrow": "data",
    "matplotlib": "plot",
    "distributed": "dist",
    "imageio_ffmpeg": "movie",
    "plotly": "movie",
    "libsbml": "sbml",
}


class FrontDoor(click.Group):
    """Turns a user's mistake into one message and exit code 2, and Ctrl-C into exit code 130."""

    def invoke(self, ctx: click.Context):
        """Run the chosen command."""
        warnings.showwarning = _tell
        try:
            with ctx:
                return super().invoke(ctx)
        except BrokenPipeError:  # the reader of our output has seen enough
            raise
        except ModuleNotFoundError as error:
            if ctx.params.get("debug") or error.name not in EXTRAS:
                raise
            extra = EXTRAS[error.name]
            click.echo(f"Error: this needs {error.name}; install it by: pip install 'wellmixed[{extra}]'", err=True)
            ctx.exit(2)
        except (ValueError, OSError) as error:
            if ctx.params.get("debug"):
                raise
            click.echo(f"Error: {error}", err=True)
            ctx.exit(2)
        except KeyboardInterrupt:
            click.echo("Interrupted: what was finished is kept; the same command goes on from there.", err=True)
            ctx.exit(130)


def _tell(message, *_, **__) -> None:
    """A warning as one line for people, without the place in the source that gave it."""
    click.echo(f"Warning: {message}", err=True)


@click.group(cls=FrontDoor, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="wellmixed")
@click.option("--debug", is_flag=True, help="Show the whole traceback of an error.")
def main(debug: bool) -> None:
    """Kinetics and Markov modelling of self-assembly, calibrated on rigid-body mechanics."""
    del debug


@main.group()
def accuracy() -> None:
    """Show what accuracy costs in time."""


mount(accuracy, ACCURACY)
mount(main, COMMANDS)

if __name__ == "__main__":
    sys.exit(main())
