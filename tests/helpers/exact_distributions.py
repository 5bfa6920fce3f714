"""Small systems and their exact distributions by mpmath, to a hundred digits.

The states, combinations and matrices are made here anew, from the reactions alone.
"""

from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from math import comb

import mpmath
import numpy as np
from known_systems import network

from kinetics import Network

DIGITS = 100


@dataclass(frozen=True)
class System:
    """A network with its start, a time, and a species whose first `copies` are waited for."""

    name: str
    net: Network
    start: tuple[int, ...]
    time: float
    waited: str
    copies: int = 1


def system(name, start, time, waited, copies, species, **reactions):
    """Rates are powers of two or sums of few, so that they are the same numbers everywhere."""
    sides = {channel: (before, after) for channel, (before, after, _) in reactions.items()}
    rates = [rate for _, _, rate in reactions.values()]
    return System(name, network(species, sides, rates), start, time, waited, copies)


STIFF = system(
    "stiff", (2, 0, 0), 0.5, "C", 2, "ABC",
    ab=((1, 0, 0), (0, 1, 0), 2.0**30), ba=((0, 1, 0), (1, 0, 0), 2.0**29), leak=((0, 1, 0), (0, 0, 1), 2.0**-10),
)  # fmt: skip
DECOMPOSABLE = system(
    "nearly decomposable", (1, 0, 0, 0), 8.0, "D", 1, "ABCD",
    ab=((1, 0, 0, 0), (0, 1, 0, 0), 1.0), ba=((0, 1, 0, 0), (1, 0, 0, 0), 2.0),
    ac=((1, 0, 0, 0), (0, 0, 1, 0), 2.0**-50), ca=((0, 0, 1, 0), (1, 0, 0, 0), 3 * 2.0**-50),
    cd=((0, 0, 1, 0), (0, 0, 0, 1), 5.0), dc=((0, 0, 0, 1), (0, 0, 1, 0), 7.0),
)  # fmt: skip
REDUCIBLE = system(
    "reducible", (2, 0, 0, 0), 3.0, "D", 1, "ABCD",
    pair=((1, 0, 0, 0), (0, 1, 0, 0), 1.0), trap=((1, 0, 0, 0), (0, 0, 0, 1), 3.0),
    bc=((0, 1, 0, 0), (0, 0, 1, 0), 2.0), cb=((0, 0, 1, 0), (0, 1, 0, 0), 8.0),
)  # fmt: skip
DIMERS = system(
    "dimers", (9, 0), 2.0, "B", 4, "AB", join=((2, 0), (0, 1), 0.125), part=((0, 1), (2, 0), 0.5)
)  # fmt: skip
TRIMERS = system(
    "trimers", (6, 0, 0), 1.0, "B", 2, "ABC",
    join=((3, 0, 0), (0, 1, 0), 0.0625), part=((0, 1, 0), (3, 0, 0), 0.25),
    turn=((1, 0, 0), (0, 0, 1), 1.0), back=((0, 0, 1), (1, 0, 0), 2.0),
)  # fmt: skip
ENZYME = system(
    "enzyme", (2, 4, 0, 0), 4.0, "P", 4, "ESCP",
    bind=((1, 1, 0, 0), (0, 0, 1, 0), 0.5), free=((0, 0, 1, 0), (1, 1, 0, 0), 1.0),
    make=((0, 0, 1, 0), (1, 0, 0, 1), 0.25),
)  # fmt: skip
SYSTEMS = (STIFF, DECOMPOSABLE, REDUCIBLE, DIMERS, TRIMERS, ENZYME)


def explored(system):
    """Reachable states in order of discovery, and {(from, to): rate} in exact fractions."""
    net, states, rates = system.net, {system.start: 0}, {}
    queue = [system.start]
    for state in queue:
        for needed, change, rate in zip(net.reactants, net.stoichiometry, net.rate_constants, strict=True):
            ways = np.prod([comb(have, need) for have, need in zip(state, needed.tolist(), strict=True)], dtype=object)
            if not ways:
                continue
            after = tuple(int(x) for x in np.array(state) + change)
            if after not in states:
                states[after] = len(states)
                queue.append(after)
            step = (states[state], states[after])
            rates[step] = rates.get(step, 0) + Fraction(float(rate)) * int(ways)
    return list(states), rates


def matrix(n, rates):
    """The generator in mpmath's numbers; rows sum to zero."""
    generator = mpmath.matrix(n)
    for (i, j), rate in rates.items():
        exact = mpmath.mpf(rate.numerator) / rate.denominator
        generator[i, j] += exact
        generator[i, i] -= exact
    return generator


@cache
def transient_distribution(system, time):
    """Probabilities by mpmath's matrix exponential, 100 digits: {state: mpf}."""
    with mpmath.workdps(DIGITS):
        states, rates = explored(system)
        law = mpmath.expm(matrix(len(states), rates) * mpmath.mpf(time))[0, :]
        return {state: law[i] for i, state in enumerate(states)}


def blurred(net, by):
    """The same network with rates wrong by up to a few times `by`."""
    return net.with_rates(net.rate_constants * (1 + by * np.arange(len(net.channels))))


def summed_error(law, t, exact):
    """Sum over all states of the two distributions; a state that only one has counts in full."""
    found = dict(zip(map(tuple, law.space.states.tolist()), law.probabilities[t].tolist(), strict=True))
    with mpmath.workdps(DIGITS):
        return float(sum(abs(mpmath.mpf(found.get(state, 0.0)) - p) for state, p in exact.items())) + sum(
            p for state, p in found.items() if state not in exact
        )


def relative_errors(found, exact):
    """Relative error of each; 0 where both are 0."""
    with mpmath.workdps(DIGITS):
        pairs = ((mpmath.mpf(float(a)), mpmath.mpf(b)) for a, b in zip(found, exact, strict=True))
        return np.array([float(abs(a - b) / b) if b else float(abs(a)) for a, b in pairs])
