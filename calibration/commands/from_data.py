"""`wellmixed calibrate MODEL --events|--counts|--snapshots FILE`: parameters from data that others recorded."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import reduce
from typing import Any, TypeVar

import click
import numpy as np

from calibration.estimating.model_fit import Compared, ModelFit, compare_models, fit_model
from calibration.estimating.posterior_sampling import sample_posterior
from calibration.estimating.priors import LogNormalPrior
from calibration.observed.fitted_study import FittedStudy
from calibration.observed.kinds import DATA_KINDS
from calibration.observed.kinds.base import DataKind
from calibration.reporting.fitted import fitted_report
from kinetics.commands.models import is_network_file, network_of_book
from kinetics.formats import read
from kinetics.markov.panels.observations import OBSERVATIONS, Censored, Observation
from kinetics.network import Model, Tank
from kinetics.support.cli.declared import count_option
from kinetics.support.cli.failures import INTERRUPTED
from kinetics.support.cli.options import echo_json, values_of
from kinetics.support.families import member_named

KINDS = {kind.name: kind for kind in DATA_KINDS}
COUNTED = tuple(name for name, kind in KINDS.items() if kind.is_counted)
FITTED = ("free", "fixed", "priors", "bounds", "own", "against", "posterior", "starts")  # options of a fit
NAMED = tuple(each for each in OBSERVATIONS if each is not Censored)  # which a table states, cell by cell
BEGIN = 1e-3  # 1/tu, a rate constant of a rule book where the search begins
Option = TypeVar("Option", bound=Callable[..., Any])


def _ranges(_ctx: click.Context, param: click.Parameter, given: tuple[str, ...]) -> dict[str, tuple[float, float]]:
    """`("k=0.01:10",)` as pairs of numbers by name."""
    found: dict[str, tuple[float, float]] = {}
    option = param.opts[0]
    for text in given:
        name, _, numbers = (part.strip() for part in text.rpartition("="))
        low, _, high = numbers.partition(":")
        try:
            pair = float(low), float(high)
        except ValueError:
            pair = (1.0, 0.0)
        if not name or name in found or not 0.0 <= pair[0] < pair[1]:
            raise ValueError(f"{option} {text}; expected a name and two rising numbers, as in {option} k=0.01:10")
        found[name] = pair
    return found


OPTIONS = (
    *(
        click.option(
            f"--{kind.name}",
            metavar="FILE",
            type=click.Path(exists=True, dir_okay=False),
            is_eager=True,
            help=kind.summary,
        )
        for kind in DATA_KINDS
    ),
    click.option(
        "--free",
        metavar="NAME",
        multiple=True,
        help="A parameter, channel or observed column to be estimated.  [default: all parameters, or all channels if "
        "there are none; for events, events over exposure of each channel]",
    ),
    click.option(
        "--fix", "fixed", metavar="NAME=VALUE", multiple=True, callback=values_of, help="A parameter that is known."
    ),
    click.option(
        "--bounds",
        metavar="NAME=LOW:HIGH",
        multiple=True,
        callback=_ranges,
        help="The range in which a parameter is searched.",
    ),
    click.option(
        "--prior",
        "priors",
        metavar="NAME=LOW:HIGH",
        multiple=True,
        callback=_ranges,
        help="What was known of a parameter before: 95 % between these numbers, normal on its logarithm.",
    ),
    click.option(
        "--per-group",
        "own",
        metavar="NAME",
        multiple=True,
        help="A parameter of which each group of runs has its own; the table names the groups in a column group.",
    ),
    click.option(
        "--against",
        metavar="MODEL|NAME=VALUE",
        multiple=True,
        help="Compare with another model of the same data, or with this one at a value of a parameter: by AIC, "
        "and by a likelihood-ratio test if one is a special case of the other; may be repeated.",
    ),
    count_option(
        "--posterior",
        help="Sample so many draws from the posterior, for `predict --rates`.  [default: a normal distribution on "
        "logarithms is taken]",
    ),
    count_option("--starts", default=3, help="How often the search for the maximum begins."),
    click.option(
        "--observe",
        "observed",
        metavar="COLUMN=MODEL:NUMBER",
        multiple=True,
        help="How the numbers of a column come from true counts: detected:0.7 (each copy is seen with this "
        "probability), rounded:5 (half the width), gaussian:2 (standard deviation).  [default: exact]",
    ),
    click.option(
        "--initial",
        metavar="FILE",
        type=click.Path(exists=True, dir_okay=False),
        help="For counts, a table of the states in which a run may start: a column for each species, and probability.",
    ),
    click.option(
        "--tank", metavar="X Y Z", type=float, nargs=3, help="Edge lengths of the tank in which events were observed."
    ),
    click.option(
        "--run-table",
        metavar="FILE",
        type=click.Path(exists=True, dir_okay=False),
        help="For events, a table of the runs: run, start, end and a column for each species with its initial count. "
        "Without it, the events need rows marked start and end.",
    ),
)


def data_options(command: Option) -> Option:
    """The options of data of others, in their order."""
    return reduce(lambda found, option: option(found), reversed(OPTIONS), command)


def is_fit(kind: str, given: Mapping[str, Any]) -> bool:
    """Whether parameters are fitted: always to counts, to events if an option of a fit was given."""
    return kind in COUNTED or any(name in given for name in FITTED)


def fit_data(kind: str, source: str, out: str, report: str | None, as_json: bool, how: dict[str, Any]) -> None:
    """Fit the parameters of a model to data; write and show them."""
    table, observations = how[kind], dict(_observed(each) for each in how["observed"])
    model, single = _model(source)
    cubes, tank = how["cubes"][0] if how["cubes_given"] else None, how["tank"] and Tank(how["tank"])
    reader = KINDS[kind].told(runs=how["run_table"], cubes=cubes, single=single, tank=tank, initial=how["initial"])
    likelihood = reader.read(model, table, observations, how["own"])
    free = likelihood.each(how["free"]) or None
    search = {
        "bounds": how["bounds"],
        "priors": {name: LogNormalPrior(*pair) for name, pair in how["priors"].items()},
        "starts": how["starts"],
        "seed": how["seed"],
    }
    found = fit_model(likelihood, free, fixed=how["fixed"], **search)
    compared = _compared(source, found, reader, table, observations, how, search)
    sampled = sample_posterior(found, how["posterior"], how["seed"]) if how["posterior"] else None
    study = FittedStudy(source, kind, table, found, sampled, compared)
    study.rates.save(out)
    if report:
        fitted_report(study, how["seed"]).write(report, data=True)
    if as_json:
        echo_json(study.to_dict() | {"out": out, "seed": how["seed"]})
    else:
        click.echo(f"{study}\nparameters written to {out}")
    if sampled is not None and len(sampled.draws) < how["posterior"]:
        raise SystemExit(INTERRUPTED)


def _compared(
    source: str,
    found: ModelFit,
    reader: DataKind,
    table: str,
    observations: Mapping[str, Observation],
    how: dict[str, Any],
    search: dict[str, Any],
) -> list[Compared]:
    """The fit beside those of other models of the same data."""
    others: dict[str, ModelFit] = {}
    if how["own"]:
        shared = reader.read(found.likelihood.model, table, observations, ())
        others["groups alike"] = fit_model(shared, list(how["free"]) or None, fixed=how["fixed"], **search)
    for text in how["against"]:
        name, equals, value = text.partition("=")
        if not equals:
            others[text] = fit_model(
                reader.read(_model(text)[0], table, observations, ()), starts=how["starts"], seed=how["seed"]
            )
            continue
        try:
            held = {name.strip(): float(value)}
        except ValueError:
            raise ValueError(
                f"--against {text}; expected a model, or a name and a number, as in --against k=1"
            ) from None
        free = [each for each in found.fit.names if each not in held]
        within = {key: {n: v for n, v in search[key].items() if n not in held} for key in ("bounds", "priors")}
        others[text] = fit_model(found.likelihood, free, fixed={**found.fixed, **held}, **{**search, **within})
    return compare_models({source: found, **others}) if others else []


def _model(source: str) -> tuple[Model, str | None]:
    """The model of a network file; or of a rule book, whose rates are yet to be found, with its single cube."""
    if is_network_file(source):
        return read(source), None
    network, single = network_of_book(source)
    return Model(network.with_rates(np.full(len(network.channels), BEGIN))), single


def _observed(text: str) -> tuple[str, Observation]:
    """Column and observation of COLUMN=MODEL:NUMBER."""
    name, _, said = text.rpartition("=")
    kind, _, number = said.partition(":")
    if not name:
        raise ValueError(f"--observe {text}: expected COLUMN=MODEL:NUMBER, such as --observe A=detected:0.7")
    model: Any = member_named(kind, NAMED, "observation model")
    if (number == "") is not (len(fields(model)) == 0):
        raise ValueError(f"--observe {text}: {kind} takes {'a number, as in detected:0.7' if not number else 'none'}")
    try:
        return name, model(*map(float, number.split()))
    except (TypeError, ValueError) as error:
        raise ValueError(f"--observe {text}: {error}") from None
