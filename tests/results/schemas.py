"""JSON schemas of what commands print with `--json`: `python -m tests.results.schemas` writes docs/schemas anew.

They are read off the outputs of tests, and of a few calls more; some ten minutes. `--from FILE` takes
outputs that were written down before, in a run of tests for which WELLMIXED_JSON_OUTPUTS named that file.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests" / "helpers"))

from command_line import run_here  # noqa: E402 - from the folder above
from json_outputs import RECORD, SCHEMAS, file_of, schema_of_command  # noqa: E402

TESTS = (
    *("test_cli.py", "test_outputs.py", "kinetics/commands", "kinetics/networkfree", "kinetics/predicting/ranking"),
    *("kinetics/rates/test_book_rates.py", "kinetics/trust/test_accuracy_kinetics.py"),
    "kinetics/trust/test_hardcases.py",
    *("kinetics/assembly/checking/test_certificate.py", "kinetics/assembly/checking/test_checker.py"),
    *("kinetics/assembly/compiler/test_compiling.py", "kinetics/assembly/drawing/test_diagrams.py"),
    *("kinetics/formats", "mechsim/accuracy/test_accuracy_mechanics.py", "mechsim/inspection"),
    *("mechsim/runs/test_shards.py", "mechsim/studies/test_first_times_command.py", "calibration/observed"),
    "calibration/pipeline",
)
PAIR = "bind: A + B <-> AB, k1, k2\nk1 = 0.01\nk2 = 0.1\nA = 20\nB = 10\n"
CALLS = (
    ["simulate", "line4", "--cubes", 8, "--cost-profile"],
    ["predict", "pair.rxn", "--duration", 60],
    ["predict", "pair.rxn", "--times", 60, "--method", "transient"],
    ["predict", "pair.rxn", "--times", 60, "--accuracy", "5%", "--show", "A"],
    ["predict", "pair.rxn", "--times", 60, "--accuracy", "1e-10%"],  # a tenth of it is beyond all
    ["predict", "pair.rxn", "--runs", 20, "--until", "AB >= 8"],
    [
        "predict",
        "growth.rxn",
        "--times",
        5,
        "--runs",
        20,
        "--max-events",
        800,
        "--until",
        "A >= 900",
    ],  # truncated there
    ["predict", "pair.rxn", "--times", 9, "--trajectories", 2],
    ["predict", "pair.rxn", "--times", 9, "--method", "mean-field"],
    ["predict", "growth.rxn", "--times", 1, "--method", "mean-field"],
    ["predict", "growth.rxn", "--times", 1, "--times", 60, "--runs", 20],  # truncated
    ["passage", "pair.rxn", "--species", "AB", "--sensitivity"],
    ["passage", "pair.rxn", "--species", "AB", "--truncate", "A <= 20"],
    ["passage", "pair.rxn", "--species", "AB", "--copies", 8, "--method", "ssa", "--runs", 20],
    ["ask", "pair.rxn", "P=? [ F<=60 AB >= 8 ]", "S=? [ AB >= 8 ]", "--sensitivity"],
    ["rules", "derive", "pair.rxn"],
    ["trust", "accuracy", "kinetics", "pair.rxn", "--budget", 0.01],
    ["trust", "hardcases"],
    ["rules", "check", "t5_as_printed"],
    ["rules", "check", "pyramid45"],
    ["rules", "rank", "t5", "t5_bar", "--join", 7e-5, "--cubes", 10, "--runs", 20],
    ["scan", "pair.rxn", "--over", "k1=0.01,0.02", "--ask", "E[AB] @ 10", "--ask", "P=? [ F<=60 AB >= 8 ]"],
    ["trust", "verify", "pair.rxn", "--times", 1, "--runs", 1000, "--method", "ssa"],
)


def written_down(tests: list[str]) -> Iterator[tuple[str, Any]]:
    """(command, output) of the calls above and of these tests, all run in this process."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ[RECORD] = str(Path(folder, "outputs"))
        (Path(folder) / "pair.rxn").write_text(PAIR, encoding="utf-8")
        if pytest.main(["-q", "-n", "0", *tests]):
            raise SystemExit("a test failed; mend it first")
        (Path(folder) / "growth.rxn").write_text("A -> 2 A, 1\nA = 10\n", encoding="utf-8")
        for call in CALLS:  # after the tests, whose conftest.py watches what is printed
            if run_here(*call, "--json", cwd=folder).code not in (0, 1, 4):  # 1: a check found errors; 4: fewer figures
                raise SystemExit(f"{call[0]} failed")
        yield from told(Path(os.environ[RECORD]))


def told(path: Path) -> Iterator[tuple[str, Any]]:
    """What a file of outputs holds."""
    with path.open(encoding="utf-8") as lines:
        yield from (tuple(json.loads(line)) for line in lines)


def main(words: list[str]) -> None:
    """Write the schemas."""
    outputs: dict[str, list[Any]] = {}
    found = told(Path(words[1])) if words[:1] == ["--from"] else written_down([str(ROOT / "tests" / t) for t in TESTS])
    for command, output in found:
        outputs.setdefault(command, []).append(output)
    SCHEMAS.mkdir(exist_ok=True)
    for command, seen in outputs.items():
        text = json.dumps(schema_of_command(command, seen), indent=1, ensure_ascii=False) + "\n"
        file_of(command).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
