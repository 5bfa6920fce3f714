"""`wellmixed passage`: the first-passage time to a number of copies of a species."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, NamedTuple

import click
import numpy as np

from kinetics.commands.start import Start, instead_of_many_states, start
from kinetics.network.sums import Counted, in_words, summed
from kinetics.support.cli.options import (
    AskedStart,
    echo_json,
    json_option,
    plot_option,
    seed_option,
    starting_options,
    tank_option,
    within_option,
)
from kinetics.support.cli.progress import progress_line, stage
from kinetics.support.tables import figure, in_unit, of_unit, text_table

if TYPE_CHECKING:
    from kinetics.markov.derivatives import Derivatives
    from kinetics.markov.passage import Passage
    from kinetics.network import Network
    from kinetics.support.arrays import Ints

MOST = 1_000_000  # states
MOST_EVENTS = 10_000_000  # of a sampled run without a horizon
INSTEAD = (
    "Follow the chain --within some of them, which gives limits; start from fewer copies, or sample the time: --method "
    "ssa"
)
QUANTILES = (0.025, 0.25, 0.5, 0.75, 0.975)


@click.command()
@starting_options
@tank_option
@click.option(
    "--species", metavar="SPECIES", required=True, help="The species to wait for, or an observable of the network file."
)
@click.option(
    "--copies",
    metavar="N",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    help="Number of its copies to wait for.",
)
@click.option(
    "--method",
    type=click.Choice(["exact", "ssa"]),
    default="exact",
    show_default=True,
    help="Solve for the time, or sample it: for networks of any size.",
)
@click.option(
    "--runs",
    metavar="N",
    type=click.IntRange(min=2),
    default=1000,
    show_default=True,
    help="Number of independent runs that are sampled.",
)
@click.option(
    "--horizon",
    metavar="TIME",
    type=click.FloatRange(min=0, min_open=True),
    default=np.inf,
    help="Time at which a sampled run ends at the latest.  [default: when nothing can happen any more]",
)
@click.option(
    "--draws",
    metavar="N",
    type=click.IntRange(min=2),
    default=100,
    show_default=True,
    help="Number of draws of the rates from which the interval is made.",
)
@within_option
@click.option(
    "--sensitivity",
    "with_sensitivity",
    is_flag=True,
    help="Say what each rate constant does to mean, sd and quantiles, or to the probability where that is below 1.",
)
@plot_option
@seed_option
@json_option
def passage(
    asked: AskedStart,
    edges: tuple[float, float, float] | None,
    species: str,
    copies: int,
    method: str,
    runs: int,
    horizon: float,
    draws: int,
    within: str | int | None,
    with_sensitivity: bool,
    plot_files: tuple[str, ...],
    seed: int,
    as_json: bool,
) -> None:
    """Solve for the first-passage time to a number of copies of a species: mean, sd, quantiles, distribution function.

    NETWORK is a rule book, which needs --rates and --cubes, or a network file that contains both. The time is solved
    for. If the rates come with their events and exposure, the mean is the posterior median of the mean time, with a
    95 % interval; sd, quantiles and curve are those at the posterior mean of each rate constant. By --method ssa the
    time is sampled at these rate constants, and the intervals show the number of runs alone.
    A network with too many states is followed --within some of them, which gives limits.
    """
    from kinetics.predicting import predict_passage

    began = time.process_time()
    begin = start(**asked._asdict(), edges=edges)
    counted = begin.counted(species)
    if method == "ssa":
        if within is not None or with_sensitivity:
            raise ValueError("--method ssa takes neither --within nor --sensitivity; leave them out")
        _sampled(begin, species, copies, (runs, seed, horizon), plot_files, as_json)
        return
    if within is not None:
        if plot_files or with_sensitivity:
            raise ValueError("--within gives limits, which have neither --plot nor --sensitivity; leave one out")
        with instead_of_many_states(INSTEAD):
            _limits(begin, within, species, copies, as_json)
        return
    with instead_of_many_states(INSTEAD), progress_line() as progress:
        progress("solving for the passage")
        made = predict_passage(begin.network, begin.rates, begin.state, counted, copies, seed, draws, begin.tank)
        found = made.passage
        progress("quantiles")
        quantiles = found.quantile(QUANTILES)
        progress("sensitivities")
        slopes = _sensitivities(made.network, begin.state, counted, copies, found) if with_sensitivity else None
    for plot_file in plot_files:
        from kinetics.support import plots

        plots.save(plot_file, found.plot)
    if as_json:
        curve = np.linspace(0.0, float(found.quantile(0.99 * found.probability)), 101)
        echo_json(
            {
                "book": asked.source,
                "rates": asked.rates_name,
                "convention": begin.convention,
                **begin.conditions,
                "initial": dict(zip(begin.network.species, begin.state, strict=True)),
                "species": species,
                "copies": copies,
                "time_unit": begin.network.time_unit,
                "mean": made.mean,
                "sd": found.sd,
                "probability": found.probability,
                "certain": found.is_certain,
                "quantiles": dict(zip(QUANTILES, quantiles.tolist(), strict=True)),
                "curve": {"times": curve, "cdf": found.cdf(curve)},
                "interval": None if made.low is None else {"level": 0.95, "low": made.low, "high": made.high},
                "error": found.error,
                "sensitivity": None if slopes is None else slopes.of_mean.to_dict(),
                "sensitivity_sd": None if slopes is None or slopes.of_sd is None else slopes.of_sd.to_dict(),
                "sensitivity_quantiles": None
                if slopes is None
                else {q: each.to_dict() for q, each in slopes.of_quantiles.items()},
                "seed": seed,
                "notes": (*begin.notes, *made.notes),
                "cpu_seconds": time.process_time() - began,
            }
        )
        return
    unit = begin.network.time_unit
    if made.low is None or made.high is None:
        click.echo(str(found))
    else:
        mean, high = ("infinite" if t == np.inf else in_unit(f"{t:.4g}", unit) for t in (made.mean, made.high))
        limits = f"95 % interval of the mean, from the rates: {figure(made.low)} to {high}"
        click.echo(f"mean time until {found.target}: {mean}; {limits}")
        click.echo(f"at the posterior mean of each rate constant: {found}")
    click.echo(
        f"{of_unit('quantiles', unit)}: "
        + ", ".join(f"{q:g}: {_when(t, '.4g')}" for q, t in zip(QUANTILES, quantiles, strict=True))
    )
    for note in (*begin.in_words, *made.notes):
        click.echo(note)
    if slopes is not None:
        of = "mean time" if found.is_certain else "probability of ever reaching the target"
        click.echo(f"\nelasticity of the {of} to each rate constant\n{slopes.of_mean}")
        if slopes.others:
            click.echo(f"\nelasticities of sd and quantiles\n{slopes}")
        if slopes.refusal:
            click.echo(f"no elasticities of quantiles: {slopes.refusal}")


def _when(time: float, form: str) -> str:
    """A quantile, or that it may never come."""
    return "never" if time == np.inf else f"{time:{form}}"


class Sensitivities(NamedTuple):
    """What each rate constant does to the mean, or to the probability; to sd and quantiles, as far as there are any.

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
        widths = [max((each.elasticity_limits[1] - each.elasticity_limits[0]) / 2) for each in self.others.values()]
        rows.append(("+- at most", *(figure(wide, ".1e") for wide in widths)))
        kind = "proven" if all(each.is_bound for each in self.others.values()) else "estimated"
        seconds = sum(each.cpu_seconds for each in self.others.values())
        return f"{text_table(('parameter', *self.others), rows)}\nlimits {kind}; {seconds:.2g} s CPU"


