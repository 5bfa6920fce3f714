"""Every exact sampling method against exact laws, against each other, and against mutants that must be caught."""

import importlib.util
import sys
from math import exp
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from known_systems import assert_follows_cdf, assert_follows_table, decay, line, network, walk
from numpy.testing import assert_allclose, assert_array_equal
from sampled_networks import APART, MIXED, PRODUCTS, THIRD_ORDER, ring
from scipy.stats import binom, nbinom

from kinetics import Transient
from kinetics.kernels import compiled, grouped, outcomes, partial, rejection, streams
from kinetics.kernels.ensemble_work import never
from kinetics.network import Network
from kinetics.sampling import (
    SAMPLING_METHODS,
    Auto,
    CompositionRejection,
    Direct,
    General,
    Lockstep,
    PartialPropensities,
    sample_path,
)
from kinetics.sampling import dependency_graph as dependencies
from kinetics.sampling import partial as partial_method
from kinetics.sampling import rejection as rejection_method
from kinetics.sampling.base import SamplingMethod, stream_key
from kinetics.sampling.cost_model import NetworkSize
from kinetics.sampling.dependency_graph import updating_sampler
from kinetics.sampling.direct import RecomputingSampler
from kinetics.sampling.lockstep import LockstepSampler
from kinetics.sampling.watch import Watch

METHODS = [method() for method in SAMPLING_METHODS]
UNRESTRICTED = [method for method in METHODS if not isinstance(method, PartialPropensities)]
named = pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)


def final_states(net, method, initial, end, runs, seed):
    return method.simulate(net, initial, [end], runs=runs, seed=seed).counts[:, 0]


def assert_joint_law(net, initial, end, states):
    exact = Transient().solve(net, initial, [end])
    observed = np.bincount(exact.space.index_of(states), minlength=len(exact.space))
    assert_follows_table(observed, exact.probabilities[0])


def test_joint_law_where_long_lists_of_groups_are_shared(monkeypatch):
    monkeypatch.setattr(rejection_method, "LONGEST_LIST", 2)
    states = final_states(MIXED, CompositionRejection(), [9, 1, 2], 1.5, 8000, seed=21)
    assert_joint_law(MIXED, [9, 1, 2], 1.5, states)
    model, _ = rejection_method.model_of(MIXED)
    heads = model.words[model.channels["event"] + 1]
    assert 0 in heads
    assert np.any(heads > 0)


@named
def test_growth_over_many_octaves(method):
    """Sums outgrow the bins of composition and rejection; the law of a Yule process is negative binomial."""
    net = network(("X",), {"birth": ((1,), (2,))}, [1.0])
    counts = final_states(net, method, [1], 8.0, 400, seed=24)[:, 0]
    assert_follows_cdf(counts, lambda x: nbinom(1, exp(-8.0)).cdf(x - 1))


@pytest.mark.parametrize(
    ("net", "initial"),
    [
        (line(), [50, 0, 0, 0]),
        (walk(14, 1.0, 1.0), [40] + 14 * [0]),
        (ring(33), 33 * [4]),
        (APART, [20, 3, 5]),
        (THIRD_ORDER, [20, 4]),
        (PRODUCTS, [21, 0]),
    ],
    ids=["line", "walk", "ring", "mixed", "third order", "products"],
)
def test_all_kernels_of_the_direct_method_agree_to_the_last_bit(net, initial):
    start, grid, key = net.state(initial), np.linspace(0.5, 8.0, 9), stream_key(29)
    samplers = [RecomputingSampler(net), LockstepSampler(net), updating_sampler(net)]
    outs = [np.empty((100, grid.size, start.size), dtype=np.int64) for _ in samplers]
    for sampler, out in zip(samplers, outs, strict=True):
        sampler.ensemble(start, grid, key, 5, out, Watch(grid))
    assert_array_equal(outs[1], outs[0])
    assert_array_equal(outs[2], outs[0])
    recomputing, updating = (samplers[i].path(start, 8.0, key, 3, Watch(grid)) for i in (0, 2))
    for one, other in zip(recomputing, updating, strict=True):
        assert_array_equal(one, other)


def test_lanes_hand_over_what_they_cannot_count():
    """Counts beyond 2**53 leave the lanes, before the start and on the way."""
    net = network(("A", "B"), {"jump": ((1, 0), (1, 2**39)), "fall": ((0, 1), (0, 0))}, [2000.0, 1e-14])
    for initial in ([1, 2**62], [1, 2**52 - 2**45]):
        lanes = Lockstep().simulate(net, initial, [0.5, 4.0], runs=40, seed=30).counts
        alone = Direct().simulate(net, initial, [0.5, 4.0], runs=40, seed=30).counts
        assert_array_equal(lanes, alone)
        assert lanes[:, 1, 1].min() > 2**52


