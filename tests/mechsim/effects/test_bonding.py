"""Bonding: which faces see each other, what a meeting is, and what a bond does."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest

from mechsim.effects.latches import Encounter, MagnetDelay
from mechsim.kernels.contact import facing_pairs
from mechsim.world.bodies import matrix_of

EDGE, CAPTURE, SIDEWAYS = 0.15, 0.02, 0.075
COSINE = math.cos(math.radians(45))


def find(centre, axes, body=None, before=None, born=None, sideways=SIDEWAYS):
    """Pairs within reach; before: centres and axes at the last look, at time 1; born: of the bodies, else long ago."""
    n = len(centre)
    found = np.zeros((200, 4), np.int64)
    body = np.arange(n) if body is None else np.array(body)
    centre, axes = np.array(centre, float), np.array(axes, float)
    last = (centre, axes) if before is None else tuple(np.array(item, float) for item in before)
    count = facing_pairs(
        body, centre, axes, np.zeros((n, 6), np.int64), np.ones((1, 1), bool),
        EDGE, CAPTURE, COSINE, sideways, np.zeros(n) if born is None else np.array(born, float),
        -math.inf if before is None else 1.0, *last, 1 / 64, np.arange(n)[::-1].copy(), np.ones(n, bool), found,
    )  # fmt: skip
    return {tuple(row) for row in found[:count].tolist()}


def turned(axis, degrees):
    half = math.radians(degrees) / 2
    return matrix_of(np.append(math.sin(half) * np.eye(3)[axis], math.cos(half)))


@pytest.mark.parametrize(
    ("gap", "sideways", "tilt", "captured"),
    [
        (0.0, 0, 0, True),
        (0.019, 0, 0, True),
        (0.021, 0, 0, False),
        (0.0, 0.074, 0, True),
        (0.0, 0.076, 0, False),
        (0.0, 0, 44, True),
        (0.0, 0, 46, False),
    ],
)
def test_capture_limits(gap, sideways, tilt, captured):
    # Two cubes on the z axis, the upper one tilted; the gap is measured between supports along the bisecting normal.
    normal = turned(0, tilt / 2) @ [0, 0, 1]
    across = turned(0, tilt / 2) @ [0, 1, 0]
    lower, upper = np.eye(3), turned(0, tilt)
    support = sum(0.5 * EDGE * np.abs(normal @ axes).sum() for axes in (lower, upper))
    pairs = find([[0, 0, 0], (support + gap) * normal + sideways * across], [lower, upper])
    assert ((0, 4, 1, 5) in pairs) == captured
    assert pairs <= {(0, 4, 1, 5)}


def test_cubes_of_one_body_are_never_a_pair():
    assert find([[0, 0, 0], [0, 0, EDGE]], [np.eye(3)] * 2, body=[0, 0]) == set()


def naive(centre, axes):
    pairs = set()
    for i, j in itertools.combinations(range(len(centre)), 2):
        between = centre[j] - centre[i]
        for f, g in itertools.product(range(6), repeat=2):
            a = axes[i][:, f // 2] * (1, -1)[f % 2]
            b = axes[j][:, g // 2] * (1, -1)[g % 2]
            n = (a - b) / np.linalg.norm(a - b) if np.linalg.norm(a - b) else a
            along = between @ n
            supports = EDGE / 2 * (np.abs(axes[i].T @ n).sum() + np.abs(axes[j].T @ n).sum())
            if (
                a @ b <= -COSINE and a @ between > 0 and along > 0
                and np.linalg.norm(between - along * n) <= SIDEWAYS and along - supports <= CAPTURE
            ):  # fmt: skip
                pairs.add((i, f, j, g))
    return pairs


def test_kernel_equals_a_naive_search():
    rng = np.random.default_rng(4)
    seen = 0
    for _ in range(150):
        centre = rng.uniform(-0.2, 0.2, (8, 3))
        axes = [np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(8)]
        expected = naive(centre, axes)
        seen += len(expected)
        assert find(centre, axes) == expected
    assert seen > 200


def test_cubes_without_a_face_that_may_pair_are_passed_over_and_nothing_is_missed(make_world, line4):
    """Structures close together, so many that some of each pair; a whole line of four may pair with nothing."""
    world = make_world({"monomer": 40, "dimer": 20, "trimer": 10, "quadmer": 10}, line4.without("breaking"))
    b, action = world.bodies, next(part.__self__ for name, part in world.parts if name == "bonding")
    faces = action.faces
    sizes = np.array([len(b.members[slot]) for slot in b.body])
    assert not faces.is_open[sizes == 4].any()
    assert faces.is_open[sizes == 1].all()
    assert 0 < faces.is_open[sizes == 3].sum() < 30
    b.position[b.live] *= 0.2
    b.locate()
    faces.looked = -math.inf
    seen = faces.within_reach().tolist()
    faces.looked, faces.is_open = -math.inf, np.ones(b.n_cubes, bool)
    assert faces.within_reach().tolist() == seen
    assert len(seen) > 20


def fake_world(step=0.005):
    bodies = SimpleNamespace(born=np.zeros(2), body=np.arange(2))
    return SimpleNamespace(time=1.0, step_size=step, bodies=bodies)


def test_a_meeting_is_drawn_once_while_faces_rattle():
    world = fake_world()
    meetings = Encounter(probability=0.5, refractory=0.05).attach(world, np.random.default_rng(1))
    answers = []
    for k in range(40):  # in reach every fourth step
        world.time = 1.0 + 0.02 * k
        answers.append(meetings((0, 4, 1, 5)))
    assert meetings.begun == 1
    assert len(set(answers)) == 1
    world.time += 0.051  # out of reach for longer than the refractory time
    meetings((0, 4, 1, 5))
    assert meetings.begun == 2


def test_faces_that_have_just_parted_have_not_met():
    world = fake_world()
    meetings = Encounter(probability=1.0).attach(world, np.random.default_rng(1))
    world.bodies.born[:] = 1.0
    assert not meetings((0, 4, 1, 5))
    for _ in range(20):
        world.time += world.step_size
        assert not meetings((0, 4, 1, 5))  # still the same closeness
    assert meetings.begun == 0
    world.time += 1.0
    assert meetings((0, 4, 1, 5))


def test_magnet_delay_is_exponential():
    world = fake_world(step=0.01)
    latch = MagnetDelay(rate=5.0).attach(world, np.random.default_rng(2))
    waits = []
    for _ in range(20_000):
        steps = 1
        while not latch((0, 4, 1, 5)):
            steps += 1
        waits.append(steps * 0.01)
    mean = 0.01 / -math.expm1(-0.05)  # of the geometric law
    assert abs(np.mean(waits) - mean) < 5.3 * mean / math.sqrt(20_000)  # false alarm 1e-7
    survivors = np.mean(np.array(waits) > 0.4)
    assert abs(survivors - math.exp(-2)) < 5.3 * math.sqrt(0.12 / 20_000)


def drive_together(make_world, scene, seed=1):
    """Two free cubes that fly at each other, top face to bottom face."""
    world = make_world({"monomer": 2}, scene.without("agitation", "drag", "walls", "breaking"), seed)
    b = world.bodies
    for slot, sign in zip(b.live.tolist(), (1, -1), strict=True):
        b.position[slot], b.orientation[slot] = [0, 0, -0.3 * sign], [0, 0, 0, 1]
        b.velocity[slot], b.spin[slot] = [0.05 * sign, 0, 1.0 * sign], [0, 0, 0.5]
        world.engine.put(slot)
    b.locate()
    before = b.momentum()
    for _ in range(60):
        world.step()
    np.testing.assert_allclose(b.momentum()[0], before[0], atol=1e-16)
    return world


def test_a_bond_makes_one_body_with_cubes_one_edge_apart(make_world, line4, derivation):
    world = drive_together(make_world, line4.changed("bonding", latch={"kind": "encounter", "probability": 1.0}))
    b = world.bodies
    (slot,) = b.live
    assert derivation.species_of(b.held(slot)) == 1
    assert b.held(slot).letters == ("b", "b")
    assert np.linalg.norm(b.centre[0] - b.centre[1]) == pytest.approx(b.edge)


def test_without_bonding_or_with_a_tiny_chance_they_only_bounce(make_world, line4):
    rare = line4.changed("bonding", latch={"kind": "encounter", "probability": 1e-12})
    assert len(drive_together(make_world, line4.without("bonding")).bodies.live) == 2
    assert len(drive_together(make_world, rare).bodies.live) == 2


def test_a_third_body_in_the_way_makes_the_snap_wait(make_world, line4, derivation):
    world = make_world({"monomer": 3}, line4.without("agitation", "drag", "walls", "breaking", "bonding"))
    b = world.bodies
    tilt = turned(0, 40)
    poses = [((0, 0, 0), np.eye(3)), ((0, -0.05, 0.17), tilt), ((0, 0.11, 0.2), np.eye(3))]
    from mechsim.world.bodies import quaternion_of

    for slot, (place, axes) in zip(b.live.tolist(), poses, strict=True):
        b.position[slot], b.orientation[slot] = place, quaternion_of(axes)
        world.engine.put(slot)
    b.locate()
    docking = world.docking(0, 4, 1, 5)
    assert docking is not None
    assert not world.fits(*docking)
    b.position[2] = [0.6, 0.6, 0.6]
    world.engine.put(2)
    b.locate()
    assert world.fits(*docking)
