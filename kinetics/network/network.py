"""Reaction networks under stochastic mass action or any other rate law.

The propensity of a channel in state s is k * N * h(s): its rate constant k, its number of ways N and the number
h(s) of combinations of its reactants. It is the probability per time unit that the channel fires (Gillespie 1977).
A rate law of another form takes the place of h(s), and may depend on the time.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from kinetics.network.checks import (
    check_no_overdraft,
    checked_choice,
    checked_conserved,
    checked_names,
    checked_table,
    some_names,
)
from kinetics.network.crowding import Crowding
from kinetics.network.fingerprint import fingerprint
from kinetics.network.laws.on_demand import channel_laws, checked_events, checked_laws, split_rates
from kinetics.network.parameters import Parameters
from kinetics.network.propensity import AT_ZERO, COMBINATIONS, mass_action
from kinetics.network.reaction_text import read_reactions
from kinetics.network.reactions import Reaction, reaction_tables
from kinetics.network.sparse_tables import SparseTable
from kinetics.support.arrays import Floats, Ints, integers, reals
from kinetics.support.frozen import set_fields
from kinetics.support.shown import ResultTable, Shown
from kinetics.support.tables import counted

if TYPE_CHECKING:
    from kinetics.network.laws.events import Event
    from kinetics.network.laws.expression import Expression
    from kinetics.network.laws.of_channels import ChannelLaw
    from kinetics.network.reaction_text import ReactionText

SAMPLE_IT = "sample it, by `simulate`, or by the commands `wellmixed predict` (method auto) and `wellmixed scan`"


@dataclass(frozen=True, eq=False, repr=False)
class Network(Shown):
    """A reaction network: species, the channels through which they react, and their rate constants if known.

    species : S names
    channels : R names, one per reaction
    sparse_reactants : (R, S) int, copies that a firing needs
    sparse_stoichiometry : (R, S) int, net change by a firing, which takes no more than the reactants
    ways : (R,) number N of ways in which one combination of reactants can react
    rate_constants : (R,) k per way and combination, 1/tu; None before the rates are known
    combinations : how h counts like reactants, one of `COMBINATIONS`
    conserved : name of a quantity -> its amount (S,) in one copy of each species; no channel changes the total
    laws : channel -> rate law that takes the place of h; the other channels follow mass action
    events : assignments to counts, made when their conditions become true
    at_zero : what is done if a rate law is above 0 although reactants are missing, one of `AT_ZERO`
    given : parameters, and what follows from them: rate constants, which are then computed, and counts at time 0
    time_unit : name of the unit of time, for tables and axes; "" if none is stated
    crowding : factors on propensities of mass action that depend on how crowded the tank is; None for none. `laws` then
        has the laws that follow from them, which whatever knows no crowds reads

    Both tables may be given dense or as `SparseTable`. The dense ones, `reactants` and `stoichiometry`, are made when
    they are first used, so that tens of thousands of channels cost milliseconds. `dataclasses.replace` gives a network
    with other laws, events or conserved quantities.
    ValueError: a name that is there twice, another shape, or a firing that takes more than it needs

    >>> from kinetics import Network
    >>> decay = Network(("A",), ("decay",), [[1]], [[-1]], ways=[1.0], rate_constants=[0.1])
    >>> decay.propensities([[20], [3]])[:, 0].round(9).tolist()
    [2.0, 0.3]
    """

    species: tuple[str, ...]
    channels: tuple[str, ...]
    sparse_reactants: SparseTable
    sparse_stoichiometry: SparseTable
    ways: Floats
    rate_constants: Floats | None = None
    combinations: str = "distinct"
    conserved: Mapping[str, Floats] = field(default_factory=dict)
    laws: Mapping[str, Expression] = field(default_factory=dict)
    events: tuple[Event, ...] = ()
    at_zero: str = "block"
    given: Parameters = field(default_factory=Parameters)
    time_unit: str = ""
    crowding: Crowding | None = None

    def __post_init__(self) -> None:
        species, channels = checked_names("species", self.species), checked_names("channels", self.channels)
        if not species:
            raise ValueError("a network needs at least one species")
        shape = (len(channels), len(species))
        needed = checked_table("reactants", self.sparse_reactants, shape, minimum=0)
        change = checked_table("stoichiometry", self.sparse_stoichiometry, shape)
        check_no_overdraft(species, channels, needed, change)
        set_fields(self, species=species, channels=channels, sparse_reactants=needed, sparse_stoichiometry=change)
        laws = checked_laws(self.laws, self.channel_places, self.species_places)
        self.given.check(channels, species, laws)
        known = self.given.constants(self.channel_places, self.rate_constants)
        set_fields(
            self,
            ways=reals("ways", self.ways, shape[:1], minimum=0),
            rate_constants=None if known is None else reals("rate_constants", known, shape[:1], minimum=0),
            combinations=checked_choice("combinations", self.combinations, COMBINATIONS),
            conserved=checked_conserved(self.conserved, channels, change),
            laws=laws,
            events=checked_events(self.events, self.species_places),
            at_zero=checked_choice("at_zero", self.at_zero, AT_ZERO),
        )
        if self.crowding is not None:
            crowded = self.crowding.laws(self)
            for name in crowded.keys() & laws.keys():
                if laws[name].text != crowded[name].text:
                    raise ValueError(
                        f"channel {name!r} has a rate law and a factor of the crowd; leave out one of them"
                    )
            set_fields(self, laws={**laws, **crowded})

    @cached_property
    def species_places(self) -> dict[str, int]:
        """Name of each species -> its position."""
        return {name: place for place, name in enumerate(self.species)}

    @cached_property
    def channel_places(self) -> dict[str, int]:
        """Name of each channel -> its position."""
        return {name: place for place, name in enumerate(self.channels)}

    @cached_property
    def reactants(self) -> Ints:
        """Copies (R, S) that a firing needs."""
        return self.sparse_reactants.dense()

    @cached_property
    def stoichiometry(self) -> Ints:
        """Net change (R, S) by a firing."""
        return self.sparse_stoichiometry.dense()

    @classmethod
    def from_text(cls, text: str, /, **parameters: float) -> Network:
        """A network from lines such as `bind: A + B <-> AB, k1, k2` and `A = 100`; see `reaction_text`.

        parameters : values of names in the rates; they go before those that the text gives

        >>> network = Network.from_text("A + B <-> AB, k1, 0.1", k1=1e-3)
        >>> network.with_parameters(k1=2e-3).rate_constants.tolist()
        [0.002, 0.1]
        """
        read = read_reactions(text, parameters)
        read.check_counts()
        return network_of(read)

    @classmethod
    def from_reactions(
        cls,
        reactions: Mapping[str, Reaction],
        rate_constants: ArrayLike | Sequence[float | str | Expression] | None = None,
        species: Sequence[str] | None = None,
        ways: ArrayLike | None = None,
        combinations: str = "distinct",
        parameters: Mapping[str, float] | None = None,
        events: Sequence[Event] = (),
        at_zero: str = "block",
        time_unit: str = "",
    ) -> Network:
        """A network from `{"bind": ({"A": 1, "B": 1}, {"AB": 1})}`: the reactants and products of each channel.

        rate_constants : (R,); an expression in place of one is the whole propensity, and k and N are then 1
        species : their order; by default that in which the reactions name them
        ways : (R,); by default 1 each
        parameters : name -> value, for expressions given as text; a parsed expression brings those of its own

        A channel that changes nothing is most likely a mistake, so there is a warning.
        """
        named, needed, change = reaction_tables(reactions, species)
        constants, laws = split_rates(rate_constants, tuple(reactions), parameters or {})
        idle = np.flatnonzero(np.diff(change.starts) == 0)
        if idle.size:
            name = list(reactions)[idle[0]]
            warnings.warn(f"channel {name!r} changes nothing: products and reactants agree; leave it out", stacklevel=2)
        chosen: Any = np.ones(len(reactions)) if ways is None else ways
        return cls(
            named, tuple(reactions), needed, change, chosen, constants, combinations, laws=laws, events=tuple(events),
            at_zero=at_zero, given=Parameters(parameters or {}), time_unit=time_unit,
        )  # fmt: skip

    def with_rates(
        self, rate_constants: ArrayLike, ways: ArrayLike | None = None, combinations: str | None = None
    ) -> Network:
        """A copy with rate constants (R,) in 1/tu, and with new multiplicities (R,) or combinations if given.

        Nothing else is rebuilt or checked again, so the cost is linear in the length of the arrays.
        """
        shape = (len(self.channels),)
        other = self._with(
            rate_constants=reals("rate_constants", rate_constants, shape, minimum=0),
            ways=self.ways if ways is None else reals("ways", ways, shape, minimum=0),
            combinations=checked_choice("combinations", combinations or self.combinations, COMBINATIONS),
            given=self.given.without_rates(self.given.rates),
        )
        if self.crowding is None or other.combinations == self.combinations:
            return other
        return other._with(laws={**self.laws, **self.crowding.laws(other)})

    @property
    def uncrowded(self) -> Network:
        """The network without the factors of its crowd: mass action in their place. Cost: linear in laws."""
        if self.crowding is None:
            return self
        crowded = {self.channels[r] for r in np.flatnonzero(self.crowding.is_changed)}
        return self._with(laws={name: law for name, law in self.laws.items() if name not in crowded}, crowding=None)

    def with_parameters(self, /, **values: float) -> Network:
        """A copy with new values for these parameters, in rate constants, laws, events and counts."""
        given = self.given.changed(values)
        return self._with(
            given=given,
            laws={name: law.with_parameters(given.values) for name, law in self.laws.items()},
            events=tuple(event.with_parameters(given.values) for event in self.events),
            rate_constants=given.constants(self.channel_places, self.rate_constants),
        )

    def _with(self, **values: Any) -> Network:
        """A copy with other values, which are checked, and without cached results."""
        other = copy(self)
        if "laws" in values:
            for computed in ("fingerprint", "channel_laws"):
                vars(other).pop(computed, None)
        vars(other).update(values)
        return other

    @property
    def parameters(self) -> dict[str, float]:
        """Name -> value of every parameter that `with_parameters` takes."""
        return dict(self.given.values)

    @property
    def initial(self) -> dict[str, int]:
        """Species -> count at time 0, if the network states one."""
        return dict(self.given.counts)

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 over species, channels, reactants, stoichiometry, rate laws and events, not rate constants."""
        tables = (self.sparse_reactants, self.sparse_stoichiometry)
        return fingerprint(self.species, self.channels, tables, self.laws, self.events, self.at_zero)

    def index(self, species: str) -> int:
        """Position of a species by its name."""
        if species not in self.species_places:
            raise ValueError(f"unknown species {species!r}; the network has {some_names(self.species)}")
        return self.species_places[species]

    def state(self, counts: Mapping[str, int] | ArrayLike) -> Ints:
        """Counts (S,) from `{"monomer": 60}` (the others 0) or from S counts in the order of the species."""
        if isinstance(counts, Mapping):
            places = {self.index(name): value for name, value in counts.items()}
            counts = [places.get(i, 0) for i in range(len(self.species))]
        return integers("state", counts, (len(self.species),), minimum=0)

    @property
    def is_mass_action(self) -> bool:
        """Whether every channel follows mass action and there are no events."""
        return not self.laws and not self.events

    @cached_property
    def channel_laws(self) -> dict[str, ChannelLaw]:
        """Channel -> its rate law with the reactants without which it is blocked or refused."""
        return channel_laws(self.laws, self.channel_places, self.species_places, self.sparse_reactants, self.at_zero)

    def combinations_of(self, states: ArrayLike, time: float | None = None) -> Floats:
        """The factor h (..., R) in states (..., S): combinations of reactants, or the rate law at a time, tu."""
        counts = np.asarray(states)
        if counts.ndim == 0 or counts.shape[-1] != len(self.species):
            raise ValueError(f"states have shape {counts.shape}; expected (..., {len(self.species)})")
        h = mass_action(self.sparse_reactants, counts, self.combinations, self.channels)
        if self.laws and time is None:
            check_homogeneous(self)
        for name, law in self.channel_laws.items():
            h[..., self.channel_places[name]] = law.values(counts, time or 0.0)
        return h

    def propensities(self, states: ArrayLike, time: float | None = None) -> Floats:
        """Propensities k * N * h (..., R), 1/tu, in states (..., S); give the time, tu, if rate laws depend on it."""
        if time is None:
            check_homogeneous(self)
        h = self.combinations_of(states, time)
        try:
            with np.errstate(over="raise"):
                return self.known_rates * self.ways * h
        except FloatingPointError:
            with np.errstate(over="ignore"):
                beyond = np.isinf(self.known_rates * self.ways * h).reshape(-1, len(self.channels)).any(axis=0)
            raise ValueError(
                f"channel {self.channels[int(np.argmax(beyond))]!r}: its propensity is beyond what a float can hold, "
                f"1.8e308; lower its rate constant, or start from smaller counts"
            ) from None

    @property
    def known_rates(self) -> Floats:
        """The rate constants (R,), or ValueError if there are none yet."""
        if self.rate_constants is None:
            raise ValueError(
                "this network has no rate constants yet; set them, as in Rates.load('table3').apply(network)"
            )
        return self.rate_constants

    @property
    def headline(self) -> str:
        """Its size, and what it conserves."""
        facts = {
            "conserved": ", ".join(self.conserved),
            "a law without its reactants": self.at_zero if self.laws else "",
            "events": str(len(self.events) or ""),
        }
        channels = counted(len(self.channels), "channel")
        size = f"{len(self.species)} species, {channels}; {self.combinations} combinations"
        return "; ".join([size, *(f"{name}: {value}" for name, value in facts.items() if value)])

    def summary(self) -> ResultTable:
        """Every channel in a row, events below."""
        has_rates = self.rate_constants is not None or bool(self.laws)
        unit = f" (1/{self.time_unit})" * bool(self.time_unit)
        rate = [f"{'k, or law' if self.laws else 'k'}{unit}"] if has_rates else []
        titles = ["channel", "reaction", "N", *rate]
        return ResultTable(self.headline, titles, channel_rows(self), [str(event) for event in self.events])