def test_limits_of_methods_are_told():
    with pytest.raises(ValueError, match="'three' has 3 reactants; the method 'partial' takes at most 2"):
        PartialPropensities().simulate(THIRD_ORDER, [9, 0], [1.0])
    with pytest.raises(ValueError, match="4000 species; the method 'partial' takes at most 3000"):
        PartialPropensities().simulate(ring(4000), 4000 * [1], [1.0])
    with pytest.raises(ValueError, match="4000 channels; the method 'lockstep' takes at most 2000"):
        Lockstep().simulate(ring(2000), 2000 * [1], [1.0])


def test_auto_chooses_by_network():
    assert Auto().choose(line()) == Lockstep()
    assert Auto(many=False).choose(line()) == Direct()
    assert Auto().choose(ring(2000)) == CompositionRejection()
    pairs = {f"{i}{j}": ({f"s{i}": 1, f"s{j}": 1}, {f"s{i + j + 1}": 1}) for i in range(40) for j in range(i, 40 - i)}
    dense = Network.from_reactions({k: ({**a}, b) for k, (a, b) in pairs.items()}, np.ones(len(pairs)))
    assert Auto().choose(dense) == PartialPropensities()
    third = Network.from_reactions({str(i): ({"a": 3}, {f"b{i}": 1}) for i in range(500)}, np.ones(500))
    assert Auto().choose(third) != PartialPropensities()
    assert NetworkSize.of(line()) == NetworkSize(8, 4, 2, NetworkSize.of(line()).updated, 8)
    assert_array_equal(
        Auto().simulate(line(), [60, 0, 0, 0], [500.0], runs=40, seed=3).counts,
        Direct().simulate(line(), [60, 0, 0, 0], [500.0], runs=40, seed=3).counts,
    )


# What the kernels carry from event to event, against the definition.


CARRIED = pytest.mark.parametrize(
    ("net", "initial"),
    [(MIXED, [60, 9, 20]), (ring(30), 30 * [3]), (THIRD_ORDER, [40, 9]), (PRODUCTS, [41, 0])],
    ids=["mixed", "ring", "third order", "products"],
)


@CARRIED
def test_carried_propensities_are_those_of_the_counts(net, initial):
    sampler = updating_sampler(net)
    counts = np.append(net.state(initial), 1)
    work = sampler.begin(counts)
    advance_some(sampler, work, counts)
    assert_array_equal(work.propensities, net.propensities(counts[:-1]))
    assert work.sums.sum() == pytest.approx(work.propensities.sum(), rel=1e-14)


@CARRIED
def test_bins_hold_the_groups_of_the_counts(net, initial):
    sampler = CompositionRejection().sampler(net)
    counts = np.append(net.state(initial), 1)
    work = sampler.begin(counts)
    advance_some(sampler, work, counts)
    groups, bins, places = work.groups, work.groups["bin"], work.places.astype(int)
    assert_array_equal(groups["owners"], counts[groups["owner"]])
    sums = groups["owners"] * (groups["partial"] + groups["like"] * (groups["owners"] - 1.0))
    exact = np.add.reduceat(net.propensities(counts[:-1])[sampler.order], work.groups["start"].astype(int))
    assert_allclose(sums, exact, rtol=1e-14)
    lodged = bins != rejection.NO_BIN
    assert_array_equal(lodged, sums > 0)
    n_groups = sums.size
    assert_array_equal(work.members[bins[lodged] * n_groups + places[lodged]], np.flatnonzero(lodged))
    upper = work.uppers[bins]
    assert np.all((sums < upper)[lodged])
    assert np.all((sums >= upper * np.where(bins % 2, 3 / 4, 2 / 3))[lodged])
    assert work.total[0] == upper[lodged].sum() == work.masses.sum()


def advance_some(sampler, work, counts, n=500):
    waits, uniforms, out = np.empty(n), np.empty(n), np.empty((1, counts.size - 1), dtype=np.int64)
    stream = np.empty(4, dtype=np.uint64)
    streams.start_stream(stream_key(31), 0, stream)
    streams.draw(stream, waits, uniforms)
    none = np.empty(0), np.empty(0, dtype=np.int64), never(len(sampler.order))
    seen, clock, grid = np.zeros(2, dtype=np.int64), np.zeros(3), np.array([1e300])
    outcome = sampler.advance(work, counts, seen, clock, waits, uniforms, grid, out, *none)
    assert outcome == outcomes.UNFINISHED


