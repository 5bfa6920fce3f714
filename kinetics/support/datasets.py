"""Results as labelled arrays, for xarray."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from kinetics.support.packages import extra

if TYPE_CHECKING:
    import xarray as xr


def dataset(
    variables: Mapping[str, tuple[tuple[str, ...], Any]],
    coordinates: Mapping[str, Any],
    time_unit: str = "",
    **facts: str | int | float,
) -> xr.Dataset:
    """A Dataset of variables, name -> (dimensions, array), over coordinates, dimension -> its values.

    time_unit : of the coordinate `time`, if it is known
    facts : attributes of the whole
    """
    xarray = extra("xarray")
    found = xarray.Dataset(dict(variables), {name: (name, values) for name, values in coordinates.items()}, facts)
    if time_unit and "time" in found.coords:
        found["time"].attrs["units"] = time_unit
    return found
