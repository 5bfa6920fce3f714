"""What `verify` sees of runs that depend on each other, and of small errors: its power, beside right runs that pass."""

from dataclasses import dataclass, replace
from itertools import islice
from typing import ClassVar

import numpy as np
import pytest
from known_systems import switch
from verified_networks import FEW

from kinetics import Direct, General, Network
from kinetics.sampling import EXACT_METHODS
from kinetics.trust.verification import MUTANTS, Reference, judge, rate_mutant, verify_against
from kinetics.trust.verification.rate_scores import RateScores, sight_of_rates
from kinetics.trust.verification.sampler_runs import SamplerRuns

RUNS = 4000
TWICE, HALVES, FIRST_TIME, ALIKE, NEXT_SEED = MUTANTS


@pytest.fixture(
    scope="module",
    params=[pytest.param(case, id=case[0], marks=[pytest.mark.validate] * (i < 2)) for i, case in enumerate(FEW)],
)
def sample(request):
    """Right runs of a network, without their paths: what is seen is seen in counts alone."""
    _, net, initial, times = request.param
    return replace(SamplerRuns.of(Reference.of(net, initial, times), Direct(), RUNS, seed=3), paths=(), next_paths=())


def seen_by(sample):
    return {finding.check for finding in judge(sample) if finding.failed}


def test_right_runs_pass(sample):
    assert seen_by(sample) == set()


@pytest.mark.parametrize(
    ("mutant", "check"),
    [
        (TWICE, "repeated runs"),
        (HALVES, "repeated runs"),
        (FIRST_TIME, "transitions"),
        (ALIKE, "correlated runs"),
        (NEXT_SEED, "repeated runs"),
    ],
    ids=lambda given: getattr(given, "name", given),
)
def test_runs_that_depend_on_each_other_are_seen(sample, mutant, check):
    """At 4,000 runs, on every one of six networks; two of them with --validate."""
    assert check in seen_by(mutant.applied(sample))


def changed(sample, change):
    """Counts at the times and at fine times changed alike."""
    return replace(sample, counts=change(sample.counts.copy()), fine=change(sample.fine.copy()))


def some_again(counts, first, last, step):
    counts[last::step] = counts[first::step][: len(counts[last::step])]
    return counts