def test_partial_propensities_are_bounded_from_above():
    net = network(
        ("A", "B", "C"),
        {"join": ((1, 1, 0), (0, 0, 1)), "part": ((0, 0, 1), (1, 1, 0)), "swap": ((1, 0, 1), (0, 1, 1))},
        [0.1, 0.3, 0.7],
    )
    sampler = PartialPropensities().sampler(net)
    counts = np.array([10**6, 10**6, 0, 1])
    work = sampler.begin(counts)
    model, _ = partial_method.model_of(net)
    for _ in range(5):
        advance_some(sampler, work, counts, 1500)
        exact = model.couplings.T @ counts[model.species[:3]] + model.alone
        assert np.all(work.partials >= exact)
        assert np.all(work.partials <= exact * (1 + 1e-11) + 1e-9)


def test_rows_of_couplings_are_short_wherever_the_hubs_are():
    """Both hubs bind each of 100 others: whatever an event changes, two owners' partial propensities follow."""
    others = [f"s{i}" for i in range(100)]
    binds = {f"{hub}{s}": ({hub: 1, s: 1}, {f"{s}{hub}": 1}) for hub in "hH" for s in others}
    bound = [f"{s}{hub}" for hub in "hH" for s in others]
    net = Network.from_reactions(binds, np.ones(200), species=["h", *others, "H", *bound])
    model, order = partial_method.model_of(net)
    assert [net.species[s] for s in model.species[:2]] == ["h", "H"]
    assert np.diff(model.reach, axis=1).max() == 2
    assert np.diff(model.owned_starts)[:2].tolist() == [100, 100]
    assert sorted(order) == list(range(200))


# One copy, so that every event moves what can happen next.
PASSED_ON = network(("A", "B", "C"), {"first": ((1, 0, 0), (0, 1, 0)), "second": ((0, 1, 0), (0, 0, 1))}, [2.0, 2.0])

# Mutants: the kernels' own text with one error put in, run as plain Python. Each must be caught.


def plain_python(module, *changes):
    """The kernel module without compilation, with its text changed."""
    text = Path(module.__file__).read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text, f"{old!r} is no longer in {module.__name__}"
        text = text.replace(old, new)
    name = f"mutant_{module.__name__.rpartition('.')[2]}"
    made = importlib.util.module_from_spec(importlib.util.spec_from_loader(name, loader=None))
    sys.modules[name] = made  # NamedTuple looks its module up
    compiler, compiled.compiled = compiled.compiled, lambda function=None, **_: function or (lambda inlined: inlined)
    try:
        exec(compile(text, name, "exec"), made.__dict__)
    finally:
        compiled.compiled = compiler
        del sys.modules[name]
    return made


class Records(list):
    """The records of an array as plain objects, whose fields plain Python reaches much sooner than those of numpy's."""

    def __init__(self, array):
        super().__init__(SimpleNamespace(**dict(zip(array.dtype.names, row, strict=True))) for row in array.tolist())
        self.size = len(self)


def as_records(arrays):
    """Arrays whose fields plain Python can name as the kernels do."""
    return type(arrays)(*(Records(a) if getattr(getattr(a, "dtype", None), "names", None) else a for a in arrays))


def mutant_states(net, module, changes, initial, end, runs):
    """Final states of runs made by a mutant."""
    kernel = plain_python(module, *changes)
    if module is grouped:
        sampler, model = updating_sampler(net), dependencies.model_of(net)
    elif module is rejection:
        sampler, model = CompositionRejection().sampler(net), rejection_method.model_of(net)[0]
    else:
        sampler, model = PartialPropensities().sampler(net), partial_method.model_of(net)[0]
    model, begin = as_records(model), sampler.begin
    sampler.begin = lambda counts: as_records(begin(counts))
    sampler.advance = lambda work, *rest: kernel.advance(model, work, *rest)
    out = np.empty((runs, 1, len(net.species)), dtype=np.int64)
    watch = Watch(np.array([end]))
    sampler.ensemble(net.state(initial), watch.grid, stream_key(32), 0, out, watch)
    assert watch.n_times == 1, "a count fell below 0"
    return out[:, 0]


