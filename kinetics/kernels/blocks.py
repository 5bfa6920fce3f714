"""Propensities summed in blocks of channels, in the same order by every kernel of the direct method.

The runs of all these kernels therefore agree to the last bit, and the walk to the channel that fires is short.
"""

from kinetics.kernels.compiled import compiled

BLOCK = 8


@compiled
def factored(coefficient, factors, r, counts):
    """Propensity of a channel of any order by its factors, see `sampling.mass_action`; slow."""
    propensity = coefficient
    for j in range(factors.shape[1]):
        copies = counts[factors[r, j, 0]]
        propensity *= (copies - factors[r, j, 1]) if copies >= factors[r, j, 2] else 0
    return propensity


@compiled
def block_at(upto, target, total):
    """The block in which a share `target` of the total lies, and how far into it.

    upto : (B,) running sums over the blocks
    """
    block = 0
    while upto[block] <= target and upto[block] < total:
        block += 1
    return block, (target - upto[block - 1] if block > 0 else target)


@compiled
def channel_at(propensities, sums, upto, target, total):
    """The channel in which a share `target` of the total lies: Gillespie (1977), eq. 21b.

    propensities : (R,), sums : (B,) of each block, upto : (B,) running
    """
    block, target = block_at(upto, target, total)
    chosen = BLOCK * block
    part = propensities[chosen]
    while part <= target and part < sums[block]:
        chosen += 1
        part += propensities[chosen]
    return chosen
