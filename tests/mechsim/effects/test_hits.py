"""Which bodies are judged and how: by hand, on a world of few bodies that does nothing but hold them."""

from types import SimpleNamespace

import numpy as np
import pytest

from kinetics.assembly import RuleBook, Structure, derive
from mechsim.effects.breaking import BOUNDS, CRITERIA, Breaking
from mechsim.effects.bridges import Bridges
from mechsim.kernels.loads import SLACK, bond_loads, hit_bound
from mechsim.world.engines import Touch

EDGE, CUBE_MASS = 0.3, 0.4
RNG = np.random.default_rng(11)
BENT = Structure(((0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1), (2, 1, 1)), (0,) * 5, ("a",) * 5)


def rotation(quaternion):
    """The matrix of (x, y, z, w)."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


class Held:
    """Bodies as effects see them: structures at places, each turned by its own quaternion."""

    def __init__(self, *structures):
        self.structures, self.edge, self.cube_mass = structures, EDGE, CUBE_MASS
        sizes = [len(one) for one in structures]
        ends = np.cumsum(sizes)
        self.members = [tuple(range(end - size, end)) for size, end in zip(sizes, ends, strict=True)]
        self.mass = CUBE_MASS * np.array(sizes, float)
        self.born = np.zeros(len(structures))
        self.position = RNG.uniform(-2, 2, (len(structures), 3))
        turns = RNG.standard_normal((len(structures), 4))
        self.orientation = turns / np.linalg.norm(turns, axis=1)[:, None]
        own = [np.array(one.positions, float) * EDGE for one in structures]
        self.offset = np.concatenate([cells - cells.mean(axis=0) for cells in own])
        turned = [
            self.position[slot] + self.offset[list(self.members[slot])] @ rotation(self.orientation[slot]).T
            for slot in range(len(structures))
        ]
        self.centre = np.concatenate(turned)

    def held(self, slot):
        return self.structures[slot]


class Tank:
    """A world in which nothing moves: it takes down who is parted and logged."""

    def __init__(self, settings, *structures, touches=(), time=1.0):
        self.bodies, self.time, self.parted, self.logged = Held(*structures), time, [], []
        self.touches = list(touches)
        self.engine = SimpleNamespace(touches=lambda of_structures: self.touches)
        self.book = SimpleNamespace(break_bond=lambda structure, i, j: (structure, i, j))
        self.action = settings.attach(self)
        for slot in range(len(structures)):
            self.action.renew(slot)

    def on_change(self, renew):
        self.renew = renew

    def log_hit(self, hit):
        self.logged.append(hit)

    def part(self, slot, parts, hit):
        self.parted.append((slot, parts[1:], hit))


@pytest.fixture(scope="module")
def structures():
    return derive(RuleBook.load("line4")).structures


def settings(**changes):
    return Breaking(**{"threshold": 0.01} | changes)


def line_of(structures, name):
    """A structure, its cubes from one end to the other."""
    cells = np.array(structures[name].positions)
    return sorted(range(len(cells)), key=lambda c: tuple(cells[c]))


def pull(tank, slot, cube, neighbour, size):
    """An impulse on an end that tears it off its neighbour."""
    centre = tank.bodies.centre[list(tank.bodies.members[slot])]
    return tuple(centre[cube]), size * (centre[cube] - centre[neighbour]) / EDGE


def test_the_most_loaded_bond_breaks_above_the_threshold_alone(structures):
    """Pulled at its end, a line of n cubes carries (n - 1) / n of the impulse in the bond there, and less beyond."""
    for name, share in (("dimer", 1 / 2), ("trimer", 2 / 3), ("quadmer", 3 / 4)):
        order = line_of(structures, name)
        for size, breaks in ((0.0101 / share, True), (0.0099 / share, False)):
            tank = Tank(settings(), structures[name], structures["monomer"])
            place, impulse = pull(tank, 0, order[0], order[1], size)
            tank.touches = [Touch(0, 1, place, tuple(impulse))]
            tank.action.after_step()
            assert [slot for slot, *_ in tank.parted] == [0] * breaks
            if breaks:
                _, bond, hit = tank.parted[0]
                assert sorted(bond) == sorted(order[:2]) == sorted(hit.bond)
                assert hit.load == pytest.approx(share * size)
                assert (hit.partner_slot, hit.is_shared, hit.breaks) == (1, False, True)
                assert hit.partner is structures["monomer"]
                assert hit.struck is structures[name]
            assert not tank.logged


def test_an_impulse_counts_with_its_sign_for_either_body(structures):
    """The engine names a body first; on the second one the opposite acts. A push tears nothing."""
    order = line_of(structures, "dimer")
    for first, sign, torn in ((True, 1, 1), (False, -1, 1), (True, -1, 0), (False, 1, 0)):
        tank = Tank(settings(), structures["dimer"], structures["monomer"])
        place, impulse = pull(tank, 0, order[0], order[1], 0.04)
        tank.touches = [Touch(*((0, 1) if first else (1, 0)), place, tuple(sign * impulse))]
        tank.action.after_step()
        assert len(tank.parted) == torn


def test_both_bodies_of_a_touch_are_judged_before_either_breaks(structures):
    order = line_of(structures, "dimer")
    tank = Tank(settings(), structures["dimer"], structures["dimer"])
    place, impulse = pull(tank, 0, order[0], order[1], 0.04)
    other, _ = pull(tank, 1, order[0], order[1], 0.04)
    along = (np.array(other) - tank.bodies.centre[tank.bodies.members[1][order[1]]]) / EDGE
    tank.touches = [Touch(0, 1, place, tuple(impulse)), Touch(0, 1, other, tuple(-0.03 * along))]
    tank.action.after_step()
    assert [slot for slot, *_ in tank.parted] == [0, 1]
    assert all(hit.partner is structures["dimer"] for *_, hit in tank.parted)


def test_loads_of_collisions_in_one_step_add_to_those_at_rest_and_not_to_each_other(structures):
    """Two bodies pull a line's end, each with a load of .006: two hits if both bounce, and one of .012 if one rests."""
    order = line_of(structures, "quadmer")
    for bounces, hits, breaks in (
        ((True, True), [(0.006, False)] * 2, False),
        ((True, False), [(0.012, True)], True),
        ((False, False), [(0.012, True)], True),
    ):
        tank = Tank(settings(log_above=0.005), *(structures[name] for name in ("quadmer", "monomer", "monomer")))
        place, impulse = pull(tank, 0, order[0], order[1], 0.008)
        tank.touches = [Touch(0, 1, place, tuple(impulse), bounces[0]), Touch(0, 2, place, tuple(impulse), bounces[1])]
        tank.action.after_step()
        assert [(pytest.approx(hit.load), hit.is_shared) for hit in tank.logged] == hits
        assert len(tank.parted) == breaks
        if len(hits) > 1:
            assert [hit.partner_slot for hit in tank.logged] == [1, 2]


