import json
from dataclasses import dataclass
from itertools import count, islice
from typing import ClassVar

import numpy as np
import pytest
from known_systems import line, network, switch
from verified_networks import FEW, MANY, dimers, enzyme

from kinetics import Direct, FiniteStateProjection, General, JumpPath, Network
from kinetics.network.sparse_tables import SparseTable
from kinetics.runs import Ensemble
from kinetics.sampling import SAMPLING_METHODS
from kinetics.trust import verify
from kinetics.trust.verification import SAMPLER_CHECKS, Reference, SamplerFinding, verify_against


@dataclass(frozen=True)
class Slow:
    """The direct method in numpy, all runs side by side; `mutation` makes it wrong."""

    mutation: str = ""
    name: ClassVar[str] = "slow"

    def propensities(self, net, states):
        if self.mutation == "combinatorics":  # s**2 for s(s-1)/2
            net = network(net.species, reactions_of(net), net.rate_constants, "product")
        if self.mutation == "off by one":  # one reactant too many is counted
            return net.propensities(states + 1) * (net.propensities(states) > 0)
        return net.propensities(states)

    def simulate(self, net, initial, times, runs=1000, seed=0, threads=None):
        rng = np.random.default_rng(seed)
        states = np.tile(net.state(initial), (runs, 1))
        seen = np.zeros((runs, len(times), states.shape[1]), dtype=np.int64)
        clocks, stale = np.zeros(runs), self.propensities(net, states)
        going = np.arange(runs)
        while going.size:
            rates = self.propensities(net, states[going])
            if self.mutation == "stale":  # the propensities of before the last event, where they still can fire
                old = np.where(rates > 0, stale[going], 0.0)
                stale[going] = rates
                rates = np.where(old.sum(axis=1, keepdims=True) > 0, old, rates)
            total = rates.sum(axis=1)
            with np.errstate(divide="ignore"):
                after = clocks[going] + rng.exponential(size=going.size) / total
            for t, time in enumerate(times):
                reached = (clocks[going] <= time) & (after > time)
                seen[going[reached], t] = states[going[reached]]
            clocks[going] = after
            moving = after <= times[-1]
            going, rates, total = going[moving], rates[moving], total[moving]
            chosen = (np.cumsum(rates, axis=1) <= (rng.random(going.size) * total)[:, None]).sum(axis=1)
            states[going] += net.stoichiometry[np.minimum(chosen, rates.shape[1] - 1)]
        return Ensemble(net, np.asarray(times, dtype=float), seen)


@dataclass(frozen=True)
class Redraw:
    """Tau-leaping that draws again until no count is negative: biased, however short the leaps look."""

    name: ClassVar[str] = "redraw"

    def simulate(self, net, initial, times, runs=1000, seed=0, threads=None):
        rng = np.random.default_rng(seed)
        states = np.tile(net.state(initial), (runs, 1))
        seen, now = np.zeros((runs, len(times), states.shape[1]), dtype=np.int64), 0.0
        for t, time in enumerate(times):
            while now < time:
                leap = min(0.02, time - now)
                rates = net.propensities(states) * leap
                after = states + rng.poisson(rates) @ net.stoichiometry
                while (bad := (after < 0).any(axis=1)).any():
                    after[bad] = states[bad] + rng.poisson(rates[bad]) @ net.stoichiometry
                states, now = after, now + leap
            seen[:, t] = states
        return Ensemble(net, np.asarray(times, dtype=float), seen)


