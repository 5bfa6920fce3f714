"""Models of crowding compared on logs of hits: the right one is chosen, with stated power."""

import numpy as np
import pytest
from hit_studies import RADIUS, SURFACE, VOLUME, hits

from calibration.estimating.crowding_comparison import CrowdingComparison
from kinetics.rates.crowding import ConvexBodies

BODIES = ConvexBodies(RADIUS, SURFACE, VOLUME)


def room(x, y, tank):
    """A pair in contact has the room of its union: densities of pairs are larger in a small tank."""
    size, wide = np.array(tank.size), 2 * RADIUS
    union = wide[x] + wide[y] - 2 * RADIUS[x] * RADIUS[y] / (RADIUS[x] + RADIUS[y])
    return tank.volume * np.prod(size - union) / np.prod(size - wide[x]) / np.prod(size - wide[y])


def compared(seed, time, **truth):
    return CrowdingComparison.of(hits(np.random.default_rng(seed), time, **truth), BODIES)


TRUTHS = {
    "none": {"hard": False},
    "hard-bodies": {"room": room},
    "three-body": {"room": room, "third": 0.5},
}


@pytest.mark.parametrize("name", list(TRUTHS))
def test_the_right_model_is_chosen(name):
    """8 logs of some 80,000 hits: power above .9 for each truth; one wrong choice in eight is allowed."""
    right = {"bodies": 0, "walls": 0}
    for seed in range(8):
        chosen = compared(seed, 1000.0, **TRUTHS[name]).chosen
        for source in right:
            right[source] += chosen[source].model == name
    assert min(right.values()) >= 7, right


def test_the_right_model_leaves_no_scatter_between_tanks():
    """chi-square keeps to its degrees of freedom at 1e-6; mass action, the control, is far off, as are its ratios."""
    fits = {(fit.source, fit.model): fit for fit in compared(1, 1000.0, room=room, third=0.5).fits}
    for source in ("bodies", "walls"):
        right, wrong = fits[source, "three-body"], fits[source, "none"]
        assert right.chi_square[2] > 1e-6 > wrong.chi_square[2]
        assert right.chi_square[1] == 5
        assert wrong.chi_square[1] == 6
        assert all(abs(row.ratio - 1) < 0.1 for row in right.tanks)
        assert max(row.ratio for row in wrong.tanks) > 1.2
        assert sum(row.low <= 1 <= row.high for row in right.tanks) >= 5