def test_a_third_body_at_rest_takes_part_in_each_collision(structures):
    """Whichever points of it bounce, a partner's are taken together."""
    order = line_of(structures, "quadmer")
    tank = Tank(settings(log_above=0.001), structures["quadmer"], *[structures["monomer"]] * 3)
    place, impulse = pull(tank, 0, order[0], order[1], 0.004 / 3)
    strikes = [Touch(0, body, place, tuple(n * impulse)) for body, n in ((1, 2), (2, 3), (2, 1))]
    tank.touches = [*strikes, Touch(0, 1, place, tuple(impulse), False), Touch(0, 3, place, tuple(impulse), False)]
    tank.action.after_step()
    # Of body 1 three parts, one of which does not bounce, of body 2 four, and one of body 3: of .001 each.
    assert [(hit.partner_slot, hit.is_shared) for hit in tank.logged] == [(2, True), (1, True)]
    np.testing.assert_allclose([hit.load for hit in tank.logged], [0.005 + 0.001, 0.004])


def test_where_a_hit_breaks_its_body_no_other_one_is_known(structures):
    order = line_of(structures, "quadmer")
    tank = Tank(settings(log_above=0.005), *(structures[name] for name in ("quadmer", "monomer", "monomer")))
    place, impulse = pull(tank, 0, order[0], order[1], 0.04 / 3)
    tank.touches = [Touch(0, body, place, tuple(part * impulse)) for body, part in ((1, 0.6), (2, 1.2), (-1, 1.1))]
    tank.action.after_step()
    (hit,) = tank.logged
    assert (hit.partner_slot, hit.breaks, hit.load) == (2, True, pytest.approx(0.012))
    assert [slot for slot, *_ in tank.parted] == [0]


def test_the_partner_is_whose_impulse_is_largest_and_a_wall_is_none(structures):
    order = line_of(structures, "quadmer")
    for strong, weak in ((1, 2), (2, 1), (-1, 1), (1, -1)):
        tank = Tank(settings(), structures["quadmer"], structures["monomer"], structures["trimer"])
        place, impulse = pull(tank, 0, order[0], order[1], 0.04)
        at_rest = Touch(0, weak, place, tuple(0.3 * impulse), bounces=False)
        tank.touches = [at_rest, Touch(0, strong, place, tuple(impulse)), at_rest]  # 0.6 in sum
        tank.action.after_step()
        hit = next(hit for slot, _, hit in tank.parted if slot == 0)
        assert hit.partner_slot == strong
        assert hit.is_shared
        assert hit.partner is (None if strong < 0 else tank.bodies.held(strong))


def test_bonds_do_not_break_in_their_time_of_grace_and_single_cubes_never(structures):
    order = line_of(structures, "dimer")
    for grace, time, breaks in ((0.5, 0.5, True), (0.5, 0.49, False), (0.0, 0.0, True)):
        tank = Tank(settings(grace=grace), structures["dimer"], structures["monomer"], time=2.0 + time)
        tank.bodies.born[0] = 2.0
        place, impulse = pull(tank, 0, order[0], order[1], 0.04)
        tank.touches = [Touch(0, 1, place, tuple(impulse)), Touch(1, -1, place, tuple(impulse))]
        tank.action.after_step()
        assert len(tank.parted) == breaks
        if breaks:
            assert tank.parted[0][2].born == 2.0


