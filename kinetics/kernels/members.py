"""Which of the network's channels fires where several are merged into one: drawn by their shares of its propensity."""

from typing import Any, NamedTuple

import numpy as np

from kinetics.kernels.compiled import compiled
from kinetics.kernels.streams import next_word, start_stream, uniform
from kinetics.kernels.thinning import true_share

NAMING = 0xD1B54A32D192ED03  # told apart from the streams of events by these bits of the key


class Members(NamedTuple):
    """The channels of the network behind each merged channel.

    spans (G + 1,), channels (R,) : channel g stands for the network's channels[spans[g]] to channels[spans[g + 1]]
    weights, partners int32, less (R,) : the share of each is as weight * (x[partner] - less)
    thinning : of a network in a crowd, whose factors multiply the shares; else None
    """

    spans: np.ndarray
    channels: np.ndarray
    weights: np.ndarray
    partners: np.ndarray
    less: np.ndarray
    thinning: Any = None


@compiled
def start_naming(key, run, stream):
    """Start the stream that attributes channels in a run; the stream of its events is the same without it."""
    start_stream(key ^ np.uint64(NAMING), run, stream)


@compiled
def member_at(members, chosen, counts, stream):
    """The network's channel for the model's channel `chosen`, at `counts` (S + 1,); a draw only among several."""
    first, end = members.spans[chosen], members.spans[chosen + 1]
    if end - first == 1:
        return members.channels[first]
    # The members fire in proportion to weight * (x[partner] - less): the propensity without its common factor.
    total = 0.0
    for k in range(first, end):
        total += member_share(members, k, counts)
    word, stream[0], stream[1], stream[2], stream[3] = next_word(stream[0], stream[1], stream[2], stream[3])
    target, part = uniform(word) * total, 0.0
    for k in range(first, end):
        part += member_share(members, k, counts)
        if part > target or part == total:  # which rounding may have made the target
            return members.channels[k]
    return members.channels[end - 1]


@compiled
def member_share(members, k, counts):
    """The propensity of a merged channel without the factor that all have in common."""
    share = members.weights[k] * (counts[members.partners[k]] - members.less[k])
    return share * true_share(members.thinning, k, counts)


@compiled
def attribute_channels(members, changes, counts, chosen, stream):
    """Put the network's channels in the place of the model's.

    changes (G, S) : see `direct.advance`
    counts : (S + 1,) before the first event; changed in place
    chosen : (B,) the model's channels, changed in place
    stream : (4,) see `start_naming`; changed in place
    """
    for event in range(chosen.size):
        g = chosen[event]
        chosen[event] = member_at(members, g, counts, stream)
        for s in range(changes.shape[1]):
            counts[s] += changes[g, s]
