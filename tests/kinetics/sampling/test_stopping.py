"""Conditions at which runs end, as tables and programs; the rest is in the contract of the samplers."""

import numpy as np
import pytest

from kinetics import Model, Network
from kinetics.kernels.compiled import compiled
from kinetics.kernels.stopping import holds
from kinetics.network.predicates import Condition
from kinetics.runs import TruncatedRunsError
from kinetics.sampling import Direct
from kinetics.sampling.stopping import stop_at


@compiled
def does_hold(stop, table, counts):
    return holds(stop, table, counts)


PAIRS = Network.from_text("A + B <-> AB, 0.01, 0.1\n2 AB -> C, 0.001")
MODEL = Model(PAIRS, {"A": 2, "B": 1}, {"all A": {"A": 1, "AB": 1, "C": 2}, "half": {"A": 0.5}})
TABLES = {  # text -> comparisons
    "AB >= 3": 1,
    "AB > 2 & A <= 4 | !(B == 0 | C != 1)": 4,
    "3 * A - B / 3 + 1 < 2 * (B - A)": 1,
    "0.1 * A <= 0.3": 1,  # in doubles 3 * 0.1 is above 0.3
    "0.1 * A + 0.2 * B == 0.7": 1,
    "2 * A == 5": 1,
    "A == A": 1,
    "true & A >= 1 | false": 3,
    "not (not (A >= 2 and (B >= 1 or C >= 1)))": 3,
    "'all A' >= 5 & 'all A' - 2 * C != 4": 2,
    "init | 'deadlock' & A == 0": 4 + 4 + 1,
    "A * B >= 6": 0,
    "max(A, B) >= 4 & 'all A' > 3": 0,
    "(A >= 1) + (B >= 1) == 1": 0,
    "A / 7 < B / 11 | 1e-9 * A > 2e-9": 2,
    "A * 1.23456789012345678 > B": 0,  # its whole weights are too large for a table
}


@pytest.mark.parametrize("text", TABLES)
def test_tables_and_programs_hold_where_the_condition_does(text):
    condition = Condition(text, MODEL)
    states = np.random.default_rng(0).integers(0, 6, (300, 4))
    stop, is_there = stop_at(condition, PAIRS, states[0])
    # As numbers are written, not as doubles round them.
    written = {"0.1 * A <= 0.3": "A <= 3", "0.1 * A + 0.2 * B == 0.7": "A + 2 * B == 7"}.get(text, text)
    expected = Condition(written, MODEL).holds(states)
    assert [does_hold(stop, stop.table, np.append(state, 1)) for state in states] == expected.tolist()
    assert is_there == condition.holds(states[:1])[0]
    comparisons, place = 0, 0
    while place < stop.table.size:
        comparisons, place = comparisons + 1, place + 5 + 2 * int(stop.table[place + 4])
    assert comparisons == TABLES[text]
    assert (stop.codes.size > 0) == (TABLES[text] == 0)


def test_only_channels_that_change_what_it_reads_are_watched():
    assert stop_at("C >= 1", PAIRS, np.zeros(4, int))[0].affects_stop.tolist() == [False, False, True]
    assert stop_at("A * B >= 1", PAIRS, np.zeros(4, int))[0].affects_stop.tolist() == [True, True, False]
    with pytest.raises(ValueError, match="unknown name 'half'"):  # no whole sum
        stop_at(Condition("half >= 1", MODEL), PAIRS, np.zeros(4, int))


def test_a_truncated_run_is_censored_where_it_was_and_others_go_on():
    growth = Network.from_text("A -> 2 A, 1\nA -> 0, 0.9\nB -> C, 0.3")
    found = Direct().first_times(growth, {"A": 50, "B": 1}, "C >= 1", 100.0, runs=30, seed=4, max_events=1000)
    whole = Direct().first_times(growth, {"A": 50, "B": 1}, "C >= 1", 100.0, runs=30, seed=4)
    cut = ~found.is_reached
    assert 0 < cut.sum() < 30
    np.testing.assert_array_equal(found.times[~cut], whole.times[~cut])
    assert (found.observed[cut] < whole.observed[cut]).all()
    assert "runs were truncated, and are censored there: it made 1e+03 events" in str(found)
    with pytest.raises(ValueError, match="runs were observed from 0 to"):
        found.reached_by(100.0)
    with pytest.raises(TruncatedRunsError):  # without a horizon the other runs would never tell
        Direct().first_times(growth, {"A": 50, "B": 1}, "C >= 1", runs=30, seed=4, max_events=1000)
    with pytest.raises(TruncatedRunsError):
        Direct().sample_path(growth, {"A": 50, "B": 1}, 1e9, max_events=10, until="C >= 2")