def network_of(read: ReactionText) -> Network:
    """The network of a text that was read."""
    named, needed, change = reaction_tables(read.reactions, read.species)
    return Network(
        named, tuple(read.reactions), needed, change, np.ones(len(read.reactions)), np.array(read.constants),
        read.combinations,
        laws=read.laws, events=tuple(read.events), given=read.given, time_unit=read.time_unit,
    )  # fmt: skip


def channel_rows(network: Network) -> list[tuple[str, ...]]:
    """Name, reaction and ways of every channel, and its rate constant if that is known, as text."""
    from kinetics.network.display import reaction_texts, rows_of

    reactions = reaction_texts(network.species, network.sparse_reactants, network.sparse_stoichiometry)
    constants, formulas = network.rate_constants, network.given.rates
    return rows_of(network.channels, reactions, network.ways, constants, network.laws, formulas)


def check_homogeneous(network: Network) -> None:
    """ValueError if rates depend on time or events set counts: the generator is then not constant."""
    for name, law in network.laws.items():
        if law.reads_time:
            raise ValueError(
                f"the law of channel {name!r}, {law}, depends on the time; without a time there is no propensity, "
                f"and the chain has no constant generator: {SAMPLE_IT}"
            )
    if network.events:
        raise ValueError(
            f"the network has events ({', '.join(event.name for event in network.events)}), so its counts are no "
            f"Markov chain with a constant generator: {SAMPLE_IT}"
        )


def is_homogeneous(network: Network) -> bool:
    """Whether rates do not depend on time and no events set counts, so that the generator is constant."""
    return not network.events and not any(law.reads_time for law in network.laws.values())
