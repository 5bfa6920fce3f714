"""Rebinding after breaks: counted by hand, seen where it is injected, and not where it is not."""

import numpy as np
import pytest
from doubtful_runs import CASES, broken
from synthetic_runs import line_network

from calibration import diagnose
from calibration.estimating.diagnosing.rebinding import Rebinding, Within, binomial_tail, excess, undoings
from kinetics.network import Network
from kinetics.runs import RESTART, JumpPath
from kinetics.support.intervals import exact_limits

NETWORK = Network(("A", "B"), ("join", "break"), [[2, 0], [0, 1]], [[-2, 1], [2, -1]], [1, 1], time_unit="tu")
JOIN, BREAK = 0, 1


def by_title(paths, bonds=None):
    return {each.title: each for each in diagnose(paths, bonds=bonds, tests=[Rebinding((2.0,))]).results}


def test_windows_by_hand():
    """h = A (A - 1) / 2 is 1, 6, 1 and 6 in turn; of two breaks the first is undone after 1 tu, the second after 3."""
    path = JumpPath(NETWORK, [2, 2], [10.0, 11.0, 20.0, 23.0], [BREAK, JOIN, BREAK, JOIN], 30.0)
    (found, single) = by_title([path]).values()
    inside, outside = 6 * 1 + 1 * 1 + 6 * 2, 1 * 10 + 1 * 8 + 6 * 1 + 1 * 7
    assert found.events == 2
    assert found.statistic == pytest.approx(1 - 1 * inside / outside)
    share = inside / (inside + outside)
    assert found.p_value == pytest.approx(1 - (1 - share) ** 2)
    assert single.p_value == found.p_value
    assert "1 of 2 breaks were undone within 2 tu where 0.613 are expected" in found.seen


def test_a_restart_ends_the_window():
    whole = JumpPath(NETWORK, [2, 2], [10.0, 11.0, 20.0], [BREAK, JOIN, JOIN], 30.0)
    cut = JumpPath(NETWORK, [2, 2], [10.0, 10.0, 11.0, 20.0], [BREAK, RESTART, JOIN, RESTART], 30.0)
    assert by_title([whole])["all breaks: rebinding within 2 tu"].p_value is not None
    silent = by_title([cut])["all breaks: rebinding within 2 tu"]
    assert silent.p_value is None
    assert "restarted" in silent.reason


def test_why_it_is_not_testable():
    idle = JumpPath(NETWORK, [2, 2], [], [], 30.0)
    assert {each.reason for each in by_title([idle]).values()} == {"no breaks"}
    apart = JumpPath(NETWORK, [2, 2], [10.0], [BREAK], 30.0)
    assert {each.reason for each in by_title([apart]).values()} == {"no joins to compare with"}
    joins = Network(("A", "B"), ("join",), [[2, 0]], [[-2, 1]], [1], time_unit="tu")
    assert by_title([JumpPath(joins, [4, 0], [1.0], [0], 3.0)]) == {}  # nothing undoes anything: it is not asked


def test_pairs_of_the_line_of_four():
    network = line_network()
    named = {network.channels[p.join]: [network.channels[b] for b in p.breaks] for p in undoings(network)}
    assert named == {"1+1->2": ["2->1+1"], "1+2->3": ["3->1+2"], "1+3->4": ["4->1+3"], "2+2->4": ["4->2+2"]}


def test_the_sum_of_binomials_is_theirs():
    """Against a million draws; a tail of 1e-12 against a single binomial."""
    rng = np.random.default_rng(1)
    counted = [Within(0, 50, 4, 0.02, 0.98), Within(0, 9, 2, 0.1, 0.9)]
    drawn = rng.binomial(50, 0.02, 10**6) + rng.binomial(9, 0.1, 10**6)
    assert binomial_tail(counted) == pytest.approx(np.mean(drawn >= 6), rel=0.05)
    small = binomial_tail([Within(0, 30, 12, 0.01, 0.99)])
    assert small == pytest.approx(6.9e-17, rel=0.1, abs=0.0)


def test_injected_rebinding_is_seen_and_measured():
    """4 % of some 500 breaks, 1 tu later on average: 3.5 % within 2 tu. Seen in all of 8 studies at 5 %, and
    measured without bias within 5 standard errors; the control without it is not seen."""
    rng = np.random.default_rng(2)
    case = CASES["rebinding"]
    found = [diagnose(broken(0.04, rng)[0], tests=[case.diagnostic]).results[0] for _ in range(8)]
    assert max(each.p_value for each in found) < 0.05
    shares = [each.statistic / each.events for each in found]
    assert abs(np.mean(shares) - 0.04 * (1 - np.exp(-2))) < 5 * 0.01 / np.sqrt(8)
    control = [case.p_value(case.sound, rng) for _ in range(8)]
    assert np.median(control) > 0.1


def test_pieces_that_are_known_are_counted_by_themselves():
    """The same two cubes within 2 tu: far less of it by chance, so that p < 1e-10, measured without bias."""
    rng = np.random.default_rng(3)
    paths, bonds = broken(0.04, rng)
    found = by_title(paths, bonds)
    mixed = found["all breaks: rebinding within 2 tu"]
    same = found["all breaks: rebinding within 2 tu, same pieces"]
    assert same.p_value < mixed.p_value
    assert same.p_value < 1e-10
    assert same.statistic / same.events == pytest.approx(0.04 * (1 - np.exp(-2)), abs=5 * 0.04**0.5 / 500**0.5)
    others = [np.arange(2 * path.times.size).reshape(-1, 2) for path in paths]  # control: no pair meets twice
    strangers = by_title(paths, others)["all breaks: rebinding within 2 tu, same pieces"]
    assert strangers.p_value == pytest.approx(1.0)
    assert strangers.events == same.events
    with pytest.raises(ValueError, match="bonds of 1 runs"):
        diagnose(paths, bonds=bonds[:1])


def test_known_pieces_are_seen_among_all_tests():
    """4 % of 500 breaks, after the correction for all tests; without it nothing is doubtful."""
    rng = np.random.default_rng(4)
    paths, bonds = broken(0.04, rng)
    assert "all breaks: rebinding within 2 tu, same pieces" in diagnose(paths, bonds=bonds).doubtful
    paths, bonds = broken(0.0, rng)
    assert not any("rebinding" in name for name in diagnose(paths, bonds=bonds).doubtful)


def test_the_interval_carries_the_uncertainty_of_what_is_expected():
    """Of 2,000 studies at least 93 % hold the truth; with the expected number taken as known fewer than 90 % do."""
    rng = np.random.default_rng(5)
    inside, outside, truth = 0.5, 0.5, 5
    held = known = 0
    for _ in range(2000):
        seen, rest = rng.poisson(20 + truth), rng.poisson(20)
        each = Within(100, int(seen + rest), int(seen), inside, outside)
        found, low, high = excess([each])
        assert low <= found <= high
        held += low <= truth <= high
        limits = np.array(exact_limits(seen, 1.0)) - each.expected
        known += limits[0] <= truth <= limits[1]
    assert held / 2000 > 0.93
    assert known / 2000 < 0.90
