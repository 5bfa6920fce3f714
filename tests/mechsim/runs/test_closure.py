"""Whatever the mechanics did is what the rule book allows: every recorded reaction, every cube, every shape.

The oracle knows nothing of the derivation: it tries every face of every cube at every twist, and breaks every bond.
"""

import json
from collections import Counter
from hashlib import sha256
from itertools import combinations_with_replacement, product
from pathlib import Path

import numpy as np
import pytest

from kinetics.assembly import ROTATIONS, RuleBook, Structure, placements
from mechsim.runs.record import RunRecord, RunSpec, book_of, execute
from mechsim.runs.store import RunStore
from mechsim.scene import Scene

RESULTS = Path(__file__).parents[3] / "results"


def naive_joins(book, a, b):
    """Canonical forms of all that two structures can make."""
    made = set()
    for (i, face), (j, other) in product(a.open_faces(), b.open_faces()):
        for placement in placements(a, i, face, b, j, other):
            joined = book.join(a, i, b, j, placement)
            if joined is not None:
                made.add(joined.canonical(book.scheme))
    return made


def naive_reactions(book):
    """All structures, and all reactions as (before, after), by trying everything until nothing new comes."""
    known, fresh, reactions = set(), {book.monomer().canonical(book.scheme)}, set()
    while fresh:
        known |= fresh
        found = set()
        for a, b in combinations_with_replacement(sorted(known, key=str), 2):
            if a in fresh or b in fresh:
                for made in naive_joins(book, a, b):
                    reactions.add((side(a, b), side(made)))
                    found.add(made)
        for whole in fresh:
            for i, j in whole.bonds:
                parts = [part.canonical(book.scheme) for _, part in book.break_bond(whole, i, j)]
                reactions.add((side(whole), side(*parts)))
                found.update(parts)
        fresh = found - known
    return known, reactions


def side(*structures):
    """One side of a reaction, in whatever order."""
    return frozenset(Counter(structures).items())


class Replay:
    """Recorded runs against what the oracle allows."""

    def __init__(self, rules):
        self.structures, self.reactions = naive_reactions(RuleBook.load(rules))

    def __call__(self, manifest, arrays):
        """Number of events of a run; AssertionError where one of them cannot be."""
        names = manifest["facts"]["species"]
        ordered = sorted(self.structures, key=lambda s: (len(s), s.positions, s.rotations, s.letters))
        assert len(names) == len(ordered)
        named = dict(zip(names, ordered, strict=True))
        named |= {str(len(s)): s for s in ordered if [len(other) for other in ordered].count(len(s)) == 1}
        start = Counter({named[name]: n for name, n in manifest["inputs"]["composition"].items()})
        n_cubes = sum(len(structure) * n for structure, n in start.items())
        tank = start
        for channel in arrays["channels"]:
            name = manifest["facts"]["channels"][channel]
            before, after = (Counter(named[one] for one in part.split("+")) for part in name.split("->"))
            assert before <= tank, f"{name}: its reactants are not there"
            tank = tank - before + after
            assert sum(len(s) * n for s, n in tank.items()) == n_cubes, f"{name}: cubes came or went"
            assert (side(*before.elements()), side(*after.elements())) in self.reactions, f"{name}: not by the rules"
        final = Counter(dict(zip(ordered, final_counts(manifest, arrays), strict=True)))
        assert +tank == +final
        return len(arrays["channels"])


def final_counts(manifest, arrays):
    """As whoever reads the run counts them (it is never restarted)."""
    network = book_of(manifest["inputs"]["scene"]["rules"])[1].network
    return (arrays["initial"] + network.stoichiometry[arrays["channels"]].sum(axis=0)).tolist()


@pytest.fixture(scope="module", params=["line4", "t5"])
def replay(request):
    return request.param, Replay(request.param)


def stored(study):
    return list(RunStore(RESULTS / study / "runs").contents())


@pytest.mark.parametrize("study", ["line4", "t5", "pyramid45"])
def test_a_stored_run_keeps_the_physics_that_made_it(study):
    """Its name is that of its own inputs, whatever the physics of today, for which only its equals are taken."""
    store = RunStore(RESULTS / study / "runs")
    manifests = [manifest for manifest, _ in store.contents()]
    assert manifests
    for manifest in manifests:
        inputs = manifest["inputs"]
        assert sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest() == manifest["key"]
        spec = RunSpec.of_inputs(inputs, store.folder)
        assert (store.read(spec) is not None) == (spec.inputs["physics"] == inputs["physics"])


def test_every_stored_reaction_is_one_of_the_rules(replay):
    study, check = replay
    seen, events = set(), 0
    for manifest, arrays in stored(study):
        events += check(manifest, arrays)
        seen.update(manifest["facts"]["channels"][c] for c in arrays["channels"])
    assert events > 500
    assert len(seen) >= {"line4": 8, "t5": 15}[study]


def test_the_derived_network_is_what_the_oracle_finds(replay):
    study, check = replay
    derivation = book_of(study)[1]
    structures = list(derivation.structures.values())
    assert set(structures) == check.structures
    derived = {
        (side(*(structures[s] for s in e.before)), side(*(structures[s] for s in e.after))) for e in derivation.events
    }
    assert derived == check.reactions


