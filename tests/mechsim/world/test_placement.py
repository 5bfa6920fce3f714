"""Starting places: no overlaps, up to the paper's densest tank."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from mechsim.kernels.contact import cubes_overlap


def apart(a, axes_a, b, axes_b, half):
    """Distance of two cubes by least squares over a point in each: an oracle that knows no separating axis."""
    fit = lsq_linear(np.hstack([axes_a, -axes_b]), b - a, bounds=(-half, half), tol=1e-14)
    return np.linalg.norm(fit.fun)


def test_overlap_agrees_with_the_distance_of_two_convex_bodies():
    rng = np.random.default_rng(8)
    verdicts = []
    for _ in range(400):
        a, b = rng.uniform(-1, 1, (2, 3))
        axes_a, axes_b = (np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(2))
        distance = apart(a, axes_a, b, axes_b, 0.5)
        verdicts.append(cubes_overlap(a, axes_a, b, axes_b, 0.5, 0.5))
        assert verdicts[-1] == (distance < 1e-6)
    assert 50 < sum(verdicts) < 390


@pytest.mark.parametrize("start", [{"monomer": 120}, {"quadmer": 20, "trimer": 10, "monomer": 10}])
def test_120_cubes_of_edge_a_quarter_find_places(make_world, line4, start):
    large = line4.replace(cubes=line4.cubes.replace(edge=0.25))
    world = make_world(start, large)
    b = world.bodies
    assert (np.abs(b.centre) <= np.array([1, 1, 1.5])).all()
    for i in range(b.n_cubes):
        for j in range(i):
            if b.body[i] != b.body[j] and np.linalg.norm(b.centre[i] - b.centre[j]) < 0.25 * 3**0.5:
                assert apart(b.centre[i], b.axes[i], b.centre[j], b.axes[j], 0.125) > 0
    for _ in range(50):
        world.step()  # and they move without a guard's word


def test_places_are_uniform_over_the_tank(make_world):
    places = np.concatenate([make_world({"monomer": 60}, seed=s).bodies.centre for s in range(20)])
    # Uniform on (-1, 1) but for the margin that corners need: mean 0, and halves equally full (false alarm 1e-6).
    for axis in range(3):
        assert abs((places[:, axis] > 0).mean() - 0.5) < 4.9 * 0.5 / len(places) ** 0.5
    orientation = np.concatenate([make_world({"monomer": 60}, seed=s).bodies.axes[:, 2, 2] for s in range(20)])
    assert abs(np.mean(orientation**2) - 1 / 3) < 4.9 * (4 / 45 / len(orientation)) ** 0.5
