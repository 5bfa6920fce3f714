"""What a network asks of its laws and events. Most have neither, and start sooner without the code that reads them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from typing_extensions import TypeIs

    from kinetics.network.laws.events import Event
    from kinetics.network.laws.expression import Expression
    from kinetics.network.laws.of_channels import ChannelLaw
    from kinetics.network.sparse_tables import SparseTable


def is_formula(given: object) -> TypeIs[Expression]:
    """Whether this is an `Expression`."""
    return hasattr(given, "formula")


def checked_laws(
    laws: Mapping[str, str | Expression], channels: Mapping[str, int], species: Mapping[str, int]
) -> dict[str, Expression]:
    """See `of_channels.checked_laws`."""
    if not laws:
        return {}
    from kinetics.network.laws import of_channels

    return of_channels.checked_laws(laws, channels, species)


def checked_events(events: Sequence[Event], species: Mapping[str, int]) -> tuple[Event, ...]:
    """See `events.checked_events`."""
    if not events:
        return ()
    from kinetics.network.laws import events as module

    return module.checked_events(events, species)


def split_rates(
    given: Any, channels: tuple[str, ...], parameters: Mapping[str, float]
) -> tuple[Any, dict[str, Expression]]:
    """Rate constants, 1 if there is a law, and the laws, see `of_channels.split_rates`."""
    if given is None or (not isinstance(given, str | Mapping) and all(hasattr(rate, "__float__") for rate in given)):
        return given, {}
    from kinetics.network.laws import of_channels

    return of_channels.split_rates(given, channels, parameters)


def channel_laws(
    laws: Mapping[str, Expression],
    channels: Mapping[str, int],
    species: Mapping[str, int],
    reactants: SparseTable,
    at_zero: str,
) -> dict[str, ChannelLaw]:
    """Channel -> its rate law with the reactants without which it is blocked or refused."""
    if not laws:
        return {}
    from kinetics.network.laws.of_channels import ChannelLaw

    return {name: ChannelLaw(name, law, species, reactants.row(channels[name]), at_zero) for name, law in laws.items()}
