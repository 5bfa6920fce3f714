"""Kinds of data that others recorded, one file each; a kind imported here is an option of `wellmixed calibrate`."""

# ruff: noqa: F401, I001 - the imports are the list, in this order

from calibration.observed.kinds.base import DataKind
from kinetics.support.families import members

from calibration.observed.kinds.events import Events
from calibration.observed.kinds.counts import Counts
from calibration.observed.kinds.snapshots import Snapshots

DATA_KINDS: tuple[type[DataKind], ...] = tuple(members(globals(), DataKind))