PICK = "target = max(target - which * uppers[bin_], 0.0)"
KEPT = "if target >= whole:"
MUTANTS = [
    (grouped, "a stale propensity", ("propensities[reader] = propensity", "pass")),
    (grouped, "s * s for s (s - 1)", ("- channels[6 * reader + 2]", "- 0")),
    (grouped, "coarse waits", ("t, waits[draw]", "t, np.floor(waits[draw] * 4) / 4 + 1e-9")),
    (rejection, "a stale partial propensity", ("part = 0.0\n                    for r", "for r in range(0): #")),
    (rejection, "a stale sum", (16 * " " + "groups[group].owners = owners", 16 * " " + "pass")),
    (rejection, "a stale bin", ("if new == old:", "if old != NO_BIN and new != NO_BIN:")),
    (rejection, "a bin too low", ("target >= whole", "target >= 0.8 * whole")),
    (rejection, "a pick from bins of before", ("continue\n                is_stale = True", "continue")),
    (rejection, "a biased redraw", (KEPT, f"{KEPT}\n            t -= waits[draw] / total")),
    (rejection, "no rejection", (PICK, "target = (target / uppers[bin_] - which) * sum_of(groups[group])")),
    (
        rejection,
        "s * s for s (s - 1)",
        (" - float(kind)", ""),
        ("(owners - 1.0)", "owners"),
        ("(group.owners - 1.0)", "group.owners"),
    ),
    (partial, "a stale partial propensity", ("partials[i] += couplings[s, i] * gained", "pass")),
    (partial, "s * s for s (s - 1)", ("count - less[s]", "count")),
    (partial, "an owner too many", ("share = target / copies[owner]", "share = target / (copies[owner] + 1)")),
]


SLOW = ("a bin too low", "a pick from bins of before", "a biased redraw", "no rejection")  # seconds each


def all_laws(module, changes):
    """The joint law of a small system, the law of a decay, and that of a copy passed on, under a mutant."""
    assert_joint_law(MIXED, [14, 0, 1], 1.0, mutant_states(MIXED, module, changes, [14, 0, 1], 1.0, 1200))
    copies = mutant_states(decay(), module, changes, [60], 1.0, 700)[:, 0]
    assert_follows_cdf(copies, binom(60, exp(-1.0)).cdf)
    assert_joint_law(PASSED_ON, [1, 0, 0], 1.0, mutant_states(PASSED_ON, module, changes, [1, 0, 0], 1.0, 500))


@pytest.mark.parametrize(
    ("module", "changes"),
    [
        pytest.param(m, c, id=f"{m.__name__[17:]}: {name}", marks=[pytest.mark.validate] * (name in SLOW))
        for m, name, *c in MUTANTS
    ],
)
def test_mutants_are_caught(module, changes):
    with pytest.raises(AssertionError, match=r"chi-square|the laws differ|below 0"):
        all_laws(module, changes)


@pytest.mark.parametrize("module", [grouped, rejection, partial])
def test_without_a_mutation_all_is_well(module):
    all_laws(module, ())


def test_a_network_of_too_many_groups_is_not_taken_and_auto_takes_another(monkeypatch):
    """Each place of the ring owns two channels: a group of its own."""
    monkeypatch.setattr(rejection_method, "MOST_GROUPS", 200)
    at, beyond = ring(200), ring(201)
    assert CompositionRejection().supports(at)
    assert isinstance(Auto(many=False).choose(at), CompositionRejection)
    assert not CompositionRejection().supports(beyond)
    assert not isinstance(Auto(many=False).choose(beyond), CompositionRejection)
    with pytest.raises(ValueError, match="201 groups of channels; the method 'rejection' takes at most 200"):
        CompositionRejection().simulate(beyond, [1] * 201, [1.0], runs=1)


def test_a_large_order_among_many_channels_is_left_to_general(monkeypatch):
    """The other methods read a table of channels times the highest order."""
    net = network(("A", "B"), {"meet": ((6, 0), (0, 1)), "back": ((0, 1), (6, 0))}, [0.5, 1.0])
    monkeypatch.setattr(SamplingMethod, "most_factors", 12)
    assert Direct().supports(net)
    monkeypatch.setattr(SamplingMethod, "most_factors", 11)
    for method in (Direct(), Lockstep(), CompositionRejection()):
        with pytest.raises(ValueError, match="channel 'meet' has 6 reactants, among 2 channels; the method"):
            method.simulate(net, [6, 0], [1.0], runs=1)
    assert isinstance(Auto().choose(net), General)


@pytest.mark.parametrize("counted", ["ordered", "product"])
def test_more_like_reactants_than_sampling_takes_are_refused(counted):
    for order, is_taken in ((1000, True), (1001, False), (2**40, False)):
        net = network(("A",), {"all": ((order,), (0,))}, [1e-300], counted)
        for method in (Direct(), General(), Auto()):
            assert method.supports(net) == is_taken
    refused = f"channel 'all' needs {2**40} copies of one species; sampling takes at most"
    with pytest.raises(ValueError, match=refused):
        Direct().simulate(net, [5], [1.0], runs=1)
    with pytest.raises(ValueError, match=f"no exact method supports this network: {refused}"):
        sample_path(net, [5], 1.0)
