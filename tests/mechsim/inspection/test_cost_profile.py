"""The profile of a step: its parts add up, what is not listed has no line, and the engine's settings are read back."""

import math
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pybullet
import pytest
from click.testing import CliRunner

import mechsim.inspection.cost_profile as profiles
from mechsim.commands.simulate import simulate
from mechsim.inspection.cost_profile import BY_PAIRS, cost_profile
from mechsim.world.engines.base import LEAST_BOUNCE, RECOVERY


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
    monkeypatch.setattr(profiles, "_breaks", int)
    told = cost_profile(world, "known", blocks=40, warm_up=0, clock=clock)
    assert {item.name: pytest.approx(item.cost) for item in told.items if item.cost} == {
        name: cost / 1e3 for name, cost in costs.items()
    }
    assert told.whole == pytest.approx(sum(costs.values()) / 1e3)
    assert told.rest == pytest.approx(0, abs=1e-9)
    assert sum(item.cost for item in told.items) + told.rest == pytest.approx(told.whole)


def test_effects_in_the_engine_cost_what_it_takes_less_without_them(clocked, monkeypatch):
    """Walls and contact have no hook. Twins with neither bonding nor breaking, which need contact, tell their cost; the
    lines still add up to the step."""
    world, clock, costs = clocked
    monkeypatch.setattr(profiles, "_breaks", int)
    seen = []

    def twin(_, scene):
        listed = [effect.effect for effect in scene.effects]
        seen.append(listed)
        engine, reading = 500 + 300 * ("contact" in listed) + 100 * ("walls" in listed), 40 * ("contact" in listed)
        parts = [("drag", clock.part(70)), ("engine", clock.part(engine)), ("reading back", clock.part(reading))]
        return nullcontext(SimpleNamespace(parts=parts, populate=len, step=int))

    monkeypatch.setattr(profiles, "_twin", twin)
    told = cost_profile(world, "known", blocks=40, warm_up=1, clock=clock)
    rest = ["agitation", "drag"]
    assert seen == [[*rest, "walls", "contact"], [*rest, "walls"], rest]
    cost = {item.name: item.cost for item in told.items}
    assert [item.name for item in told.items if item.kind == BY_PAIRS] == ["walls", "contact"]
    assert cost["walls"] == pytest.approx(0.1)
    assert cost["contact"] == pytest.approx(0.34)
    assert cost["engine"] == pytest.approx(costs["engine"] / 1e3 - 0.4)
    assert cost["reading back"] == pytest.approx(costs["reading back"] / 1e3 - 0.04)
    assert cost["drag"] == pytest.approx(costs["drag"] / 1e3)
    assert sum(cost.values()) + told.rest == pytest.approx(told.whole) == pytest.approx(sum(costs.values()) / 1e3)
    assert "subtracted from their lines" in str(told)


def test_blocks_that_another_process_broke_into_are_left_out(clocked, monkeypatch):
    world, clock, costs = clocked
    calls = iter(range(10**6))

    def breaks():
        k = next(calls)
        if k % 8 != 1:
            return -1
        clock.now += 10**9  # lost the core during every fourth block, for long
        return k

    monkeypatch.setattr(profiles, "_breaks", breaks)
    told = cost_profile(world, "broken", blocks=40, warm_up=0, clock=clock)
    assert told.whole == pytest.approx(sum(costs.values()) / 1e3)
    monkeypatch.setattr(profiles, "_breaks", lambda: next(calls))
    with pytest.raises(RuntimeError, match="try again on an idle machine"):
        cost_profile(world, "busy", blocks=4, warm_up=0, clock=clock)


@pytest.mark.parametrize(
    "left_out", [(), ("bonding",), ("agitation", "breaking", "bonding"), ("contact", "breaking", "bonding")]
)
def test_an_effect_that_is_not_listed_has_no_line_and_no_part(make_world, line4, left_out, monkeypatch):
    monkeypatch.setattr(profiles, "_breaks", int)  # on a busy machine too
    scene = line4.without(*left_out)
    world = make_world({"monomer": 12}, scene)
    told = cost_profile(world, "real", blocks=8, warm_up=5)
    effects = [effect.effect for effect in scene.effects]
    assert [item.name for item in told.items if item.kind.startswith("effect")] == effects
    assert not set(left_out) & {name for name, _ in world.parts}
    assert {i.name for i in told.items if i.kind == BY_PAIRS} == {"walls", "contact"} & set(effects)
    assert sum(item.cost for item in told.items) + told.rest == pytest.approx(told.whole)
    assert all(math.isfinite(item.error) and item.error >= 0 for item in told.items)
    assert all(item.name in str(told) for item in told.items)


DECLARED = {
    "substeps": 0, "gravity": 0, "linear_damping": 0, "angular_damping": 0, "rolling_friction": 0,
    "spinning_friction": 0, "contact_damping": -1, "contact_stiffness": -1, "mass_error": 0, "inertia_error": 0,
    "margin": 0.001, "least_bounce": 0.2, "overlap_recovery": 0.08, "sleeping": 0, "continuous_collision": 0,
    "inner_iterations": 1, "differences": 0,
}  # fmt: skip


