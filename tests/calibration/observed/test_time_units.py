"""Units of time in the titles of columns."""

import numpy as np
import pytest

from calibration.observed.counts import read_counts
from calibration.observed.reading import read_observed
from kinetics import Network

HOURS = Network.from_text("time unit: h\nfade: A -> B, 1")


def written(folder, text, name="a.csv"):
    (folder / name).write_text(text)
    return folder / name


@pytest.mark.parametrize("title", ["time (min)", "time [min]", "time(minutes)"])
def test_times_are_converted(tmp_path, title):
    data = read_counts(HOURS, written(tmp_path, f"{title},A\n0,5\n90,3\n"))
    assert data.runs[0].times.tolist() == [1.5]


def test_events_and_their_runs_are_converted(tmp_path):
    events = written(tmp_path, "run,time (min),channel\na,30,fade\n")
    runs = written(tmp_path, "run,start (min),end (h),A\na,0,2,5\n", "runs.csv")
    path = read_observed(HOURS, events, runs)["a"]
    assert (path.times.tolist(), path.end) == ([0.5], 2.0)


def test_a_network_without_a_unit_takes_times_as_they_are(tmp_path):
    data = read_counts(Network.from_text("A -> B, 1"), written(tmp_path, "time (fortnight),A\n0,5\n2,3\n"))
    assert data.runs[0].times.tolist() == [2.0]


def test_long_tables_have_units_too(tmp_path):
    data = read_counts(HOURS, written(tmp_path, "time (d),species,count\n0,A,5\n0.5,A,3\n"))
    np.testing.assert_allclose(data.runs[0].times, [12.0])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "time (moons),A\n0,5\n1,3\n",
            "a.csv: times in moons, but the network's unit of time is h, and moons is no unit",
        ),
        ("time,time (min),A\n0,0,5\n1,60,3\n", "a.csv has two columns of time"),
        ("time (min),A\n0,5\nx,3\n", r"a.csv, line 3: time \(min\) = x; expected a finite number"),
    ],
)
def test_what_cannot_be_converted_is_refused(tmp_path, text, said):
    with pytest.raises(ValueError, match=said):
        read_counts(HOURS, written(tmp_path, text))
