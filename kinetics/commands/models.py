"""The model that the options of a command describe, and the rates that are to be applied to it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kinetics.network import Model, Network, Tank
from kinetics.support.cli.options import ModelOptions, counts_of

if TYPE_CHECKING:
    from kinetics.predicting.observables import Observables
    from kinetics.rates.applied import AppliedRates

CUBES = "cubes"  # the quantity that networks of rule books conserve
MOST_SHOWN = 30  # species that are shown without being asked for


@contextmanager
def instead_of_many_states(advice: str) -> Iterator[None]:
    """Replace the advice of an error about too many states by what this command can do."""
    try:
        yield
    except ValueError as error:
        came = getattr(error, "came", None)  # of a `TooManyStatesError`, whose room need not be imported for this
        if came is None:
            raise
        raise ValueError(f"{came}. {advice}") from None


def described(asked: ModelOptions) -> tuple[Model, AppliedRates | None]:
    """The model, the rates to be applied to it (None: it has its own), and the tank (None: that of the rates).

    A rule book is a network without rates and counts, which options must give; a network file has both.
    """
    if is_network_file(asked.source):
        return _from_file(asked)
    source, rates_name, cubes = asked.source, asked.rates_name, asked.cubes
    if asked.copies_per_unit is not None:
        raise ValueError(
            f"--copies-per-unit {asked.copies_per_unit:g} is the scale of a network file; {source} is a rule book"
        )
    if asked.chosen:
        raise ValueError(
            f"--set {next(iter(asked.chosen))} is of a parameter of a network file; {source} is a rule book, whose "
            f"rates come by --rates"
        )
    if rates_name is None:
        raise ValueError("a rule book has no rates; name some, as in --rates table3")
    if (cubes is None) == (asked.initial is None):
        raise ValueError("say what the tank holds at time 0 by either --cubes 60 or --initial monomer=20,dimer=20")
    from kinetics.assembly import RuleBook
    from kinetics.assembly.deriving.cached import derive_cached
    from kinetics.rates import (
        BookRates,
        ClassRates,
        FittedParameters,
        Rates,
        about_priors,
        are_by_class,
        are_fitted,
    )

    by_class = ClassRates.load(rates_name) if are_by_class(rates_name) else None
    derivation = derive_cached(RuleBook.load(source))
    book, network = derivation.book, derivation.network
    rates: AppliedRates
    if by_class is not None:
        rates = BookRates(by_class, derivation)
    else:
        rates = FittedParameters.load(rates_name) if are_fitted(rates_name) else Rates.load(rates_name)
    if cubes is None:
        counts = counts_of(asked.initial or "")
    else:
        counts = {network.species[derivation.species_of(book.monomer())]: cubes}
        seed = None if by_class is None else book.seed()
        if seed is not None:
            counts[network.species[derivation.species_of(seed)]] = 1
    tank = None if asked.edges is None else Tank(asked.edges)
    if tank is not None and rates.measured_in is None:
        raise ValueError(f"--tank {tank}: the rates {rates_name} do not state the tank in which they were measured")
    guessed = rates.not_measured if isinstance(rates, Rates) else ()
    notes = (about_priors(guessed),) if guessed else ()
    return Model(network, network.state(counts), notes=notes, tank=tank), rates


def applied(model: Model, rates: AppliedRates | None) -> Model:
    """The model with the rate constants that these rates give it in this tank."""
    return model if rates is None else replace(model, network=rates.apply(model.network, model.tank))


def conditions(model: Model, rates: AppliedRates | None) -> dict[str, Any]:
    """The convention of propensities, the break model and the tank, for JSON; None if that is not known."""
    from kinetics.rates import BookRates, Convention, Rates

    if not isinstance(rates, Rates | BookRates):
        return {"convention": Convention.of(model.network).as_dict(), "breaks": None, "tank": None}
    breaks, here = rates.breaks, model.tank or rates.measured_in
    return {
        "convention": rates.convention.as_dict(),
        "breaks": {"model": breaks.model, "shape": breaks.shape},
        "tank": None if here is None else here.size,
    }


def remarks(model: Model, rates: AppliedRates | None) -> tuple[str, ...]:
    """How bonds break and in which tank, in a line for people where it applies, and the notes of the model."""
    here = model.tank or (None if rates is None else rates.measured_in)
    if rates is None or (here is None and CUBES not in model.network.conserved):
        return model.notes
    shape = ", ".join(f"{name} = {value:.3g}" for name, value in rates.breaks.shape.items())
    words = f"breaks: {rates.breaks.model}{f' ({shape})' if shape else ''}; "
    return (words + ("a tank that the rates do not state" if here is None else f"tank {here}"), *model.notes)


def shown_of(model: Model, names: tuple[str, ...]) -> Observables | None:
    """The species and observables of `--show`; None for all species and no more.

    By default they are all observables that are whole sums of counts, and all species unless these are many.
    """
    from kinetics.predicting.observables import Observables

    network = model.network
    few = network.species if len(network.species) <= MOST_SHOWN else ()
    whole = [name for name, weights in model.observables.items() if _are_whole(weights) and name not in few]
    if not names and few and not whole:
        return None
    sums = {name: model.counted(name) for name in names or (*few, *whole)}
    if not sums:
        n = len(network.species)
        raise ValueError(
            f"{n} species and no observable that is a whole sum; name those to be shown, as in --show A --show B"
        )
    return Observables.of(network, sums)


def network_of_book(name: str) -> tuple[Network, str]:
    """The network that a book gives, and the name of its single cube."""
    from kinetics.assembly import RuleBook
    from kinetics.assembly.deriving.cached import derive_cached

    book = RuleBook.load(name)
    derivation = derive_cached(book)
    return derivation.network, derivation.network.species[derivation.species_of(book.monomer())]


def is_network_file(source: str) -> bool:
    """Does the name end as a network file's does? A book ends in .toml, or in nothing."""
    suffix = Path(source).suffix.lower()
    if suffix in ("", ".toml"):
        return False  # a book needs no readers of files
    from kinetics.formats import SUFFIXES

    if suffix not in SUFFIXES and not Path(source).is_dir():
        raise ValueError(
            f"{source} ends in {suffix}, which is not read; a network file ends in {', '.join(SUFFIXES)}, a rule book "
            f"in .toml"
        )
    return suffix in SUFFIXES


