"""Whole runs: determinism, closure, restarts, absent effects, the guard."""

import json
import zlib
from dataclasses import replace
from importlib.metadata import version

import numpy as np
import pytest

from kinetics.runs import RESTART
from mechsim.runs.record import PROGRESS_STEPS, RunSpec, execute
from mechsim.scene import TankSize
from mechsim.world.world import World

KEYED_BY = "mechsim.runs.record.version"


@pytest.fixture(scope="module")
def eager(line4):
    """Every meeting bonds and bonds break easily, so that short runs are full of events."""
    scene = line4.changed("bonding", latch={"kind": "encounter", "probability": 1.0})
    return scene.changed("breaking", threshold=0.003)


@pytest.fixture(scope="module")
def busy(eager):
    return execute(RunSpec(eager, {"monomer": 20, "dimer": 8, "trimer": 4, "quadmer": 3}, 25.0, seed=5, run=0))


def test_the_same_inputs_give_the_same_record(busy):
    brief = replace(busy.spec, duration=5.0)
    one, again, other = (execute(spec) for spec in (brief, brief, replace(brief, run=1)))
    assert again.digest == one.digest != other.digest
    assert again.outcome == "completed"
    assert len(one.path.times) >= 4


def test_reactions_are_those_of_the_network_and_cubes_are_kept(busy, derivation):
    path = busy.path  # its construction checks that every event had its reactants
    # All eight but 4->2+2: a line's middle bond is the last to give way.
    assert set(path.channels.tolist()) >= set(range(7))
    sizes = derivation.network.conserved["cubes"]
    assert (path.states @ sizes == 60).all()
    assert path.end >= 25.0
    assert path.open_channels.all()


