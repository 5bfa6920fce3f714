"""Options shared by the commands."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

import click
import numpy as np

from kinetics.support import plots
from kinetics.support.arrays import Floats
from kinetics.support.cli.completion import shipped
from kinetics.support.cli.declared import POSITIVE, count_option, default_option, files_option
from kinetics.support.cli.progress import BUDGET
from kinetics.support.cli.study_folder import BOOK, is_filled, or_study_folder, rates_of, start_of
from kinetics.support.output import check_target, write_whole
from kinetics.support.packages import require

DURATION = 2000.0  # tu, the paper's

seed_option = count_option("--seed", least=0, default=0, help="Random seed; the same seed gives the same result.")
json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")


def _part(_ctx: click.Context, _param: click.Parameter, value: str | None) -> str | int | None:
    """A number of states if it is one, else a condition."""
    return int(value) if value is not None and value.strip().isdigit() else value


budget_option = default_option(
    "--budget",
    metavar="MINUTES",
    type=POSITIVE,
    default=BUDGET,
    help="CPU time allowed; work forecast to take more is refused before it starts.",
)

truncate_option = click.option(
    "--truncate",
    metavar="CONDITION|N",
    callback=_part,
    help="Truncate the chain to the states in which this condition holds, or to the N nearest to its start; bounds "
    "hold for any behaviour outside.",
)

PICTURES = (".png", ".pdf", ".svg")


Decorated = TypeVar("Decorated", bound=Callable[..., Any])
Named = TypeVar("Named", str | None, tuple[str, ...])  # the file of an option, or the files of one that is repeated


def in_a_folder(ctx: click.Context, param: click.Parameter, value: Named) -> Named:
    """Refuse, before any work is done, a file that could not be written."""
    for file in _files(value):
        if file in ("", "-"):  # elsewhere standard output, which is that of the report
            raise click.BadParameter(f"{file!r} names no file; give a path, or ./- for a file of that name", ctx, param)
        if not Path(file).absolute().parent.is_dir():
            raise click.BadParameter(f"the folder of {file} does not exist; make it first", ctx, param)
        check_target(file)
    return value


def picture_of(ctx: click.Context, param: click.Parameter, value: Named) -> Named:
    """Refuse, before any work is done, a picture that could not be drawn."""
    for file in _files(value):
        if Path(file).suffix.lower() not in PICTURES:
            raise click.BadParameter(f"{file} must end in {', '.join(PICTURES)}", ctx, param)
        require("matplotlib")
    return in_a_folder(ctx, param, value)


def table_of(*packages: str) -> Callable[[click.Context, click.Parameter, Named], Named]:
    """Refuse, before any work is done, a table that could not be written; these packages write it."""

    def checked(ctx: click.Context, param: click.Parameter, value: Named) -> Named:
        for package in packages if value else ():
            require(package)
        return in_a_folder(ctx, param, value)

    return checked


def _files(value: str | tuple[str, ...] | None) -> tuple[str, ...]:
    return value if isinstance(value, tuple) else () if value is None else (value,)


csv_option = files_option(
    "--csv", "csv_files", callback=table_of("pandas"), help="Write a table to this CSV file; may be repeated."
)
plot_option = files_option(
    "--plot", "plot_files", callback=picture_of, help="Write a figure to this PNG, PDF or SVG file; may be repeated."
)


def page_option(shows: str) -> Callable[[Decorated], Decorated]:
    """The option `--html`; `shows` : what the page has, for the help."""
    return files_option(
        "--html",
        "html_files",
        callback=table_of("plotly"),
        help=f"Write an interactive page to this HTML file, which needs no network: {shows}; may be repeated.",
    )


def write_tables(files: Sequence[str], frame: Callable[[], Any], **form: Any) -> None:
    """Write a table to these CSV files; it is made only if there are any."""
    for file in files:
        write_whole(file, frame().to_csv(index=False, **form))


def write_plots(files: Sequence[str], draw: Callable[[Any], Any]) -> None:
    """Write a figure, drawn on one pair of axes, to these files."""
    for file in files:
        plots.save(file, draw)


class OptionToldLate(click.Option):
    """An option whose help is made when it is shown: what the text names need not be imported to run."""

    def __init__(self, *names: Any, told_by: Callable[[], str], **settings: Any):
        super().__init__(*names, **settings)
        self.told_by = told_by

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        """Its line of the help."""
        self.help = self.told_by()
        return super().get_help_record(ctx)


HEADING = "Options"  # of those that state none
RULES, FILES = "For rule books and rates files", "For network files"


def heading(text: str) -> Callable[[Decorated], Decorated]:
    """State the heading in `--help` of the options below this line, up to the next heading."""

    def mark(command: Decorated) -> Decorated:
        for param in getattr(command, "__click_params__", ()):
            if not hasattr(param, "heading"):
                param.heading = text
        return command

    return mark


class HeadedCommand(click.Command):
    """A command whose help prints its options by heading."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a section a heading, that of options without one first."""
        sections: dict[str, list[tuple[str, str]]] = {}
        for param in self.get_params(ctx):
            if isinstance(param, click.Option) and (record := param.get_help_record(ctx)) is not None:
                sections.setdefault(getattr(param, "heading", HEADING), []).append(record)
        for title in sorted(sections, key=lambda title: title != HEADING):
            with formatter.section(title):
                formatter.write_dl(sections[title])


