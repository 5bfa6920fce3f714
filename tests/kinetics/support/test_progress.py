"""What a command says while it works: to a terminal, to a pipe, and to nobody."""

import ast
import io
import json
import sys
import threading
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from kinetics.support.cli import progress
from kinetics.support.cli.progress import forecast, is_terminal, progress_line, sign_of_life, span, stage
from wellmixed import main

ROOT = Path(__file__).parents[3]
SOURCES = [
    *(path for room in ("kinetics", "mechsim", "calibration") for path in (ROOT / room).rglob("*.py")),
    ROOT / "wellmixed.py",
]
MEASURED = ROOT / "results" / "line4" / "rates.toml"
HELPER = ROOT / "kinetics" / "support" / "cli" / "progress.py"


class Terminal(io.StringIO):
    def isatty(self):
        return True


class Closed(io.StringIO):
    """As a text stream over a closed file: the question itself is an error."""

    def isatty(self):
        raise ValueError("I/O operation on closed file")


@pytest.mark.parametrize(
    ("stream", "is_one"), [(Terminal(), True), (io.StringIO(), False), (None, False), (Closed(), False)]
)
def test_a_terminal_is_there_and_open(stream, is_one):
    assert is_terminal(stream) is is_one


def asks(source: str) -> bool:
    """Whether a module asks by itself whether something is a terminal."""
    return any(
        getattr(node, "attr", getattr(node, "id", None)) == "isatty"
        or (isinstance(node, ast.alias) and node.name == "isatty")
        or (isinstance(node, ast.Constant) and node.value == "isatty")
        for node in ast.walk(ast.parse(source))
    )


def test_one_place_asks_whether_there_is_a_terminal():
    assert len(SOURCES) > 300
    assert [path.name for path in SOURCES if asks(path.read_text(encoding="utf-8"))] == [HELPER.name]


@pytest.mark.parametrize(
    "source", ["sys.stderr.isatty()", "from os import isatty", "getattr(stream, 'isatty')()", "os.isatty(2)"]
)
def test_one_who_asks_is_seen(source):
    """A control that must fail."""
    assert asks(source)


class Clock:
    """Seconds that pass when a test says so."""

    def __init__(self):
        self.now = 1000.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    """The clock of all progress, and no thread that watches it: tests tick themselves."""
    made = Clock()
    monkeypatch.setattr(progress.Progress.__init__, "__defaults__", (made,))
    return made


def told(monkeypatch, stream):
    monkeypatch.setattr(sys, "stderr", stream)
    return stream


def pass_time(line, clock, seconds):
    for _ in range(seconds):
        clock.now += 1.0
        line.tick()


def test_a_pipe_gets_a_line_every_30_s(clock, monkeypatch):
    stream = told(monkeypatch, io.StringIO())
    with progress_line() as line:
        line("3 of 12 points", 0.25)
        pass_time(line, clock, 29)
        assert stream.getvalue() == ""
        pass_time(line, clock, 1)
        assert stream.getvalue() == "3 of 12 points, 30 s so far\n"
        clock.now += 10.0
        line("6 of 12 points", 0.5)
        pass_time(line, clock, 20)
    assert stream.getvalue().splitlines() == [
        "3 of 12 points, 30 s so far",
        "forecast: about 80 s left after 6 of 12 points",  # 40 s for a quarter
        "6 of 12 points, 60 s so far, about 60 s left",
    ]


def test_a_terminal_gets_one_line_that_is_cleared(clock, monkeypatch):
    stream = told(monkeypatch, Terminal())
    with progress_line() as line:
        line("listing")
        line("listing more")  # too soon to be drawn
        pass_time(line, clock, 2)
    assert stream.getvalue() == "".join(
        f"\r\033[K{text}" for text in ("listing", "listing more, 1 s so far", "listing more, 2 s so far", "")
    )


