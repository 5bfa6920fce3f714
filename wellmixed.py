"""The command line: one command, `wellmixed`, each of whose subcommands is imported only when it is used."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import os
import warnings
from typing import Any, NoReturn

import click

MARK = '__project__ = "wellmixed"'  # in the __init__.py of each of our packages
REPAIR = "pip install --force-reinstall --no-deps wellmixed"


def stranger() -> str | None:
    """What is wrong where a package of ours is missing, or another project's stands in its place; None if all is well.

    Nothing of the packages is imported: PyPI has a `kinetics` of others, which overwrites ours where it is installed.
    """
    for name in ("kinetics", "mechsim", "calibration"):
        spec = importlib.util.find_spec(name)
        if spec is None or spec.loader is None:
            return f"the package {name} of wellmixed is missing; install it again: {REPAIR}"
        source = getattr(spec.loader, "get_source", lambda _: None)(name)
        if source is not None and MARK not in source:
            return (
                f"{spec.origin} is another project's package {name}, in the place of wellmixed's; remove it "
                f"(pip uninstall {name}, or move it away if it is a file of yours), then install ours again: {REPAIR}"
            )
    return None


# Before numpy is imported. Matrix products of most commands are too small for threads, which then wait busily for the
# next one, for a third of the processor time of a prediction.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

if (trouble := stranger()) is not None:
    with contextlib.suppress(OSError):  # not by `sys.stderr`, whose flush at exit would change the code
        os.write(2, f"Error: {trouble}\n".encode())
    raise SystemExit(2)

from kinetics import __version__  # noqa: E402 - ours, as we now know
from kinetics.support.cli.failures import INTERRUPTED, interrupted, judged  # noqa: E402
from kinetics.support.cli.lazy_commands import Menu, mount  # noqa: E402
from kinetics.support.cli.options_file import options_in  # noqa: E402
from kinetics.support.cli.process import run  # noqa: E402
from kinetics.support.cli.progress import sign_of_life  # noqa: E402
from kinetics.support.interrupts import was_interrupted  # noqa: E402

# words -> (module, attribute, the line that `--help` shows), in the order of `--help`
COMMANDS = {
    "demo": ("calibration.commands.demo", "demo", "Simulate, calibrate, predict and validate, with a report."),
    "new": ("calibration.commands.new", "new", "Create the folder of a study: rules, scene and plan for a shape."),
    "simulate": (
        "mechsim.commands.simulate",
        "simulate",
        "Simulate cubes in an agitated tank, as rigid bodies.",
    ),
    "calibrate": ("calibration.commands.calibrate", "calibrate", "Estimate reaction rates from runs of the mechanics."),
    "validate": (
        "calibration.commands.validate",
        "validate",
        "Compare predictions with mechanics runs held out of the fit.",
    ),
    "predict": ("kinetics.commands.predict", "predict", "Predict the counts of all species over time."),
    "ask": ("kinetics.commands.ask", "ask", "Answer questions about a Markov chain, with bounds."),
    "passage": ("kinetics.commands.passage", "passage", "Solve for the first-passage time to copies of a species."),
    "scan": ("kinetics.commands.scan", "scan", "Answer questions over a grid of parameters, rates and counts."),
    "rules check": ("kinetics.commands.check", "check", "Verify a rule book by exhausting everything it can assemble."),
    "rules derive": (
        "kinetics.commands.derive",
        "derive",
        "Derive the reaction network of a rule book, or convert a file.",
    ),
    "rules compile": (
        "kinetics.commands.compile",
        "compile_",
        "Synthesise a rule book that builds a structure.",
    ),
    "rules certify": ("kinetics.commands.certify", "certify", "Verify the certificate of a compiled rule book."),
    "rules draw": ("kinetics.commands.draw", "draw", "Draw structures, state diagrams, networks and growth."),
    "rules grow": ("kinetics.commands.grow", "grow", "Simulate assembly directly from the rules, without a network."),
    "rules rank": (
        "kinetics.commands.rank",
        "rank",
        "Rank rule books of one target by yield or first-assembly time.",
    ),
    "study plan": ("calibration.commands.plan", "plan", "Plan the runs of a study: tanks, runs and held-out runs."),
    "study first-times": (
        "mechsim.commands.first_times",
        "first_times",
        "Measure first-assembly times over a range of conditions.",
    ),
    "study rates": ("calibration.commands.rates", "rates", "Estimate reaction rates at each point of a study."),
    "runs render": (
        "mechsim.commands.render",
        "render",
        "Render a mechanics run as pictures, a film or a 3-D view.",
    ),
    "runs replay": (
        "mechsim.commands.replay",
        "replay",
        "Repeat a stored mechanics run and inspect its last steps.",
    ),
    "runs export": (
        "mechsim.commands.export",
        "export",
        "Export stored mechanics runs as Parquet and CSV tables.",
    ),
    "runs loads": ("mechsim.commands.loads", "loads", "Extrapolate rates of breaks from logged hits."),
    "runs crowding": ("calibration.commands.crowding", "crowding", "Test models of crowding on logged hits."),
    "trust verify": (
        "kinetics.commands.verify",
        "verify",
        "Verify samplers and solvers on a network, with their power.",
    ),
    "trust hardcases": (
        "kinetics.commands.hardcases",
        "hardcases",
        "Test every numerical method on problems that break methods.",
    ),
    "trust accuracy kinetics": (
        "kinetics.commands.accuracy",
        "kinetics",
        "Measure each prediction method's error against its CPU time.",
    ),
    "trust accuracy mechanics": (
        "mechsim.commands.accuracy",
        "mechanics",
        "Measure the mechanics' error against its CPU time.",
    ),
}
GROUPS = {
    "rules": "Check, derive, compile, draw, grow and rank rule books.",
    "study": "Plan studies; measure first times and rates over conditions.",
    "runs": "Render, replay and export stored mechanics runs.",
    "trust": "Verify the methods, and measure their accuracy.",
    "trust accuracy": "Measure accuracy against CPU time.",
}


class FrontDoor(Menu):
    """Turns every error into one message and an exit code, see `kinetics.support.cli.failures`."""

    def __call__(self, *args: Any, **named: Any) -> NoReturn:
        """Be the process of the command line, see `kinetics.support.cli.process`."""
        run(self, *args, **named)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the chosen command."""
        warnings.showwarning = _tell
        silenced = contextlib.redirect_stderr(io.StringIO()) if ctx.params.get("quiet") else contextlib.nullcontext()
        try:
            with ctx, silenced:
                return super().invoke(ctx)
        except (click.ClickException, click.exceptions.Exit):  # click's own ways to end
            raise
        except (click.Abort, KeyboardInterrupt):
            click.echo(interrupted(ctx), err=True)
            ctx.exit(INTERRUPTED)
        except Exception as error:
            if was_interrupted(error):
                click.echo(interrupted(ctx), err=True)
                ctx.exit(INTERRUPTED)
            if ctx.params.get("debug"):
                raise
            code, said = judged(error)
            click.echo(f"Error: {said}", err=True)
            ctx.exit(code)


def _tell(message: Warning | str, *_: Any, **__: Any) -> None:
    """A warning as one line for people, without the place in the source that gave it."""
    click.echo(f"Warning: {message}", err=True)


@click.group(cls=FrontDoor, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="wellmixed")
@click.option("--debug", is_flag=True, help="Show the whole traceback of an error.")
@click.option("--quiet", is_flag=True, help="Print results and errors only: no progress, no warnings.")
@click.option(
    "--config",
    "options_file",
    metavar="FILE",
    help="Read options from this TOML file, one table per command: [predict] runs = 500. The command line overrides "
    "it.",
)
@click.pass_context
def main(ctx: click.Context, debug: bool, quiet: bool, options_file: str | None) -> None:
    """Kinetics and Markov modelling of self-assembly, calibrated on rigid-body mechanics."""
    del debug
    ctx.with_resource(sign_of_life(str(ctx.invoked_subcommand), quiet))
    if options_file is not None:
        options_in(ctx, options_file)


mount(main, COMMANDS, GROUPS)

if __name__ == "__main__":
    main()