def test_hits_above_the_log_are_logged_whether_they_break_or_not(structures):
    order = line_of(structures, "dimer")
    for load, logged, breaks in ((0.004, 0, 0), (0.0051, 1, 0), (0.0101, 1, 1)):
        tank = Tank(settings(log_above=0.005), structures["dimer"], structures["monomer"])
        place, impulse = pull(tank, 0, order[0], order[1], 2 * load)
        tank.touches = [Touch(0, 1, place, tuple(impulse))]
        tank.action.after_step()
        assert (len(tank.logged), len(tank.parted)) == (logged, breaks)
        assert [hit.breaks for hit in tank.logged] == [bool(breaks)] * logged
    assert settings(log_above=0.01).check(SimpleNamespace(providers=(), provider=lambda _: object())) is None


def test_light_bodies_break_by_their_change_of_velocity(structures):
    """Of a body that weighs less than 1 the change of velocity is above the impulse."""
    order = line_of(structures, "dimer")
    for change, breaks in ((1.01, True), (0.99, False)):
        tank = Tank(settings(criterion="velocity", threshold=1.0), structures["dimer"], structures["monomer"])
        place, impulse = pull(tank, 0, order[0], order[1], 2 * CUBE_MASS * change)
        tank.touches = [Touch(0, 1, place, tuple(impulse))]
        tank.action.after_step()
        assert len(tank.parted) == breaks


def test_criteria_by_hand():
    load = np.array([[3.0, 4.0, 7.0], [-3.0, 4.0, 7.0], [0.0, 0.0, 2.0]])
    np.testing.assert_allclose(CRITERIA["impulse"](load, 9.0), [5, 4, 0])
    np.testing.assert_allclose(CRITERIA["wrench"](load, 9.0), [12, 9, 2])
    np.testing.assert_allclose(CRITERIA["velocity"](load, 10.0), [10, 8, 0])


@pytest.mark.parametrize("criterion", CRITERIA)
def test_the_bound_is_above_every_load_and_not_far(structures, criterion):
    """Single contacts anywhere about a bent line: the sharpest bound is the load, and none is below."""
    of_pull, of_moment, of_change = BOUNDS[criterion]
    structure = BENT
    bodies = Held(structures["monomer"], structure)
    bridges, cubes = Bridges.of(structure), bodies.offset[list(bodies.members[1])] / EDGE
    levers, mine = bridges.levers(cubes), list(bodies.members[1])
    shares = []
    for trial in range(200):
        cube = bodies.centre[mine[trial % 5]]
        place = cube + RNG.uniform(-0.5, 0.5, 3) * EDGE
        impulse = RNG.standard_normal(3)
        sign = (1.0, -1.0)[trial % 2]
        loads = np.zeros((len(bridges.bonds), 3))
        bond_loads(
            bridges.bonds, bridges.sides, bodies.centre[mine], place[None], sign * impulse[None], CUBE_MASS, EDGE, loads
        )
        load = CRITERIA[criterion](loads, float(np.linalg.norm(impulse) / bodies.mass[1])).max()
        bound = hit_bound(
            levers, bridges.sides, cubes, bodies.position, bodies.orientation, 1, tuple(place), tuple(impulse), sign,
            EDGE, of_pull, of_moment, of_change / bodies.mass[1],
        )  # fmt: skip
        size = np.linalg.norm(impulse)
        if criterion == "wrench":
            exact = (np.sqrt(1.25) * np.hypot(np.maximum(loads[:, 0], 0), loads[:, 1]) + loads[:, 2]).max()
        else:
            exact = load if criterion == "impulse" else size / bodies.mass[1]
        arm = np.linalg.norm(place - bodies.position[1]) / EDGE
        slack = SLACK * ((of_pull + of_moment) * (1 + arm) + of_change / bodies.mass[1])
        assert bound == pytest.approx(exact + slack * size, rel=1e-10)
        assert load <= bound
        shares.append(load / bound)
    assert max(shares) > 0.95


def test_of_cubes_equally_near_each_counts(structures):
    """On the face between two cubes rounding decides who was hit; the bound takes the worse."""
    structure = structures["dimer"]
    bodies = Held(structure)
    bridges, cubes = Bridges.of(structure), bodies.offset / EDGE
    middle = bodies.centre.mean(axis=0)
    along = (bodies.centre[1] - bodies.centre[0]) / EDGE
    for aside, worst in ((0.0, 0.5), (1e-3, 0.5), (-1e-3, 0.0)):
        bound = hit_bound(
            bridges.levers(cubes), bridges.sides, cubes, bodies.position, bodies.orientation, 0,
            tuple(middle + aside * along), tuple(along), 1.0, EDGE, 1.0, 0.0, 0.0,
        )  # fmt: skip
        # Pulled along: the hit cube drags the other by half of it where it is ahead, and pushes it where it is behind.
        assert bound == pytest.approx(worst, abs=1e-5)