def test_a_part_of_the_work_goes_on_with_the_clock_of_the_whole(clock, monkeypatch):
    stream = told(monkeypatch, io.StringIO())
    with progress_line(budget=1.0) as whole:
        pass_time(whole, clock, 20)
        with progress_line() as part:
            part("elasticities")
            pass_time(part, clock, 10)
            with pytest.raises(click.ClickException, match="beyond the budget of 1 min"):
                part.forecast(61.0, "much")
        pass_time(whole, clock, 29)
    assert stream.getvalue() == "elasticities, 30 s so far\n"


def test_long_work_is_forecast_and_refused_beyond_the_budget(clock, monkeypatch):
    stream = told(monkeypatch, io.StringIO())
    with progress_line(budget=10.0) as line:
        forecast(10.0, "short work")
        assert stream.getvalue() == ""
        forecast(360.0, "1e6 runs of some 2e4 events", at_once=2)
        assert stream.getvalue() == "forecast: about 3 min: 1e6 runs of some 2e4 events\n"
        pass_time(line, clock, 30)
        assert stream.getvalue().endswith("at work, 30 s so far, about 2.5 min left\n")
        with pytest.raises(click.ClickException) as refused:
            forecast(601.0, "1e8 runs of some 2e4 events")
    assert refused.value.exit_code == 2
    for words in ("forecast: about 10 min of CPU time (1e8 runs", "budget of 10 min", "--budget MINUTES"):
        assert words in refused.value.message


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(3.25, "3.2 s"), (119, "119 s"), (200, "3.3 min"), (7300, "2 h"), (4e5, "4.6 days"), (1e12, "3.2e+04 years")],
)
def test_lengths_of_time(seconds, words):
    assert span(seconds) == words


def test_without_a_command_nothing_is_said(monkeypatch):
    stream = told(monkeypatch, Terminal())
    stage("diagnosis", 0.5)
    forecast(1e9, "for ever")
    assert stream.getvalue() == ""


def test_who_asks_for_quiet_gets_it(clock, monkeypatch):
    stream = told(monkeypatch, Terminal())
    with progress_line(False) as line:
        line("runs", 0.1)
        forecast(1e3, "long work")
        with progress_line() as part:
            part("more runs")
            pass_time(part, clock, 100)
    assert stream.getvalue() == ""


@pytest.mark.parametrize("stream", [None, Closed()])
def test_a_stream_that_is_gone_disturbs_nothing(clock, monkeypatch, stream):
    if stream is not None:
        io.StringIO.close(stream)
    monkeypatch.setattr(sys, "stderr", stream)
    with progress_line() as line:
        line("work")
        forecast(1e3, "long work")
        pass_time(line, clock, 60)


def test_a_thread_watches_a_command_and_ends_with_it(monkeypatch):
    ticked = threading.Event()
    monkeypatch.setattr(progress, "TICK", 0.001)
    monkeypatch.setattr(progress.Progress, "tick", lambda line: line.text == "scan at work" and ticked.set())
    before = threading.active_count()
    with sign_of_life("scan"):
        assert ticked.wait(60)
        assert threading.active_count() == before + 1
    assert threading.active_count() == before


def run(*words, code=0):
    done = CliRunner().invoke(main, list(map(str, words)))
    assert done.exit_code == code, done.output
    return done


@pytest.fixture
def births(tmp_path):
    path = tmp_path / "births.rxn"
    path.write_text("0 -> A, 1\n")
    return path


@pytest.fixture
def pairs(tmp_path):
    """5,151 states."""
    path = tmp_path / "pairs.rxn"
    path.write_text("A <-> B, 1.3, 1\nB <-> C, 1, 0.7\nA = 100\n")
    return path


UNIFORM = ("--join", "1e-5")


