"""Every fault that is planted is found, and none in the same book without it."""

import pytest
from click.testing import CliRunner

from kinetics.assembly import check
from kinetics.assembly.checking import checker, exploration_index
from kinetics.assembly.rules.writing import written
from tests.helpers.planted_faults import FAULTS, WARNINGS, planted
from wellmixed import main


def found(book):
    return {(finding.kind, finding.is_error) for finding in check(book, slow_waves=False).findings}


def all_found(fault, seeds):
    wanted = (FAULTS[fault][0], fault not in WARNINGS)
    for seed in seeds:
        sound, faulty = planted(fault, seed)
        assert found(sound) == set(), sound.name
        assert wanted in found(faulty), faulty.name


@pytest.mark.parametrize("fault", FAULTS)
def test_planted_faults_are_found(fault):
    all_found(fault, range(4))


@pytest.mark.validate
@pytest.mark.parametrize("fault", FAULTS)
def test_hundreds_of_planted_faults_are_found(fault):
    """300 books of each fault, each beside the same book without it."""
    all_found(fault, range(100, 400))


@pytest.mark.parametrize("fault", ["endless pairing", "squeezed"])
def test_the_command_finds_them_too(fault, tmp_path):
    files = [tmp_path / "sound.toml", tmp_path / "faulty.toml"]
    for file, book in zip(files, planted(fault, 0), strict=True):
        file.write_text(written(book), encoding="utf-8")
    sound, faulty = (CliRunner().invoke(main, ["rules", "check", str(file)]) for file in files)
    assert sound.exit_code == 0
    assert f"{FAULTS[fault][0]}: " not in sound.output
    assert faulty.exit_code == 1
    assert f"{FAULTS[fault][0]}: " in faulty.output


@pytest.mark.parametrize(
    ("where", "name", "blind", "fault"),
    [
        (exploration_index, "lost_cubes", lambda *_: [], "endless pairing"),
        (exploration_index, "lost_cubes", lambda *_: [], "closed circle"),
        (exploration_index, "lost_cubes", lambda *_: [], "dead end"),
        (exploration_index, "fits_into", lambda part, whole, scheme: True, "off target"),
        (exploration_index.ExplorationIndex, "closure", lambda self: [], "restless"),
        (exploration_index.ExplorationIndex, "squeezes", lambda self: [], "squeezed"),
        (checker, "in_tanks", lambda index: (None, []), "holding"),
        (checker, "in_tanks", lambda index: (None, []), "never free"),
        (checker, "in_tanks", lambda index: (None, []), "remainder"),
    ],
)
def test_a_blind_checker_is_found_out(where, name, blind, fault, monkeypatch):
    """The control, fault by fault."""
    monkeypatch.setattr(where, name, blind)
    with pytest.raises(AssertionError, match=fault):
        all_found(fault, range(1))
