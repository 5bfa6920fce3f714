"""Candidates of a network in a crowd, and which of them are kept: see `sampling.crowds`.

Without a crowd the `thinning` of a model is None. Each function then compiles to nothing, so it costs a kernel nothing.
"""

import numpy as np

from kinetics.kernels.blocks import BLOCK
from kinetics.kernels.compiled import compiled


@compiled
def candidates(thinning):
    """Candidates to each event at the low factors, and the first channel that the crowd changes."""
    if thinning is None:
        return 0.0, 0
    return thinning.ratio, thinning.first


@compiled
def add_candidates(thinning, within, upto, part, total, active):
    """Add the rate of candidates, 1/tu, to the totals of the lanes of `lockstep`; `part` is scratch."""
    if thinning is None:
        return
    last, ratio, lanes = thinning.first - 1, thinning.ratio, np.uint64(active)
    for lane in range(lanes):
        part[lane] = 0.0
    if last >= 0:
        for lane in range(lanes):
            part[lane] = within[np.uint64(last), lane]
    if last >= BLOCK:
        for lane in range(lanes):
            part[lane] += upto[np.uint64(last // BLOCK - 1), lane]
    for lane in range(lanes):
        total[lane] += ratio * (total[lane] - part[lane])


@compiled
def keep_candidates(thinning, first, within, upto, counts, target, chosen, active):
    """Choose the channels of the lanes of `lockstep` that drew a candidate, which come with a channel of no change."""
    if thinning is None:
        return
    n_channels = within.shape[0]
    for lane in range(active):
        if chosen[lane] == n_channels and target[lane] < float("inf"):
            beyond = target[lane] - upto[upto.shape[0] - 1, lane]
            chosen[lane] = kept_channel(thinning, first, within[:, lane], counts[:, lane], beyond, n_channels)


@compiled
def kept_channel(thinning, first, within, copies, beyond, n_channels):
    """The channel of a candidate that is kept, or `n_channels` for one that is not.

    first (G,), copies (S + 1,) : see `sampling.merging.MergedChannels`; counts as floats
    within (G,) : running sums of the propensities in blocks
    beyond : how far a uniform share of events and candidates lies beyond the events
    """
    if thinning is None:
        return n_channels
    # The place within its channel that the share has left over is itself uniform: no other number is drawn.
    target = beyond
    surface = surface_of(thinning, copies)
    for g in range(thinning.first, n_channels):
        part = within[g]
        if g % BLOCK > 0:
            part -= within[g - 1]
        part *= thinning.ratio
        if target < part:
            k, end = thinning.spans[g], thinning.spans[g + 1]
            if end - k == 1:
                part *= 1.0 / thinning.ratio
            else:  # the channel that is thinned is one of those merged
                own = copies[first[g]]
                while True:
                    part = thinning.coefficients[k] * own * (copies[thinning.partners[k]] - thinning.less[k])
                    whole = thinning.ratio * part * (1.0 + thinning.slopes[k] * surface)
                    if target < whole:
                        break
                    target -= whole
                    k += 1
                    if k == end:
                        return n_channels  # by rounding
            return g if target < part * share_kept(thinning, k, surface, copies) else n_channels
        target -= part
    return n_channels


@compiled
def surface_of(thinning, copies):
    """The surface s of all bodies at `copies` (S + 1,)."""
    surface = 0.0
    for s in range(thinning.weights.size):
        surface += thinning.weights[s] * copies[s]
    return surface


@compiled
def share_kept(thinning, k, surface, copies):
    """(f - low factor) / (low factor at s = 0) of channel k, one of those before merging."""
    filled = 0.0
    for s in range(thinning.volumes.size):
        filled += thinning.volumes[s] * copies[s]
    per_free, share = 1.0 / (1.0 - filled), 0.0
    z = surface * per_free
    for d in range(thinning.factors.shape[1] - 1, 0, -1):  # Horner's rule
        share = share * z + thinning.factors[k, d]
    return share * per_free + thinning.factors[k, 0] - thinning.slopes[k] * surface


@compiled
def true_share(thinning, k, copies):
    """The rate of channel k at `copies` (S + 1,), in units of that at its low factor at s = 0."""
    if thinning is None:
        return 1.0
    surface = surface_of(thinning, copies)
    return 1.0 + thinning.slopes[k] * surface + share_kept(thinning, k, surface, copies)