def _are_whole(weights: Mapping[str, float]) -> bool:
    """True if a sum counts every species a whole number of times."""
    return all(weight >= 0 and weight == int(weight) for weight in weights.values())


def _from_file(asked: ModelOptions) -> tuple[Model, AppliedRates | None]:
    """The model of a network file with the counts and parameters that are given, and rates in the place of its own."""
    from kinetics.formats import read

    source, rates_name = asked.source, asked.rates_name
    if asked.edges is not None:
        raise ValueError(f"{source} has rates that state no tank; leave out --tank, or take a rule book with --rates")
    if asked.cubes is not None:
        raise ValueError(
            f"--cubes {asked.cubes}: {source} has no cubes but its own initial counts; change them by --initial"
        )
    if rates_name is not None and asked.chosen:
        raise ValueError("--rates replaces all rates of the file, --set changes single parameters; leave one out")
    model = read(source, asked.copies_per_unit)
    model = model.with_parameters(**asked.chosen) if asked.chosen else model
    if asked.initial is not None:
        model = model.with_counts(counts_of(asked.initial))
    hidden = [name for name, weights in model.observables.items() if not _are_whole(weights)]
    more = [f"not shown, because they are not sums of counts with whole weights: {', '.join(hidden)}"] if hidden else []
    rates = None if rates_name is None else _rates_of(rates_name, model.network)
    return replace(model, notes=(*model.notes, *more)), rates


def _rates_of(name: str, network: Network) -> AppliedRates:
    """Rates by channel, or fitted parameters, for the network of a file, in the place of its own."""
    from kinetics.rates import FittedParameters, Rates, are_by_class, are_fitted

    if are_by_class(name):
        raise ValueError(
            f"{name} holds rates by class, which apply to rule books only; a network file needs rates by channel"
        )
    rates = FittedParameters.load(name) if are_fitted(name) else Rates.load(name)
    _ = rates.apply(network)  # else it is found out after the network has been shown
    return rates
