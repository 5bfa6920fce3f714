"""Contact points that our own engine remembers: what becomes of them, and what they do to bodies."""

import numpy as np
import pytest
from handling import act, collide, energy, put

from mechsim.kernels.contact_manifolds import update_manifolds
from mechsim.world.bodies import matrix_of
from mechsim.world.engines import own_engine
from mechsim.world.engines.base import LEAST_BOUNCE


@pytest.fixture(scope="session")
def line4(by_engine):
    """By this engine alone."""
    return by_engine("own")


# -- what is remembered, by an oracle that shares no code --------------------------------------------------------------


class Memory:
    """The same rules in plain words: of each pair, points as (place on the first, on the second, normal, gap)."""

    def __init__(self, breaking):
        self.breaking, self.points = breaking, {}

    def limit(self, one, two):
        return min(self.breaking[body] for body in (one, two) if body >= 0)

    def take(self, contacts, slot, pose):
        for boxes, place, outwards, depth in contacts:
            is_turned = 0 <= boxes[1] < boxes[0]
            (a, b), normal = (boxes[::-1], -outwards) if is_turned else (boxes, outwards)
            bodies = slot[a], slot[b] if b >= 0 else -1
            on_a, on_b = (pose.local(k, place + s * depth / 2 * normal) for k, s in zip(bodies, (-1, 1), strict=True))
            here = self.points.setdefault((a, b), [])
            side = 1 if b < 0 else 0
            new = (on_a, on_b, normal, -depth)
            apart = [np.linalg.norm(old[side] - new[side]) for old in here]
            if apart and min(apart) < self.limit(*bodies):
                here[int(np.argmin(apart))] = new
            elif len(here) < 4:
                here.append(new)
            else:
                here[self.least([old[side] for old in here], [old[3] for old in here], new[side], -depth)] = new
        for (a, b), here in self.points.items():
            bodies, kept = (slot[a], slot[b] if b >= 0 else -1), []
            for on_a, on_b, normal, _ in here:
                between = pose.world(bodies[0], on_a) - pose.world(bodies[1], on_b)
                gap = between @ normal
                if gap <= self.limit(*bodies) and np.linalg.norm(between - gap * normal) <= self.limit(*bodies):
                    kept.append((on_a, on_b, normal, gap))
            here[:] = kept

    @staticmethod
    def least(places, gaps, new, gap):
        spans = []
        for k in range(4):
            i, j, o = (n for n in range(4) if n != k)
            is_deepest = gaps[k] < gap and gaps[k] == min(gaps)
            spans.append(-1 if is_deepest else np.linalg.norm(np.cross(new - places[i], places[o] - places[j])))
        return int(np.argmax(spans))


class Pose:
    """Where bodies are."""

    def __init__(self, position, orientation):
        self.position, self.orientation = position, orientation

    def local(self, body, place):
        return place if body < 0 else matrix_of(self.orientation[body]).T @ (place - self.position[body])

    def world(self, body, place):
        return place if body < 0 else self.position[body] + matrix_of(self.orientation[body]) @ place


def followed(kernel, steps=150, told=1.0):
    """Five bodies, of which the second has the first two boxes, that tumble slowly among random contacts; what the
    kernel holds and what the oracle holds after each step; told : times the distance at which the oracle forgets."""
    rng = np.random.default_rng(1)
    slot, breaking = np.array([1, 1, 0, 2, 3, 4]), np.array([0.02, 0.03, 0.05, 0.04, 0.03])
    position, orientation = rng.standard_normal((5, 3)) * 0.05, rng.standard_normal((5, 4))
    orientation /= np.linalg.norm(orientation, axis=1)[:, None]
    n, room = 0, 40
    pair, count, point = np.zeros((room, 2), np.int64), np.zeros(room, np.int64), np.zeros((room, 4, 10))
    who, contact = np.zeros((4 * room, 4), np.int64), np.zeros((4 * room, 7))
    first, after, oracle = np.full(6, -1), np.zeros(room, np.int64), Memory(told * breaking)
    among = [(0, 2), (3, 1), (5, 4), (2, -1), (4, -6), (3, 2)]
    for _ in range(steps):
        position += 0.004 * rng.standard_normal((5, 3))
        orientation += 0.01 * rng.standard_normal((5, 4))
        orientation /= np.linalg.norm(orientation, axis=1)[:, None]
        made = []
        for boxes in rng.permutation(len(among))[: rng.integers(0, 4)]:
            normal = rng.standard_normal(3)
            normal /= np.linalg.norm(normal)
            made += [
                (among[boxes], 0.1 * rng.standard_normal(3), normal, rng.uniform(0, 0.02))
                for _ in range(rng.integers(1, 7))
            ]
        for c, (boxes, place, normal, depth) in enumerate(made):
            who[c] = slot[boxes[0]], slot[boxes[1]] if boxes[1] >= 0 else -1, *boxes
            contact[c] = *place, *normal, depth
        oracle.take(made, slot, Pose(position, orientation))
        n, found = kernel(
            len(made), who, contact, slot, breaking, position, orientation, n, pair, count, point, first, after
        )
        assert (first == -1).all()
        assert found == count[:n].sum()
        held = {tuple(pair[m].tolist()): point[m, : count[m]].copy() for m in range(n)}
        yield held, oracle.points, who[:found].copy(), contact[:found].copy(), Pose(position, orientation)