def audit(world):
    """Damping, margins, friction: what the scene says, zero, or named as the engine's own. Anything else fails here."""
    contact, numerics = world.scene.effect("contact"), world.scene.numerics
    declared = DECLARED | {
        "restitution": contact.restitution, "friction": contact.friction, "step": numerics.step,
        "solver_iterations": numerics.solver_iterations,
    }  # fmt: skip
    force = world.engine.in_force() | profiles._damping(world)
    assert force.keys() == declared.keys()
    for name, value in force.items():
        assert value == pytest.approx(declared[name], abs=1e-12), name


@pytest.mark.parametrize("restitution", [0.0, 0.3, 0.9])
def test_nothing_undeclared_is_in_force_in_the_engine(make_world, line4, restitution):
    scene = line4.changed("contact", restitution=restitution, friction=0.7)
    world = make_world({"monomer": 4, "dimer": 2, "trimer": 1, "quadmer": 1}, scene)
    for _ in range(5):
        world.step()
    audit(world)


@pytest.mark.parametrize(
    ("undeclared", "said"),
    [
        ({"linearDamping": 0.04}, "linear_damping"),  # the engine's own default
        ({"angularDamping": 0.04}, "angular_damping"),
        ({"lateralFriction": 0.5}, "differences"),  # too, and less than the walls have
        ({"rollingFriction": 0.001}, "rolling_friction"),
        ({"spinningFriction": 0.001}, "spinning_friction"),
        ({"restitution": 0.9}, "restitution"),
        ({"contactDamping": 1.0, "contactStiffness": 1e4}, "contact_"),
        ({"collisionMargin": 0.01}, "margin"),
        ({"mass": 0.0034}, "mass_error"),
        ({"localInertiaDiagonal": [1e-5, 1e-5, 1e-5]}, "inertia_error"),
        ({"gravity": -9.81}, "gravity"),
        ({"numSubSteps": 2}, "substeps"),
        ({"numSolverIterations": 10}, "solver_iterations"),
    ],
)
def test_the_audit_sees_what_nobody_declared(make_world, line4, monkeypatch, undeclared, said):
    """Control: one setting of one body, or of the engine, that the scene does not tell of."""
    world = make_world({"monomer": 2}, line4)
    audit(world)
    client, told = world.engine.client, dict(undeclared)
    if "gravity" in told:
        pybullet.setGravity(0, 0, told["gravity"], physicsClientId=client)
    elif next(iter(told)).startswith("num"):
        pybullet.setPhysicsEngineParameter(**told, physicsClientId=client)
    elif "Damping" in next(iter(told)) and said != "contact_":  # cannot be read back: what a new body gets is measured
        change = pybullet.changeDynamics
        monkeypatch.setattr(pybullet, "changeDynamics", lambda *a, **settings: change(*a, **settings | told))
    else:
        pybullet.changeDynamics(1 + 6, -1, **told, physicsClientId=client)  # after six walls
    with pytest.raises(AssertionError, match=said):
        audit(world)


def test_nothing_is_put_to_rest_for_being_slow(make_world, scene_of):
    """The engine could put a body that is slow for 2 s to sleep; a thousandth of the usual speed lasts."""
    world = make_world({"monomer": 1}, scene_of())
    world.bodies.velocity[0] = [1e-3, 0, 0]
    begin = world.bodies.position[0].copy()
    for _ in range(600):
        world.step()
    assert world.bodies.position[0] - begin == pytest.approx(np.array([3.15e-3, 0, 0]), abs=1e-12)


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
    """They cannot be read back: approaches above 0.2 bounce, and of an overlap of others a step takes back 8 %."""
    world = head_on(make_world, scene_of("walls", {"effect": "contact", "restitution": 0.9}), 0.004, speed)
    b = world.bodies
    while b.velocity[0, 2] == speed:
        overlap = b.position[0, 2] + b.edge / 2 - 1.5
        world.step()
    assert overlap > 0
    expected = restitution * speed if restitution else RECOVERY * overlap / world.step_size
    assert -b.velocity[0, 2] == pytest.approx(expected, rel=0.02)
    assert (speed < LEAST_BOUNCE) == (restitution == 0.0)


def test_the_command_prints_it(tmp_path, monkeypatch):
    monkeypatch.setattr(profiles, "_breaks", int)
    asked = [
        "line4",
        "--cubes",
        "5",
        "--cost-profile",
        "--runs-folder",
        str(tmp_path / "runs"),
        "--without",
        "breaking",
    ]
    text = CliRunner().invoke(simulate, asked, catch_exceptions=False)
    assert text.exit_code == 0
    assert "bonding" in text.output
    assert "breaking" not in text.output
    assert "linear damping: 0" in text.output
    assert not (tmp_path / "runs").exists()