@dataclass(frozen=True)
class ShortWords(Direct):
    """Direct, but for waits from random numbers of so many bits."""

    bits: int
    name: ClassVar[str] = "short words"
    made: ClassVar[dict] = {}

    def simulate(self, net, initial, times, runs=1000, seed=0, threads=None, first_run=0):
        paths = list(islice(self.sample_paths(net, initial, times[-1], seed), runs))
        return Ensemble(net, np.asarray(times, dtype=float), np.array([path.at(times) for path in paths]))

    def sample_paths(self, net, initial, end, seed=0, first_run=0):
        for run in count(first_run):
            key = (self.bits, id(net), tuple(initial), end, seed, run)
            if key not in self.made:
                self.made[key] = self.drawn(net, initial, end, np.random.default_rng((seed, run)))
            yield self.made[key]

    def drawn(self, net, initial, end, rng):
        state, times, channels, now = net.state(initial), [], [], 0.0
        while True:
            rates = net.propensities(state)
            word = int(rng.integers(1, 2**self.bits))
            now -= np.log(word / 2.0**self.bits) / rates.sum() if rates.any() else -np.inf
            if now > end:
                return JumpPath(net, net.state(initial), np.array(times), np.array(channels, dtype=np.int64), end)
            channels.append(int(np.searchsorted(np.cumsum(rates), rng.random() * rates.sum(), "right")))
            times.append(now)
            state = state + net.stoichiometry[channels[-1]]


def reactions_of(net):
    rows = zip(net.reactants, net.stoichiometry, strict=True)
    return {name: (before, before + change) for name, (before, change) in zip(net.channels, rows, strict=True)}


# The twelve networks with names; twenty random ones are long runs.
each_network = pytest.mark.parametrize(
    ("net", "initial", "times"),
    [pytest.param(*case, id=name, marks=[pytest.mark.validate] * (i >= 12)) for i, (name, *case) in enumerate(MANY)],
)


@pytest.fixture(scope="module")
def references():
    """The exact side of each network, for all methods."""
    made: dict[int, Reference] = {}

    def reference(net, initial, times):
        if id(net) not in made:
            made[id(net)] = Reference.of(net, initial, times)
        return made[id(net)]

    return reference


@each_network
@pytest.mark.parametrize("method", SAMPLING_METHODS)
def test_samplers_follow_the_exact_distribution(method, net, initial, times, references):
    """Each of the checks on 32 networks and seven methods gives a false alarm one time in a million, so all of
    them together do less than once in 5000. By default 12 of the networks are asked.
    """
    paths = 0.1 if any(net is one for _, one, _, _ in FEW) else 0.03  # waits are seen on the few; else, 30 paths each
    if not method().supports(net):
        with pytest.raises(ValueError, match="takes at most 2"):
            verify(net, method(), initial, times)
        return
    found = verify_against(references(net, initial, times), method(), 1000, 7, with_power=False, paths=paths)
    assert found.passed, str(found)
    assert found.is_bound
    assert len(found.findings) > 100


@pytest.mark.validate
@each_network
@pytest.mark.parametrize("method", SAMPLING_METHODS)
def test_samplers_follow_the_exact_distribution_to_the_second_digit(method, net, initial, times):
    if not method().supports(net):
        pytest.skip("the method does not take this network")
    found = verify(net, method(), initial, times, runs=200_000, seed=8, with_power=False)
    assert found.passed, str(found)


def test_there_are_thirty_networks():
    assert len(MANY) >= 30


def test_the_slow_sampler_without_a_mutation_passes():
    for _, net, initial, times in (FEW[3], FEW[5]):
        found = verify(net, Slow(), initial, times, runs=10_000, seed=1, with_power=False)
        assert found.passed, str(found)


def verified(mutation, net, initial):
    return verify(net, Slow(mutation), initial, [0.5, 4.0], runs=10_000, seed=1, with_power=False)


def test_squares_for_pairs_are_caught():
    assert not verified("combinatorics", dimers(), [17, 0]).passed
    assert verified("combinatorics", enzyme(), [3, 12, 0, 0]).passed  # without like reactants it is the same


@pytest.mark.parametrize(("net", "initial"), [(dimers(), [17, 0]), (enzyme(), [3, 12, 0, 0])])
def test_an_off_by_one_reactant_is_caught(net, initial):
    assert not verified("off by one", net, initial).passed


