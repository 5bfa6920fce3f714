"""Results as tables for pandas and as labelled arrays for xarray."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from kinetics.support.arrays import Floats
from kinetics.support.packages import extra, pd

if TYPE_CHECKING:
    import xarray as xr


def dataframe(table: Any, columns: list[str] | None = None) -> pd.DataFrame:
    """A DataFrame of columns, name -> values, or of a sequence of rows."""
    return pd.DataFrame(table, columns=columns)


def dataframe_over_times(
    times: Floats, what: str, names: Sequence[str], figures: Mapping[str, np.ndarray[Any, Any]]
) -> pd.DataFrame:
    """One row per time and name, the latter in the column `what`; figures, name -> (T, S)."""
    keys = {"time": np.repeat(times, len(names)), what: list(names) * times.size}
    return dataframe(keys | {name: values.ravel() for name, values in figures.items()})


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
    places = {name: (name, values) for name, values in coordinates.items()}
    found: xr.Dataset = extra("xarray").Dataset(dict(variables), places, facts)
    if time_unit and "time" in found.coords:
        found["time"].attrs["units"] = time_unit
    return found