@pytest.mark.parametrize(
    "command",
    [
        ("predict", "births", "--times", 10, "--runs", 10**13),
        ("predict", "births", "--times", 1e9, "--method", "fsp", "--budget", 0.1),
        ("rules", "grow", "line4", "--cubes", 10**8, *UNIFORM),
        ("rules", "grow", "line4", "--cubes", 4, *UNIFORM, "--runs", 10**9),
        ("rules", "rank", "line4", "--join", 1, "--break", 1, "--runs", 10**8, "--max-states", 0),
        ("trust", "verify", "line4", "--rates", "table3", "--cubes", 4, "--times", 1, "--runs", 10**12, "--no-power"),
        ("scan", "births", "--over", "A=0,1", "--ask", "E[A] @ 10", "--max-states", 0, "--runs", 10**13),
        ("ask", "pairs", "E[C] @ 10", "--budget", 1e-4),
        ("passage", "pairs", "--species", "C", "--copies", 50, "--budget", 1e-4),
    ],
    ids=lambda command: " ".join(map(str, command[:2])),
)
def test_work_without_a_natural_end_is_refused_with_its_forecast(command, births, pairs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run(*({"births": births, "pairs": pairs}.get(word, word) for word in command), code=2)
    assert done.stdout == ""
    if "fsp" not in command:  # which forecasts as it goes
        assert "Error: forecast: about" in done.stderr
        assert "of CPU time" in done.stderr
        minutes = f"{command[-1] if '--budget' in command else 120:g}"
        assert f"beyond the budget of {minutes} min; ask for less, or allow more by --budget MINUTES" in done.stderr


def test_the_limit_of_a_method_is_named_as_the_command_names_it(pairs):
    done = run("predict", pairs, "--times", 4e4, "--method", "exact", "--budget", 1e-3, code=2)
    assert "--budget 0.001 (minutes); raise it" in done.stderr


def test_a_budget_is_what_is_allowed(births):
    """A control: the same work, which a larger budget allows."""
    command = ("predict", births, "--times", 10, "--runs", 20_000)
    assert "beyond the budget of 1e-06 min" in run(*command, "--budget", 1e-6, code=2).stderr
    assert run(*command).stderr == ""


@pytest.fixture
def stages(monkeypatch):
    """What commands say that they do, in order."""
    said = []
    monkeypatch.setattr(progress.Progress, "__call__", lambda line, text, share=None: said.append(text))
    return said


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (
            ("passage", "line4", "--rates", "measured", "--cubes", 4, "--species", "quadmer", "--draws", 3),
            "2 of 3 draws",
        ),
        (
            ("passage", "line4", "--rates", "table3", "--cubes", 4, "--species", "quadmer", "--sensitivity"),
            "of quantile",
        ),
        (("predict", "line4", "--rates", "table3", "--cubes", 4, "--times", 1, "--elasticity"), "elasticities"),
        (("predict", "births", "--times", 1, "--method", "fsp"), "projection: 0 of 1 on"),
        (
            ("ask", "line4", "--rates", "table3", "--cubes", 4, "P=? [ F<=1 quadmer >= 1 ]"),
            "answering P=? [ F<=1 quadmer",
        ),
        (
            (
                "trust",
                "verify",
                "line4",
                "--rates",
                "table3",
                "--cubes",
                4,
                "--times",
                1,
                "--runs",
                100,
                "--method",
                "ssa",
            ),
            "mistake",
        ),
        (("rules", "rank", "line4", "--join", 1e-3, "--cubes", 4), "line4, 1 of 1"),
        (("rules", "grow", "line4", "--cubes", 40, "--join", 1e-3), "19 of 20 runs"),
        (("trust", "hardcases", "--only", "nowhere"), "of 1 cases done"),
    ],
    ids=lambda given: " ".join(map(str, given[:2])) if isinstance(given, tuple) else "",
)
def test_a_command_names_what_it_does(command, words, births, stages):
    run(*(births if word == "births" else MEASURED if word == "measured" else word for word in command))
    assert any(words in text for text in stages), stages


def test_standard_output_is_free_of_it(births, monkeypatch):
    """Lines as often as can be: what a program reads is the same."""
    command = ("predict", births, "--times", 10, "--runs", 200_000, "--json")
    quiet = json.loads(run(*command).stdout)
    for name, seconds in (("TICK", 1e-3), ("EVERY", 0.0), ("LONG", 0.0)):
        monkeypatch.setattr(progress, name, seconds)
    loud = run(*command)
    assert "forecast: about" in loud.stderr
    assert json.loads(loud.stdout) | {"cpu_seconds": 0} == quiet | {"cpu_seconds": 0}
    assert run("--quiet", *command).stderr == ""
