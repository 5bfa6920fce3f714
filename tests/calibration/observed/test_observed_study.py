"""Rates from tables: those of the runs that were written, to the last digit, and known ones within their intervals."""

import math
import re
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from scipy.stats import binom
from synthetic_runs import breaking_run, line_network, restarted_run

from calibration.estimating.diagnosing.diagnosis import diagnose
from calibration.estimating.estimate import estimate
from calibration.observed.study import observed_study
from kinetics import Model
from kinetics.formats import read, write
from kinetics.network import Network, Tank
from kinetics.rates import Rates
from kinetics.rates.breaks import Expansion, break_model
from kinetics.runs.event_tables import TableRun, event_tables
from kinetics.sampling import sample_path
from tests.helpers.expanded_paths import on_base

STUDIES, ALL = 100, 2000  # by default, and with --validate
FALSE_ALARM = 1e-6
TANK = Tank((2.0, 2.0, 3.0))


def table_run(name, path):
    """A jump path, ready for `event_tables`."""
    return TableRun(
        name,
        path.network.species,
        path.network.channels,
        path.initial,
        path.times,
        path.channels,
        path.end,
        path.open_channels,
        None if path.tank is None else path.tank.size,
        path.resolution,
    )


def paths_of_all_kinds():
    """Full, restarted and breaks alone, as a calibration has them; events share a time in none."""
    network = line_network()
    rng = np.random.default_rng(3)
    paths = [
        *(sample_path(network, [60, 0, 0, 0], 100.0, seed=4, run=run) for run in range(3)),
        restarted_run(network, network.state([14, 12, 6, 1]), 50.0, rng),
        breaking_run(network, network.state([0, 0, 30, 20]), 20.0, seed=5),
    ]
    return [replace(path, network=network, tank=TANK) for path in paths]


def written(folder, paths, kind="csv"):
    """Files of events and of runs."""
    frames = event_tables(table_run(f"run {i}", path) for i, path in enumerate(paths))
    files = [folder / f"{name}.{kind}" for name in ("events", "runs")]
    for frame, file in zip(frames, files, strict=True):
        file.write_bytes(frame.to_csv(index=False).encode() if kind == "csv" else frame.to_parquet(index=False))
    return files


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_round_trip_gives_the_same_rates_to_the_last_digit(tmp_path, kind):
    paths = paths_of_all_kinds()
    files = written(tmp_path, paths, kind)
    study = observed_study("line4", line_network(), *files)
    assert study.calibration.table() == estimate(paths).table()
    assert study.calibration.table() == estimate(paths[::-1]).table()  # whatever the order of the runs
    np.testing.assert_equal(study.diagnosis.table(), diagnose(paths).table())
    for path, again in zip(paths, study.paths, strict=True):
        for name in ("initial", "times", "channels", "open_channels", "end", "tank"):
            np.testing.assert_array_equal(getattr(path, name), getattr(again, name))
    shifted = [replace(path, times=path.times + 1e-9) for path in paths[:3]]
    assert estimate([*shifted, *paths[3:]]).table() != study.calibration.table()  # the control


def test_a_table_holds_runs_of_one_network():
    other = Network.from_reactions({"go": ({"A": 1}, {"B": 1})}).with_rates([1.0])
    paths = [paths_of_all_kinds()[0], sample_path(other, [3, 0], 1.0, seed=1)]
    with pytest.raises(ValueError, match="runs of two networks"):
        event_tables(table_run(str(i), path) for i, path in enumerate(paths))


def counts_table(path, name):
    """The table of one run as counts alone, with its start and end."""
    frame = path.to_dataframe()
    frame.insert(0, "run", name)
    return frame.assign(channel=frame["event"].where(frame["event"].isin(["start", "end"]), "")).drop(columns="event")


def test_counts_give_the_same_rates_to_the_last_digit(tmp_path):
    path = paths_of_all_kinds()[0]
    counts_table(path, "a").to_csv(tmp_path / "counts.csv", index=False)
    study = observed_study("line4", line_network(), tmp_path / "counts.csv", cubes=60)
    assert study.calibration.table() == estimate([path]).table()


def test_a_simulation_under_a_break_model_is_read_as_the_book_has_it(tmp_path):
    """Its channels say who broke what; those of a rule book do not."""
    base = line_network()
    expansion = Expansion.of(base, break_model("collision-wall"))
    known = expansion.network.with_rates(np.full(len(expansion.network.channels), 1e-3))
    paths = [sample_path(known, [60, 0, 0, 0], 100.0, seed=6, run=run) for run in range(2)]
    study = observed_study("line4", base, *written(tmp_path, paths))
    assert study.calibration.table() == estimate(on_base(expansion, path) for path in paths).table()
    assert study.calibration.total.events.min() > 0


