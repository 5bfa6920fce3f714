"""Mutants are what they claim to be, and a test that cannot fail lets them live."""

import ast
import subprocess
import sys
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest

from tests.mutation.__main__ import Room, Score, Verdict, code_of, drawn, judged, rooms, stored
from tests.mutation.judging import ROOT, run_tests
from tests.mutation.sites import mutants

SOURCE = '''"""A docstring with 1 number."""

def least(values: list[int], start=0):
    """Another."""
    found = start  # a comment
    for value in values:
        if value < found or not values:
            found = value - 1 + 1
    values.clear()
    if found is None:
        raise ValueError(f"{1 + 2}")
    return found
'''


def test_every_kind_of_change_is_made_once():
    changes = [mutant.change for mutant in mutants(SOURCE)]
    assert "value < found -> value <= found" in changes
    assert "value < found or not values -> value < found and (not values)" in changes
    assert "not values -> values" in changes
    assert "value - 1 -> value + 1" in changes
    assert "value - 1 + 1 -> value - 1 - 1" in changes
    assert "values.clear() -> pass" in changes
    assert "found is None -> found is not None" in changes
    assert "0 -> 1" in changes  # the default; nothing of docstrings and messages
    assert changes.count("1 -> 2") == 2
    assert len(changes) == 10


def test_a_mutant_differs_in_its_change_alone():
    sound = ast.dump(ast.parse(SOURCE))
    told = {mutant.source: mutant for mutant in mutants(SOURCE)}
    assert len(told) == 10
    for text, mutant in told.items():
        assert ast.dump(ast.parse(text)) != sound
        assert SOURCE.splitlines()[mutant.line - 1].strip() == mutant.place


@pytest.mark.parametrize("room", rooms().values(), ids=lambda room: room.name)
def test_a_room_is_what_is_there(room):
    """Its files exist, the draw is the same each time, and mutants accepted are mutants of it."""
    assert all((ROOT / name.partition("::")[0]).exists() for name in room.modules + room.tests + room.slow)
    for file, _, test in (name.partition("::") for name in room.slow):
        assert f"def {test}(" in (ROOT / file).read_text("utf-8")
    once, again, other = (
        [(module, mutant.line, mutant.change) for module, mutant in drawn(room, 5, seed)] for seed in (1, 1, 2)
    )
    assert once == again != other
    every = {f"{mutant.place} | {mutant.change}" for _, mutant in drawn(room, 10_000, 1)}
    assert len(every) > 50
    assert room.accepted.keys() <= every


def small_project(folder: Path, test: str) -> Path:
    for name in ("kinetics", "mechsim", "calibration", "tests"):
        (folder / name).mkdir()
    (folder / "kinetics/least.py").write_text("def least(a, b):\n    return a if a < b else b + 0\n")
    (folder / "tests/test_least.py").write_text(f"from kinetics.least import least\n\ndef test():\n    {test}\n")
    return folder


ROOM = Room(
    "small", ("kinetics/least.py",), ("tests/test_least.py",), {"return a if a < b else b + 0 | b + 0 -> b - 0": "x"}
)


@pytest.fixture(scope="module")
def twice(tmp_path_factory):
    """The project, its scores after three mutants and after all, and what the second run printed; judged but once."""
    root = small_project(tmp_path_factory.mktemp("small"), "assert least(1, 2) == 1 and least(4, 3) == 3")
    first = judged(ROOM, 2, 1, root / "stored", root)
    with redirect_stdout(StringIO()) as said:
        whole = judged(ROOM, 60, 1, root / "stored", root)
    return root, first, whole, said.getvalue()


def test_what_is_tested_is_killed_and_what_is_not_lives(twice):
    root, _, score, _ = twice
    assert {verdict.change: verdict.fate for verdict in score.verdicts} == {
        "a < b -> a <= b": "lives",  # the same numbers where they are equal
        "0 -> 1": "killed",
        "b + 0 -> b - 0": "accepted",
    }
    assert score.share == pytest.approx(1 / 2)
    assert stored("small", root / "stored") == score


def test_a_second_run_judges_what_is_left(twice):
    """Those not yet judged, and those that lived; all of them where the code is another."""
    root, first, whole, said = twice
    assert whole.verdicts[:2] == first.verdicts
    told = [line.split()[0] for line in said.splitlines()[1:]]
    assert len(told) == 3 - first.of("killed")
    source = root / "kinetics/least.py"
    source.write_text('"""A docstring."""\n\n' + source.read_text())
    assert code_of(ROOM, root) == whole.code
    source.write_text(source.read_text().replace("0", "9"))
    assert code_of(ROOM, root) != whole.code


def test_a_test_that_cannot_fail_lets_all_live(tmp_path):
    assert (
        judged(replace(ROOM, accepted={}), 1, 2, tmp_path / "stored", small_project(tmp_path, "assert True")).share == 0
    )


def test_a_mutant_that_never_ends_is_killed(tmp_path):
    root = small_project(tmp_path, "assert True")
    outcome = run_tests(root, ("tests/test_least.py",))
    assert outcome.passed
    (root / "tests/test_least.py").write_text("def test():\n    while True:\n        pass\n")
    assert not run_tests(root, ("tests/test_least.py",), seconds=1.0).passed


def test_a_test_that_fails_without_any_mutant_is_no_judge(tmp_path):
    with pytest.raises(RuntimeError, match="fails without any mutant"):
        judged(ROOM, 60, 1, tmp_path / "stored", small_project(tmp_path, "assert False"))


def test_score():
    fates = ["killed", "killed", "lives", "accepted"]
    assert Score("", 9, 1, tuple(Verdict("m.py", 1, "", "", fate) for fate in fates)).share == pytest.approx(2 / 3)
    assert Score("", 9, 1, ()).share == 1.0


def test_a_test_passes_in_a_process_that_pytest_did_not_start():
    """There the fork's own imports come before pytest's, which warns of them; and a warning is an error."""
    one = "tests/mutation/test_mutation.py::test_score"
    code = (
        "from tests.mutation.judging import copy_of, run_tests\n"
        f"with copy_of() as tree: assert run_tests(tree, ({one!r},)).passed"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)
