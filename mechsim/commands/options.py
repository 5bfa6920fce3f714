"""Options shared by the commands that make runs: the runs folder, the executor, shards."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING, Any

import click

from kinetics.support.cli.declared import POSITIVE, default_option
from kinetics.support.cli.failures import INCOMPLETE, INSTEAD, keep_runs
from kinetics.support.cli.options import echo_json
from mechsim.runs.ensemble import run_all
from mechsim.runs.executors import EXECUTORS, Executor
from mechsim.runs.preflight import check_starts
from mechsim.runs.shards import Shard, missing
from mechsim.runs.store import RunStore
from mechsim.world.engines import ENGINES

if TYPE_CHECKING:
    from mechsim.runs.record import RunSpec
    from mechsim.runs.shards import Shard

PATIENCE = 600.0  # s; even compiling all kernels on a busy machine takes a tenth

progress_option = click.option(
    "--progress/--quiet", default=None, help="Show progress.  [default: on a terminal, and now and then elsewhere]"
)
_timeout_option = default_option(
    "--timeout",
    metavar="SECONDS",
    type=POSITIVE,
    default=PATIENCE,
    help="Wall time without progress after which a run is ended, s; a run is tried three times in all.",
)
runs_option = default_option(
    "--runs-folder",
    metavar="FOLDER",
    type=click.Path(file_okay=False),
    default="runs",
    help="Folder in which runs are kept; a run that is already there is not made again.",
)


def _engine(ctx: click.Context, _: click.Parameter, name: str | None) -> str | None:
    """The engine's name; an error about the package of another one may now speak of this option."""
    ctx.meta[f"{INSTEAD}.pybullet"] = "or add --engine own"
    return name


engine_option = click.option(
    "--engine",
    type=click.Choice([engine.name for engine in ENGINES]),
    callback=_engine,
    help="Engine that finds the contacts; `own` needs no PyBullet, which has wheels for Python 3.11 alone.  [default: "
    "the scene's]",
)
_shard_option = click.option(
    "--shard",
    metavar="K/N",
    help="For job arrays: make only the K-th of N shares of the runs; when all shares are done, the same command "
    "without it finds every run.",
)
_missing_option = click.option(
    "--missing",
    is_flag=True,
    help="Make no runs; list those that are not in the folder. Exit code 4: some are missing.",
)


def executor_options(command: Callable[..., None]) -> Callable[..., None]:
    """One option for each executor, of which one may be given; the command gets it as `workers`, ready to be used."""

    @wraps(command)
    def chosen(*args: Any, timeout: float, **values: Any) -> None:
        given = {kind: values.pop(_name(kind)) for kind in EXECUTORS}
        asked = [kind for kind, value in given.items() if value is not None]
        if len(asked) > 1:
            raise ValueError(f"{asked[0].option} and {asked[1].option} both say what makes the runs; give one of them")
        kind = asked[0] if asked else EXECUTORS[0]
        executor = kind.from_option(given[kind], timeout)
        executor.check()
        if "runs_folder" in values:
            keep_runs(values["runs_folder"])
        command(*args, workers=executor, **values)

    described = _timeout_option(chosen)
    for kind in reversed(EXECUTORS):
        option = click.option(kind.option, _name(kind), type=kind.kind, metavar=kind.metavar, help=kind.help)
        described = option(described)
    return described


def run_options(command: Callable[..., None]) -> Callable[..., None]:
    """All options of a command that makes runs: it gets `runs_folder`, `workers`, `part` and `progress`."""

    @wraps(command)
    def chosen(*args: Any, shard: str | None, missing: bool, **values: Any) -> None:

        part = ShardWork(Shard.parse(shard) if shard else Shard(1, 1), missing) if shard or missing else None
        command(*args, part=part, **values)

    described: Callable[..., None] = chosen
    for option in (progress_option, _missing_option, _shard_option, executor_options, runs_option):
        described = option(described)
    return described


@dataclass(frozen=True)
class ShardWork:
    """The work of a command with --shard or --missing: make one shard of its runs, or list those missing of it."""

    shard: Shard
    only_list: bool

    def make(
        self, specs: Sequence[RunSpec], folder: str, workers: Executor, progress: bool | None, as_json: bool
    ) -> None:
        """Do so, report the result, and leave with exit code 4 if a run is missing, stopped or given up."""
        mine = self.shard.of(specs)
        is_whole = (
            self._list(mine, folder, as_json) if self.only_list else self._run(mine, folder, workers, progress, as_json)
        )
        if not is_whole:
            click.get_current_context().exit(INCOMPLETE)

    def _list(self, mine: list[RunSpec], folder: str, as_json: bool) -> bool:

        lacking = missing(mine, folder)
        if as_json:
            rows = [{"run": spec.title, "key": spec.key} for spec in lacking]
            echo_json({"shard": str(self.shard), "runs": len(mine), "missing": rows})
        else:
            for spec in lacking:
                click.echo(f"missing: {spec.title}")
            click.echo(f"{len(mine) - len(lacking)} of {len(mine)} runs are in {folder}")
        return not lacking

    def _run(self, mine: list[RunSpec], folder: str, workers: Executor, progress: bool | None, as_json: bool) -> bool:

        check_starts(mine)
        outcome = run_all(mine, RunStore(folder), workers=workers, progress=progress)
        stopped = [record for record in outcome.records if not record.completed]
        if as_json:
            echo_json(
                {
                    "shard": str(self.shard),
                    "runs": len(mine),
                    "computed": outcome.computed,
                    "reused": outcome.reused,
                    "stopped": [{"run": record.spec.title, "outcome": record.outcome} for record in stopped],
                    "quarantined": [{"run": q.spec.title, "reasons": q.reasons} for q in outcome.quarantined],
                    "digest": outcome.digest,
                }
            )
        else:
            for record in stopped:
                click.echo(f"{record.outcome}: {record.spec.title}")
            for given_up in outcome.quarantined:
                click.echo(f"given up: {given_up.spec.title}: {given_up.reasons[-1]}")
            counts = f"{outcome.computed} runs made, {outcome.reused} found"
            click.echo(f"shard {self.shard}: {counts}; digest {outcome.digest[:16]}")
        return not stopped and not outcome.quarantined


def _name(kind: type[Executor]) -> str:
    """`--scheduler` -> scheduler"""
    return kind.option.removeprefix("--").replace("-", "_")
