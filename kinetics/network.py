"""Reaction networks under stochastic mass action.

The propensity of a channel in state s is k * N * h(s): its rate constant k, its number of ways N and the number
h(s) of combinations of its reactants. It is the probability per time unit that the channel fires (Gillespie 1977).
"""

from __future__ import annotations

import hashlib
import html
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import factorial

import numpy as np
from numpy.typing import ArrayLike

from kinetics.arrays import Floats, Ints, integers, reals

# What h(s) counts for m like reactants among s copies:
#   distinct  sets of m copies, s!/(m!(s-m)!), for a pair s(s-1)/2
#   ordered   sequences of m copies, s!/(s-m)!, for a pair s(s-1)
#   product   s**m, zero below m copies: the paper's multiplicity M in eqs 9-10, taken to the letter
COMBINATIONS = ("distinct", "ordered", "product")


@dataclass(frozen=True, eq=False)
class Network:
    """Reactions among species.

    species : S names
    channels : R names, one a reaction
    reactants : (R, S) int, copies that a firing needs
    stoichiometry : (R, S) int, net change by a firing; never takes more than the reactants
    ways : (R,) number N of ways in which one combination of reactants can react
    rate_constants : (R,) k per way and combination, 1/tu; None before the rates are known
    combinations : how h counts like reactants, one of `COMBINATIONS`
    conserved : name of a quantity -> its amount in one copy of each species, (S,); every channel keeps it
    """

    species: tuple[str, ...]
    channels: tuple[str, ...]
    reactants: Ints
    stoichiometry: Ints
    ways: Floats
    rate_constants: Floats | None = None
    combinations: str = "distinct"
    conserved: Mapping[str, Floats] = field(default_factory=dict)

    def __post_init__(self) -> None:
        species = _names("species", self.species)
        channels = _names("channels", self.channels)
        if not species:
            raise ValueError("a network needs at least one species")
        shape = (len(channels), len(species))
        checked = {
            "species": species,
            "channels": channels,
            "reactants": integers("reactants", _table(self.reactants, shape), shape, minimum=0),
            "stoichiometry": integers("stoichiometry", _table(self.stoichiometry, shape), shape),
            "ways": reals("ways", self.ways, shape[:1], minimum=0),
        }
        if self.rate_constants is not None:
            checked["rate_constants"] = reals("rate_constants", self.rate_constants, shape[:1], minimum=0)
        for name, value in checked.items():
            object.__setattr__(self, name, value)
        if self.combinations not in COMBINATIONS:
            raise ValueError(f"combinations = {self.combinations!r}; expected one of {', '.join(COMBINATIONS)}")
        self._check_no_overdraft()
        object.__setattr__(self, "conserved", self._checked_laws())

    def _check_no_overdraft(self) -> None:
        """A channel that took more copies than it needs could make a count negative."""
        for r, s in np.argwhere(self.reactants + self.stoichiometry < 0):
            raise ValueError(
                f"channel {self.channels[r]!r} takes {-self.stoichiometry[r, s]} of {self.species[s]!r} but needs "
                f"only {self.reactants[r, s]}; raise its reactants"
            )

    def _checked_laws(self) -> dict[str, Floats]:
        laws = {}
        for name, weights in self.conserved.items():
            laws[name] = reals(f"conserved {name!r}", weights, (len(self.species),))
            change = self.stoichiometry @ laws[name]
            scale = np.abs(self.stoichiometry) @ np.abs(laws[name])
            broken = np.flatnonzero(np.abs(change) > 1e-12 * scale)
            if broken.size:
                raise ValueError(
                    f"channel {self.channels[broken[0]]!r} changes the conserved quantity {name!r} by "
                    f"{change[broken[0]]:g}; correct the channel or the weights"
                )
        return laws

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 over species, channels, reactants and stoichiometry: which network, whatever its rates."""
        content = [self.species, self.channels, self.reactants.tolist(), self.stoichiometry.tolist()]
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()

    def index(self, species: str) -> int:
        """Position of a species by its name."""
        if species not in self.species:
            raise ValueError(f"unknown species {species!r}; the network has {', '.join(self.species)}")
        return self.species.index(species)

    def state(self, counts: Mapping[str, int] | ArrayLike) -> Ints:
        """Counts (S,) from `{"monomer": 60}` (the others 0) or from S counts in the order of the species."""
        if isinstance(counts, Mapping):
            places = {self.index(name): value for name, value in counts.items()}
            counts = [places.get(i, 0) for i in range(len(self.species))]
        return integers("state", counts, (len(self.species),), minimum=0)

    def combinations_of(self, states: ArrayLike) -> Floats:
        """h (..., R): combinations of each channel's reactants in states (..., S)."""
        counts = np.asarray(states)
        if counts.ndim == 0 or counts.shape[-1] != len(self.species):
            raise ValueError(f"states have shape {counts.shape}; expected (..., {len(self.species)})")
        h = np.ones((*counts.shape[:-1], len(self.channels)))
        for r, s in np.argwhere(self.reactants):
            h[..., r] *= _choices(counts[..., s], int(self.reactants[r, s]), self.combinations)
        return h

    def propensities(self, states: ArrayLike) -> Floats:
        """Firing rates k * N * h (..., R) in 1/tu at states (..., S)."""
        return self.known_rates * self.ways * self.combinations_of(states)

    @property
    def known_rates(self) -> Floats:
        """The rate constants (R,), or a ValueError where there are none yet."""
        if self.rate_constants is None:
            raise ValueError(
                "this network has no rate constants yet; give it some, as in Rates.load('table3').apply(network)"
            )
        return self.rate_constants

    def with_rates(self, rate_constants: ArrayLike) -> Network:
        """The same network with rate constants (R,) in 1/tu."""
        return replace(self, rate_constants=np.asarray(rate_constants))

    def rows(self) -> list[tuple[str, ...]]:
        """Name, reaction and ways of every channel, and its rate constant where that is known, as text."""
        rows = []
        for r, name in enumerate(self.channels):
            rate = () if self.rate_constants is None else (f"{self.rate_constants[r]:.4g}",)
            rows.append((name, self._reaction(r), f"{self.ways[r]:g}", *rate))
        return rows

    def _reaction(self, r: int) -> str:
        products = self.reactants[r] + self.stoichiometry[r]
        return f"{self._side(self.reactants[r])} -> {self._side(products)}"

    def _side(self, copies: Ints) -> str:
        terms = [name if n == 1 else f"{n} {name}" for n, name in zip(copies, self.species, strict=True) if n]
        return " + ".join(terms) or "0"

    def _headline(self) -> str:
        laws = f"; conserved: {', '.join(self.conserved)}" if self.conserved else ""
        return f"{len(self.species)} species, {len(self.channels)} channels; {self.combinations} combinations{laws}"

    def _titles(self) -> tuple[str, ...]:
        return ("channel", "reaction", "N", "k (1/tu)")[: 3 if self.rate_constants is None else 4]

    def __str__(self) -> str:
        return f"{self._headline()}\n{text_table(self._titles(), self.rows())}"

    def _repr_html_(self) -> str:
        lines = [f"<th>{title}</th>" for title in self._titles()]
        table = "".join(f"<tr>{''.join(cells)}</tr>" for cells in [lines, *self._html_rows()])
        return f"<p>{html.escape(self._headline())}</p><table>{table}</table>"

    def _html_rows(self) -> list[list[str]]:
        return [[f"<td>{html.escape(cell)}</td>" for cell in row] for row in self.rows()]


