"""The benchmarks are no tests and are run by hand; but they import what exists, also where they import it late."""

import ast
import importlib
import re
from importlib.util import find_spec
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent / "benchmarks"
SCRIPTS = sorted(FOLDER.glob("*.py"))
OURS = ("kinetics", "mechsim", "calibration", "tests", "fake_runs")


def missing(source: str) -> list[str]:
    """Names that `source` imports from our packages and that are not there."""
    lacking = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] in OURS:
            module = importlib.import_module(node.module) if find_spec(node.module) else None
            lacking += [f"{node.module}.{name.name}" for name in node.names if not hasattr(module, name.name)]
    return lacking


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_a_benchmark_imports_what_is_there(path):
    assert missing(path.read_text(encoding="utf-8")) == []


def test_what_is_missing_is_seen():
    late = "def main():\n    from kinetics import Network, Nowhere"
    assert missing(f"{late}\n    from tests.benchmarks.nothing import some") == [
        "kinetics.Nowhere",
        "tests.benchmarks.nothing.some",
    ]


@pytest.mark.parametrize(
    "path", [path for path in SCRIPTS if path.stem.startswith("bench_")], ids=lambda path: path.stem
)
def test_a_benchmark_is_run_as_its_docstring_says(path):
    docstring = ast.get_docstring(ast.parse(path.read_text()))
    assert re.search(rf"^ *python -m tests\.benchmarks\.{path.stem}\b", docstring, flags=re.MULTILINE)
