"""Tables of observed runs: what they say is what happened, and what cannot be is refused where it stands."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from synthetic_runs import line_network

from calibration.observed.reading import read_observed
from calibration.observed.tables import read_table
from kinetics.network import Network, Tank
from kinetics.runs import BY_SEVERAL, BY_UNKNOWN, BY_WALL, NO_BREAK, RESTART

DOCUMENT = Path(__file__).parents[3] / "docs" / "observed_events.md"
MARKED, COUNTS, RUNS = re.findall(r"```csv\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), flags=re.DOTALL)
TANK = Tank((2.0, 2.0, 3.0))
EVENTS = """run,time,channel
monday,12.5,1+1->2
monday,30.2,1+1->2
tuesday,17.4,2+2->4
"""


@pytest.fixture
def read(tmp_path):
    def read_texts(events, runs=None, network=None, **said):
        (tmp_path / "events.csv").write_text(events, encoding="utf-8")
        if runs is not None:
            (tmp_path / "runs.csv").write_text(runs, encoding="utf-8")
            runs = tmp_path / "runs.csv"
        return read_observed(network or line_network(), tmp_path / "events.csv", runs, **said)

    return read_texts


@pytest.fixture
def refused(read):
    def message(*arguments, **said):
        with pytest.raises(ValueError) as error:  # noqa: PT011 - the message is what the tests look at
            read(*arguments, **said)
        return str(error.value)

    return message


def fired(path):
    return ["restart" if j == RESTART else path.network.channels[j] for j in path.channels]


def test_marked_rows(read):
    observed = read(MARKED, tank=TANK)
    monday, tuesday = observed.values()
    assert fired(monday) == ["1+1->2", "1+1->2", "2->1+1", "1+2->3"]
    assert monday.times.tolist() == [12.5, 30.2, 41.0, 55.8]
    assert (monday.initial.tolist(), monday.end) == ([20, 0, 0, 0], 100.0)
    assert (tuesday.initial.tolist(), tuesday.end) == ([10, 5, 0, 0], 100.0)
    assert tuesday.times.tolist() == [17.4 - 3.0]
    assert monday.tank == tuesday.tank == TANK


def test_counts_tell_what_fired(read):
    (inferred,) = read(COUNTS).values()
    named = read(MARKED)["monday"]
    np.testing.assert_array_equal(inferred.channels, named.channels)
    np.testing.assert_array_equal(inferred.times, named.times)


def test_counts_alone(read):
    text = "run,time,monomer,dimer\nx,1,4,1\nx,2,2,2\nx,7,4,1\n"
    (path,) = read(text, "run,start,end,monomer\nx,0,9,6\n").values()
    assert fired(path) == ["1+1->2", "1+1->2", "2->1+1"]


def test_a_row_without_a_change_is_no_event(read):
    (path,) = read(COUNTS.replace("monday,41.0", "monday,35,,16,2,0,0\nmonday,41.0")).values()
    assert fired(path) == ["1+1->2", "1+1->2", "2->1+1", "1+2->3"]


def test_a_table_of_runs(read):
    observed = read(EVENTS, RUNS)
    monday, tuesday = observed.values()
    assert monday.open_channels.all()
    assert [
        name for name, is_open in zip(tuesday.network.channels, tuesday.open_channels, strict=True) if not is_open
    ] == [
        *("1+1->2", "1+2->3"),
    ]
    assert (tuesday.end, tuesday.tank) == (100.0, TANK)


def test_a_run_without_events_and_a_start_from_single_cubes(read):
    observed = read(
        EVENTS[: EVENTS.index("tuesday")], "run,start,end\nmonday,0,50\nquiet,0,70\n", cubes=12, single="monomer"
    )
    quiet = observed["quiet"]
    assert (quiet.initial.tolist(), quiet.times.size, quiet.end) == ([12, 0, 0, 0], 0, 70.0)


def test_restarts_and_a_coarse_clock(read):
    text = "run,time,channel\na,1,1+1->2\na,1,restart\na,2,1+1->2\na,2,restart\na,3,1+1->2\na,3,1+1->2\n"
    path = read(text, "run,start,end,monomer,resolution\na,0,4,4,0.5\n")["a"]
    assert path.states[:, 1].tolist() == [0, 1, 0, 1, 0, 1, 2]


def test_both_kinds_of_file_say_the_same(tmp_path):
    (tmp_path / "events.csv").write_text(COUNTS, encoding="utf-8-sig")
    frame = pd.read_csv(tmp_path / "events.csv")
    frame.to_parquet(tmp_path / "events.parquet")
    one, other = (read_observed(line_network(), tmp_path / f"events.{kind}")["monday"] for kind in ("csv", "parquet"))
    np.testing.assert_array_equal(one.times, other.times)
    np.testing.assert_array_equal(one.channels, other.channels)


HEAD = "run,time,channel,monomer\na,0,start,10\n"


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("a,2,1+1->2\na,1,1+1->2\na,9,end\n", "line 4, run a, time 1: this comes after a row with a later time; sort"),
        ("a,2,1+1->2\na,2,1+1->2\na,9,end\n", "line 4, run a, time 2: a second row at this time; if the clock"),
        ("a,0,1+1->2\na,9,end\n", "line 3, run a, time 0: a second row at this time"),
        ("a,-1,1+1->2\na,9,end\n", "time -1: this run has not started yet; it starts at 0"),
        ("a,10,1+1->2\na,9,end\n", "line 3, run a, time 10: this run is over; it ends at 9"),
        ("a,nan,1+1->2\na,9,end\n", "line 3, run a: time = nan; expected a finite number"),
        ("a,,1+1->2\na,9,end\n", "line 3, run a: time is empty; expected a number"),
        ("a,soon,1+1->2\na,9,end\n", "line 3, run a: time = soon; expected a finite number"),
        ("a,inf,end\n", "line 3, run a: time = inf; expected a finite number"),
        ("a,0,end\n", "line 2, run a: it ends at 0 and starts at 0; the end comes later"),
        ("a,1,1+1->2\n", "run a has no end; add a row with end in the column channel, or give a table of runs"),
        ("a,9,end\nb,1,1+1->2\nb,9,end\n", "run b has no start; add a row with start"),
        ("a,9,end\na,9.5,1+1->2\n", "the start must be the first row of a run and the end its last"),
        ("a,9,end\na,9,end\n", "line 4, run a: a second end of this run"),
        ("a,9,end\n,1,1+1->2\n", "run without a name has no start"),
        ("a,1,1+1>2\na,9,end\n", "line 3, run a: unknown channel '1+1>2'; did you mean 1+1->2"),
        ("a,1,2->1+1\na,9,end\n", "run a, times from its start: event 0 (2->1+1 at 1) needs 1 of 'dimer'; there are 0"),
        ("a,1,\na,9,end\n", "line 3, run a: neither a channel nor counts"),
        ("a,1,1+1->2,9\na,9,end\n", "line 3, run a: 1+1->2 leaves monomer 8, dimer 1, but the counts say monomer 9"),
        ("a,1,1+1->2\na,9,end,9\n", "run a: it ends with monomer 9, but its rows leave monomer 8, dimer 1"),
        (
            "a,1,1+1->2,x,y\na,9,end\n",
            "line 3 has 5 cells for 4 titles; put a name that holds a comma in double quotes",
        ),
    ],
)
def test_rows_that_cannot_be(refused, rows, said):
    assert said in refused(HEAD + rows)


def test_the_controls_are_read(read):
    """The head above with sound rows: what is refused is refused for its fault."""
    path = read(HEAD + "a,1,1+1->2\na,2,1+1->2\na,9,end\n")["a"]
    assert path.states[-1].tolist() == [6, 2, 0, 0]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "18,1,0,0\nmonday,30",
            "17,1,0,0\nmonday,30",
            "time 12.5: monomer -3, dimer +1; cubes go from 20 to 19, but no",
        ),
        (
            "18,1,0,0\nmonday,30",
            "16,2,0,0\nmonday,30",
            "time 12.5: monomer -4, dimer +2: no channel does that; nearest are 1+1->2",
        ),
        (
            "18,1,0,0\nmonday,30",
            "18,-1,0,0\nmonday,30",
            "line 3, run monday: -1 copies of dimer; expected a whole number",
        ),
        (
            "18,1,0,0\nmonday,30",
            "18,.5,0,0\nmonday,30",
            "line 3, run monday: .5 copies of dimer; expected a whole number",
        ),
        (
            "18,1,0,0\nmonday,30",
            "18,1,,0\nmonday,30",
            "line 3, run monday: the cell of trimer is empty; write 0 if there are none",
        ),
        ("start,20,0,0,0", "start,20,,0,0", "line 2, run monday: the cell of dimer is empty"),
        ("start,20,0,0,0", "start", "line 2, run monday: no counts at the start of this run; give a column"),
        (
            "end,17,0,1,0",
            "end,18,1,0,0",
            "run monday: it ends with monomer 18, dimer 1, but its rows leave monomer 17, trimer 1",
        ),
        (
            "dimer,",
            "dimmer,",
            "'dimmer' is neither one of run, time, channel, cube_a, cube_b, partner nor a species; did you mean dimer",
        ),
    ],
)
def test_counts_that_cannot_be(refused, old, new, said):
    assert old in COUNTS
    assert said in refused(COUNTS.replace(old, new))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("tuesday", "friday", "line 4, run tuesday: the table of runs does not name this run; add when it started"),
        ("tuesday", "monday", "runs.csv, line 3, run monday: a second row of this run"),
        ("tuesday", "", "runs.csv, line 3: the run is not named"),
        ("end", "stop", "runs.csv has no column end; it has run, start, stop"),
        (",100,", ",,", "runs.csv, line 2, run monday: end is empty; expected a number"),
        (",100,", ",20,", "events.csv, line 3, run monday, time 30.2: this run is over; it ends at 20"),
        (
            "2 2 3,1+1",
            "2 3,1+1",
            "runs.csv, line 3, run tuesday: tank has shape (2,); expected",
        ),
        ("2 2 3,1+1", "2 2 -3,1+1", "run tuesday: tank holds -3.0; expected at least 0"),
        ("1+2->3", "1+9->3", "runs.csv, line 3, run tuesday: unknown channel '1+9->3'; did you mean"),
        ("1+2->3", "2+2->4", "run tuesday, times from its start: channel '2+2->4' fired but is not open"),
        ("tank", "size", "column 'size' is neither one of run, start, end, tank, resolution, closed nor a species"),
        ("20,0,", "20.5,0,", "runs.csv, line 2, run monday: 20.5 copies of monomer"),
    ],
)
def test_runs_that_cannot_be(refused, old, new, said):
    assert old in RUNS
    assert said in refused(EVENTS, RUNS.replace(old, new, 1))


def test_what_is_said_twice_or_not_at_all(refused):
    assert "runs.csv says when runs start and end; leave this row out" in refused(MARKED, RUNS)
    assert "both --tank and the column tank of runs.csv" in refused(EVENTS, RUNS, tank=TANK)
    assert "line 2, run monday: this run starts with 20 cubes; expected 30, as --cubes says" in refused(
        MARKED, cubes=30
    )
    assert "runs.csv has no column end; it has run, start" in refused(EVENTS, "run,start\nmonday,0\n")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "events.csv is empty"),
        ("run,time,channel\n\n", "is empty: it has no rows below its titles"),
        ("time,channel\n1,1+1->2\n", "events.csv has no column run; it has time, channel"),
        ("run,channel\na,1+1->2\n", "events.csv has no column time"),
        ("run,time\na,1\n", "events.csv has no column channel"),
        (
            "run;time;channel\na;1;1+1->2\n",
            "it has run;time;channel: give it a first line of titles, separated by commas",
        ),
        ("run,time,time\na,1,1\n", "two columns of one title"),
        ("run,time,channel\na,\0,end\n", "events.csv"),
    ],
)
def test_tables_that_are_none(refused, text, said):
    assert said in refused(text)


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("events.xlsx", b"", "expected a table whose name ends in .csv or .parquet"),
        ("events.parquet", b"run,time\n", "cannot be read as a table"),
        ("events.csv", b"run,time\n\xff\xfe\x00", "cannot be read as a table"),
        ("none.csv", None, "does not exist"),
    ],
)
def test_files_that_are_none(tmp_path, name, data, said):
    if data is not None:
        (tmp_path / name).write_bytes(data)
    with pytest.raises(ValueError, match=re.escape(said)):
        read_observed(line_network(), tmp_path / name)


CORPUS = Path(__file__).parents[2] / "kinetics/corpus"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("nul_in_a_name", "column 'run' has a text with the invisible character U+0000"),
        ("rows_without_end", "10000000 rows of 2 columns; at most 10000000 cells are read"),
    ],
)
def test_a_sound_parquet_file_may_hold_what_is_no_table(name, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        read_observed(line_network(), CORPUS / f"{name}.parquet")


MEASURED = """
import resource, sys
from calibration.observed.tables import read_table
import pyarrow.parquet
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
read_table(sys.argv[1])
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


