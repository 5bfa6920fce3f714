"""The public names of the packages: one list, one home each, and nothing besides."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

from kinetics.support.lazy_names import lazy_names

PACKAGES = pytest.mark.parametrize("name", ["kinetics", "mechsim", "calibration"])


def imported_for_types(package):
    """Name -> module of the imports below `if TYPE_CHECKING`, which editors and mypy read."""
    tree = ast.parse(Path(package.__file__).read_text(encoding="utf-8"))
    (block,) = [node for node in tree.body if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"]
    return {alias.name: line.module for line in block.body for alias in line.names}


@PACKAGES
def test_dir_lists_the_public_names_and_nothing_else(name):
    package = importlib.import_module(name)
    assert dir(package) == sorted(package.__all__)
    assert len(set(package.__all__)) == len(package.__all__)


@PACKAGES
def test_list_homes_and_types_agree(name):
    package = importlib.import_module(name)
    home_of = {public: module for module, names in package._HOMES.items() for public in names}
    assert len(home_of) == sum(map(len, package._HOMES.values())), "a name has two homes"
    assert imported_for_types(package) == home_of
    own = {public for public in package.__all__ if public in vars(package) and public not in home_of}
    assert set(package.__all__) == set(home_of) | own
    assert own <= {"__version__"}


@PACKAGES
def test_every_name_is_what_its_home_has(name):
    package = importlib.import_module(name)
    for module, names in package._HOMES.items():
        for public in names:
            assert getattr(package, public) is getattr(importlib.import_module(module), public)
    with pytest.raises(AttributeError, match=f"module '{name}' has no attribute 'nothing'"):
        _ = package.nothing


def test_what_a_user_looks_for_is_there():
    assert {"General", "Network", "Rates", "__version__", "predict", "simulate", "solve"} <= set(
        dir(importlib.import_module("kinetics"))
    )


def test_importing_the_packages_imports_none_of_their_rooms():
    code = "import sys, kinetics, mechsim, calibration; print(*[m for m in sys.modules if m.startswith('kinetics.')])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) == {"kinetics.support", "kinetics.support.lazy_names"}


def test_a_list_that_differs_from_its_homes_is_seen():
    find, listed = lazy_names("package", ["pi", "absent"], {"math": ("pi",)})
    assert listed() == ["absent", "pi"]
    assert find("pi") == importlib.import_module("math").pi
    with pytest.raises(AttributeError, match="module 'package' has no attribute 'absent'"):
        find("absent")


@pytest.mark.parametrize(
    ("package", "name", "hint"),
    [
        ("kinetics", "splitting", "the public names"),
        ("kinetics", "Simulate", "did you mean 'simulate'"),
        ("kinetics.assembly", "Event", "did you mean 'StructureEvent'"),
        ("calibration", "Table", "did you mean 'ReportTable'"),
        ("calibration", "diagnoses", "did you mean 'diagnose'"),
    ],
)
def test_an_unknown_name_is_answered_by_near_ones(package, name, hint):
    module = importlib.import_module(package)
    said = f"module '{package}' has no attribute '{name}'; {hint}.* are those of dir\\({package}\\)"
    with pytest.raises(AttributeError, match=said):
        getattr(module, name)
