"""Reaction networks under stochastic mass action, or any other rate law.

The propensity of a channel in state s is k * N * h(s): its rate constant k, its number of ways N and the number
h(s) of combinations of its reactants. It is the probability per time unit that the channel fires (Gillespie 1977).
A law of another form takes the place of h(s), and may depend on the time.
"""

from __future__ import annotations

import hashlib
import html
import json
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kinetics.network.laws.events import Event
from kinetics.network.laws.expression import Expression
from kinetics.network.laws.program import Step
from kinetics.network.propensity import AT_ZERO, check_homogeneous, checked_laws, law_steps, law_values, split_rates
from kinetics.network.sparse_tables import SparseTable
from kinetics.support.arrays import Floats, Ints, integers, reals
from kinetics.support.tables import text_table

# What h(s) counts for m like reactants among s copies:
#   distinct  sets of m copies, s!/(m!(s-m)!), for a pair s(s-1)/2
#   ordered   sequences of m copies, s!/(s-m)!, for a pair s(s-1)
#   product   s**m, zero below m copies: the paper's multiplicity M in eqs 9-10, taken to the letter
COMBINATIONS = ("distinct", "ordered", "product")
MAX_DENSE_HASH = 10**6  # entries of a table that the fingerprint reads in full; of a larger one, those other than 0
SPARSE = {"reactants": "sparse_reactants", "stoichiometry": "sparse_stoichiometry"}
Reaction = tuple[Mapping[str, int], Mapping[str, int]]  # copies needed and copies made, by species


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
    laws : channel -> what takes the place of h; the others follow mass action
    events : what sets counts when a condition becomes true
    at_zero : what becomes of a law that is above 0 though reactants are missing, one of `AT_ZERO`

    The two tables are also there without their zeros, as `sparse_reactants` and `sparse_stoichiometry`. A network made
    by `from_sparse` or `from_reactions` keeps only these, and makes the dense tables when they are first asked for:
    tens of thousands of channels then cost milliseconds.
    """

    species: tuple[str, ...]
    channels: tuple[str, ...]
    reactants: Ints
    stoichiometry: Ints
    ways: Floats
    rate_constants: Floats | None = None
    combinations: str = "distinct"
    conserved: Mapping[str, Floats] = field(default_factory=dict)
    laws: Mapping[str, Expression] = field(default_factory=dict)
    events: tuple[Event, ...] = ()
    at_zero: str = "block"
    sparse_reactants: SparseTable = field(init=False, repr=False)
    sparse_stoichiometry: SparseTable = field(init=False, repr=False)

    def __post_init__(self) -> None:
        species = _names("species", self.species)
        channels = _names("channels", self.channels)
        if not species:
            raise ValueError("a network needs at least one species")
        shape = (len(channels), len(species))
        checked: dict[str, Any] = {
            "species": species,
            "channels": channels,
            "ways": reals("ways", self.ways, shape[:1], minimum=0),
        }
        if self.rate_constants is not None:
            checked["rate_constants"] = reals("rate_constants", self.rate_constants, shape[:1], minimum=0)
        for name, minimum in (("reactants", 0), ("stoichiometry", None)):
            table = getattr(self, name)
            if isinstance(table, SparseTable):
                checked[SPARSE[name]] = _checked_table(name, table, shape, minimum)
                del self.__dict__[name]  # `__getattr__` makes it when it is asked for
            else:
                checked[name] = integers(name, _table(table, shape), shape, minimum)
                checked[SPARSE[name]] = SparseTable.of_dense(checked[name])
        for name, value in checked.items():
            object.__setattr__(self, name, value)
        if self.combinations not in COMBINATIONS:
            raise ValueError(f"combinations = {self.combinations!r}; expected one of {', '.join(COMBINATIONS)}")
        if self.at_zero not in AT_ZERO:
            raise ValueError(f"at_zero = {self.at_zero!r}; expected one of {', '.join(AT_ZERO)}")
        self._check_no_overdraft()
        object.__setattr__(self, "conserved", self._checked_conserved())
        object.__setattr__(self, "laws", checked_laws(self.laws, channels, species))
        object.__setattr__(self, "events", tuple(self.events))
        if not all(isinstance(event, Event) for event in self.events):
            raise ValueError(f"events are {self.events!r}; expected a sequence of kinetics.network.laws.Event")
        _names("events", [event.name for event in self.events])
        for event in self.events:
            event.check_names({name: s for s, name in enumerate(species)})

    def __getattr__(self, name: str) -> Ints:
        """The dense table of a network that was made from sparse tables."""
        if name not in SPARSE or SPARSE[name] not in self.__dict__:
            raise AttributeError(f"a network has no {name!r}")
        object.__setattr__(self, name, self.__dict__[SPARSE[name]].dense())
        return self.__dict__[name]

    @classmethod
    def from_sparse(
        cls,
        species: Sequence[str],
        channels: Sequence[str],
        reactants: SparseTable,
        stoichiometry: SparseTable,
        ways: ArrayLike,
        rate_constants: ArrayLike | None = None,
        combinations: str = "distinct",
        conserved: Mapping[str, ArrayLike] | None = None,
        laws: Mapping[str, Expression] | None = None,
        events: Sequence[Event] = (),
        at_zero: str = "block",
    ) -> Network:
        """A network from tables without their zeros, (R, S) each."""
        tables: Any = (reactants, stoichiometry)
        rest: Any = (ways, rate_constants, combinations, conserved or {}, laws or {}, tuple(events), at_zero)
        return cls(tuple(species), tuple(channels), *tables, *rest)

    @classmethod
    def from_reactions(
        cls,
        reactions: Mapping[str, Reaction],
        rate_constants: ArrayLike | Sequence[float | str | Expression] | None = None,
        species: Sequence[str] | None = None,
        ways: ArrayLike | None = None,
        combinations: str = "distinct",
        conserved: Mapping[str, ArrayLike] | None = None,
        parameters: Mapping[str, float] | None = None,
        events: Sequence[Event] = (),
        at_zero: str = "block",
    ) -> Network:
        """A network from `{"bind": ({"A": 1, "B": 1}, {"AB": 1})}`: what each channel needs, and what it makes.

        rate_constants : (R,); an expression in the place of one is the whole propensity, its k and N are 1
        species : their order; by default that in which the reactions name them
        ways : (R,); by default 1 each
        parameters : name -> value, for expressions given as text; a parsed one brings its own
        A channel that changes nothing is most likely a slip, and warned of.
        """
        constants, laws = split_rates(rate_constants, tuple(reactions), parameters or {})
        sides = [(r, side, made) for r, pair in enumerate(reactions.values()) for made, side in enumerate(pair)]
        in_order = dict.fromkeys(name for _, side, _ in sides for name in side)
        named = _names("species", tuple(in_order) if species is None else species)
        place = {name: s for s, name in enumerate(named)}
        entries = [(r, name, n, made) for r, side, made in sides for name, n in side.items()]
        unknown = [name for _, name, _, _ in entries if name not in place]
        if unknown:
            raise ValueError(f"unknown species {unknown[0]!r}; the network has {', '.join(place)}")
        rows = np.array([r for r, _, _, _ in entries], dtype=np.int64)
        columns = np.array([place[name] for _, name, _, _ in entries], dtype=np.int64)
        copies = integers("copies", [n for _, _, n, _ in entries], (None,), minimum=0)
        is_made = np.array([made for _, _, _, made in entries], dtype=bool)
        shape = (len(reactions), len(place))
        change = SparseTable.of_entries(shape, rows, columns, np.where(is_made, copies, -copies))
        idle = np.flatnonzero(np.diff(change.starts) == 0)
        if idle.size:
            name = list(reactions)[idle[0]]
            warnings.warn(f"channel {name!r} changes nothing: it makes what it needs; leave it out", stacklevel=2)
        return cls.from_sparse(
            named,
            tuple(reactions),
            SparseTable.of_entries(shape, rows[~is_made], columns[~is_made], copies[~is_made]),
            change,
            np.ones(shape[0]) if ways is None else ways,
            constants,
            combinations,
            conserved,
            laws,
            events,
            at_zero,
        )

    def _check_no_overdraft(self) -> None:
        """A channel that took more copies than it needs could make a count negative."""
        change = self.sparse_stoichiometry
        short = np.flatnonzero(self.sparse_reactants.at(change.keys) + change.copies < 0)
        if short.size:
            r, s = change.rows[short[0]], change.columns[short[0]]
            raise ValueError(
                f"channel {self.channels[r]!r} takes {-change.copies[short[0]]} of {self.species[s]!r} but needs "
                f"only {self.sparse_reactants.at(change.keys[short[:1]])[0]}; raise its reactants"
            )

    def _checked_conserved(self) -> dict[str, Floats]:
        weights_of = {}
        change = self.sparse_stoichiometry
        n_channels = len(self.channels)
        for name, weights in self.conserved.items():
            weights_of[name] = reals(f"conserved {name!r}", weights, (len(self.species),))
            gains = change.copies * weights_of[name][change.columns]
            net = np.bincount(change.rows, gains, n_channels)
            scale = np.bincount(change.rows, np.abs(gains), n_channels)
            broken = np.flatnonzero(np.abs(net) > 1e-12 * scale)
            if broken.size:
                raise ValueError(
                    f"channel {self.channels[broken[0]]!r} changes the conserved quantity {name!r} by "
                    f"{net[broken[0]]:g}; correct the channel or the weights"
                )
        return weights_of

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 over species, channels, reactants, stoichiometry, laws and events: which network, whatever its k."""
        sparse = (self.sparse_reactants, self.sparse_stoichiometry)
        if len(self.channels) * len(self.species) <= MAX_DENSE_HASH:
            tables = [table.dense().tolist() for table in sparse]
        else:
            tables = [[table.keys.tolist(), table.copies.tolist()] for table in sparse]
        content: list[Any] = [self.species, self.channels, *tables]
        if not self.is_mass_action:
            laws = [[name, law.text, sorted(law.parameters.items())] for name, law in self.laws.items()]
            content += [laws, [repr(event) for event in self.events], self.at_zero]
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

    @property
    def is_mass_action(self) -> bool:
        """Whether there are neither other laws nor events."""
        return not self.laws and not self.events

    @cached_property
    def law_programs(self) -> dict[str, list[Step]]:
        """Channel -> its law as a program, see `laws.program`."""
        return {name: law_steps(self, name) for name in self.laws}

    def check_homogeneous(self) -> None:
        """A ValueError where the rates depend on the time, or events set counts: no Markov chain with a generator."""
        check_homogeneous(self)

    def combinations_of(self, states: ArrayLike, time: float | None = None) -> Floats:
        """h (..., R): combinations of each channel's reactants in states (..., S), or its law at a time, tu."""
        counts = np.asarray(states)
        if counts.ndim == 0 or counts.shape[-1] != len(self.species):
            raise ValueError(f"states have shape {counts.shape}; expected (..., {len(self.species)})")
        h = np.ones((*counts.shape[:-1], len(self.channels)))
        needed = self.sparse_reactants
        places = np.arange(needed.rows.size) - needed.starts[needed.rows]  # first, second, ... reactant of its channel
        for place, taken in set(zip(places.tolist(), needed.copies.tolist(), strict=True)):
            alike = (places == place) & (needed.copies == taken)
            h[..., needed.rows[alike]] *= _choices(counts[..., needed.columns[alike]], taken, self.combinations)
        if self.laws and time is None:
            self.check_homogeneous()
        for name in self.laws:
            h[..., self.channels.index(name)] = law_values(self, name, counts, time or 0.0)
        return h

    def propensities(self, states: ArrayLike, time: float | None = None) -> Floats:
        """Firing rates k * N * h (..., R) in 1/tu at states (..., S); a time in tu where laws depend on it."""
        if time is None:
            self.check_homogeneous()
        return self.known_rates * self.ways * self.combinations_of(states, time)

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
        other = copy(self)  # all else was checked before
        checked = reals("rate_constants", rate_constants, (len(self.channels),), minimum=0)
        object.__setattr__(other, "rate_constants", checked)
        return other

    def rows(self) -> list[tuple[str, ...]]:
        """Name, reaction and ways of every channel, and its rate constant where that is known, as text."""
        rows = []
        for r, name in enumerate(self.channels):
            rate: tuple[str, ...] = () if self.rate_constants is None else (f"{self.rate_constants[r]:.4g}",)
            if name in self.laws:
                factor = "" if rate in ((), ("1",)) else f"{rate[0]} * "
                rate = (f"{factor}[{self.laws[name]}]",)
            rows.append((name, self._reaction(r), f"{self.ways[r]:g}", *rate))
        width = max(map(len, rows), default=0)
        return [(*row, *[""] * (width - len(row))) for row in rows]

    def _reaction(self, r: int) -> str:
        before = dict(zip(*(part.tolist() for part in self.sparse_reactants.row(r)), strict=True))
        change = dict(zip(*(part.tolist() for part in self.sparse_stoichiometry.row(r)), strict=True))
        after = {s: before.get(s, 0) + change.get(s, 0) for s in sorted(before | change)}
        return f"{self._side(before)} -> {self._side(after)}"

    def _side(self, copies: Mapping[int, int]) -> str:
        terms = [self.species[s] if n == 1 else f"{n} {self.species[s]}" for s, n in copies.items() if n]
        return " + ".join(terms) or "0"

    def _headline(self) -> str:
        laws = f"; conserved: {', '.join(self.conserved)}" if self.conserved else ""
        missing = f"; a law without its reactants: {self.at_zero}" if self.laws else ""
        events = f"; {len(self.events)} events" if self.events else ""
        size = f"{len(self.species)} species, {len(self.channels)} channels"
        return f"{size}; {self.combinations} combinations{laws}{missing}{events}"

    def _titles(self) -> tuple[str, ...]:
        last = "k, or law (1/tu)" if self.laws else "k (1/tu)"
        titles = ("channel", "reaction", "N", last)
        return titles if self.laws or self.rate_constants is not None else titles[:3]

    def __str__(self) -> str:
        lines = [self._headline(), text_table(self._titles(), self.rows()), *map(str, self.events)]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        lines = [f"<th>{title}</th>" for title in self._titles()]
        table = "".join(f"<tr>{''.join(cells)}</tr>" for cells in [lines, *self._html_rows()])
        events = "".join(f"<p>{html.escape(str(event))}</p>" for event in self.events)
        return f"<p>{html.escape(self._headline())}</p><table>{table}</table>{events}"

    def _html_rows(self) -> list[list[str]]:
        return [[f"<td>{html.escape(cell)}</td>" for cell in row] for row in self.rows()]


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
    if len(set(checked)) < len(checked):
        doubled = {name for name, count in Counter(checked).items() if count > 1}
        raise ValueError(f"{what} has {min(doubled)!r} twice; every name must differ")
    return checked


def _checked_table(name: str, table: SparseTable, shape: tuple[int, int], minimum: int | None) -> SparseTable:
    if table.shape != shape:
        raise ValueError(f"{name} has shape {table.shape}; expected {shape}")
    if minimum is not None and table.copies.size and table.copies.min() < minimum:
        raise ValueError(f"{name} holds {table.copies.min()}; expected at least {minimum}")
    return table


def _table(values: ArrayLike, shape: tuple[int, int]) -> ArrayLike:
    """An empty list stands for a table without rows."""
    return np.zeros(shape, dtype=np.int64) if shape[0] == 0 and np.size(values) == 0 else values
