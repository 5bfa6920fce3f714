"""Rate constants of a network, with their convention and evidence, in TOML files."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from kinetics.network import Network
from kinetics.support.arrays import Floats
from kinetics.support.config import Settings, find, read_toml, validated, write_toml
from kinetics.support.intervals import posterior_draws

SHIPPED = Path(__file__).parent / "tables"


class Convention(Settings):
    """The formula by which the numbers of a rates file give a propensity, with every factor stated."""

    propensity: Literal["rate * ways * combinations"] = "rate * ways * combinations"
    combinations: Literal["distinct", "ordered", "product"]
    time_unit: Literal["tu"] = "tu"


class MeasuredRate(Settings):
    """A rate constant, 1/tu per way and combination, with its interval and its evidence.

    low, high : 95 % interval of the rate
    events, exposure : firings n, and the integral of ways * combinations over the time observed, tu
    """

    rate: float = Field(ge=0)
    low: float | None = Field(default=None, ge=0)
    high: float | None = Field(default=None, ge=0)
    events: float | None = Field(default=None, ge=0)
    exposure: float | None = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.low is None) != (self.high is None):
            raise ValueError("low and high come together")
        if self.low is not None and self.high is not None and not self.low <= self.rate <= self.high:
            raise ValueError(f"expected low <= rate <= high; {self.low}, {self.rate}, {self.high} came")
        if (self.events is None) != (self.exposure is None):
            raise ValueError("events and exposure come together")
        return self


class ChannelRate(MeasuredRate):
    """The rate constant of one channel, with its evidence.

    ways : number of ways N of one combination of reactants
    """

    events: int | None = Field(default=None, ge=0)
    ways: float = Field(gt=0)


class Rates(Settings):
    """Rate constants of all channels of one network.

    channels : channel name -> ChannelRate
    network : fingerprint of the network they were measured for, where it was recorded
    evidence : table of free form that says where the rates come from (scene, seeds, cost, versions, notes)
    """

    convention: Convention
    channels: dict[str, ChannelRate] = Field(min_length=1)
    network: str | None = None
    evidence: dict[str, Any] = Field(default_factory=dict)

    @classmethod
    def load(cls, name_or_path: str | Path) -> Rates:
        """A shipped table (`table3`, `table3_geometric`, `table3_literal`) or a file of your own."""
        path = find(name_or_path, SHIPPED, "rates")
        return validated(cls, read_toml(path), path)

    def save(self, path: str | Path) -> None:
        """Write as TOML: whole or not at all, so that an older file stays until the new one is safely there."""
        write_toml(self.model_dump(exclude_none=True), Path(path))

    def apply(self, network: Network) -> Network:
        """`network` with the rates, ways and combinations of this table.

        ValueError: the two do not have the same channels (in any order), or the fingerprints differ.
        """
        missing = [name for name in network.channels if name not in self.channels]
        extra = [name for name in self.channels if name not in network.channel_places]
        if missing or extra:
            parts = [
                f"{what} {', '.join(names[:8])}{f' and {len(names) - 8} more' if len(names) > 8 else ''}"
                for what, names in (("missing", missing), ("not in the network:", extra))
                if names
            ]
            raise ValueError(f"these rates are for another network ({'; '.join(parts)})")
        if self.network not in (None, network.fingerprint):
            raise ValueError(
                f"these rates are for another network: its channels have the same names, but its fingerprint is "
                f"{self.network[:12]}, not {network.fingerprint[:12]}"
            )
        ordered = [self.channels[name] for name in network.channels]
        return network.with_rates(
            [channel.rate for channel in ordered],
            [channel.ways for channel in ordered],
            self.convention.combinations,
        )

    def without_evidence(self) -> list[str]:
        """Channels whose rate has no events and exposure, and therefore no known uncertainty."""
        return [name for name, channel in self.channels.items() if channel.exposure is None]

    def sample(self, rng: np.random.Generator, n: int) -> Floats:
        """Draws (n, R) of the rate constants, in the order of `channels`.

        They come from Gamma(events + 1/2, exposure), the posterior under Jeffreys' prior, or are the point rate where
        there is no evidence.
        """
        known = self.channels.values()
        return posterior_draws(rng, n, [c.rate for c in known], [c.events for c in known], [c.exposure for c in known])
