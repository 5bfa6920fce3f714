"""`wellmixed trust verify`: samplers against the exact solution of a network, and solvers against each other."""

from __future__ import annotations

import click
import numpy as np

from kinetics.commands.models import applied, described
from kinetics.sampling import SAMPLING_METHODS, SamplingMethod
from kinetics.sampling.forecast import forecast_runs
from kinetics.support.cli.declared import count_option, default_option
from kinetics.support.cli.options import (
    DURATION,
    ModelOptions,
    NumbersCommand,
    budget_option,
    echo_json,
    json_option,
    model_options,
    seed_option,
)
from kinetics.support.cli.progress import progress_line
from kinetics.trust.verification import Reference, verify_against

METHODS: dict[str, type[SamplingMethod]] = {method.name: method for method in SAMPLING_METHODS}
ALL = "all"
ENSEMBLES, WITH_POWER = 2, 14  # of runs, at most: of this seed and the next; of mutants of the rates


@click.command(cls=NumbersCommand)
@model_options
@click.option(
    "--times", type=float, multiple=True, metavar="T ...", help="Compare at these times, tu.  [default: 200 2000]"
)
@default_option(
    "--method",
    type=click.Choice([ALL, *METHODS]),
    default=ALL,
    help="Sampling method to verify, or all that support the network.",
)
@count_option(
    "--runs", least=100, default=20_000, help="Number of runs of each method; more runs detect smaller errors."
)
@click.option(
    "--power/--no-power", default=True, help="Measure, on runs with planted mistakes, which of them the checks detect."
)
@budget_option
@seed_option
@json_option
def verify(
    asked: ModelOptions,
    times: tuple[float, ...],
    method: str,
    runs: int,
    power: bool,
    budget: float,
    seed: int,
    as_json: bool,
) -> None:
    """Verify samplers against the exact solution of a network, and all solvers against each other.

    NETWORK is a rule book, which needs --rates and --cubes, or a network file that contains both. Runs are compared
    with the exact distribution at each time and from one time to the next, and with each other, within a seed and
    between this seed and the next. All checks of a method together give a false alarm once in a million. The report
    says which mistakes so many runs would detect. Solvers must agree within their stated errors. Exit code 1 if
    anything fails.
    """
    from kinetics.trust.solver_agreement import compare_solvers

    model = applied(*described(asked))
    grid = list(times) or [DURATION / 10, DURATION]
    chosen = [kind() for name, kind in METHODS.items() if method in (ALL, name)]
    refused = {one.name: one.unsupported_reason(model.network) for one in chosen}
    if all(refused.values()):
        raise ValueError(f"no such method supports the network: {'; '.join(refused.values())}")
    with progress_line(budget=budget) as progress:
        for one in chosen:
            if not refused[one.name]:
                made = runs * (WITH_POWER if power else ENSEMBLES)
                forecast_runs(model.network, one, model.initial, np.array(grid), made)
        progress("solving")
        reference = Reference.of(model, None, grid)
        progress("comparing solvers")
        solvers = compare_solvers(model, None, grid)
    failed = len(solvers.failures)
    if not as_json:
        click.echo(f"solvers\n{solvers}")
    verified = []
    for one in chosen:
        if refused[one.name]:
            continue
        with progress_line() as progress:
            progress(f"verifying {one.name}")
            found = verify_against(reference, one, runs, seed, with_power=power)
        failed += not found.passed
        verified.append(found.to_json())
        if not as_json:
            click.echo(f"\n{found}")
    if as_json:
        echo_json(
            {
                "book": asked.source,
                "rates": asked.rates_name,
                "initial": dict(zip(model.network.species, model.initial.tolist(), strict=True)),
                "times": grid,
                "seed": seed,
                "solvers": solvers.to_json(),
                "samplers": verified,
                "refused": {name: reason for name, reason in refused.items() if reason},
                "failed": failed,
            }
        )
    else:
        for name, reason in refused.items():
            if reason:
                click.echo(f"\n{name} was not verified: {reason}")
    if failed:
        raise SystemExit(1)
