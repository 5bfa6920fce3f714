"""The bill of a step: its parts add up, what is not listed has no line, and the engine's settings are read back."""

import math

import pytest
from click.testing import CliRunner

import mechsim.bill as bills
from mechsim.bill import bill
from mechsim.commands.simulate import simulate
from mechsim.engine import LEAST_BOUNCE, RECOVERY


class FakeTime:
    """A clock that parts move on by a known time each, ns; a look at it takes 40 ns."""

    def __init__(self):
        self.now = 0

    def __call__(self):
        self.now += 40
        return self.now

    def part(self, cost):
        def work():
            self.now += cost

        return work


@pytest.fixture
def clocked(make_world, line4):
    """A world whose parts take known times, and its clock."""
    world, clock = make_world({"monomer": 2}, line4), FakeTime()
    costs = {name: 1000 * (k + 1) for k, (name, _) in enumerate(world.parts)}
    world.parts = [(name, clock.part(cost)) for name, cost in costs.items()]
    return world, clock, costs


def test_each_part_gets_its_own_time_and_looks_at_the_clock_cost_nothing(clocked, monkeypatch):
    world, clock, costs = clocked
    monkeypatch.setattr(bills, "_breaks", int)
    told = bill(world, "known", blocks=40, warm_up=0, clock=clock)
    assert {item.name: pytest.approx(item.cost) for item in told.items if item.cost} == {
        name: cost / 1e3 for name, cost in costs.items()
    }
    assert told.whole == pytest.approx(sum(costs.values()) / 1e3)
    assert told.rest == pytest.approx(0, abs=1e-9)
    assert sum(item.cost for item in told.items) + told.rest == pytest.approx(told.whole)


def test_blocks_that_another_process_broke_into_are_left_out(clocked, monkeypatch):
    world, clock, costs = clocked
    calls = iter(range(10**6))

    def breaks():
        k = next(calls)
        if k % 8 != 1:
            return -1
        clock.now += 10**9  # lost the core during every fourth block, for long
        return k

    monkeypatch.setattr(bills, "_breaks", breaks)
    told = bill(world, "broken", blocks=40, warm_up=0, clock=clock)
    assert told.whole == pytest.approx(sum(costs.values()) / 1e3)
    monkeypatch.setattr(bills, "_breaks", lambda: next(calls))
    with pytest.raises(RuntimeError, match="try when it is calm"):
        bill(world, "busy", blocks=4, warm_up=0, clock=clock)


@pytest.mark.parametrize(
    "left_out", [(), ("bonding",), ("agitation", "breaking", "bonding"), ("contact", "breaking", "bonding")]
)
def test_an_effect_that_is_not_listed_has_no_line_and_no_part(make_world, line4, left_out):
    scene = line4.without(*left_out)
    world = make_world({"monomer": 12}, scene)
    told = bill(world, "real", blocks=8, warm_up=5)
    effects = [effect.effect for effect in scene.effects]
    assert [item.name for item in told.items if item.kind.startswith("effect")] == effects
    assert not set(left_out) & {name for name, _ in world.parts}
    assert {i.name for i in told.items if i.kind == "effect, in the engine"} == {"walls", "contact"} & set(effects)
    assert sum(item.cost for item in told.items) + told.rest == pytest.approx(told.whole)
    assert all(math.isfinite(item.error) and item.error >= 0 for item in told.items)
    assert all(item.name in str(told) for item in told.items)


DECLARED = {
    "substeps": 0, "gravity": 0, "linear_damping": 0, "angular_damping": 0, "rolling_friction": 0,
    "spinning_friction": 0, "contact_damping": -1, "contact_stiffness": -1, "mass_error": 0, "inertia_error": 0,
    "margin": 0.001, "least_bounce": 0.2, "overlap_recovery": 0.08,
}  # fmt: skip


@pytest.mark.parametrize("restitution", [0.0, 0.3, 0.9])
def test_nothing_undeclared_is_in_force_in_the_engine(make_world, line4, restitution):
    """Damping, margins, friction: what the scene says, zero, or named as the engine's own. Anything else fails here."""
    scene = line4.changed("contact", restitution=restitution, friction=0.7)
    world = make_world({"monomer": 4, "dimer": 2, "trimer": 1, "quadmer": 1}, scene)
    for _ in range(5):
        world.step()
    declared = DECLARED | {
        "restitution": restitution, "friction": 0.7, "step": 0.00525, "solver_iterations": 50,
    }  # fmt: skip
    force = world.engine.in_force() | bills._damping(world)
    assert force.keys() == declared.keys()
    for name, value in force.items():
        assert value == pytest.approx(declared[name], abs=1e-12), name


def test_without_contact_no_friction_is_in_force(make_world, line4):
    force = make_world({"dimer": 2}, line4.without("contact", "breaking", "bonding")).engine.in_force()
    assert force["restitution"] == force["friction"] == 0


def head_on(make_world, scene, gap, speed):
    """A cube that flies at a wall from so far away."""
    world = make_world({"monomer": 1}, scene)
    b = world.bodies
    b.position[0], b.orientation[0], b.velocity[0] = [0, 0, 1.5 - b.edge / 2 - gap], [0, 0, 0, 1], [0, 0, speed]
    world.engine.put(0)
    b.locate()
    return world


@pytest.mark.parametrize(("speed", "restitution"), [(0.19, 0.0), (0.21, 0.9), (0.5, 0.9), (2.0, 0.9)])
def test_the_engines_own_limits_are_those_we_name(make_world, scene_of, speed, restitution):
    """They cannot be read back: only approaches above 0.2 bounce, and a step takes back 8 % of an overlap."""
    world = head_on(make_world, scene_of("walls", {"effect": "contact", "restitution": 0.9}), 0.004, speed)
    b = world.bodies
    while b.velocity[0, 2] == speed:
        overlap = b.position[0, 2] + b.edge / 2 - 1.5
        world.step()
    assert overlap > 0
    expected = restitution * speed + RECOVERY * overlap / world.step_size
    assert -b.velocity[0, 2] == pytest.approx(expected, rel=0.02)
    assert (speed < LEAST_BOUNCE) == (restitution == 0.0)


def test_the_command_prints_it(tmp_path):
    asked = ["line4", "--cubes", "5", "--bill", "--runs-folder", str(tmp_path / "runs"), "--without", "breaking"]
    text = CliRunner().invoke(simulate, asked, catch_exceptions=False)
    assert text.exit_code == 0
    assert "bonding" in text.output
    assert "breaking" not in text.output
    assert "linear damping: 0" in text.output
    assert not (tmp_path / "runs").exists()