def test_equal_cells_take_little_memory(tmp_path):
    """A file of 41 kB with nearly ten million cells took a gigabyte."""
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet

    rows = 10_000_000 // 6
    columns = {"run": ["a"], "time": [1.5], "channel": ["1+1->2"], "X": [5], "Y": [5], "E": [5]}
    path = tmp_path / "events.parquet"
    pyarrow.parquet.write_table(pa.table({name: cells * rows for name, cells in columns.items()}), path)
    done = subprocess.run([sys.executable, "-c", MEASURED, str(path)], capture_output=True, text=True, check=True)
    assert int(done.stdout) < 300 * 1024


def test_what_pandas_notes_beside_a_table_is_not_read():
    for name in ("metadata_is_a_number", "metadata_is_deep"):
        assert len(read_table(CORPUS / f"{name}.parquet"))


def two_ways() -> Network:
    return Network.from_reactions(
        {"alone": ({"X": 1}, {"Y": 1}), "helped": ({"X": 1, "E": 1}, {"Y": 1, "E": 1}), "back": ({"Y": 1}, {"X": 1})},
        species=["X", "Y", "E"],
    )


def test_channels_with_one_change_are_told_apart_by_the_table_alone(read, refused):
    text = "run,time,channel,X,Y,E\na,0,start,3,0,1\na,1,,2,1,1\na,2,,3,0,1\na,9,end\n"
    assert "time 1: X -1, Y +1 may be alone or helped; name the one that fired in the column channel" in refused(
        text, network=two_ways()
    )
    path = read(text.replace("a,1,,", "a,1,helped,"), network=two_ways())["a"]
    assert fired(path) == ["helped", "back"]
    assert "--cubes 3: this network does not say how many cubes" in refused(text, network=two_ways(), cubes=3)


