"""Looks that are coarse beside what happens: how far off they make a rate, and which tests they upset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from calibration.estimating.exposure import Exposure, count, pooled
from kinetics.runs import RESTART, JumpPath
from kinetics.support.arrays import Floats
from kinetics.support.tables import in_unit

COARSE = 0.05  # fall of a propensity between two looks, by which its rate is 2.5 % off; or events between two
SHOWN = 3  # channels in a sentence


class LookedAt(NamedTuple):
    """One channel, as looks show it.

    resolution : longest time between two looks at its events
    rate : events / exposure, as looks show them
    fall : of its propensity between two looks, relative; below 0 if it rises. For a decay alone rate * resolution
    bias : relative error of `rate`, about -fall / 2
    corrected : `rate` without it; None if all is over by the first look
    per_look : mean number of its events between two looks
    """

    channel: str
    resolution: float
    rate: float
    fall: float
    bias: float
    corrected: float | None
    per_look: float


@dataclass(frozen=True, eq=False)
class CoarseLooks:
    """The bias of rates and tests if a tank is observed at intervals, and events are recorded at the next observation.

    runs : the paths; those whose resolution is 0 add nothing

    An event is then late by half a look on average, so a propensity that an event lowers counts for too long: exposure
    is (h(start) - h(end)) * resolution / 2 too large, h being the ways times the combinations of reactants. If h
    falls like exp(-k t) and x = k * resolution as looks show it, the right rate is -ln(1 - x) / x times the one seen.
    For one channel of first order that is its grouped likelihood, -ln(1 - events / looks) / resolution; for others it
    is exact to first order in x.

    >>> from calibration.estimating.coarse_looks import CoarseLooks
    >>> from kinetics import JumpPath, Network
    >>> decay = Network.from_text("die: A -> 0, 1")
    >>> ends = [1.0] * 4 + [2.0] * 2 + [3.0]  # 7 deaths, seen in 11 looks at what was alive
    >>> runs = [JumpPath(decay, {"A": 1}, [end], [0], end=end, resolution=1.0) for end in ends]
    >>> found = CoarseLooks(runs).channels[0]
    >>> round(found.rate, 4), round(found.corrected, 4)  # 7/11, -ln(4/11)
    (0.6364, 1.0116)
    """

    runs: Sequence[JumpPath]

    @cached_property
    def channels(self) -> tuple[LookedAt, ...]:
        """The channels that fired and at which looks are coarse, the most biased first."""
        looked = [path for path in self.runs if path.resolution > 0]
        if not looked:
            return ()
        total, falling, rising = map(pooled, zip(*map(_parts, self.runs), strict=True))
        looks, events = np.sum([_possible(path) for path in looked], axis=0)
        longest = max(path.resolution for path in looked)
        found = []
        for j in np.flatnonzero((total.events > 0) & (events > 0)):
            fall = float((falling.exposure[j] - rising.exposure[j]) / total.exposure[j])
            per_look = float(events[j] / looks[j])
            if max(abs(fall), per_look) > COARSE:
                factor = np.inf if fall >= 1 else 1.0 if fall == 0 else float(-np.log1p(-fall) / fall)
                rate = float(total.events[j] / total.exposure[j])
                corrected = rate * factor if factor < np.inf else None
                name = total.network.channels[j]
                found.append(LookedAt(name, longest, rate, fall, 1 / factor - 1, corrected, per_look))
        return tuple(sorted(found, key=lambda each: -abs(each.bias)))

    @property
    def sentence(self) -> str:
        """Sentences on the bias of rates and tests, and its remedy; "" if the intervals are short enough."""
        if not self.channels:
            return ""
        unit, resolution = self.runs[0].network.time_unit, self.channels[0].resolution
        most = max(each.per_look for each in self.channels)
        said = [_in_words(each) for each in self.channels if abs(each.fall) > COARSE]
        more = f"; and {len(said) - SHOWN} more" if len(said) > SHOWN else ""
        rates = finer = ""
        if said:
            rates = (
                "Rates are off by about half the change of their propensity between two looks (for a decay alone: "
                f"rate x resolution), and intervals do not include that: {'; '.join(said[:SHOWN])}{more}. "
            )
            fine = resolution * COARSE / max(abs(each.fall) for each in self.channels)
            finer = f"below {in_unit(f'{fine:.2g}', unit)} for the rates, and "
        finer += f"below {in_unit(f'{resolution * COARSE / most:.2g}', unit)} for the tests"
        return (
            f"Looks are coarse: they are {in_unit(f'{resolution:g}', unit)} apart, with up to {most:.3g} events of a "
            f"channel between two. {rates}Tests of waits, drift, mixing and crowding may fail for this reason alone. "
            f"Look at shorter intervals: {finer}."
        )

    def table(self) -> list[dict[str, Any]]:
        """One row a channel."""
        return [each._asdict() for each in self.channels]


def _in_words(seen: LookedAt) -> str:
    right = "all is over by the first look" if seen.corrected is None else f"about {seen.corrected:.3g} would be right"
    size = f"{abs(seen.bias):.0%} too {'small' if seen.bias < 0 else 'large'}"
    return f"{seen.channel}: {seen.rate:.3g}, with {seen.fall:.2g} a look, is {size}; {right}"


def _parts(path: JumpPath) -> tuple[Exposure, Exposure, Exposure]:
    """Events and exposure of one run; the falls, and the rises, of each h by its events, times the resolution."""
    own = count(path)
    h = path.network.ways * path.network.combinations_of(path.states) * path.open_channels
    steps = path.resolution * np.diff(h, axis=0)[path.channels != RESTART]
    none = np.zeros_like(own.events)
    falls, rises = (np.clip(sign * steps, 0.0, None).sum(axis=0) for sign in (-1, 1))
    return own, Exposure(path.network, none, falls, path.tank), Exposure(path.network, none, rises, path.tank)


def _possible(path: JumpPath) -> tuple[Floats, Floats]:
    """Number of looks (R,) during which a channel could fire, and its events (R,)."""
    edges = np.concatenate([[0.0], path.times, [path.end]])
    can = (path.network.combinations_of(path.states) > 0) & path.open_channels
    fired = path.channels[path.channels != RESTART]
    events = np.bincount(fired, minlength=len(path.network.channels)).astype(float)
    return np.diff(edges) @ can / path.resolution, events
