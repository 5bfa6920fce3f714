"""Mean speeds are over the phase of the agitation's hold, within which the speed swings."""

import numpy as np
import pytest

from mechsim.accuracy.trial import AccuracyTrial, execute_trial, with_numerics
from mechsim.inspection.speeds import mean_speed, steps_of_hold, whole_holds


def test_steps_of_a_hold(line4, scene_of):
    assert steps_of_hold(line4) == 2
    assert steps_of_hold(with_numerics(line4, step=line4.numerics.step / 4)) == 8
    remembering = scene_of({"effect": "ornstein-uhlenbeck", "sigma": 4.0, "correlation_time": 0.00525}, "drag")
    assert steps_of_hold(remembering) == steps_of_hold(scene_of()) == 1


def test_a_duration_is_rounded_to_whole_holds(line4):
    fine = with_numerics(line4, step=line4.numerics.step / 4)
    assert whole_holds(fine, 1e-6) == 8
    assert whole_holds(fine, 2.5) == 8 * 238  # 2.5 tu are 238.1 holds
    assert whole_holds(line4, 2.5) * line4.numerics.step == pytest.approx(whole_holds(fine, 2.5) * fine.numerics.step)


def test_a_mean_speed_counts_all_phases_of_the_hold_alike(make_world, line4):
    """Samples at one phase alone are off by several per cent: the control."""
    scene = line4.without("bonding", "breaking")
    phases = steps_of_hold(scene)
    world = make_world({"monomer": 30}, scene)
    speeds = []
    for _ in range(whole_holds(scene, 4.0)):
        world.step()
        speeds.append(mean_speed(world.bodies, world.bodies.live))
    by_phase = np.array(speeds[100 * phases :]).reshape(-1, phases)
    low, high = sorted(by_phase.mean(axis=0))
    assert high / low > 1.08
    assert by_phase.mean() == pytest.approx((low + high) / 2)


def test_blocks_of_a_trial_are_whole_holds(line4):
    """At any step, and whatever the duration asked for."""
    for finer in (1, 4):
        scene = with_numerics(line4, step=line4.numerics.step / finer)
        facts = execute_trial(AccuracyTrial(scene, {"monomer": 2}, 0.5, 1, 0)).facts
        holds = facts["block"] / line4.effect("agitation").hold
        assert holds == pytest.approx(2)
