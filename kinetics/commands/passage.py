"""`wellmixed passage`: the first-passage time to a number of copies of a species."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import click
import numpy as np

from kinetics.commands.models import applied, conditions, described, instead_of_many_states, remarks
from kinetics.markov.network_questions import chain_to
from kinetics.network.laws.writing import quoted
from kinetics.network.sums import Counted, in_words, summed
from kinetics.predicting import predict_passage
from kinetics.runs import TruncatedRunsError
from kinetics.sampling import simulate
from kinetics.sampling.watch import MAX_EVENTS
from kinetics.support.answer import CONFIDENCE, Answer, kind_of
from kinetics.support.cli.declared import count_option, default_option
from kinetics.support.cli.options import (
    HEADING,
    RULES,
    HeadedCommand,
    ModelOptions,
    budget_option,
    echo_json,
    heading,
    json_option,
    model_options,
    plot_option,
    seed_option,
    truncate_option,
    write_plots,
)
from kinetics.support.cli.progress import progress_line, stage
from kinetics.support.tables import figure, in_unit, of_unit, text_table

if TYPE_CHECKING:
    from kinetics.markov.derivatives import Derivatives
    from kinetics.markov.passage import Passage
    from kinetics.network import Model
    from kinetics.rates.applied import AppliedRates

MOST = 1_000_000  # states
MOST_EVENTS = 10_000_000  # of a sampled run without a horizon
INSTEAD = (
    "Truncate the chain by --truncate, which gives bounds; start from smaller counts, or sample the time: --method ssa"
)
QUANTILES = (0.025, 0.25, 0.5, 0.75, 0.975)


@click.command(cls=HeadedCommand)
@model_options
@click.option(
    "--species", metavar="SPECIES", required=True, help="The species to wait for, or an observable of the network file."
)
@count_option("--copies", default=1, help="Number of its copies to wait for.")
@default_option(
    "--method",
    type=click.Choice(["solve", "ssa"]),
    default="solve",
    help="Solve for the time, or sample it: for networks of any size.",
)
@count_option("--runs", least=2, default=1000, help="Number of independent runs to sample.")
@click.option(
    "--horizon",
    metavar="TIME",
    type=click.FloatRange(min=0, min_open=True),
    default=np.inf,
    help="Latest time at which a sampled run ends.  [default: when nothing can happen any more]",
)
@heading(RULES)
@count_option(
    "--posterior-draws",
    "draws",
    least=2,
    default=100,
    help="Number of draws of the rates from which the interval is made.",
)
@heading(HEADING)
@truncate_option
@click.option(
    "--sensitivity",
    "with_sensitivity",
    is_flag=True,
    help="Report elasticities by each rate constant: of mean, sd and quantiles, or of the probability if it is "
    "below 1.",
)
@plot_option
@budget_option
@seed_option
@json_option
def passage(
    asked: ModelOptions,
    species: str,
    copies: int,
    method: str,
    runs: int,
    horizon: float,
    draws: int,
    truncate: str | int | None,
    with_sensitivity: bool,
    plot_files: tuple[str, ...],
    budget: float,
    seed: int,
    as_json: bool,
) -> None:
    """Solve for the first-passage time to a number of copies of a species: mean, sd, quantiles, distribution function.

    NETWORK is a rule book, which needs --rates and --cubes, or a network file that contains both. The time is solved,
    not sampled. If the rates come with their events and exposure, the mean is the posterior median of the mean time,
    with a 95 % interval; sd, quantiles and curve are those at the posterior mean of each rate constant. With --method
    ssa the time is sampled at these rate constants, and the intervals reflect the number of runs only. For a network
    with too many states, --truncate gives bounds.
    """
    began = time.process_time()
    model, rates = given = described(asked)
    counted = model.counted(species)
    if truncate is not None and (plot_files or with_sensitivity):
        raise ValueError("--truncate gives bounds, for which there is neither --plot nor --sensitivity; leave one out")
    if method == "ssa":
        if truncate is not None or with_sensitivity:
            raise ValueError("--method ssa takes neither --truncate nor --sensitivity; leave them out")
        _sample(asked, given, species, copies, (runs, seed, horizon), plot_files, as_json)
        return
    slopes = None
    with instead_of_many_states(INSTEAD), progress_line(budget=budget) as progress:
        progress("solving for the first-passage time")
        if truncate is None:
            made = predict_passage(model, rates, None, counted, copies, seed, draws)
            found, mean, notes, network = made.passage, made.mean, made.notes, made.network
        else:
            network = applied(*given).network
            chain, goal = chain_to(replace(model, network=network), None, counted, copies, MOST, truncate)
            found = chain.passage(goal, in_words(summed(network, counted)[1], copies))
            mean, notes = found.answer("mean"), ()
        progress("quantiles")
        quantiles = {q: found.answer(q) for q in QUANTILES}
        if with_sensitivity:
            progress("sensitivities")
            slopes = _sensitivities(replace(model, network=network), counted, copies, found)
    write_plots(plot_files, found.plot)
    if as_json:
        curve = np.linspace(0.0, float(found.quantile(0.99 * found.probability)), 101)
        is_whole = found.earliest is None
        echo_json(
            {
                "book": asked.source,
                "rates": asked.rates_name,
                **conditions(*given),
                "initial": dict(zip(model.network.species, model.initial, strict=True)),
                "species": species,
                "copies": copies,
                "time_unit": model.network.time_unit,
                "mean": mean.to_dict(),
                "sd": found.answer("sd").to_dict(),
                "probability": found.answer("probability").to_dict(),
                "certain": found.is_certain,
                "quantiles": {q: each.to_dict() for q, each in quantiles.items()},
                "curve": {"times": curve, "cdf": found.cdf(curve)} if is_whole else None,
                "sensitivity": None if slopes is None else slopes.of_mean.to_dict(),
                "sensitivity_sd": None if slopes is None or slopes.of_sd is None else slopes.of_sd.to_dict(),
                "sensitivity_quantiles": None
                if slopes is None
                else {q: each.to_dict() for q, each in slopes.of_quantiles.items()},
                "seed": seed,
                "notes": (*model.notes, *notes),
                "cpu_seconds": time.process_time() - began,
            }
        )
        return
    unit = model.network.time_unit
    if mean.kind == CONFIDENCE:
        median, high = ("infinite" if t == np.inf else in_unit(f"{t:.4g}", unit) for t in (mean.value, mean.high))
        interval = f"95 % interval of the mean, from the rates: {figure(mean.low)} to {high}"
        click.echo(f"mean time until {found.target}: {median}; {interval}")
        click.echo(f"at the posterior mean of each rate constant: {found}")
    else:
        click.echo(str(found) if found.earliest is None else f"{found} ({mean.kind}; {mean.why})")
    click.echo(f"{of_unit('quantiles', unit)}: " + ", ".join(f"{q:g}: {_when(found, t)}" for q, t in quantiles.items()))
    for note in (*remarks(*given), *notes):
        click.echo(note)
    if slopes is not None:
        of = "mean time" if found.is_certain else "probability of ever reaching the target"
        click.echo(f"\nelasticity of the {of} to each rate constant\n{slopes.of_mean}")
        if slopes.others:
            click.echo(f"\nelasticities of sd and quantiles\n{slopes}")
        if slopes.refusal:
            click.echo(f"no elasticities of quantiles: {slopes.refusal}")


def _when(found: Passage, time: Answer) -> str:
    """A quantile, or that it may never come; of a truncated chain, its bounds."""
    ends, form = ([time.value], ".4g") if found.earliest is None else ([time.low, time.high], ".6g")
    return " to ".join("never" if end == np.inf else f"{end:{form}}" for end in ends)


class Sensitivities(NamedTuple):
    """Derivatives by each rate constant: of the mean or the probability, and of sd and quantiles if there are any.

    refusal : why there are no quantiles
    """

    of_mean: Derivatives
    of_sd: Derivatives | None
    of_quantiles: dict[float, Derivatives]
    refusal: str

    @property
    def others(self) -> dict[str, Derivatives]:
        """All but the first, by name."""
        named = {} if self.of_sd is None else {"sd": self.of_sd}
        return named | {f"q = {q:g}": each for q, each in self.of_quantiles.items()}

    def __str__(self) -> str:
        rows = [
            (name, *(figure(each.elasticity[p], ".6g") for each in self.others.values()))
            for p, name in enumerate(self.of_mean.parameters)
        ]
        widths = [max((each.elasticity_bounds[1] - each.elasticity_bounds[0]) / 2) for each in self.others.values()]
        rows.append(("+- at most", *(figure(wide, ".1e") for wide in widths)))
        kind = kind_of(all(each.is_bound for each in self.others.values()))
        seconds = sum(each.cpu_seconds for each in self.others.values())
        return f"{text_table(('parameter', *self.others), rows)}\nbounds {kind}; {seconds:.2g} s CPU"


def _sensitivities(model: Model, species: Counted, copies: int, found: Passage) -> Sensitivities:
    from kinetics.markov import sensitivity_to

    asked, goal = sensitivity_to(model, None, species, copies)
    mean, sd = (asked.passage(goal), asked.passage_sd(goal)) if found.is_certain else (asked.until(goal), None)
    quantiles = {}
    try:
        for q in QUANTILES:
            if found.is_certain or q < found.probability:
                stage(f"sensitivity of quantile {q:g}")
                quantiles[q] = asked.passage_quantile(goal, q)
    except ValueError as refusal:  # too stiff
        return Sensitivities(mean, sd, {}, str(refusal))
    return Sensitivities(mean, sd, quantiles, "")


def _sample(
    asked: ModelOptions,
    given: tuple[Model, AppliedRates | None],
    species: str,
    copies: int,
    numbers: tuple[int, int, float],
    plot_files: tuple[str, ...],
    as_json: bool,
) -> None:
    """First times of runs that end with the passage, at the posterior mean of each rate constant."""
    began = time.process_time()
    (runs, seed, horizon), unit = numbers, given[0].network.time_unit
    model = replace(applied(*given), observables={species: given[0].counted(species)})
    most = MAX_EVENTS if horizon < np.inf else MOST_EVENTS
    until = f"{quoted(species)} >= {copies}"
    with progress_line() as progress:
        progress(f"sampling {runs} runs")
        try:
            found = simulate(model, "auto", None, horizon, runs, seed, max_events=most, until=until)
        except TruncatedRunsError as error:
            told = error.truncation
            raise ValueError(
                f"{until} has not held in run {told.run} by {in_unit(f'{told.time:.4g}', unit)}, where it was "
                f"truncated: {told.cause}; give a --horizon, at which runs end"
            ) from error
    write_plots(plot_files, found.plot)
    quantiles = {q: found.answer(q) for q in QUANTILES}
    if as_json:
        echo_json(
            {
                "book": asked.source,
                "rates": asked.rates_name,
                **conditions(*given),
                "initial": dict(zip(model.network.species, model.initial, strict=True)),
                "species": species,
                "copies": copies,
                "time_unit": unit,
                "mean": found.answer("mean").to_dict(),
                "probability": None if found.truncated else found.answer("probability").to_dict(),
                "quantiles": {q: each.to_dict() for q, each in quantiles.items()},
                "horizon": horizon,
                "runs": runs,
                "censored": found.censored,
                "truncated": None if found.truncated is None else found.truncated.to_dict(),
                "seed": seed,
                "notes": model.notes,
                "cpu_seconds": time.process_time() - began,
            }
        )
        return
    click.echo(f"{found.summary().text}; runs by {found.method}")
    spans = (f"{q:g}: {figure(each.value)} {each.bounds_text}" for q, each in quantiles.items())
    click.echo(f"{of_unit('quantiles', unit)}: " + ", ".join(spans))
    for note in remarks(*given):
        click.echo(note)
