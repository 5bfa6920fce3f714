"""Counts at fixed times say what a path says at them, and what would mislead is refused."""

import numpy as np
import pytest

from kinetics.network import Network
from kinetics.runs import RESTART, JumpPath
from kinetics.runs.count_tables import MOST_CELLS, count_table
from kinetics.sampling import sample_path

PAIR = Network.from_text("A + B <-> AB, 0.02, 0.1")


def paths(n=3, end=10.25):
    return {f"run {r}": sample_path(PAIR, {"A": 6, "B": 4}, end, seed=7, run=r) for r in range(n)}


@pytest.mark.parametrize("every", [0.1, 1.0, 3.7, 10.25])
def test_each_row_is_the_path_at_that_time(every):
    runs = paths()
    table = count_table(runs, every)
    assert list(table) == ["run", "time", "A", "B", "AB"]
    assert list(dict.fromkeys(table["run"])) == list(runs)
    for name, path in runs.items():
        mine = table[table["run"] == name]
        assert len(mine) == int(path.end / every + 1e-9) + 1
        np.testing.assert_allclose(mine["time"], every * np.arange(len(mine)), rtol=1e-15)
        for _, row in mine.iterrows():  # added up anew, event by event
            counts = np.array(path.initial)
            for moment, channel in zip(path.times, path.channels, strict=True):
                if moment <= row["time"]:
                    counts = counts + PAIR.stoichiometry[channel]
            assert list(row[["A", "B", "AB"]]) == list(counts)


def test_times_read_as_they_were_asked_for():
    """Not 0.30000000000000004; and a run whose length is a multiple but for rounding has its last look."""
    table = count_table({"a": JumpPath(PAIR, {"A": 1}, [], [], end=0.3)}, 0.1)
    assert table["time"].tolist() == [0.0, 0.1, 0.2, 0.3]


def test_an_event_at_the_time_of_a_look_has_happened():
    table = count_table({"a": JumpPath(PAIR, {"AB": 1}, [2.0], [1], end=4.0)}, 2.0)
    assert table["AB"].tolist() == [1, 0, 0]


def test_no_runs():
    assert list(count_table({}, 1.0)) == ["run", "time"]


@pytest.mark.parametrize(
    ("every", "said"),
    [
        (0.0, "every = 0; expected a time between two looks in tu, finite and above 0"),
        (-2.0, "every = -2; expected"),
        (float("nan"), "every = nan; expected"),
        (float("inf"), "every = inf; expected"),
        (10.5, r"every = 10\.5 tu is longer than run run 0, which ended at 10\.25 tu; take a shorter time"),
        (1e-6, rf"rows of 5 cells; a table has at most {MOST_CELLS} cells: take a longer time"),
    ],
)
def test_times_that_cannot_be(every, said):
    with pytest.raises(ValueError, match=said):
        count_table(paths(), every)


def test_looks_closer_than_events_are_told_apart():
    path = JumpPath(PAIR, {"AB": 2}, [1.0, 1.0], [1, 1], end=4.0, resolution=0.5)
    assert count_table({"a": path}, 0.5)["AB"].tolist() == [2, 2, 0, 0, 0, 0, 0, 0, 0]
    with pytest.raises(ValueError, match=r"every = 0\.4 tu is shorter than 0\.5 tu, the time within which"):
        count_table({"a": path}, 0.4)


def test_a_run_that_was_put_back_to_its_start():
    """Its looks would all show the start, however often it left it."""
    path = JumpPath(PAIR, {"AB": 2}, [1.5, 1.5], [1, RESTART], end=4.0)
    assert path.at([0.0, 1.0, 2.0, 3.0])[:, 2].tolist() == [2, 2, 2, 2]
    with pytest.raises(ValueError, match=r"run a was put back to its start after each event: .* are too low; take its"):
        count_table({"a": path}, 1.0)


def test_runs_that_do_not_fit_one_table():
    first = JumpPath(PAIR, {"AB": 2}, [], [], end=4.0)
    other = JumpPath(Network.from_text("A -> B, 1"), {"A": 2}, [], [], end=4.0)
    with pytest.raises(ValueError, match="runs a and b are of two networks; a table holds runs of one"):
        count_table({"a": first, "b": other}, 1.0)
    closed = JumpPath(PAIR, {"AB": 2}, [], [], end=4.0, open_channels=[True, False])
    assert len(count_table({"a": closed, "b": closed}, 1.0)) == 10
    with pytest.raises(ValueError, match="runs a and b did not have the same channels open, which counts cannot say"):
        count_table({"a": first, "b": closed}, 1.0)