def study_of_known_rates(folder, i, clock=1.0):
    """Three runs of 60 single cubes, their times as a clock shows them that is `clock` times too fast."""
    paths = [sample_path(line_network(), [60, 0, 0, 0], 100.0, seed=6, run=3 * i + run) for run in range(3)]
    told = [replace(path, times=path.times * clock, end=path.end * clock) for path in paths]
    # New names, gone before a disk has them: to write over a file waits for the disk, thousands of times.
    with TemporaryDirectory(dir=folder) as own:
        if i % 2:  # one form of the tables or the other
            frames = [counts_table(path, run) for run, path in enumerate(told)]
            file = Path(own) / "counts.csv"
            file.write_text("".join(frame.to_csv(index=False, header=not run) for run, frame in enumerate(frames)))
            return observed_study("line4", line_network(), file)
        return observed_study("line4", line_network(), *written(Path(own), told))


def covered(studies):
    """Number of studies whose interval holds the true rate, channel by channel (R,)."""
    known = line_network().rate_constants
    limits = np.array([[(row["low"], row["high"]) for row in study.calibration.table()] for study in studies])
    return ((limits[..., 0] <= known) & (known <= limits[..., 1])).sum(axis=0)


@pytest.mark.validate
def test_intervals_of_simulated_studies_cover_the_truth(tmp_path, request):
    """No channel is covered less often than a coverage of 95 % allows with a chance of 1e-6 for all channels together.

    Garwood's limits cover 95 % or more at any number of events. A clock that is 20 % fast is the control.
    """
    n = ALL if request.config.getoption("--validate") else STUDIES
    least = binom.ppf(FALSE_ALARM / len(line_network().channels), n, 0.95)
    assert (covered(study_of_known_rates(tmp_path, i) for i in range(n)) >= least).all()
    assert (covered(study_of_known_rates(tmp_path, i, clock=1.2) for i in range(n)) < least).any()


def test_one_run_has_a_wide_interval_and_is_not_tested_against_others(tmp_path):
    path = sample_path(line_network(), [60, 0, 0, 0], 100.0, seed=6)
    study = observed_study("line4", line_network(), *written(tmp_path, [path]))
    assert all(math.isnan(row["runs"]) and math.isnan(row["start"]) for row in study.diagnosis.p_values())
    many = [sample_path(line_network(), [60, 0, 0, 0], 100.0, seed=6, run=run) for run in range(9)]
    nine = observed_study("line4", line_network(), *written(tmp_path, many))
    assert not all(math.isnan(row["runs"]) for row in nine.diagnosis.p_values())  # the control
    for alone, pooled in zip(study.calibration.table(), nine.calibration.table(), strict=True):
        assert (alone["high"] - alone["low"]) > 2 * (pooled["high"] - pooled["low"])


def test_a_channel_that_could_not_fire_is_not_measured(tmp_path):
    (tmp_path / "events.csv").write_text("run,time,channel,monomer\na,0,start,4\na,1,1+1->2\na,9,end\n")
    study = observed_study("line4", line_network(), tmp_path / "events.csv")
    assert study.rates.not_measured == ["1+3->4", "2+2->4", "3->1+2", "4->1+3", "4->2+2"]


def test_rate_laws_have_no_constants_to_estimate(tmp_path):
    network = Network.from_reactions({"go": ({"A": 1}, {"B": 1})}, ["A / (3 + A)"])
    (tmp_path / "events.csv").write_text("run,time,channel,A\na,0,start,4\na,9,end\n")
    with pytest.raises(ValueError, match=r"model\.net: rate constants are those of mass action; rate laws .* own: go"):
        observed_study("model.net", network, tmp_path / "events.csv")


@pytest.fixture
def tables(tmp_path):
    return written(tmp_path, paths_of_all_kinds())


def test_the_command(wellmixed_here, tmp_path, tables):
    command = ["calibrate", "line4", "--events", "events.csv", "--run-table", "runs.csv", "--out", "rates.toml"]
    done = wellmixed_here(*command, "--report", "report.html", "--json", cwd=tmp_path)
    assert [row["rate"] for row in done.json["channels"]] == [e.rate for e in estimate(paths_of_all_kinds()).estimates]
    rates = Rates.load(tmp_path / "rates.toml")
    assert rates.tank == TANK.size
    assert [rates.channels[row["channel"]].low for row in done.json["channels"]] == [
        row["low"] for row in done.json["channels"]
    ]
    assert "Rates of line4" in (tmp_path / "report.html").read_text(encoding="utf-8")
    rates.apply(line_network())
    told = wellmixed_here(*command, cwd=tmp_path).out
    assert "5 observed runs, 370 tu" in told