def agree(held, told):
    """The same points of the same pairs, in whatever order."""
    told = {boxes: np.array([np.hstack(one) for one in here]) for boxes, here in told.items() if here}
    if held.keys() != told.keys():
        return False
    for boxes, points in held.items():
        other = told[boxes]
        if points.shape != other.shape:
            return False
        if not np.allclose(points[np.lexsort(points.T)], other[np.lexsort(other.T)], atol=1e-12):
            return False
    return True


def test_the_kernel_remembers_what_the_rules_say():
    seen = most = 0
    for held, told, *_ in followed(update_manifolds):
        assert agree(held, told)
        seen += len(held)
        most = max([most, *map(len, held.values())])
    assert seen > 300
    assert most == 4
    # A control: an oracle that forgets a fiftieth earlier differs.
    assert not all(agree(held, told) for held, told, *_ in followed(update_manifolds, told=0.98))


def test_what_is_remembered_is_a_contact_half_way_between_the_two_bodies():
    gaps = 0
    for held, _, who, contact, pose in followed(update_manifolds, steps=60):
        told = [(boxes, point) for boxes, points in held.items() for point in points]
        assert len(told) == len(contact)
        for (boxes, point), bodies, line in zip(told, who, contact, strict=True):
            on_a, on_b = pose.world(bodies[0], point[:3]), pose.world(bodies[1], point[3:6])
            assert tuple(bodies[2:]) == boxes
            np.testing.assert_allclose(line[:3], (on_a + on_b) / 2, atol=1e-12)
            np.testing.assert_allclose(line[3:6], point[6:9])
            assert line[6] == pytest.approx(-(on_a - on_b) @ point[6:9], abs=1e-12)
            gaps += line[6] < 0
    assert gaps > 100


def test_the_kernel_of_memory_does_what_its_source_says():
    """Bit for bit, without its compiler."""
    for one, other in zip(
        followed(update_manifolds, steps=40), followed(update_manifolds.py_func, steps=40), strict=True
    ):
        assert one[0].keys() == other[0].keys()
        for boxes, points in one[0].items():
            np.testing.assert_array_equal(points, other[0][boxes])
        for mine, its in zip(one[2:4], other[2:4], strict=True):
            np.testing.assert_array_equal(mine, its)


# -- what a step makes of it -------------------------------------------------------------------------------------------


def parted(make_world, line4, gap, speed, aside=0.0, size="monomer", room=None):
    """A line that has touched a wall with a side, and is now so far from it, and so far aside, and moves towards it:
    the world, and its velocity away from the wall after a step."""
    world = make_world({size: 1}, line4.without("agitation", "drag", "breaking", "bonding"))
    b = world.bodies
    put(world, 0, [0, 0, 0], np.eye(3))
    up = b.centre[:, 2].max() + b.edge / 2
    put(world, 0, [0, 0, world.half[2] - up + 5e-6], np.eye(3))
    collide(world)
    b.position[0], b.orientation[0] = [aside, 0, world.half[2] - up - gap], [0, 0, 0, 1]
    b.velocity[0], b.spin[0] = [0, 0, speed], 0.0
    if room:
        world.engine._make_room(room)
    collide(world)
    return world, -b.velocity[0, 2]


@pytest.mark.parametrize("size", ["monomer", "quadmer"])
@pytest.mark.parametrize("gap", [1e-4, 1e-3, 0.002])
@pytest.mark.parametrize("speed", [0.1, 0.5, 1.5])
def test_a_surface_that_comes_back_is_stopped_at_the_gap(make_world, line4, gap, speed, size):
    """It may approach by the gap in a step, less what it bounces by; where it would stay further away, nothing."""
    world, away = parted(make_world, line4, gap, speed, size=size)
    bounce = 0.3 * speed if speed >= LEAST_BOUNCE else 0.0
    expected = max(-speed, bounce - (gap + 1e-5) / world.step_size)
    assert away == pytest.approx(expected, rel=1e-3, abs=1e-7)  # four corners take turns, 50 times
    assert away <= bounce
    # A control: a body that was put there has forgotten, and flies on.
    world.engine.put(0)
    world.bodies.position[0, 2] -= 0.01
    world.bodies.velocity[0] = [0, 0, speed]
    collide(world)
    assert world.bodies.velocity[0, 2] == speed


