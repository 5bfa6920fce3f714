"""What a command says while it works: to a terminal, to a pipe, and to nobody."""

import ast
import io
from pathlib import Path

import pytest

from kinetics.support.cli.progress import is_terminal

ROOT = Path(__file__).parents[3]
SOURCES = [
    *(path for room in ("kinetics", "mechsim", "calibration") for path in (ROOT / room).rglob("*.py")),
    ROOT / "wellmixed.py",
]
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
