"""Events and exposure of every channel: the sufficient statistics of a jump path for mass-action rate constants.

Under mass action the likelihood of a fully observed path is prod_j k_j^events_j exp(-k_j exposure_j), so the two
arrays counted here are sufficient. Competing channels and censored waits enter through the exposure alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import fsum
from typing import NamedTuple

import numpy as np

from kinetics.network import Crowding, Network, Tank
from kinetics.rates.breaks import Expansion
from kinetics.runs import RESTART, JumpPath
from kinetics.support.arrays import Floats, Ints, integers, reals
from kinetics.support.frozen import set_fields

Crowd = Callable[[Expansion, Tank], Crowding | None]  # the factors on the channels of a network in a tank


@dataclass(frozen=True, eq=False)
class Exposure:
    """Events and exposure of every channel, in one run or in several that are pooled.

    events : (R,) firings of each channel
    exposure : (R,) integral of ways * h(s(t)) dt over the time the channel was open, in tu; h counts the
        combinations of reactants by the network's convention. 0 if a channel could never fire.
    tank : the tank in whose rate constants the exposure is counted; None if it is not known
    ValueError: arrays of another shape, negative numbers, or events without exposure

    >>> from calibration import Exposure
    >>> from kinetics import Network
    >>> decay = Network.from_text("decay: A -> 0, 1")
    >>> both = Exposure(decay, events=[2], exposure=[2.0]) + Exposure(decay, events=[1], exposure=[4.0])
    >>> both.events.tolist(), both.exposure.tolist()
    ([3], [6.0])
    """

    network: Network
    events: Ints
    exposure: Floats
    tank: Tank | None = None

    def __post_init__(self) -> None:
        shape = (len(self.network.channels),)
        events = integers("events", self.events, shape, minimum=0)
        set_fields(self, events=events, exposure=reals("exposure", self.exposure, shape, minimum=0))
        impossible = (self.events > 0) & (self.exposure == 0)
        if impossible.any():
            names = [self.network.channels[j] for j in np.flatnonzero(impossible)]
            raise ValueError(
                f"events of {', '.join(names)} without exposure: the channel was closed or had no reactants; "
                "check open_channels and the network of the path"
            )

    def __add__(self, other: Exposure) -> Exposure:
        if not isinstance(other, Exposure):
            return NotImplemented
        require_same(self.network, other.network)
        more = other.in_tank(self.tank)
        return Exposure(self.network, self.events + more.events, self.exposure + more.exposure, self.tank)

    def in_tank(self, tank: Tank | None) -> Exposure:
        """These events, with the exposure for rate constants of another tank. ValueError: a tank is not known."""
        if tank == self.tank:
            return self
        return Exposure(self.network, self.events, self.exposure * meetings(self.network, self.tank, tank), tank)

    def __radd__(self, other: object) -> Exposure:
        return self if other == 0 else NotImplemented  # so that sum() works


def meetings(network: Network, measured: Tank | None, wanted: Tank | None) -> Floats:
    """Factors (R,) from exposures in one tank to those in another: n bodies meet volume^-(n - 1) times as often.

    ValueError: one of the two tanks is not known.
    """
    if measured is None or wanted is None:
        raise ValueError("some runs state their tank and others do not; state it for all of them, or for none")
    order = np.zeros(len(network.channels))
    np.add.at(order, network.sparse_reactants.rows, network.sparse_reactants.copies)
    return np.asarray(wanted.dilution(measured) ** (order - 1))


def crowding_of(crowd: Crowd | None, expansion: Expansion, tank: Tank | None) -> Crowding | None:
    """The factors in the tank of a run; None for mass action. ValueError: crowding, and a tank that is not known."""
    if crowd is None:
        return None
    if tank is None:
        raise ValueError("a run without its tank; crowding depends on the volume: state the edges of the tank")
    return crowd(expansion, tank)


def require_tanks(paths: Iterable[JumpPath]) -> None:
    """ValueError if only some of the runs state their tank."""
    if len({path.tank is None for path in paths}) > 1:
        raise ValueError("some runs state their tank and others do not; state it for all of them, or for none")


def require_same(first: Network, second: Network) -> None:
    """Refuse to pool what was measured on two networks or under two conventions."""
    if first.fingerprint != second.fingerprint:
        raise ValueError(
            f"two networks: channels {list(first.channels)} and {list(second.channels)}; "
            "pool only runs of one rule book"
        )
    if first.combinations != second.combinations or not np.array_equal(first.ways, second.ways):
        raise ValueError("two conventions: the networks differ in multiplicities or combinations; derive both again")


class Sojourns(NamedTuple):
    """The stretches of a path in one state each; arrays (E + 1,), times in tu.

    begin, end : from one event or restart to the next; the last stretch is cut off by the end of watching
    origin : start, or last restart, from which the age of a stretch counts
    """

    begin: Floats
    end: Floats
    origin: Floats


def sojourns(path: JumpPath) -> Sojourns:
    """The stretches in which the state of a path stays as it is."""
    edges = np.concatenate(([0.0], path.times, [path.end]))
    restarts = np.where(path.channels == RESTART, path.times, 0.0)
    return Sojourns(edges[:-1], edges[1:], np.maximum.accumulate(np.concatenate(([0.0], restarts))))


def count(path: JumpPath, ages: tuple[float, float] = (0.0, np.inf), crowding: Crowding | None = None) -> Exposure:
    """Count events and exposure of one path; waits that the end cut short count in full.

    ages : limits (a, b), tu; count only ages a <= t < b, the age being the time since the start or the last restart
    crowding : factors on the propensities in the tank of the run; None for mass action

    A restart puts the state back to the initial one and is no event. Channels that were not open (`open_channels`)
    gather no exposure. Cost: linear in events times channels. ValueError: limits that are no ages

    >>> from calibration import count
    >>> from kinetics import JumpPath, Network
    >>> decay = Network.from_text("decay: A -> 0, 1")
    >>> path = JumpPath(decay, {"A": 2}, times=[0.5], channels=[0], end=3.0)
    >>> count(path).exposure.tolist(), count(path, ages=(1.0, 3.0)).exposure.tolist()  # 2 * 0.5 + 1 * 2.5, and 1 * 2.0
    ([3.5], [2.0])
    """
    lower, upper = ages
    if not 0 <= lower < upper:
        raise ValueError(f"ages = {ages}; expected 0 <= from < to")
    begin, end, origin = sojourns(path)
    waits = np.minimum(end, origin + upper) - np.maximum(begin, origin + lower)
    network = path.network
    combinations = network.combinations_of(path.states)
    if crowding is not None:
        combinations = combinations * crowding.factors(path.states)
    exposure = network.ways * (np.clip(waits, 0.0, None) @ combinations)
    exposure = np.where(path.open_channels, exposure, 0.0)
    age = path.times - origin[:-1]
    fired = path.channels[(path.channels != RESTART) & (lower <= age) & (age < upper)]
    return Exposure(network, np.bincount(fired, minlength=len(network.channels)), exposure, path.tank)


def pooled(exposures: Iterable[Exposure]) -> Exposure:
    """Events and exposures of several runs, summed; their order makes no difference, not to the last digit.

    ValueError: no runs, runs of several networks or conventions, or some with a tank and some without

    >>> from calibration import Exposure, pooled
    >>> from kinetics import Network
    >>> decay = Network.from_text("decay: A -> 0, 1")
    >>> pooled(Exposure(decay, [1], [0.1]) for run in range(10)).exposure.tolist()
    [1.0]
    """
    runs = list(exposures)
    if not runs:
        raise ValueError("no runs to count; give at least one path")
    for run in runs[1:]:
        require_same(runs[0].network, run.network)
    # rounded once, so that the order of the runs changes no digit
    tank = runs[0].tank
    total = [fsum(column) for column in np.array([run.in_tank(tank).exposure for run in runs]).T]
    return Exposure(runs[0].network, np.sum([run.events for run in runs], axis=0), np.array(total), tank)


def composition(path: JumpPath) -> str:
    """The initial state as text: `40 monomer, 10 dimer`."""
    species = path.network.species
    return ", ".join(f"{n} {species[i]}" for i, n in enumerate(path.initial) if n) or "nothing"
