"""Paths of a network in which breaks have partners, as the mechanics would record them."""

import numpy as np

from kinetics.rates.breaks.base import ALONE, WALL
from kinetics.runs import BY_UNKNOWN, BY_WALL, NO_BREAK, RESTART, JumpPath


def on_base(expansion, path):
    """A path of the expanded network as a path of the base, which keeps who broke what as `partners`."""
    channels = np.where(path.channels == RESTART, RESTART, np.append(expansion.base_of, RESTART)[path.channels])
    is_open = np.zeros(len(expansion.base.channels), dtype=bool)
    np.logical_or.at(is_open, expansion.base_of, path.open_channels)
    partners = None
    if expansion.network is not expansion.base:
        numbers = expansion.base.species_places | {WALL: BY_WALL, ALONE: BY_UNKNOWN}
        named = [numbers[name] for name in expansion.model.partners(expansion.base)]
        of_channel = np.where(expansion.partner_of < 0, NO_BREAK, np.array(named)[expansion.partner_of])
        partners = np.append(of_channel, NO_BREAK)[path.channels]
    said = path.tank, partners, path.resolution
    return JumpPath(expansion.base, path.initial, path.times, channels, path.end, is_open, *said)
