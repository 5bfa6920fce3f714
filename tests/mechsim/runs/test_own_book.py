"""Scenes with a rule book of the user's own: found beside the scene, and part of a run's name by content alone."""

import shutil
from pathlib import Path

import pytest

import kinetics.assembly
from mechsim.inspection.poses import record_at
from mechsim.inspection.replay import replay
from mechsim.runs.record import RunSpec, execute
from mechsim.runs.store import RunStore
from mechsim.scene import SCENES, Scene

BOOKS = Path(kinetics.assembly.__file__).parent / "books"


@pytest.fixture
def folder(tmp_path):
    """A scene with a copy of line4's book."""
    made = tmp_path / "mine"
    made.mkdir()
    shutil.copy(BOOKS / "line4.toml", made / "book.toml")
    text = (SCENES / "line4.toml").read_text(encoding="utf-8")
    (made / "scene.toml").write_text(text.replace('rules = "line4"', 'rules = "book.toml"'), encoding="utf-8")
    return made


def short(folder, **changes):
    return RunSpec(Scene.load(folder / "scene.toml"), {"monomer": 12}, 1.0, 1, 0, **changes)


def test_a_book_is_found_beside_its_scene_wherever_one_works(folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    absolute = short(folder)
    monkeypatch.chdir(folder)
    assert short(Path()).key == absolute.key
    shutil.move(folder, tmp_path / "moved")
    moved = short(tmp_path / "moved")
    assert moved.key == absolute.key
    assert moved.scene.fingerprint == absolute.scene.fingerprint


def test_another_book_of_that_name_gives_another_run(folder):
    before = short(folder).key
    other = folder.parent / "other"
    shutil.copytree(folder, other)
    text = (other / "book.toml").read_text(encoding="utf-8")
    (other / "book.toml").write_text(text.replace('name = "line4"', 'name = "mine"'), encoding="utf-8")
    assert short(other).key == before  # a name is no rule
    shutil.copy(BOOKS / "t5.toml", other / "book.toml")
    assert short(other).key != before


def test_stored_runs_find_their_book(folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    RunStore(folder / "runs").write(execute(short(folder)))
    (file,) = (folder / "runs").glob("*.run")
    assert record_at(str(file), "nowhere").spec.key == short(folder).key
    assert replay(file).is_same
    (folder / "book.toml").unlink()
    with pytest.raises(ValueError, match=r"book\.toml, which none of .* holds; put it beside the run"):
        record_at(str(file), "nowhere")
    shutil.copy(BOOKS / "t5.toml", folder / "book.toml")
    with pytest.raises(ValueError, match="no longer the one"):
        record_at(str(file), "nowhere")