@pytest.mark.parametrize(("net", "initial"), [(dimers(), [17, 0]), (enzyme(), [3, 12, 0, 0])])
def test_a_stale_propensity_is_caught(net, initial):
    assert not verified("stale", net, initial).passed


def test_a_biased_redraw_is_caught():
    # Pairs die out in large leaps: the last ones are drawn again and again.
    net = network("X", {"pair": ((2,), (0,)), "death": ((1,), (0,))}, [5.0, 10.0])
    assert not verify(net, Redraw(), [10], [0.04, 0.2], runs=20_000, seed=2, with_power=False).passed


@pytest.mark.parametrize(("bits", "passes"), [(53, True), (32, False), (24, False)])
def test_short_random_numbers_in_the_waits_are_caught(bits, passes):
    found = verify(switch(3.0, 5.0), ShortWords(bits), [20, 0], [1.0], runs=100, seed=3, with_power=False)
    assert found.passed is passes
    assert passes or "waits are finer than 32 bits" in {failure.what for failure in found.failures}


def rare_among_many(n=2**15):
    """Births, each by a channel of chance just below 2**-32 that lies between the steps of 32-bit random numbers.

    The other channels change nothing. All sums of propensities are exact, and the total is 1.
    """
    rare = 2.0**-32 - 2.0**-40
    rates = np.tile([1.0 / n - rare, rare], n)
    made = SparseTable.of_entries((2 * n, 1), 2 * np.arange(n) + 1, np.zeros(n, dtype=int), np.ones(n, dtype=int))
    none = SparseTable.of_entries((2 * n, 1), *np.zeros((3, 0), dtype=int))
    return Network(("X",), [f"r{i}" for i in range(2 * n)], none, made, np.ones(2 * n), rates)


@dataclass(frozen=True)
class ShortChoice:
    """Exact for channels without reactants, but that the choice is made by random numbers of so many bits."""

    bits: int
    name: ClassVar[str] = "short choice"
    last: ClassVar[dict] = {}  # counts at the first grid that was asked for, by bits and seed

    def simulate(self, net, initial, times, runs=1000, seed=0, threads=None):
        rng = np.random.default_rng(seed)
        if (self.bits, seed) in self.last:  # runs do not depend on the grid, and all grids end together
            return Ensemble(net, np.asarray(times, dtype=float), self.last[self.bits, seed][:, -len(times) :])
        ladder = np.cumsum(net.propensities(net.state(initial)))
        seen = np.tile(net.state(initial), (runs, len(times), 1))
        for run in range(runs):
            for t, gap in enumerate(np.diff(times, prepend=0.0)):
                words = rng.integers(0, 2**self.bits, rng.poisson(ladder[-1] * gap))
                chosen = np.searchsorted(ladder, words / 2.0**self.bits * ladder[-1], "right")
                seen[run, t:] += net.sparse_stoichiometry.at(chosen).sum()  # of one species: the keys are the channels
        self.last[self.bits, seed] = seen
        return Ensemble(net, np.asarray(times, dtype=float), seen)


@dataclass(frozen=True)
class SolvedOnce(FiniteStateProjection):
    """The projection, which keeps its last answer; for one network only."""

    answers: ClassVar[list] = []

    def distribution(self, network, start, grid):
        if not self.answers:
            self.answers.append(super().distribution(network, start, grid))
        return self.answers[0]


@pytest.fixture(scope="module")
def many_channels():
    return rare_among_many()


@pytest.mark.parametrize(("bits", "passes"), [(53, True), (32, False)])
def test_short_random_numbers_in_the_choice_are_caught(bits, passes, many_channels):
    """A channel of chance below 2**-32 never fires, or too often; many of them together show it.

    Together they fire 25 times: none at all has the chance exp(-25).
    """
    found = verify(many_channels, ShortChoice(bits), [0], [2.0**15], 100, 3, solver=SolvedOnce(), with_power=False)
    assert found.passed is passes, str(found)


