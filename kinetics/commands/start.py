"""The network, rates and initial counts that the options of a command describe."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kinetics.network import Network, Tank
from kinetics.network.checks import some_names
from kinetics.support.arrays import Ints
from kinetics.support.cli.options import counts_of

if TYPE_CHECKING:
    from kinetics.formats import NetworkModel
    from kinetics.predicting.observables import Observables
    from kinetics.rates import BookRates, Rates

CUBES = "cubes"  # the quantity that networks of rule books conserve
MOST_SHOWN = 30  # species that are shown without being asked for


@contextmanager
def instead_of_many_states(advice: str) -> Iterator[None]:
    """Where a network reaches too many states, say what this command can do about it."""
    try:
        yield
    except ValueError as error:
        came = getattr(error, "came", None)  # of a `TooManyStatesError`, whose room need not be imported for this
        if came is None:
            raise
        raise ValueError(f"{came}. {advice}") from None


@dataclass(frozen=True, eq=False)
class Start:
    """A network with the counts (S,) at time 0.

    rates : to be applied to it; None where the network has its own, as one from a file has
    tank : where it happens; None for the tank of the rates
    observables : name -> weight of each species in the sum
    notes : remarks on how a network file was read, or on rates that were not measured
    cube : species that is a free single cube; "" in a network file, which knows of none
    """

    network: Network
    state: Ints
    rates: Rates | BookRates | None = None
    observables: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    tank: Tank | None = None
    notes: tuple[str, ...] = ()
    cube: str = ""

    @property
    def conditions(self) -> dict[str, Any]:
        """How bonds break and in which tank, for JSON: break model, its shape, edges; None where that is not known."""
        if self.rates is None:
            return {"breaks": None, "tank": None}
        breaks, tank = self.rates.breaks, self.tank or self.rates.measured_in
        return {"breaks": {"model": breaks.model, "shape": breaks.shape}, "tank": None if tank is None else tank.size}

    @property
    def in_words(self) -> tuple[str, ...]:
        """The same in a line for people, where it applies, and the notes."""
        if self.rates is None:
            return self.notes
        breaks, tank = self.rates.breaks, self.tank or self.rates.measured_in
        if tank is None and CUBES not in self.network.conserved:
            return self.notes  # a network of no cubes
        shape = ", ".join(f"{name} = {value:.3g}" for name, value in breaks.shape.items())
        words = f"breaks: {breaks.model}{f' ({shape})' if shape else ''}; "
        return (words + ("a tank that the rates do not state" if tank is None else f"tank {tank}"), *self.notes)

    @property
    def convention(self) -> dict[str, Any]:
        """How a propensity is put together, as a rates file states it."""
        from kinetics.rates import Convention

        return (Convention.of(self.network) if self.rates is None else self.rates.convention).as_dict()

    @property
    def model(self) -> NetworkModel:
        """The network with rates, counts and observables, as a network file holds them."""
        from kinetics.formats import NetworkModel

        network = self.network if self.rates is None else self.rates.apply(self.network, self.tank)
        return NetworkModel(network, self.state, self.observables)

    def counted(self, name: str, option: str = "--species") -> Mapping[str, float]:
        """The weights of an observable of the file, or of a species, which comes first."""
        if name in self.network.species:
            return {name: 1.0}
        if name not in self.observables:
            near = difflib.get_close_matches(name, [*self.observables, *self.network.species], n=3, cutoff=0.4)
            known = f"; there are {some_names([*self.network.species, *self.observables])}"
            hint = f"; did you mean {' or '.join(near)}?" if near else known
            raise ValueError(f"{option} {name}: neither a species nor an observable{hint}")
        return self.observables[name]

    def shown(self, names: tuple[str, ...]) -> Observables | None:
        """The species and observables of `--show`; None for all species and no more.

        By default they are all observables that are whole sums of counts, and all species unless these are many.
        """
        from kinetics.predicting.observables import Observables

        few = self.network.species if len(self.network.species) <= MOST_SHOWN else ()
        whole = [name for name, weights in self.observables.items() if _are_whole(weights) and name not in few]
        if not names and few and not whole:
            return None
        sums: dict[str, Mapping[str, float]] = {}
        for name in names or (*few, *whole):
            sums[name] = self.counted(name, "--show")
        if not sums:
            n = len(self.network.species)
            raise ValueError(
                f"{n} species and no observable that is a whole sum; name those to be shown, as in --show A --show B"
            )
        return Observables.of(self.network, sums)


def start(
    source: str,
    rates_name: str | None,
    cubes: int | None,
    initial: str | None,
    edges: tuple[float, float, float] | None = None,
    copies_per_unit: float | None = None,
    chosen: Mapping[str, float] | None = None,
) -> Start:
    """The start that the arguments of `predict` and `passage` ask for.

    source : a rule book, whose network needs rates and counts; or a network file, which has both
    edges : of the tank in which it happens; None for the tank of the rates
    copies_per_unit : how many copies one unit of a network file's amounts is; None where it is one
    chosen : values of parameters of a network file, in the place of its own
    """
    if is_network_file(source):
        if edges is not None:
            raise ValueError(
                f"{source} brings rates that state no tank; leave out --tank, or take a rule book with --rates"
            )
        return _from_file(source, rates_name, cubes, initial, copies_per_unit, chosen or {})
    if copies_per_unit is not None:
        raise ValueError(
            f"--copies-per-unit {copies_per_unit:g} is the scale of a network file; {source} is a rule book"
        )
    if chosen:
        raise ValueError(
            f"--set {next(iter(chosen))} is of a parameter of a network file; {source} is a rule book, whose rates "
            f"come by --rates"
        )
    from kinetics.rates import Rates, about_priors, are_by_class

    if rates_name is None:
        raise ValueError("a rule book has no rates; name some, as in --rates table3")
    if (cubes is None) == (initial is None):
        raise ValueError("say what the tank holds at time 0 by either --cubes 60 or --initial monomer=20,dimer=20")
    if are_by_class(rates_name):
        return _by_class(source, rates_name, cubes, initial, edges)
    rates = Rates.load(rates_name)
    network, monomer = network_of_book(source)
    counts = {monomer: cubes} if cubes is not None else counts_of(initial or "")
    tank = None if edges is None else Tank(edges)
    if tank is not None and rates.tank is None:
        raise ValueError(f"--tank {tank}: the rates {rates_name} do not state the tank in which they were measured")
    notes = (about_priors(rates.not_measured),) if rates.not_measured else ()
    return Start(network, network.state(counts), rates, tank=tank, notes=notes, cube=monomer)


def _by_class(
    source: str, rates_name: str, cubes: int | None, initial: str | None, edges: tuple[float, float, float] | None
) -> Start:
    """A book's network, and its rates by class."""
    from kinetics.assembly import RuleBook, derive
    from kinetics.rates import BookRates, ClassRates

    rates = BookRates(ClassRates.load(rates_name), derive(RuleBook.load(source)))
    book, network = rates.derivation.book, rates.derivation.network
    monomer = network.species[rates.derivation.species_of(book.monomer())]
    if cubes is None:
        counts = counts_of(initial or "")
    else:
        counts = {monomer: cubes}
        seed = book.seed()
        if seed is not None:
            counts[network.species[rates.derivation.species_of(seed)]] = 1
    tank = None if edges is None else Tank(edges)
    if tank is not None and rates.measured_in is None:
        raise ValueError(f"--tank {tank}: the rates {rates_name} do not state the tank in which they were measured")
    return Start(network, network.state(counts), rates, tank=tank, cube=monomer)


