"""Rate laws in the place of the combinations of reactants: h(s, t) of a channel, and what it must not be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from kinetics.network.laws.expression import Expression
from kinetics.network.laws.program import Code, Step, evaluate, steps_of
from kinetics.support.arrays import Floats, Ints

if TYPE_CHECKING:
    from kinetics.network.network import Network

# What becomes of a law that is above 0 though reactants are missing:
#   block   the channel waits until they are there
#   refuse  a ValueError that names the channel and the state
AT_ZERO = ("block", "refuse")


def checked_laws(
    laws: Mapping[str, str | Expression], channels: Sequence[str], species: Sequence[str]
) -> dict[str, Expression]:
    """The laws, parsed, of channels that exist, in terms of species that exist."""
    places = {name: s for s, name in enumerate(species)}
    checked = {}
    for name, law in laws.items():
        if name not in channels:
            raise ValueError(f"a law for channel {name!r}, which the network does not have")
        checked[name] = _parsed(name, law, {})
        checked[name].check_names(f"law of channel {name!r}", places)
        steps_of(checked[name], places)
    return {name: checked[name] for name in channels if name in checked}


def _parsed(channel: str, law: str | Expression, parameters: Mapping[str, float]) -> Expression:
    try:
        return law if isinstance(law, Expression) else Expression(law, parameters)
    except ValueError as error:
        raise ValueError(f"law of channel {channel!r}: {error}") from None


def split_rates(
    given: Any, channels: tuple[str, ...], parameters: Mapping[str, float]
) -> tuple[ArrayLike | None, dict[str, Expression]]:
    """Rate constants, 1 where there is a law, and the laws."""
    if isinstance(given, str | Mapping):
        raise ValueError(f"rates are {given!r}; expected a sequence, one rate constant or law a channel")
    rates = None if given is None else list(given)
    laws: dict[str, Expression] = {}
    if rates is None or not any(isinstance(rate, str | Expression) for rate in rates):
        return given, laws
    if len(rates) != len(channels):
        raise ValueError(f"{len(rates)} rates or laws came; expected one for each of {len(channels)} channels")
    for r, (name, rate) in enumerate(zip(channels, rates, strict=True)):
        if isinstance(rate, str | Expression):
            laws[name], rates[r] = _parsed(name, rate, parameters), 1.0
    return rates, laws


def check_homogeneous(network: Network) -> None:
    """A ValueError where rates depend on the time, or events set counts: no Markov chain with a constant generator."""
    for name, law in network.laws.items():
        if law.reads_time:
            raise ValueError(
                f"the law of channel {name!r}, {law}, depends on the time; without a time there is no propensity, "
                f"and the chain has no constant generator: sample it with the method 'general'"
            )
    if network.events:
        raise ValueError(
            f"the network has events ({', '.join(event.name for event in network.events)}), so its counts are no "
            f"Markov chain with a constant generator: sample it with the method 'general'"
        )


def law_steps(network: Network, channel: str) -> list[Step]:
    """The program of a channel's law, with what becomes of it where reactants are missing."""
    law = steps_of(network.laws[channel], {name: s for s, name in enumerate(network.species)})
    needs = zip(*(part.tolist() for part in network.sparse_reactants.row(network.channels.index(channel))), strict=True)
    if network.at_zero == "block":
        return [*(Step(Code.GUARD, s, float(copies)) for s, copies in needs), *law]
    return [*law, *(Step(Code.REFUSE, s, float(copies)) for s, copies in needs)]


def law_values(network: Network, channel: str, states: Ints, time: float) -> Floats:
    """h (...) of a channel at states (..., S); a ValueError where it is below 0, infinite or undefined."""
    values = evaluate(network.law_programs[channel], states, time)
    bad = ~((values >= 0.0) & (values < np.inf))
    if bad.any():
        raise ValueError(refusal(network, channel, states[bad][0], time))
    return values


def refusal(network: Network, channel: str, state: Ints, time: float) -> str:
    """What is wrong with a law in a state."""
    law = network.laws[channel]
    places = {name: s for s, name in enumerate(network.species)}
    value = float(evaluate(steps_of(law, places), state, time))
    needed = network.sparse_reactants.row(network.channels.index(channel))
    where = f"at {shown(network, state)}" + (f", t = {time:.17g} tu" if law.reads_time else "")
    if network.at_zero == "refuse" and value > 0 and np.any(state[needed[0]] < needed[1]):
        return (
            f"the law of channel {channel!r}, {law}, is {value:g} {where}, where its reactants are missing; correct "
            f"the law, or let it wait for them with at_zero='block'"
        )
    return (
        f"the law of channel {channel!r}, {law}, is {value:g} {where}; expected a finite number of at least 0: correct "
        f"it, or write max(0, ...) or piecewise(...) where that is meant"
    )


def shown(network: Network, state: Ints) -> str:
    """A state by the names of its species, those at 0 left out where there are many."""
    pairs = [(name, int(n)) for name, n in zip(network.species, state, strict=True) if n or len(network.species) <= 8]
    text = ", ".join(f"{name} = {n}" for name, n in pairs[:12])
    return text + (f" and {len(pairs) - 12} more" if len(pairs) > 12 else "") if pairs else "no copies at all"