def test_the_command_with_one_run(wellmixed_here, tmp_path):
    path = paths_of_all_kinds()[0]
    counts_table(path, "a").to_csv(tmp_path / "counts.csv", index=False)
    command = ["calibrate", "line4", "--events", "counts.csv", "--cubes", 60, "--tank", 2, 2, 3, "--out", "rates.toml"]
    done = wellmixed_here(*command, "--report", "report.html", cwd=tmp_path)
    assert (done.code, done.err) == (0, "")
    assert re.search(r"(?m)^1\+1->2 .* - ", done.out)  # one run is not tested against others
    assert "1 observed run, 100 tu" in done.out
    assert "not testable" in (tmp_path / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("suffix", [".net", ".xml"])
def test_a_network_file_says_what_can_happen(wellmixed_here, tmp_path, tables, suffix):
    network = line_network()
    file = tmp_path / f"line{suffix}"
    write(Model(network, network.state({"monomer": 60}), {}), file)
    known = read(file).network
    renamed = dict(zip(network.channels, known.channels, strict=True))
    text = tables[0].read_text()
    for name in sorted(renamed, key=len, reverse=True):
        text = text.replace(f",{name}\n", f",{renamed[name]}\n")
    tables[0].write_text(text)
    runs = tables[1].read_text().replace(",".join(network.species), ",".join(known.species))
    for name in network.channels:
        runs = runs.replace(name, renamed[name])
    tables[1].write_text(runs)
    command = ["calibrate", file.name, "--events", "events.csv", "--run-table", "runs.csv", "--out", "rates.toml"]
    rows = wellmixed_here(*command, "--json", cwd=tmp_path).json["channels"]
    own = estimate(paths_of_all_kinds()).estimates
    assert [row["events"] for row in rows] == [each.events for each in own]
    for row, each in zip(rows, own, strict=True):  # a file may count ways and combinations otherwise
        ratio = known.combinations_of([60, 3, 3, 3])[rows.index(row)] * row["ways"] * row["rate"]
        assert ratio == pytest.approx(network.combinations_of([60, 3, 3, 3])[rows.index(row)] * each.ways * each.rate)


WATCHED = ("line4", "--events", "events.csv")


def test_options_of_one_mode_are_not_taken_by_another_later(wellmixed_here, tmp_path, tables):
    """A fit, which takes --seed, comes before a calibration in the same process, which does not."""
    wellmixed_here("calibrate", *WATCHED, "--free", "1+1->2", "--seed", 2, "--out", "rates.toml", cwd=tmp_path)
    done = wellmixed_here("calibrate", *WATCHED, "--seed", 2, "--out", "rates.toml", cwd=tmp_path)
    assert "--seed applies to mechanics runs, and --events makes none" in " ".join(done.err.split())


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([*WATCHED, "--runs", 5], "--runs applies to mechanics runs, and --events makes none"),
        ([*WATCHED, "--duration", 5], "--duration applies to mechanics runs, and --events makes none"),
        ([*WATCHED, "--cubes", 60, 80], "--cubes 60 80: for events one number, that of the cubes"),
        ([*WATCHED, "--workers", 2], "--workers applies to mechanics runs, and --events makes none"),
        ([*WATCHED, "--shard", "1/2"], "--shard applies to mechanics runs, and --events makes none"),
        ([*WATCHED, "--seed", 2], "--seed applies to mechanics runs, and --events makes none"),
        (["line4", "--run-table", "runs.csv"], "--run-table is for --events, not for channels; leave it out"),
        (["line4", "--tank", 2, 2, 3], "--tank is for --events, not for channels; leave it out"),
        (["line4", "again", "--events", "events.csv"], "expected calibrate MODEL --events FILE; line4 again came"),
        (WATCHED, "run run 0 has no start"),
        (["line4", "--events", "no.csv"], "File 'no.csv' does not exist"),
        ([*WATCHED, "--run-table", "runs.csv", "--tank", 2, 2, 3], "both --tank and the column tank"),
        ([*WATCHED, "--run-table", "runs.csv", "--cubes", 61], "this run starts with 60 cubes; expected 61"),
    ],
)
def test_options_that_do_not_go_together(wellmixed_here, tmp_path, tables, options, said):
    done = wellmixed_here("calibrate", *options, "--out", "rates.toml", cwd=tmp_path)
    assert (done.code, done.out) == (2, "")
    assert said in " ".join(done.err.split())
    assert not (tmp_path / "rates.toml").exists()