def network_of_book(name: str) -> tuple[Network, str]:
    """The network that a book gives, and the name of its single cube."""
    from kinetics.assembly import RuleBook, derive

    book = RuleBook.load(name)
    derivation = derive(book)
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
    """Whether a sum counts every species a whole number of times."""
    return all(weight >= 0 and weight == int(weight) for weight in weights.values())


def _from_file(
    source: str,
    rates_name: str | None,
    cubes: int | None,
    initial: str | None,
    copies_per_unit: float | None,
    chosen: Mapping[str, float],
) -> Start:
    from kinetics.formats import read

    if cubes is not None:
        raise ValueError(f"--cubes {cubes}: {source} has no cubes, and counts of its own; --initial gives others")
    if rates_name is not None and chosen:
        raise ValueError("--rates takes the place of all rates of the file, and --set changes one; leave one out")
    model = read(source, copies_per_unit)
    model = model.with_parameters(**chosen) if chosen else model
    counts = dict(zip(model.network.species, model.initial.tolist(), strict=True))
    if initial is not None:
        counts |= counts_of(initial)
    hidden = [name for name, weights in model.observables.items() if not _are_whole(weights)]
    more = [f"no whole sums of counts, and not shown: {', '.join(hidden)}"] if hidden else []
    state = model.network.state(counts)
    rates = None if rates_name is None else _rates_of(rates_name, model.network)
    return Start(model.network, state, rates, observables=model.observables, notes=(*model.notes, *more))


def _rates_of(name: str, network: Network) -> Rates:
    """Rates by channel for the network of a file, in the place of its own."""
    from kinetics.rates import Rates, are_by_class

    if are_by_class(name):
        raise ValueError(f"{name} holds rates by class, which are those of rule books; a network file has channels")
    rates = Rates.load(name)
    _ = rates.apply(network)  # else it is found out after the network has been shown
    return rates