@pytest.mark.parametrize("size", ["monomer", "quadmer"])
def test_a_point_is_forgotten_beyond_a_fiftieth_of_the_radius(make_world, line4, size):
    """Along the normal and across it; of the body's radius."""
    k = {"monomer": 1, "quadmer": 4}[size]
    limit = 0.02 * 0.15 / 2 * np.sqrt(k * k + 2)
    for share, is_kept in ((0.98, True), (1.02, False)):
        _, away = parted(make_world, line4, share * limit, speed=3.0, size=size)
        assert (away != -3.0) == is_kept
        _, away = parted(make_world, line4, 1e-4, speed=3.0, aside=share * limit, size=size)
        assert (away != -3.0) == is_kept


def test_impulses_without_an_overlap_keep_both_momenta_and_create_no_energy(make_world, line4):
    """Of cubes, in steps in which nothing that overlaps is pushed, so that no overlap is taken back; momenta where no
    wall takes some."""
    tight = line4.replace(tank=line4.tank.replace(size=(0.6, 0.6, 0.6))).without("breaking", "bonding")
    world = make_world({"monomer": 8}, tight)
    b, engine, all_of, of_bodies = world.bodies, world.engine, 0, 0
    names = [name for name, _ in world.parts]
    for _ in range(4000):
        act(world)
        before, had = b.momentum(), energy(world)
        engine.step()
        pushing = engine._impulse[: engine._found].any(axis=1)
        if pushing.any() and (engine._contact[: engine._found, 6][pushing] < 0).all():
            all_of += 1
            assert energy(world) < had
            if (engine._who[: engine._found, 1][pushing] >= 0).all():
                of_bodies += 1
                for now, was in zip(b.momentum(), before, strict=True):
                    np.testing.assert_allclose(now, was, rtol=0, atol=1e-14 * b.mass.sum())
        for _, part in world.parts[names.index("free flight") :]:
            part()
    assert all_of > of_bodies > 10


def test_a_body_that_changes_forgets_and_others_remember(make_world, line4):
    """Two pairs of cubes that touch; one cube is taken out of the engine, as in a join or a break."""
    world = make_world({"monomer": 4}, line4.without("agitation", "drag", "walls", "breaking", "bonding"))
    engine, edge = world.engine, world.bodies.edge
    for slot, place in enumerate([(0, 0, 0), (0, 0, 1), (3, 0, 0), (3, 0, 1)]):
        put(world, slot, np.array(place) * (edge - 1e-4))
    collide(world)

    def held():
        return {tuple(boxes) for boxes in engine._pair[: engine._manifolds].tolist()}

    assert held() == {(0, 1), (2, 3)}
    engine.remove(1)
    assert held() == {(2, 3)}
    engine.create(1)
    engine.put(2)
    assert held() == set()


def test_bodies_that_join_or_break_forget(make_world, line4, book):
    """By the world's own ways: no box of theirs is remembered just after."""
    world = make_world({"monomer": 1, "trimer": 1}, line4.without("agitation", "drag", "walls"))
    b, engine = world.bodies, world.engine
    line, cube = (next(s for s in b.live if len(b.members[s]) == k) for k in (3, 1))
    put(world, line, [0, 0, 0], np.eye(3))
    axis = int(np.ptp(b.centre[list(b.members[line])], axis=0).argmax())
    across = np.eye(3)[(axis + 1) % 3]
    put(world, cube, (b.edge - 1e-4) * across, np.eye(3))
    collide(world)
    assert engine._manifolds == 1
    i, j = b.held(line).bonds[0]
    world.part(line, book.break_bond(b.held(line), i, j))
    assert engine._manifolds == 0


def test_more_room_is_made_without_forgetting(make_world, line4, monkeypatch):
    """The same bits, however much room there was for contacts at first; what is remembered moves into it."""
    assert parted(make_world, line4, 1e-3, 0.5, room=4096)[1] == parted(make_world, line4, 1e-3, 0.5)[1] > -0.5
    crowd = line4.replace(tank=line4.tank.replace(size=(0.9, 0.9, 0.9))).without("breaking", "bonding")
    ends = []
    for room in (own_engine.FIRST_ROOM, 4):
        monkeypatch.setattr(own_engine, "FIRST_ROOM", room)
        world = make_world({"monomer": 20, "trimer": 4}, crowd)
        assert len(world.engine._pair) == room // 4
        held = 0
        for _ in range(300):
            world.step()
            held = max(held, world.engine._manifolds)
        assert held > 8
        ends.append([world.bodies.position.copy(), world.bodies.spin.copy()])
    for one, other in zip(*ends, strict=True):
        np.testing.assert_array_equal(one, other)