def test_names_that_mean_something_in_a_table(refused):
    network = Network.from_reactions({"end": ({"A": 1}, {"B": 1})})
    assert "the network calls something 'end', which means something else in a table" in refused(
        MARKED, network=network
    )


def test_who_broke_what(read, refused):
    rows = "run,time,channel,partner\na,1,1+1->2,\na,2,2->1+1,wall\na,3,1+1->2,\na,4,2->1+1,monomer\na,5,1+1->2,\n"
    rows += "a,6,2->1+1,several\na,7,1+1->2,\na,8,2->1+1,\n"
    runs = "run,start,end,monomer\na,0,9,4\n"
    (path,) = read(rows, runs).values()
    expected = [NO_BREAK, BY_WALL, NO_BREAK, 0, NO_BREAK, BY_SEVERAL, NO_BREAK, BY_UNKNOWN]
    assert path.partners.tolist() == expected
    (blind,) = read(rows.replace(",partner", ",cube_a"), runs).values()
    assert blind.partners is None
    assert "unknown partner 'ghost'" in refused(rows.replace("wall", "ghost"), runs)
    assert "as a partner of what is no break" in refused(rows.replace("1,1+1->2,", "1,1+1->2,wall", 1), runs)


CHAIN = "ripen: A -> B, 1\ndie: A -> 0, 1\nfade: B -> 0, 1\nmake: 0 -> A, 1"


