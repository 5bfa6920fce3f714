"""The usual rate laws by name, each a function that returns an `Expression`.

To add one, write its function, with an example at the end of its docstring, and put it into `LAWS`: the contract in
tests/contracts/test_laws.py reads both.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

from kinetics.network.laws.expression import Expression
from kinetics.network.laws.writing import quoted


def mass_action(k: float, reactants: Mapping[str, int]) -> Expression:
    """Mass action, k times the number of combinations of reactants: k * A * (A - 1) / 2 for two of A.

    As an expression it costs more per event than a rate constant; it is a starting point for other rate laws.

    >>> from kinetics.network.laws import mass_action
    >>> mass_action(0.3, {"A": 2, "B": 1}).text
    'k * A * (A - 1) * B / 2'
    """
    return Expression(f"k{_combinations(reactants)}", {"k": _positive("k", k)})


def michaelis_menten(substrate: str, vmax: float, K: float, enzyme: str | None = None) -> Expression:
    """Michaelis-Menten kinetics, vmax * S / (K + S), K in copies; with an enzyme, vmax is per copy of it (1913).

    >>> from kinetics.network.laws import michaelis_menten
    >>> michaelis_menten("S", vmax=2.0, K=10.0, enzyme="E").text
    'vmax * E * S / (K + S)'
    """
    s = quoted(substrate)
    front = "vmax * " if enzyme is None else f"vmax * {quoted(enzyme)} * "
    return Expression(f"{front}{s} / (K + {s})", {"vmax": _positive("vmax", vmax), "K": _above_0("K", K)})


def hill(activator: str, vmax: float, K: float, n: float, basal: float = 0.0) -> Expression:
    """Hill activation, basal + vmax * A**n / (K**n + A**n), with half its effect at K copies (Hill 1910).

    >>> from kinetics.network.laws import hill
    >>> hill("A", vmax=2.0, K=10.0, n=4.0, basal=0.1).text
    'basal + vmax * A ** n / (K ** n + A ** n)'
    """
    a = quoted(activator)
    return Expression(f"basal + vmax * {a} ** n / (K ** n + {a} ** n)", _hill(vmax, K, n, basal))


def hill_repression(repressor: str, vmax: float, K: float, n: float, basal: float = 0.0) -> Expression:
    """Hill repression, basal + vmax / (1 + (R / K)**n), with half its effect at K copies.

    >>> from kinetics.network.laws import hill_repression
    >>> hill_repression("R", vmax=2.0, K=10.0, n=4.0, basal=0.1).text
    'basal + vmax / (1 + (R / K) ** n)'
    """
    return Expression(f"basal + vmax / (1 + ({quoted(repressor)} / K) ** n)", _hill(vmax, K, n, basal))


def steps_in_count(species: str, counts: Sequence[int], rates: Sequence[float]) -> Expression:
    """A stepwise rate: rates[0] below counts[0] copies, then rates[1] below counts[1], and so on; one rate more.

    >>> from kinetics.network.laws import steps_in_count
    >>> steps_in_count("A", counts=[3, 20], rates=[1.0, 4.0, 0.5]).text
    'piecewise(1.0, A < 3.0, 4.0, A < 20.0, 0.5)'
    """
    return _steps(quoted(species), "counts", counts, rates)


def steps_in_time(times: Sequence[float], rates: Sequence[float], reactants: Mapping[str, int]) -> Expression:
    """Mass action whose rate constant is rates[0] before times[0] tu, then rates[1], and so on; one rate more.

    >>> from kinetics.network.laws import steps_in_time
    >>> steps_in_time(times=[5.0, 12.0], rates=[1.0, 0.0, 3.0], reactants={"A": 2}).text
    'piecewise(1.0, t < 5.0, 0.0, t < 12.0, 3.0) * A * (A - 1) / 2'
    """
    stepped = _steps("t", "times", times, rates)
    return Expression(f"{stepped.text}{_combinations(reactants)}")


def periodic(k: float, amplitude: float, period: float, reactants: Mapping[str, int], peak: float = 0.0) -> Expression:
    """Mass action whose rate constant is k * (1 + amplitude * cos(2 pi (t - peak) / period)); amplitude up to 1.

    >>> from kinetics.network.laws import periodic
    >>> periodic(k=2.0, amplitude=0.5, period=24.0, reactants={"A": 1}, peak=6.0).text
    'k * (1 + amplitude * cos(2 * pi * (t - peak) / period)) * A'
    """
    if not 0 <= amplitude <= 1:
        raise ValueError(f"amplitude = {amplitude}; expected between 0 and 1, so that the rate is never below 0")
    values = {"k": _positive("k", k), "amplitude": amplitude, "period": _above_0("period", period), "peak": peak}
    wave = "k * (1 + amplitude * cos(2 * pi * (t - peak) / period))"
    return Expression(f"{wave}{_combinations(reactants)}", values)


LAWS: tuple[Callable[..., Expression], ...] = (
    mass_action,
    michaelis_menten,
    hill,
    hill_repression,
    steps_in_count,
    steps_in_time,
    periodic,
)


def _combinations(reactants: Mapping[str, int]) -> str:
    """Factors after a rate: sets of like copies."""
    factors = []
    for species, copies in reactants.items():
        if not isinstance(copies, int) or copies < 1:
            raise ValueError(f"{copies!r} copies of {species!r}; expected a whole number of at least 1")
        name = quoted(species)
        factors += [name, *(f"({name} - {i})" for i in range(1, copies))]
    parts = math.prod(math.factorial(copies) for copies in reactants.values())
    return "".join(f" * {factor}" for factor in factors) + (f" / {parts}" if parts > 1 else "")


def _steps(of: str, what: str, places: Sequence[float], rates: Sequence[float]) -> Expression:
    if len(rates) != len(places) + 1 or not places:
        raise ValueError(
            f"{len(places)} {what} and {len(rates)} rates; expected one more rate, and at least one of each"
        )
    if not all(one < other for one, other in pairwise(places)):
        raise ValueError(f"{what} must rise; {list(places)} came")
    if not all(math.isfinite(place) for place in places):
        raise ValueError(f"{what} = {list(places)}; expected finite numbers")
    values = [_positive("rates", rate) for rate in rates]
    pieces = [f"{value!r}, {of} < {float(place)!r}" for value, place in zip(values, places, strict=False)]
    return Expression(f"piecewise({', '.join(pieces)}, {values[-1]!r})")


def _hill(vmax: float, K: float, n: float, basal: float) -> dict[str, float]:
    values = {"vmax": _positive("vmax", vmax), "K": _above_0("K", K), "n": _above_0("n", n)}
    return values | {"basal": _positive("basal", basal)}


def _positive(name: str, value: float) -> float:
    if not (math.isfinite(value) and value >= 0):
        raise ValueError(f"{name} = {value}; expected a finite number of at least 0")
    return float(value)


def _above_0(name: str, value: float) -> float:
    if not (math.isfinite(value) and value > 0):
        raise ValueError(f"{name} = {value}; expected a finite number above 0")
    return float(value)