@pytest.mark.parametrize(
    ("event", "reaction", "reason"),
    [
        (0, "2+2->4", "reactants are not there"),
        (3, "1+1->3", "cubes came or went"),
        (3, "2+1->1+1+1", "not by the rules"),
        (3, "1+1+1->3", "not by the rules"),
    ],
)
def test_a_forged_reaction_is_seen(event, reaction, reason):
    check, (manifest, arrays) = Replay("line4"), stored("line4")[0]
    check(manifest, arrays)
    channels = arrays["channels"].copy()
    channels[event] = len(manifest["facts"]["channels"])
    facts = manifest["facts"] | {"channels": [*manifest["facts"]["channels"], reaction]}
    with pytest.raises(AssertionError, match=reason):
        check(manifest | {"facts": facts}, arrays | {"channels": channels})


# Shapes


def shapes(record, frame):
    """Structures in the tank by what their cubes' poses show, letters left out; all lie on a lattice."""
    edge, scheme = record.spec.scene.cubes.edge, book_of(record.spec.scene.rules)[0].scheme
    centres, axes, slots = (record.arrays[name][frame] for name in ("centres", "axes", "slots"))
    found = Counter()
    for slot in set(slots.tolist()):
        cubes = np.flatnonzero(slots == slot)
        frame_of = axes[cubes[0]]
        places = (centres[cubes] - centres[cubes[0]]) @ frame_of / edge
        np.testing.assert_allclose(places, places.round(), atol=1e-9)
        turns = [int(np.argmax([(r * (frame_of.T @ axes[c])).sum() for r in ROTATIONS])) for c in cubes]
        for cube, turn in zip(cubes, turns, strict=True):
            np.testing.assert_allclose(frame_of.T @ axes[cube], ROTATIONS[turn], atol=1e-9)
        positions = tuple(tuple(int(x) for x in place) for place in places.round())
        found[Structure(positions, tuple(turns), ("x",) * len(cubes)).canonical(scheme)] += 1
    return found


def recorded_shapes(record, frame):
    """The same by the recorded events."""
    book, derivation = book_of(record.spec.scene.rules)
    counts = record.path.at(record.arrays["pose_times"][frame : frame + 1])[0]
    found = Counter()
    for structure, n in zip(derivation.structures.values(), counts.tolist(), strict=True):
        if n:
            found[structure.with_letters(("x",) * len(structure)).canonical(book.scheme)] += n
    return found


@pytest.fixture(scope="module")
def eager_t5():
    """Every meeting bonds and bonds break easily: a short run full of events, with poses."""
    scene = Scene.load("t5").changed("bonding", latch={"kind": "encounter", "probability": 1.0})
    scene = scene.changed("breaking", threshold=0.003)
    start = {"monomer": 21, "dimer.a": 6, "trimer.a": 3, "quadmer.b": 2, "pentamer": 2}
    return execute(RunSpec(scene, start, 20.0, seed=3, run=0, poses=2.5))


def test_the_poses_show_the_shapes_that_the_events_tell_of(eager_t5):
    assert len(eager_t5.arrays["channels"]) > 15  # 30 or more; how many depends on the machine, whose motions part
    for frame in range(len(eager_t5.arrays["pose_times"])):
        assert shapes(eager_t5, frame) == recorded_shapes(eager_t5, frame)


def test_a_shape_that_no_event_tells_of_is_seen(eager_t5):
    """The control: one event taken out of the record."""
    last = len(eager_t5.arrays["pose_times"]) - 1
    forged = type(eager_t5)(
        eager_t5.spec,
        eager_t5.outcome,
        eager_t5.arrays | {name: eager_t5.arrays[name][:-1] for name in ("times", "channels", "bonds", "partners")},
        eager_t5.facts,
    )
    assert shapes(forged, last) != recorded_shapes(forged, last)


# The pyramid: cubes that dock where they touch several others at once


@pytest.fixture(scope="module")
def pyramid():
    """The longest of the recorded growths, read back as a record."""
    manifest, arrays = max(stored("pyramid45"), key=lambda run: run[0]["inputs"]["duration"])
    given = manifest["inputs"]
    spec = RunSpec(
        Scene(**given["scene"]), *(given[name] for name in ("composition", "duration", "seed", "run")),
        restart=given["restart"], poses=given["poses"],
    )  # fmt: skip
    assert spec.inputs["rules"] == given["rules"]
    return RunRecord(spec, manifest["outcome"], arrays, manifest["facts"])


def test_the_recorded_pyramid_grew_by_the_rules(pyramid):
    book, derivation = book_of("pyramid45")
    path, monomer = pyramid.path, book.monomer()
    assert len(path.channels) > 40
    structures = list(derivation.structures.values())
    for state, channel in zip(path.states, path.channels, strict=False):
        grown = [s for s in np.flatnonzero(path.network.reactants[channel]) if structures[s] != monomer]
        (made,) = np.flatnonzero(path.network.stoichiometry[channel] > 0)
        assert state[grown] == 1
        assert structures[made] in naive_joins(book, structures[grown[0]], monomer)
    for frame in range(0, len(pyramid.arrays["pose_times"]), 4):
        assert shapes(pyramid, frame) == recorded_shapes(pyramid, frame)


def test_a_cube_docks_in_a_corner(pyramid):
    """From a cross of five cubes, every meeting a bond: a cube between two arms is bonded to both."""
    eager = pyramid.spec.scene.changed("bonding", latch={"kind": "encounter", "probability": 1.0})
    record = execute(RunSpec(eager, {"monomer": 100, "pentamer": 1}, 25.0, seed=2, run=0, poses=25.0))
    (grown,) = [shape for shape in shapes(record, -1) if len(shape) > 1]
    assert len(grown.bonds) > len(grown) - 1  # loops
    assert shapes(record, -1) == recorded_shapes(record, len(record.arrays["pose_times"]) - 1)