def text_table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Columns of text, aligned, for a terminal."""
    widths = [max(len(line[i]) for line in (titles, *rows)) for i in range(len(titles))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in (titles, *rows)
    )


def _choices(copies: Ints, taken: int, combinations: str) -> Floats:
    """Ways to take `taken` of `copies`, as counted by `combinations`. Floats: 1e15 copies do not overflow."""
    available = copies.astype(np.float64)
    if combinations == "product":
        return np.where(copies >= taken, available**taken, 0.0)
    # With fewer copies than taken, one of the factors is exactly 0; the clip keeps the others from going below.
    ordered = np.prod([np.maximum(available - i, 0.0) for i in range(taken)], axis=0)
    return ordered if combinations == "ordered" else ordered / factorial(taken)


def _names(what: str, names: Sequence[str]) -> tuple[str, ...]:
    if isinstance(names, str):
        raise ValueError(f"{what} = {names!r}; expected a sequence of names")
    checked = tuple(names)
    if not all(isinstance(name, str) and name for name in checked):
        raise ValueError(f"{what} must be non-empty names; {checked} came")
    doubled = {name for name in checked if checked.count(name) > 1}
    if doubled:
        raise ValueError(f"{what} has {min(doubled)!r} twice; every name must differ")
    return checked


def _table(values: ArrayLike, shape: tuple[int, int]) -> ArrayLike:
    """An empty list stands for a table without rows."""
    return np.zeros(shape, dtype=np.int64) if shape[0] == 0 and np.size(values) == 0 else values