def _sensitivities(network: Network, initial: Ints, species: Counted, copies: int, found: Passage) -> Sensitivities:
    from kinetics.markov import sensitivity_to

    asked, goal = sensitivity_to(network, initial, species, copies)
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


def _sampled(
    begin: Start,
    species: str,
    copies: int,
    asked: tuple[int, int, float],
    plot_files: tuple[str, ...],
    as_json: bool,
) -> None:
    """First times of runs that end with the passage, at the rates of the file or their posterior means."""
    from kinetics.network import Condition
    from kinetics.network.laws.expression import quoted
    from kinetics.runs import TruncatedRunsError
    from kinetics.sampling import simulate
    from kinetics.sampling.watch import MAX_EVENTS

    began = time.process_time()
    (runs, seed, horizon), model = asked, begin.model
    until = Condition(f"{quoted(species)} >= {copies}", {species: begin.counted(species)})
    with progress_line() as progress:
        progress(f"sampling {runs} runs")
        try:
            most = MAX_EVENTS if horizon < np.inf else MOST_EVENTS
            found = simulate(model.network, "auto", model.initial, horizon, runs, seed, max_events=most, until=until)
        except TruncatedRunsError as error:
            told = error.truncation
            raise ValueError(
                f"{until.text} has not held in run {told.run} by {in_unit(f'{told.time:.4g}', told.time_unit)}, where "
                f"it was truncated: {told.cause}; give a --horizon, at which runs end"
            ) from error
    for plot_file in plot_files:
        from kinetics.support import plots

        plots.save(plot_file, found.plot)
    quantiles = {q: found.quantile(q) for q in QUANTILES}
    if as_json:
        names = ("value", "low", "high")
        echo_json(
            {
                "species": species,
                "copies": copies,
                "method": found.method,
                "runs": runs,
                "censored": found.censored,
                "horizon": horizon,
                "time_unit": model.network.time_unit,
                "mean": dict(zip(names, (found.mean, *found.mean_interval()), strict=True)),
                "probability": None if found.truncated else dict(zip(names, found.reached_by(horizon), strict=True)),
                "quantiles": {q: dict(zip(names, each, strict=True)) for q, each in quantiles.items()},
                "truncated": None if found.truncated is None else found.truncated.to_dict(),
                "seed": seed,
                "notes": begin.notes,
                "cpu_seconds": time.process_time() - began,
            }
        )
        return
    click.echo(f"{found.summary().text}; runs by {found.method}")
    title = of_unit("quantiles with 95 % intervals", model.network.time_unit)
    click.echo(f"{title}: " + ", ".join(f"{q:g}: {a:.4g} [{b:.4g}, {c:.4g}]" for q, (a, b, c) in quantiles.items()))
    for note in begin.in_words:
        click.echo(note)