def some_anywhere(counts):
    rng = np.random.default_rng(0)
    copies = rng.choice(len(counts), len(counts) // 100, replace=False)
    counts[copies] = counts[rng.integers(0, len(counts), copies.size)]
    return counts


def same_at_first(counts):
    counts[1::2, 0] = counts[::2, 0]
    return counts


def last_exchanged(counts, of_ten=3):
    ours = np.arange(len(counts) // 2)
    ours = 2 * ours[ours % 10 < of_ten]
    counts[ours, -1], counts[ours + 1, -1] = counts[ours + 1, -1].copy(), counts[ours, -1].copy()
    return counts


@pytest.mark.parametrize(
    ("change", "check"),
    [
        (lambda counts: some_again(counts, 8, 9, 10), "repeated runs"),
        (some_anywhere, "repeated runs"),
        (same_at_first, "correlated runs"),
        (last_exchanged, "transitions"),
    ],
    ids=["every tenth run again", "1 % of the runs again, anywhere", "pairs that begin alike", "30 % continue another"],
)
def test_dependence_of_some_runs_is_seen(sample, change, check):
    """At 4,000 runs, on every one of six networks; two of them with --validate."""
    assert check in seen_by(changed(sample, change))


def alike_at(counts, lag):
    """Runs i and i + lag alike, and at no other distance: groups sorted, and their pairs shuffled."""
    rng = np.random.default_rng(0)
    last = counts[:, -1, int(counts[:, -1].std(axis=0).argmax())]
    order = np.arange(len(counts))
    groups = order[: len(counts) // (8 * lag) * (8 * lag)].reshape(-1, 8, lag)
    ranks = np.argsort(last[groups], axis=1, kind="stable")
    shuffled = np.argsort(rng.random((len(groups), 4, lag)), axis=1)
    pairs = np.stack([np.take_along_axis(ranks[:, k::2], shuffled, axis=1) for k in (0, 1)], axis=2)
    order[: groups.size] = np.take_along_axis(groups, pairs.reshape(groups.shape), axis=1).ravel()
    return counts[order]


def test_runs_alike_at_other_distances_are_not_seen(sample):
    """As the report says; and at its distances they are."""
    assert seen_by(replace(sample, counts=alike_at(sample.counts, 5))) == set()
    assert "correlated runs" in seen_by(replace(sample, counts=alike_at(sample.counts, 4)))


def mixed_with(sample, start, share):
    """Some of the runs from another start, counts and fine counts."""
    reference = sample.reference

    def change(counts, times):
        few = int(share * len(counts))
        counts[:few] = Direct().simulate(reference.network, start, times, runs=few, seed=77).counts
        return counts

    counts = change(sample.counts.copy(), reference.solution.times)
    return replace(sample, counts=counts, fine=change(sample.fine.copy(), reference.fine_times))


def test_a_start_without_a_copy_is_seen_in_one_run_of_a_hundred(sample):
    """What no chain can do is not left to chance, where copies are conserved; decay alone can have lost one."""
    less = sample.reference.start - np.eye(len(sample.reference.start), dtype=int)[0]
    seen = seen_by(mixed_with(sample, less, 0.01))
    assert seen == (set() if len(less) == 1 else {"each time"})


@pytest.mark.parametrize(("share", "seen"), [(0.01, set()), (0.05, {"transitions"})])
def test_a_start_one_event_late_is_seen_in_one_run_of_twenty(share, seen):
    """From 60 tu apart, on the line of four; a start is seen at the first fine time, and one in a hundred is not."""
    _, net, initial, times = FEW[2]
    right = replace(SamplerRuns.of(Reference.of(net, initial, times), Direct(), RUNS, seed=3), paths=(), next_paths=())
    later = right.reference.start + net.stoichiometry[0]
    assert seen_by(mixed_with(right, later, share)) == seen


@pytest.mark.parametrize(("net", "initial", "times"), [case[1:] for case in FEW], ids=[case[0] for case in FEW])
def test_states_of_one_event_later_are_seen(net, initial, times):
    """In 1,000 runs: each count is that after the next event."""
    right = replace(SamplerRuns.of(Reference.of(net, initial, times), Direct(), 1000, 3), paths=(), next_paths=())
    paths = list(islice(Direct().sample_paths(net, initial, 3 * times[-1], seed=3), 1000))

    def later(grid):
        after = [np.minimum(np.searchsorted(path.times, grid, "right") + 1, path.times.size) for path in paths]
        return np.array([path.states[rows] for path, rows in zip(paths, after, strict=True)])

    assert seen_by(right) == set()
    wrong = replace(right, counts=later(np.array(times)), fine=later(right.reference.fine_times))
    assert seen_by(wrong) >= {"transitions"}


@dataclass(frozen=True)
class Exchanged(Direct):
    """Rates that belong to a network whose channels 0 and 1 have exchanged theirs."""

    name: ClassVar[str] = "exchanged"

    def simulate(self, network, *arguments, **options):
        return super().simulate(exchanged(network), *arguments, **options)

    def sample_paths(self, network, *arguments, **options):
        for path in super().sample_paths(exchanged(network), *arguments, **options):
            yield replace(path, network=network)


def exchanged(network):
    return network.with_rates(network.known_rates[[1, 0, *range(2, len(network.channels))]])


def test_channels_that_change_the_counts_alike_are_told_apart_by_paths():
    """Rates .6 and .4 of two ways from X to Y, exchanged: the counts are right, and the events show it in 200 runs."""
    back = {"back": ({"Y": 1}, {"X": 1})}
    net = Network.from_reactions({"one": ({"X": 1}, {"Y": 1}), "two": ({"X": 1}, {"Y": 1}), **back}, [0.6, 0.4, 1.0])
    reference = Reference.of(net, [10, 0], [1.0, 4.0])
    assert seen_by(SamplerRuns.of(reference, Direct(), 200, 3)) == set()
    wrong = SamplerRuns.of(reference, Exchanged(), 200, 3)
    assert seen_by(wrong) == {"choices"}
    assert seen_by(replace(wrong, paths=(), next_paths=())) == set()  # the control


def test_reactants_in_the_wrong_order_are_seen():
    """The combinations of 2 A + B for those of A + 2 B, in 1,000 runs, by counts alone."""
    reaction, start, times = {"join": ({"A": 1, "B": 2}, {"C": 1})}, [8, 12, 0], [0.1, 0.5]
    reference = Reference.of(Network.from_reactions(reaction, [0.02]), start, times)
    right = replace(SamplerRuns.of(reference, Direct(), 1000, 3), paths=(), next_paths=())
    assert seen_by(right) == set()
    law = Network.from_reactions(reaction, ["0.02 * A * (A - 1) / 2 * B * (B > 1)"])
    wrong = General().simulate(law, start, times, runs=1000, seed=3).counts
    assert "each time" in seen_by(replace(right, counts=wrong))


def test_opposite_runs_are_seen():
    """In groups of twenty, the lowest beside the highest."""
    net = switch(1.0, 2.0)
    sample = SamplerRuns.of(Reference.of(net, [400, 0], [0.3, 2.0]), Direct(), RUNS, seed=3)
    counts = sample.counts.copy()
    for group in counts.reshape(-1, 20, *counts.shape[1:]):
        order = np.argsort(group[:, 1, 0])
        group[:] = group[np.stack([order[:10], order[:9:-1]], axis=1).ravel()]
    assert seen_by(replace(sample, paths=())) == set()
    assert seen_by(replace(sample, counts=counts, paths=())) >= {"correlated runs"}


def test_a_few_repeated_runs_are_seen(sample):
    """One run in fifty is the one before."""
    fine = sample.fine.copy()
    fine[1::50] = fine[::50]
    assert "repeated runs" in seen_by(replace(sample, fine=fine))


@pytest.mark.parametrize("shift", [0, 1])
def test_paths_that_share_their_stream_are_seen(shift):
    """The next seed draws the same waits, from the start or one number later."""
    _, net, initial, times = FEW[5]
    right = SamplerRuns.of(Reference.of(net, initial, times), Direct(), 1000, seed=3)
    assert seen_by(right) == set()
    shared = replace(right, next_paths=right.paths[shift:], next_fine=right.fine)
    assert "waits" in seen_by(shared)


@pytest.fixture(scope="module")
def many_copies():
    return Reference.of(switch(1.0, 2.0), [120, 0], [0.3, 2.0])


def stated(reference, channel):
    """Runs after which `verify` says that it sees 1 %."""
    found = verify_against(reference, Direct(), 100, with_power=False)
    return next(rate.runs_for_one_percent for rate in found.rates if rate.channel == channel)


@pytest.mark.parametrize("channel", ["forward", "backward"])
def test_a_rate_one_percent_off_is_seen_in_the_stated_number_of_runs(many_copies, channel):
    """And not in a twentieth of them: what is stated is not far too many."""
    runs = int(stated(many_copies, channel))
    assert 10_000 < runs < 60_000
    mutant = rate_mutant(many_copies.network, Direct(), 5, channel, 0.01)
    right = SamplerRuns.of(many_copies, Direct(), runs, 5)
    assert seen_by(right) == set()
    assert "rates" in seen_by(mutant.applied(right))
    few = SamplerRuns.of(many_copies, Direct(), runs // 20, 5)
    assert seen_by(mutant.applied(few)) == set()


@pytest.mark.validate
@pytest.mark.parametrize("method", EXACT_METHODS)
@pytest.mark.parametrize(("net", "initial", "times"), [case[1:] for case in FEW], ids=[case[0] for case in FEW])
def test_every_rate_one_percent_off_is_seen_in_the_stated_number_of_runs(method, net, initial, times):
    """For rates that need up to 300,000 runs."""
    if not method().supports(net):
        pytest.skip("the method does not take this network")
    reference = Reference.of(net, initial, times)
    for rate in verify_against(reference, method(), 100, with_power=False).rates:
        if rate.runs_for_one_percent > 3e5:
            continue
        right = SamplerRuns.of(reference, method(), int(rate.runs_for_one_percent), 6)
        assert seen_by(right) == set()
        mutant = rate_mutant(net, method(), 6, rate.channel, 0.01)
        assert "rates" in seen_by(mutant.applied(right))


def test_the_power_that_is_stated_is_measured(many_copies):
    """Of each rate: 1 % off, and off by as much as is said to be seen."""
    found = verify_against(many_copies, Direct(), 3000, 2)
    assert found.passed, str(found)
    outcome = {mutant.name: mutant.caught_by for mutant in found.mutants}
    for rate in found.rates:
        assert 0.01 < rate.smallest < 0.1
        assert outcome[f"the rate of {rate.channel} 1 % too high"] == ()
        assert "rates" in outcome[f"the rate of {rate.channel} {100 * rate.smallest:.3g} % too high"]
    assert all(outcome[mutant.name] for mutant in MUTANTS)
    less = sight_of_rates(many_copies, 300_000, 1e-7)
    assert all(a.smallest < b.smallest / 5 for a, b in zip(less, found.rates, strict=True))


def p_values(reference, runs, seed):
    return np.array([f.p_value for f in judge(SamplerRuns.of(reference, Direct(), runs, seed))])


def excess(seeds, levels):
    """Of p-values at or below each level over their expected number, in standard deviations between seeds."""
    reference = Reference.of(switch(1.0, 2.0), [12, 0], [0.3, 2.0])
    found = np.array([p_values(reference, 300, seed) for seed in seeds])
    shares = (found[:, :, None] <= levels).mean(axis=1)
    return (shares.mean(axis=0) - levels) / (shares.std(axis=0) / len(shares) ** 0.5 + 1e-9)


def test_small_p_values_are_no_more_frequent_than_they_say():
    assert excess(range(0, 60, 2), np.array([0.05])).max() < 4.75


@pytest.mark.validate
def test_small_p_values_are_no_more_frequent_than_they_say_over_many_seeds():
    assert excess(range(0, 1000, 2), np.array([0.1, 0.01, 0.001])).max() < 4.75


def test_names_of_scores_are_those_of_the_channels(many_copies):
    found = [f.what for f in RateScores().findings(SamplerRuns.of(many_copies, Direct(), 200, 0))]
    assert found == [f"score of the rate of {name} at all times" for name in ("forward", "backward")]
