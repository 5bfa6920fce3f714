"""Rate constants of a network, with their convention and evidence, in TOML files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta, field

from kinetics.network import Network, Tank
from kinetics.rates.applied import MeasuredRates
from kinetics.rates.break_terms import BreakTerms
from kinetics.rates.breaks import Expansion
from kinetics.rates.crowding_terms import CrowdingTerms
from kinetics.rates.measured import MeasuredRate
from kinetics.support.config import find, read_toml, write_toml
from kinetics.support.settings import Positive, Settings, validated

SHIPPED = Path(__file__).parent / "tables"


class Convention(Settings):
    """The formula by which the numbers of a rates file give a propensity, with every factor stated.

    time_unit : that of all times and, inverted, of the rates; "" if it is not stated
    combinations : of x like reactants: `distinct`, x (x - 1) / 2; `ordered`, x (x - 1); `product`, x x

    >>> from kinetics import Convention, Network
    >>> convention = Convention(combinations="ordered")
    >>> dimers = Network.from_text("2 A -> AA, 1")
    >>> dimers.with_rates([1.0], combinations=convention.combinations).propensities([3, 0]).tolist()
    [6.0]
    """

    propensity: Literal["rate * ways * combinations"] = "rate * ways * combinations"
    combinations: Literal["distinct", "ordered", "product"]
    time_unit: Annotated[str, Meta(max_length=40)] = ""

    @classmethod
    def of(cls, network: Network) -> Convention:
        """The convention by which propensities of `network` count combinations."""
        return validated(cls, {"combinations": network.combinations, "time_unit": network.time_unit}, "the network")


class ChannelRate(MeasuredRate):
    """The rate constant of one channel, with its evidence; the other fields are those of `MeasuredRate`.

    ways : number of ways N of one combination of reactants
    exposures : of a break whose model has partners, the exposure to each of them, tu; `exposure` is their sum, weighted
        as the model weights its partners
    prior : of a channel that no run could fire, the group whose mean rate stands in for evidence: the exposure is that
        in which half an event of such a rate is expected, the events are 0; None if runs are the evidence

    >>> from kinetics import ChannelRate
    >>> measured = ChannelRate(rate=0.02, low=0.0024, high=0.072, events=2, exposure=100.0, ways=1)
    >>> measured.events / measured.exposure == measured.rate
    True
    """

    events: Annotated[int, Meta(ge=0)] | None = None
    ways: Positive
    exposures: tuple[float, ...] | None = None
    prior: Literal["joins", "breaks"] | None = None


class Rates(Settings, MeasuredRates):
    """Rate constants of all joins and breaks of one network, how breaks depend on their partners, and for which tank.

    channels : channel name -> ChannelRate; of a break the coefficient b per partner of weight 1
    breaks : the break model; by default breaks are of first order
    crowding : how crowds change rates; None for mass action
    tank : edges of the tank in which the constants hold; None: not known, so that they cannot be used in another
    network : fingerprint of the network they were measured for, where it was recorded
    evidence : table of free form that says where the rates come from (scene, seeds, cost, versions, notes)

    >>> from kinetics import ChannelRate, Convention, Network, Rates
    >>> decay = Network.from_text("decay: A -> 0, 1")
    >>> measured = ChannelRate(rate=0.02, events=2, exposure=100.0, ways=1)
    >>> rates = Rates(convention=Convention(combinations="distinct"), channels={"decay": measured})
    >>> rates.apply(decay).rate_constants.tolist(), rates.expected(decay).rate_constants.tolist()
    ([0.02], [0.025])
    """

    convention: Convention
    tank: tuple[float, float, float] | None = None
    breaks: BreakTerms = BreakTerms()
    crowding: CrowdingTerms | None = None
    channels: Annotated[dict[str, ChannelRate], Meta(min_length=1)]
    network: str | None = None
    evidence: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def load(cls, name_or_path: str | Path) -> Rates:
        """A shipped table (`table3`, `table3_geometric`, `table3_literal`) or a file of your own."""
        path = find(name_or_path, SHIPPED, "rates")
        return validated(cls, read_toml(path), path)

    def save(self, path: str | Path) -> None:
        """Write as TOML: whole or not at all, so that an older file stays until the new one is safely there."""
        write_toml(self.as_dict(none=False), Path(path))

    def expansion(self, network: Network) -> Expansion:
        """`network` with these rates as they stand, and what the break model makes of it."""
        self._check(network)
        ordered = [self.channels[name] for name in network.channels]
        base = network.with_rates(
            [channel.rate for channel in ordered],
            [channel.ways for channel in ordered],
            self.convention.combinations,
        )
        self.breaks.check(base)
        self._check_exposures(base)
        return Expansion.of(base, self.breaks.break_model)

    def crowded(self, expansion: Expansion, tank: Tank | None) -> Expansion:
        """The expansion with the crowd's factors in the tank of use; None for that of the rates."""
        if self.crowding is None:
            return expansion
        used = tank or self.measured_in
        if used is None:
            raise ValueError(
                "these rates depend on how crowded the tank is, and do not state theirs; give the tank, or state its "
                "edges as `tank` in the rates file"
            )
        factors = self.crowding.crowding(expansion, used)
        if factors is None:
            return expansion
        return replace(expansion, network=replace(expansion.network, crowding=factors))

    def known(self, network: Network) -> tuple[dict[str, MeasuredRate], None]:
        """The rate of each channel, which belongs to it alone."""
        return {name: self.channels[name] for name in network.channels}, None

    def _check(self, network: Network) -> None:
        """Raise a ValueError if these are the rates of another network."""
        missing = [name for name in network.channels if name not in self.channels]
        extra = [name for name in self.channels if name not in network.channel_places]
        if missing or extra:
            parts = [
                f"{what} {_some(names)}"
                for what, names in (("missing", missing), ("not in the network:", extra))
                if names
            ]
            raise ValueError(f"these rates are for another network ({'; '.join(parts)})")
        if self.network not in (None, network.fingerprint):
            raise ValueError(
                f"these rates are for another network: its channels have the same names, but its fingerprint is "
                f"{self.network[:12]}, not {network.fingerprint[:12]}"
            )

        stated, expected = self.convention.time_unit, network.time_unit
        if stated and expected and stated != expected:
            raise ValueError(
                f"these rates are per {stated}, and the network's time unit is {expected}; convert them, and state "
                f"time_unit = '{expected}' in their convention"
            )

    def _check_exposures(self, network: Network) -> None:
        """ValueError if the exposures to partners are not those of the break model."""
        weights = self.breaks.weights(network)
        for name, channel in self.channels.items():
            if channel.exposures is None:
                continue
            if len(channel.exposures) != weights.size:
                raise ValueError(
                    f"{name} has exposures to {len(channel.exposures)} partners; break model {self.breaks.model!r} has "
                    f"{weights.size} in this network"
                )
            total = float(weights @ channel.exposures)
            if channel.exposure is None or not np.isclose(channel.exposure, total, rtol=1e-3):
                raise ValueError(
                    f"{name} has exposure = {channel.exposure}; its exposures, weighted as break model "
                    f"{self.breaks.model!r} weights the partners, add up to {total:g}: give that number"
                )

    @property
    def has_evidence(self) -> bool:
        """Whether any channel has events and exposure."""
        return len(self.without_evidence()) < len(self.channels)

    @property
    def not_measured(self) -> list[str]:
        """Channels of which only a prior is known."""
        return [name for name, channel in self.channels.items() if channel.prior is not None]

    def without_evidence(self) -> list[str]:
        """Channels whose rate has no events and exposure, and therefore no known uncertainty."""
        return [name for name, channel in self.channels.items() if channel.exposure is None]


def about_priors(names: Sequence[str]) -> str:
    """A sentence on the prior of channels that no run could fire; "" if there are none.

    >>> from kinetics.rates import about_priors
    >>> about_priors(["2+2->4"])[:21]
    'Not measured: 2+2->4.'
    """
    if not names:
        return ""
    return (
        f"Not measured: {_some(names)}. No run held the reactants: a prior from the mean rate of all joins, or of "
        f"all breaks, replaces it, ranging from 0 to 7 times that mean."
    )


def _some(names: Sequence[str]) -> str:
    return f"{', '.join(names[:8])}{f' and {len(names) - 8} more' if len(names) > 8 else ''}"
