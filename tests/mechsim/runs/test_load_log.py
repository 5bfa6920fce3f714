"""What a record keeps of events: the bond, its partner, and the log of hits, which changes nothing that happens."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from kinetics.runs import BY_SEVERAL, BY_WALL, NO_BREAK, RESTART
from mechsim.effects.hits import Hit
from mechsim.runs.load_log import BROKE, SHARED, LoadLog
from mechsim.runs.record import RunSpec, book_of, execute
from mechsim.runs.store import RunStore

MIXED = {"quadmer": 10, "trimer": 10, "dimer": 5, "monomer": 10}
WHAT_HAPPENS = ("times", "channels", "bonds", "partners", "pose_times", "centres", "axes", "slots")


@pytest.fixture(scope="module")
def record(line4):
    """Breaks and joins in plenty, with a log."""
    scene = line4.changed("breaking", threshold=0.003, log_above=0.0015)
    return execute(RunSpec(scene, MIXED, 12.0, 2, 0, poses=1.0))


def without_log(spec):
    return replace(spec, scene=spec.scene.changed("breaking", log_above=None))


def test_a_log_changes_nothing_that_happens(record):
    plain = execute(without_log(record.spec))
    for name in WHAT_HAPPENS:
        np.testing.assert_array_equal(plain.arrays[name], record.arrays[name], strict=True)
    assert set(record.arrays) - set(plain.arrays) == {
        "load_time", "load_channel", "load_partner", "load_value", "load_flags"
    }  # fmt: skip
    assert "log_above" not in str(plain.spec.inputs)
    assert record.spec.key != plain.spec.key
    # Control: another threshold does change it.
    other = execute(replace(plain.spec, scene=plain.spec.scene.changed("breaking", threshold=0.0036)))
    assert not np.array_equal(other.arrays["centres"], plain.arrays["centres"])


def moved_by(bonds, spec, channels):
    """Do the bonds tell the same story as the channels? Bodies as sets of cubes, followed from the start."""
    derivation = book_of(spec.scene.rules)[1]
    sizes = {name: len(s) for name, s in derivation.structures.items()}
    network = derivation.network
    bodies, cube = [], 0
    for structure in spec.start:
        bodies.append(list(range(cube, cube + len(structure))))
        cube += len(structure)
    chains = {frozenset(b): b for b in bodies}  # a body is a line: its cubes in order
    for (i, j), channel in zip(bonds.tolist(), channels.tolist(), strict=True):
        name = network.channels[channel]
        one = next(b for b in chains.values() if i in b)
        other = next(b for b in chains.values() if j in b)
        left, right = ([sizes[s] for s in side.split("+")] for side in _sides(network, name))
        if len(left) == 2:
            if one is other or sorted((len(one), len(other))) != sorted(left):
                return False
            one, other = (one[::-1] if one[0] == i else one), (other[::-1] if other[-1] == j else other)
            if one[-1] != i or other[0] != j:
                return False
            new = [one + other]
        else:
            if one is not other or abs(one.index(i) - one.index(j)) != 1:
                return False
            cut = max(one.index(i), one.index(j))
            new = [one[:cut], one[cut:]]
            if sorted(map(len, new)) != sorted(right):
                return False
        for gone in (one, other):
            chains.pop(frozenset(gone), None)
        chains |= {frozenset(b): b for b in new}
    return True


def _sides(network, channel):
    index = network.channels.index(channel)
    needs, gives = network.reactants[index], network.reactants[index] + network.stoichiometry[index]
    return [
        "+".join(s for s, n in zip(network.species, row, strict=True) for _ in range(int(n))) for row in (needs, gives)
    ]


def test_the_bonds_of_the_events_tell_which_cubes_are_where(record):
    arrays, spec = record.arrays, record.spec
    assert len(arrays["bonds"]) >= 10  # some 20; how many depends on the machine, whose motions part
    assert moved_by(arrays["bonds"], spec, arrays["channels"])
    shuffled = np.random.default_rng(1).permutation(arrays["bonds"])
    assert not moved_by(shuffled, spec, arrays["channels"])


def test_every_break_has_a_partner_and_stands_in_the_log(record):
    arrays, facts = record.arrays, record.facts
    is_join = np.array(["->" in c and "+" in c.split("->")[0] for c in facts["channels"]])[arrays["channels"]]
    assert ((arrays["partners"] == NO_BREAK) == is_join).all()
    broke = (arrays["load_flags"] & BROKE) > 0
    np.testing.assert_array_equal(arrays["load_time"][broke], arrays["times"][~is_join])
    np.testing.assert_array_equal(arrays["load_channel"][broke], arrays["channels"][~is_join])
    shared = (arrays["load_flags"] & SHARED) > 0
    told = np.where(shared, BY_SEVERAL, arrays["load_partner"])[broke]
    np.testing.assert_array_equal(told, arrays["partners"][~is_join])
    assert (broke == (arrays["load_value"] > np.float32(0.003))).all()
    assert arrays["load_value"].min() > 0.0015
    assert (arrays["load_partner"] == BY_WALL).any()
    assert (arrays["load_partner"] >= 0).any()
    assert broke.sum() < len(broke) / 2


def test_after_a_restart_the_log_goes_on(record):
    again = execute(replace(record.spec, restart=True, poses=None, duration=3.0)).arrays
    is_restart = again["channels"] == RESTART
    assert is_restart.any()
    assert (again["bonds"][is_restart] == -1).all()
    assert (again["partners"][is_restart] == NO_BREAK).all()
    assert (again["bonds"][~is_restart] >= 0).all()
    assert again["load_time"].max() > again["times"][is_restart][0]


def hit(load, slot=1, partner=2, born=0.0):
    return Hit(slot, born, None, (0, 1), load, partner, None, False, False)


@pytest.mark.parametrize(
    ("second", "expected"),
    [
        ((11, hit(3.0)), [3.0]),  # the next step: the same collision
        ((11, hit(1.0)), [2.0]),
        ((12, hit(3.0)), [2.0, 3.0]),  # a step between
        ((11, hit(3.0, slot=3)), [2.0, 3.0]),
        ((11, hit(3.0, partner=-1)), [2.0, 3.0]),
        ((11, hit(3.0, born=1.0)), [2.0, 3.0]),
    ],
)
def test_a_collision_of_several_steps_is_one_row_with_its_largest_load(second, expected):
    log = LoadLog()
    log.add(10, 1.0, hit(2.0))
    log.add(second[0], 1.1, second[1])
    arrays = log.arrays(lambda *_: 0, lambda _: 0)
    np.testing.assert_array_equal(arrays["load_value"], np.float32(expected))


def test_a_log_above_the_threshold_is_refused(line4):
    with pytest.raises(ValueError, match="expected at most the threshold"):
        line4.changed("breaking", log_above=0.1)


def test_the_table_of_events_shows_bond_and_partner(record, tmp_path):
    store = RunStore(tmp_path)
    store.write(record)
    events = store.to_frames()[0]
    assert events[["cube_a", "cube_b"]].to_numpy().tolist() == record.arrays["bonds"].tolist()
    names = {BY_WALL: "wall", BY_SEVERAL: "several"} | dict(enumerate(record.facts["species"]))
    for told, partner in zip(events["partner"], record.arrays["partners"].tolist(), strict=True):
        assert pd.isna(told) if partner == NO_BREAK else told == names[partner]
    store.export(tmp_path / "tables")