def _limits(begin: Start, within: str | int, species: str, copies: int, as_json: bool) -> None:
    """Limits of the time within a part of the states, at the rates of the file."""
    from kinetics.markov import Chain

    began = time.process_time()
    model = begin.model
    weights, name = summed(model.network, begin.counted(species))
    with progress_line() as progress:
        progress("listing states")
        chain = Chain.of(
            model.network, model.initial, stop=lambda states: states @ weights >= copies, within=within, max_states=MOST
        )
        progress(f"solving {len(chain)} states")
        found = chain.passage_limits(np.asarray(chain.counts) @ weights >= copies, in_words(name, copies))
        low, high = found.quantile_bounds(QUANTILES)
    if as_json:
        ever = found.probability_bounds
        echo_json(
            {
                "species": species,
                "copies": copies,
                "states": len(chain),
                "mean": {"low": found.mean_low},
                "probability": dict(zip(("low", "high"), ever, strict=True)),
                "quantiles": {q: {"low": a, "high": b} for q, a, b in zip(QUANTILES, low, high, strict=True)},
                "is_bound": found.is_bound,
                "notes": begin.notes,
                "cpu_seconds": time.process_time() - began,
            }
        )
        return
    click.echo(f"{found} ({'proven' if found.is_bound else 'estimated'}; {len(chain)} states)")
    limits = zip(QUANTILES, low, high, strict=True)
    title = of_unit("quantiles", model.network.time_unit)
    click.echo(f"{title}: " + ", ".join(f"{q:g}: {_when(a, '.6g')} to {_when(b, '.6g')}" for q, a, b in limits))
    for note in begin.in_words:
        click.echo(note)