def test_a_restarted_run_always_leaves_from_its_start(eager):
    record = execute(RunSpec(eager, {"monomer": 40, "dimer": 10}, 10.0, seed=4, run=0, restart=True))
    path = record.path
    assert len(path.channels) > 20
    assert (path.channels[1::2] == RESTART).all()
    assert (path.channels[0::2] != RESTART).all()
    np.testing.assert_array_equal(path.states[2::2], np.tile(path.initial, (len(path.channels) // 2, 1)))


def test_only_the_first_event_of_a_step_counts_before_a_restart(eager):
    """In a crowd that bonds from afar the first step alone makes many joins."""
    grasping = eager.changed("bonding", capture_distance=0.15, latch={"kind": "delay", "rate": 1e6})
    crowded = grasping.without("breaking").replace(tank=TankSize(size=(1.2, 1.2, 1.2)))
    spec = RunSpec(crowded, {"monomer": 100}, 0.02, seed=4, run=0)
    times = execute(spec).arrays["times"]
    assert (times == times[0]).sum() > 2  # the control: events that share a step
    restarted = execute(replace(spec, restart=True))
    channels = restarted.arrays["channels"]
    assert len(channels) > 2
    assert (channels[1::2] == RESTART).all()
    assert (channels[0::2] != RESTART).all()
    assert len(set(restarted.arrays["times"].tolist())) == len(channels) / 2
    np.testing.assert_array_equal(restarted.path.states[2::2], np.tile(restarted.path.initial, (len(channels) // 2, 1)))


def test_a_run_is_named_by_the_versions_that_decide_its_numbers(line4, monkeypatch):
    spec = RunSpec(line4, {"monomer": 2}, 1.0, seed=1, run=0)
    keys = {spec.key}
    for package in ("numpy", "pybullet"):
        monkeypatch.setattr(KEYED_BY, lambda name, other=package: "0.0" if name == other else version(name))
        keys.add(replace(spec).key)
    monkeypatch.setattr(KEYED_BY, lambda name: "0.0" if name == "pandas" else version(name))
    assert replace(spec).key == spec.key  # the control: a package that decides nothing
    assert len(keys) == 3


def test_what_a_scene_does_not_list_does_not_happen(eager):
    only_breaks = execute(RunSpec(eager.without("bonding"), {"quadmer": 15}, 10.0, seed=1, run=0)).path
    assert len(only_breaks.channels)
    assert not only_breaks.open_channels[:4].any()
    only_joins = execute(RunSpec(eager.without("breaking"), {"monomer": 60}, 5.0, seed=1, run=0)).path
    assert len(only_joins.channels)
    assert (only_joins.channels < 4).all()
    assert not only_joins.open_channels[4:].any()
    neither = execute(RunSpec(eager.without("breaking", "bonding"), {"quadmer": 15}, 5.0, seed=1, run=0)).path
    assert not len(neither.channels)


def test_an_effect_that_never_acts_changes_nothing(line4, book):
    """Bit for bit: the streams of the others do not notice it."""
    rare = line4.changed("bonding", latch={"kind": "encounter", "probability": 1e-15})
    places = []
    for scene in (rare, line4.without("bonding"), line4.without("bonding", "breaking")):
        with World(scene, book, 30, np.random.SeedSequence(3)) as world:
            world.populate([book.monomer()] * 30)
            for _ in range(400):
                world.step()
            places.append(world.bodies.centre.tobytes())
    assert places[0] == places[1] == places[2]


def test_poses_are_recorded_only_on_request(busy, eager):
    assert set(busy.arrays) == {"initial", "times", "channels", "bonds", "partners"}
    record = execute(RunSpec(eager, {"monomer": 30}, 2.0, seed=4, run=0, poses=0.5))
    assert record.arrays["pose_times"] == pytest.approx([0, 0.5, 1.0, 1.5, 2.0, 2.0], abs=0.006)
    often = execute(replace(record.spec, duration=0.1, poses=0.1 * eager.numerics.step))
    assert len(often.arrays["pose_times"]) == often.facts["steps"] + 1  # no more than one a step, and the end
    centres, slots = record.arrays["centres"], record.arrays["slots"]
    assert centres.shape == (6, 30, 3)
    for frame in range(6):  # cubes of one body hang one edge apart
        for slot in set(slots[frame].tolist()):
            cubes = centres[frame][slots[frame] == slot]
            if len(cubes) > 1:
                gaps = np.linalg.norm(cubes[:, None] - cubes[None], axis=2)
                assert np.sort(gaps + np.eye(len(cubes)), axis=1)[:, 0] == pytest.approx(0.15)


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lambda b: b.velocity.__setitem__(0, [np.nan, 0, 0]), "not a number"),
        (lambda b: b.velocity.__setitem__(0, [20.0, 0, 0]), "tunnelling risk"),
        (lambda b: b.velocity.__setitem__(0, [50.0, 0, 0]), "runaway speed"),
        (lambda b: b.spin.__setitem__(0, [0, 150.0, 0]), "spin"),
        (lambda b: b.position.__setitem__(0, [3.0, 0, 0]), "escaped"),
    ],
)
def test_the_guard_names_what_is_wrong(make_world, line4, damage, reason):
    from mechsim.world.world import Stopped

    world = make_world({"monomer": 5}, line4.without("agitation", "drag"))
    world.bodies.position[0] = 0
    damage(world.bodies)
    world.engine.put(0)
    with pytest.raises(Stopped, match=reason):
        world.step()


def test_a_run_that_the_guard_stops_says_so_and_ends_there(line4):
    wild = line4.changed("agitation", sigma=60.0)
    record = execute(RunSpec(wild, {"monomer": 20}, 5.0, seed=1, run=0))
    assert record.outcome.startswith("stopped: ")
    assert record.path.end < 5.0


def test_bonds_that_hold_do_not_go_with_breaking(line4):
    holding = line4.replace(rules="pyramid45")
    with pytest.raises(ValueError, match="bonds of book pyramid45 hold"):
        RunSpec(holding, {"monomer": 60}, 1.0, seed=1, run=0)
    RunSpec(holding.without("breaking"), {"monomer": 60, "seed": 1}, 1.0, seed=1, run=0)


def test_a_run_until_a_species_ends_at_its_first_copy(eager):
    full = RunSpec(eager, {"monomer": 60}, 20.0, seed=4, run=0)
    short = replace(full, until="dimer")
    whole, cut = execute(full), execute(short)
    first = whole.path.first_time("dimer")
    assert cut.facts["end"] == cut.path.first_time("dimer") == first < 20.0
    assert cut.outcome == "completed"
    assert cut.arrays["times"].tolist() == [t for t in whole.arrays["times"].tolist() if t <= first]
    unreached = execute(replace(short, duration=first / 2))
    assert unreached.facts["end"] == pytest.approx(first / 2, abs=0.006)
    assert np.isnan(unreached.path.first_time("dimer"))


def test_a_tank_that_does_not_hold_its_cubes_is_refused(line4):
    alone = line4.without("bonding", "breaking")

    def spec(size, n):
        return RunSpec(alone.replace(tank=TankSize(size=size)), {"monomer": n}, 1.0, seed=1, run=0)

    assert spec((0.2, 0.2, 0.2), 1).n_cubes == 1
    with pytest.raises(ValueError, match=r"3 cubes of edge 0.15 take 0.01012; the tank holds 0.008"):
        spec((0.2, 0.2, 0.2), 3)
    with pytest.raises(ValueError, match=r"a cube of edge 0.15 does not fit into a tank that is 0.1 wide"):
        spec((3.0, 3.0, 0.1), 1)
    with pytest.raises(ValueError, match="holds no cubes"):
        spec((3.0, 3.0, 3.0), 0)


def test_a_run_has_as_many_steps_as_its_duration_takes(line4):
    step = line4.numerics.step
    for duration, steps in ((30 * step, 30), (3 * (10 * step), 30), (29.5 * step, 30)):
        assert execute(RunSpec(line4, {"monomer": 2}, duration, seed=1, run=0)).facts["steps"] == steps


def test_the_digest_tells_facts_and_shapes_and_not_in_which_order_they_are_kept(busy):
    assert replace(busy, facts=dict(reversed(busy.facts.items()))).digest == busy.digest
    assert replace(busy, facts=busy.facts | {"steps": 1}).digest != busy.digest
    for other in (busy.arrays["bonds"].ravel(), busy.arrays["bonds"].view(np.uint16)):  # of the same bytes
        assert replace(busy, arrays=busy.arrays | {"bonds": other}).digest != busy.digest


def test_progress_is_told_every_so_many_steps(line4):
    told, every = [], PROGRESS_STEPS * line4.numerics.step
    record = execute(RunSpec(line4, {"monomer": 2}, 2.5 * every, seed=1, run=0), told.append)
    assert told == pytest.approx([every, 2 * every])
    assert record.facts["end"] > told[-1]


def test_until_is_part_of_the_name_only_where_it_is_asked_for(eager):
    spec = RunSpec(eager, {"monomer": 60}, 20.0, seed=4, run=0)
    assert "until" not in spec.inputs
    assert replace(spec, until="dimer").inputs == spec.inputs | {"until": "dimer"}
    assert replace(spec, until="dimer").key != spec.key


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"until": "pentamer"}, "book line4 has monomer"),
        ({"until": "monomer"}, "already holds one"),
        ({"until": "dimer", "restart": True}, "choose one"),
    ],
)
def test_until_what_cannot_be_waited_for(eager, changes, said):
    with pytest.raises(ValueError, match=said):
        RunSpec(eager, {"monomer": 60}, 20.0, seed=4, run=0, **changes)