@dataclass(frozen=True)
class CountsOf:
    """The direct method without its paths, whose network and counts may be changed."""

    network: object = None
    change: object = None
    name: ClassVar[str] = "counts"

    def simulate(self, net, initial, times, runs=1000, seed=0, threads=None):
        made = Direct().simulate(self.network or net, initial, times, runs=runs, seed=seed)
        return made if self.change is None else Ensemble(net, made.times, self.change(made.counts.copy()))


def test_a_rate_wrong_by_four_percent_is_caught():
    wrong = CountsOf(line().with_rates(line().rate_constants * 1.04))
    assert not verify(line(), wrong, [16, 0, 0, 0], [60.0, 500.0], 20_000, 4, with_power=False).passed


def test_a_space_without_end():
    net = network("X", {"birth": ((0,), (1,)), "death": ((1,), (0,))}, [10.0, 1.0])
    solver = FiniteStateProjection()
    found = verify(net, Direct(), [0], [1.0, 8.0], runs=5000, seed=5, solver=solver, with_power=False)
    assert found.passed, str(found)
    assert {check.name: check.findings for check in found.checks}["transitions"] > 0
    late = CountsOf(net.with_rates([10.5, 1.0]))
    assert not verify(net, late, [0], [1.0, 8.0], 20_000, 5, solver=solver, with_power=False).passed


def test_impossible_states_are_not_left_to_chance():
    def escape(counts):
        counts[0, 0] = [21, 0]
        return counts

    found = verify(switch(), CountsOf(change=escape), [20, 0], [1.0], runs=5000, seed=6, with_power=False)
    assert "states that are impossible at 1 tu" in {failure.what for failure in found.failures}
    assert verify(switch(), CountsOf(), [20, 0], [1.0], runs=5000, seed=6, with_power=False).passed


def test_reading_a_verification():
    found = verify(switch(), Direct(), [5, 0], [1.0], runs=1000, seed=9)
    assert str(found).startswith(
        f"ssa: {len(found.findings)} findings on 1000 runs (seed 9), 0 failed; a correct sampler"
    )
    assert "power, measured on mutants of these runs, each made once" in str(found)
    assert "at distances other than 1, 2, 3, 4, 8 and half of the runs" in str(found)
    data = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert data["passed"]
    assert data["failures"] == []
    assert [check["name"] for check in data["checks"]] == [check.name for check in SAMPLER_CHECKS]
    assert data["power"]["not_seen"]
    assert {rate["channel"] for rate in data["power"]["rates"]} == {"forward", "backward"}
    assert SamplerFinding("impossible", 1.0, 0.0, 0.0).failed


def test_a_solution_without_a_proven_error_is_called_an_estimate():
    """A law that saturates has a bound; one that may round to another value has none, and is named."""
    for law, unbounded in (("X / (1 + X)", ()), ("floor(X / 3 * 3) / (1 + X)", ("death",))):
        net = Network.from_reactions({"birth": ({}, {"X": 1}), "death": ({"X": 1}, {})}, [2.0, law])
        solver = FiniteStateProjection()
        found = verify(net, General(), [0], [1.0, 2.0], runs=1000, seed=1, solver=solver, with_power=False)
        assert found.passed, str(found)
        assert found.is_bound == (not unbounded)
        assert found.unbounded == unbounded
        assert ("an estimate, holds: no bound on the rounding of 'death'" in str(found)) == bool(unbounded)
    assert "an estimate, holds" not in str(verify(switch(), Direct(), [5, 0], [1.0], 200, with_power=False))


@pytest.mark.parametrize(
    ("options", "message"), [({"runs": 10}, "runs = 10; expected"), ({"false_alarm": 0.0}, "false_alarm = 0")]
)
def test_bad_input(options, message):
    with pytest.raises(ValueError, match=message):
        verify(switch(), Direct(), [5, 0], [1.0], **options)


def test_nothing_can_be_compared_at_time_0():
    with pytest.raises(ValueError, match="times begin at 0"):
        verify(switch(), Direct(), [5, 0], [0.0, 1.0])
