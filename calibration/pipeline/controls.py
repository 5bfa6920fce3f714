"""Controls of a plan: rates that must break its rules, or these could not fail wrong rates."""

from __future__ import annotations

from collections.abc import Sequence

from kinetics.rates import ClassRates, Rates


def load_controls(names: Sequence[str], rates: Rates | ClassRates) -> dict[str, Rates]:
    """Rates that must fail, by what sets them apart from the `rates` that are judged; none for rates by class.

    names : shipped tables, or files
    ValueError: rates with the break model and crowding of those that are judged

    >>> from calibration.pipeline.controls import load_controls
    >>> from kinetics.rates import Rates
    >>> load_controls([], Rates.load("table3"))
    {}
    """
    found = {}
    for name in names:
        control = Rates.load(name)
        if isinstance(rates, Rates):
            apart = [f"{control.breaks.model} breaks"] if control.breaks.model != rates.breaks.model else []
            apart += ["no crowding"] if rates.crowding is not None and control.crowding is None else []
            if not apart:
                raise ValueError(
                    f"--control {name}: {rates.breaks.model} breaks and crowding, as the rates that are judged; give "
                    "rates fitted with another break model, or without crowding"
                )
            found[" and ".join(apart)] = control
    return found
