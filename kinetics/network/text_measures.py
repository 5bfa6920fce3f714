"""The volume and the unit of time of a text of reactions, and what its numbers with units are in them."""

from __future__ import annotations

from math import isfinite

from kinetics.network.source_spans import SourceSpan
from kinetics.network.units import AVOGADRO, TIMES, VOLUME, Measured, kind_text, quantity_in


class Measures:
    """The volume and the unit of time of one text.

    time_unit : as the text states it; "" if it does not, and then that of its first number with a unit of time
    notes : the volume, and what was rounded, for people

    >>> measures = Measures()
    >>> measures.set_volume(SourceSpan(1, "volume = 1 fL", 9, "1 fL"))
    >>> round(measures.factor(quantity_in("5 nM")), 6)  # copies in 1 nM
    0.602214
    """

    def __init__(self) -> None:
        self.time_unit = ""
        self.is_time_stated = False
        self.volume: float | None = None
        self.volume_text = ""
        self.notes: list[str] = []

    def state_time(self, unit: str) -> None:
        """Take the unit of time that the text states."""
        self.time_unit, self.is_time_stated = unit, True

    def set_volume(self, span: SourceSpan) -> None:
        """Take the volume that a span states. ValueError, with line and column, if it is none above 0."""
        if self.volume is not None:
            raise span.wrong(f"a volume, {self.volume_text}, is stated already; leave out one of the lines")
        given = span.located(lambda: quantity_in(span.text))
        if given is None or given.unit.kind != VOLUME:
            raise span.wrong(f"{span.text!r} is no volume; expected one such as 1 fL, 2 pL or 5 um^3")
        volume = given.value * given.unit.scale
        if not (volume * AVOGADRO > 0 and isfinite(volume * AVOGADRO)):
            raise span.wrong(f"the volume is {span.text}; expected one above 0")
        self.volume, self.volume_text = volume, span.text
        self.notes.append(f"volume {span.text}: 1 nM is {1e-9 * volume * AVOGADRO:.6g} copies")

    def factor(self, quantity: Measured) -> float:
        """What one of a quantity's unit is, in copies and units of time. ValueError if volume or time is missing."""
        unit = quantity.unit
        if unit.length:
            raise ValueError(f"a unit of {kind_text(unit.kind)}; expected one of concentration and time, such as /nM/s")
        factor = unit.scale
        if unit.amount:
            if self.volume is None:
                raise ValueError("a concentration, in a text without a volume; add a line such as 'volume = 1 fL'")
            factor *= _power(AVOGADRO * self.volume, unit.amount)
        if unit.time:
            factor /= TIMES[self._time(quantity)] ** unit.time
        if not (factor > 0 and isfinite(factor)):
            raise ValueError(f"one of its unit is {factor:g} in copies; expected a finite number above 0")
        return factor

    def _time(self, quantity: Measured) -> str:
        """The model's unit of time."""
        known = ", ".join(TIMES)
        if self.is_time_stated and self.time_unit not in TIMES:
            raise ValueError(f"the time unit is stated as {self.time_unit!r}; with units expected one of {known}")
        for name in quantity.times if not self.is_time_stated else ():
            if self.time_unit not in ("", name):
                raise ValueError(
                    f"units of time differ, {self.time_unit} and {name}; state that of the model, as by a line "
                    f"'time unit: {self.time_unit}'"
                )
            self.time_unit = name
        return self.time_unit


def _power(base: float, n: int) -> float:
    try:
        return float(base**n)
    except OverflowError:
        return float("inf")