class NumbersCommand(HeadedCommand):
    """A command whose repeatable options take several numbers in one go: `--times 10 50 100`.

    Every option declared with `multiple=True` does; `--times 10 --times 50` means the same.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Name the option again before each further number, then parse as ever."""
        repeatable = {
            name
            for option in self.params
            if isinstance(option, click.Option) and option.multiple
            for name in option.opts
        }
        spelled: list[str] = []
        current, values = "", 0
        for position, word in enumerate(args):
            if word == "--":
                spelled += args[position:]
                break
            name = word.split("=", 1)[0]
            if name in repeatable:
                current, values = name, int("=" in word)
            elif not (current and _is_number(word)):
                current = ""
            else:
                if values:
                    spelled.append(current)
                values += 1
            spelled.append(word)
        return super().parse_args(ctx, spelled)


def counts_of(text: str) -> dict[str, int]:
    """`monomer=20,dimer=20` as counts. Names may hold commas: `A(x,y)=3`."""
    counts: dict[str, int] = {}
    for part in re.split(r",(?![^()]*\))", text):
        name, equals, number = part.strip().partition("=")
        if not equals or not number.strip().isdecimal():
            raise ValueError(f"--initial has {part.strip()!r}; expected species=count, as in monomer=20,dimer=20")
        if name.strip() in counts:
            raise ValueError(f"--initial names {name.strip()!r} twice")
        counts[name.strip()] = int(number)
    return counts


def values_of(_ctx: click.Context, param: click.Parameter, given: tuple[str, ...]) -> dict[str, float]:
    """`("k1=2e-3", "k2=5")` as numbers by name."""
    values: dict[str, float] = {}
    for text in given:
        name, _, number = (part.strip() for part in text.rpartition("="))
        if not name or not _is_number(number) or name in values:
            option = param.opts[0]
            raise ValueError(f"{option} {text}; expected a name and a number, once a name, as in {option} k1=2e-3")
        values[name] = float(number)
    return values


def time_grid(duration: float | None, times: tuple[float, ...]) -> Floats:
    """The times of a prediction, tu: those of `--times`, or 101 from 0 to `--duration`."""
    if times and duration is not None:
        raise ValueError("give either --duration or --times, not both")
    if times:
        return np.array(times)
    end = DURATION if duration is None else duration
    if not 0 < end < np.inf:
        raise ValueError(f"--duration {end:g}; expected a positive number of tu")
    return np.linspace(0.0, end, 101)


def echo_json(data: dict[str, Any]) -> None:
    """Print one JSON object; arrays become lists, and numbers that are not finite become null."""
    click.echo(json.dumps(plain(data), allow_nan=False))


def plain(data: Any) -> Any:
    """`data` in the types that JSON knows."""
    if isinstance(data, dict):
        return {str(key): plain(value) for key, value in data.items()}
    if isinstance(data, np.ndarray | np.generic):
        return plain(data.tolist())
    if isinstance(data, list | tuple):
        return [plain(value) for value in data]
    if isinstance(data, float) and not math.isfinite(data):
        return None
    return data


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


class ModelOptions(NamedTuple):
    """The model options of a command: rule book or network file, rates, counts at time 0, tank."""

    source: str
    rates_name: str | None = None
    cubes: int | None = None
    initial: str | None = None
    copies_per_unit: float | None = None
    chosen: Mapping[str, float] = MappingProxyType({})
    edges: tuple[float, float, float] | None = None


def model_options(command: Callable[..., None]) -> Any:
    """The argument and options that describe a model. The command gets them as one argument, `asked`."""

    @wraps(command)
    def with_model(**given: Any) -> None:
        asked = ModelOptions(*(given.pop(name) for name in ModelOptions._fields))
        if asked.cubes is not None and is_filled("initial"):
            asked = asked._replace(initial=None)
        command(asked=asked, **given)

    decorated: Any = with_model
    for decorate in (
        click.option("--initial", metavar="SPECIES=COUNT,...", help="Counts at time 0, as in monomer=20,dimer=20."),
        heading(HEADING),
        click.option(
            "--copies-per-unit",
            metavar="N",
            type=float,
            help="Copies in one unit of the file's amounts; needed if these are not whole numbers.",
        ),
        click.option(
            "--set",
            "chosen",
            metavar="NAME=VALUE",
            multiple=True,
            callback=values_of,
            help="Set a parameter to this value; may be repeated.",
        ),
        heading(FILES),
        click.option(
            "--tank",
            "edges",
            metavar="X Y Z",
            nargs=3,
            type=float,
            help="Edge lengths of the tank; rates of joins scale with 1/volume.  [default: as in the rates]",
        ),
        count_option("--cubes", help="Number of single cubes at time 0."),
        click.option(
            "--rates",
            "rates_name",
            metavar="NAME|FILE",
            shell_complete=shipped("rates"),
            help="Rate constants: a shipped table such as table3, or a .toml file.",
        ),
        heading(RULES),
        click.argument(
            "source",
            metavar="NETWORK|FOLDER",
            shell_complete=shipped("book"),
            **or_study_folder(BOOK, {"rates_name": rates_of, "initial": start_of}),
        ),
    ):
        decorated = decorate(decorated)
    return decorated