def test_a_species_without_a_column_is_not_counted_as_none(read, refused):
    """After the start, what has no column was not looked at: a change that it would tell apart is asked for."""
    network = Network.from_text(CHAIN)
    alone = "run,time,channel,A\na,0,start,5\na,1,{},4\na,9,end,4\n"
    assert "A -1 may be ripen or die; name the one" in refused(alone.format(""), network=network)
    path = read(alone.format("ripen"), network=network)["a"]
    assert path.states[-1].tolist() == [4, 1]  # and the end, which says nothing of B, agrees
    assert fired(read(alone.format("").replace("4", "6"), network=network)["a"]) == ["make"]
    hidden = "run,time,channel,A\na,0,start,5\na,1,,5\na,9,end\n"
    assert "no count changes; that may be fade, or no event" in refused(hidden, network=network)
    both = "run,time,channel,A,B\na,0,start,5,0\na,1,,4,0\na,2,,4,0\na,9,end,4,0\n"
    assert fired(read(both, network=network)["a"]) == ["die"]
    assert "it ends with A 5, but its rows leave A 4, B 1" in refused(
        alone.format("ripen").replace("end,4", "end,5"), network=network
    )


@pytest.mark.parametrize(
    ("resolution", "is_fine"), [("", True), ("0", True), ("4", True), ("4.5", False), ("-1", False)]
)
def test_looks_come_within_a_run(read, refused, resolution, is_fine):
    tables = "run,time,channel\na,1,1+1->2\n", f"run,start,end,monomer,resolution\na,0,4,4,{resolution}\n"
    if is_fine:
        assert read(*tables)["a"].resolution == float(resolution or 0)
    else:
        assert f"resolution = {resolution}; expected a time from 0 to the run's 4" in refused(*tables)