def test_the_order_in_which_a_composition_is_written_does_not_matter(line4):
    """A run's name does not tell it, so it must not decide what happens."""
    one, other = (
        RunSpec(line4, start, 0.5, seed=1, run=0)
        for start in ({"monomer": 4, "dimer": 2, "trimer": 0}, {"dimer": 2, "monomer": 4})
    )
    assert (one.key, one.title) == (other.key, other.title)
    assert list(one.composition) == ["monomer", "dimer"]
    assert execute(one).digest == execute(other).digest


def test_compositions_whose_checksums_agree_draw_different_numbers(line4):
    """These two have the same CRC-32, by which streams were keyed before: the control."""
    starts = (
        {"dimer": 18, "trimer": 1, "quadmer": 15},
        {"monomer": 39, "dimer": 4, "trimer": 11, "quadmer": 9},
    )
    specs = [RunSpec(line4, start, 1.0, seed=1, run=0) for start in starts]
    texts = [json.dumps(spec.inputs["composition"], sort_keys=True) for spec in specs]
    assert zlib.crc32(texts[0].encode()) == zlib.crc32(texts[1].encode())
    one, other, again = (np.random.default_rng(spec.streams).random(8) for spec in (*specs, specs[0]))
    assert not (one == other).any()
    assert (one == again).all()


def test_seeds_and_runs_are_counted_from_zero(line4):
    assert RunSpec(line4, {"monomer": 2}, 1.0, seed=0, run=0).title.endswith("seed 0, run 0")
    for seed, run in ((-1, 0), (0, -1)):
        with pytest.raises(ValueError, match="neither may be negative"):
            RunSpec(line4, {"monomer": 2}, 1.0, seed=seed, run=run)


@pytest.mark.parametrize("poses", [0.0, -1.0, float("inf")])
def test_poses_are_recorded_at_an_interval_above_zero(line4, poses):
    with pytest.raises(ValueError, match="poses = "):
        RunSpec(line4, {"monomer": 2}, 1.0, seed=0, run=0, poses=poses)
