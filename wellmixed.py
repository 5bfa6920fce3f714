"""The command line: one command, `wellmixed`, each of whose subcommands is imported only when it is used."""

from __future__ import annotations

import sys
import warnings

import click

from kinetics import __version__
from kinetics.support.cli.lazy_commands import mount

# name -> (module, attribute, the line that `--help` shows)
COMMANDS = {
    "new": ("calibration.commands.new", "new", "Make the folder of a study: from a shape to rules, scene and plan."),
    "simulate": (
        "mechsim.commands.simulate",
        "simulate",
        "Simulate cubes in an agitated tank by rigid-body mechanics.",
    ),
    "study": (
        "mechsim.commands.study",
        "study",
        "Measure first-assembly times over a range of conditions.",
    ),
    "plan": ("calibration.commands.plan", "plan", "Plan the runs of a study: tanks, runs and held-out runs."),
    "calibrate": ("calibration.commands.calibrate", "calibrate", "Estimate reaction rates from runs of the mechanics."),
    "predict": (
        "kinetics.commands.predict",
        "predict",
        "Predict the counts of all species over time.",
    ),
    "passage": (
        "kinetics.commands.passage",
        "passage",
        "Solve for the first-passage time to copies of a species.",
    ),
    "ask": (
        "kinetics.commands.ask",
        "ask",
        "Answer exact questions about a Markov chain, with limits.",
    ),
    "rates": ("calibration.commands.rates", "rates", "Estimate reaction rates at each point of a study."),
    "validate": (
        "calibration.commands.validate",
        "validate",
        "Compare predictions with mechanics runs held out of the fit.",
    ),
    "demo": (
        "calibration.commands.demo",
        "demo",
        "Simulate, calibrate, predict and validate, with a report.",
    ),
    "derive": (
        "kinetics.commands.derive",
        "derive",
        "Derive the reaction network of a rule book, or convert a file.",
    ),
    "hardcases": (
        "kinetics.commands.hardcases",
        "hardcases",
        "Test every numerical method on problems that break methods.",
    ),
    "verify": (
        "kinetics.commands.verify",
        "verify",
        "Verify samplers and solvers on a network, with their power.",
    ),
    "render": (
        "mechsim.commands.render",
        "render",
        "Render a mechanics run as pictures, a film or a 3-D view.",
    ),
    "replay": ("mechsim.commands.replay", "replay", "Repeat a stored mechanics run and inspect its last steps."),
    "loads": ("mechsim.commands.loads", "loads", "Extrapolate rates of breaks from logged hits."),
    "export": ("mechsim.commands.export", "export", "Export stored mechanics runs as Parquet and CSV tables."),
    "rules": ("kinetics.commands", "rules", "Check, compile, draw, grow and rank rule books."),
}

# `wellmixed accuracy ...`, a command a room
ACCURACY = {
    "kinetics": (
        "kinetics.commands.accuracy",
        "kinetics",
        "Measure each prediction method's error against its CPU time.",
    ),
    "mechanics": (
        "mechsim.commands.accuracy",
        "mechanics",
        "Measure the mechanics' error against its CPU time.",
    ),
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
    """Measure accuracy against CPU time."""


mount(accuracy, ACCURACY)
mount(main, COMMANDS)

if __name__ == "__main__":
    sys.exit(main())
