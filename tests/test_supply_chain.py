"""What is installed on a fresh machine is pinned by hash, and says which Pythons it was tested under."""

import re
import tomllib
from importlib.metadata import requires, version
from pathlib import Path

import pytest

import kinetics

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def normal(name):
    return re.sub(r"[-_.]+", "-", name).lower()


def pins(path):
    """name -> version of every `name==version` at the start of a line."""
    return {normal(name): pin for name, pin in re.findall(r"^([\w.-]+)==(\S+)", path.read_text("utf-8"), re.MULTILINE)}


@pytest.fixture(scope="module")
def locked():
    return pins(ROOT / "requirements.lock")


def without_hash(text):
    """Requirements of a lock that are not one version with its hashes."""
    blocks = re.split(r"^(?=\S)", text, flags=re.MULTILINE)[1:]
    return [block for block in blocks if not re.match(r"[\w.-]+==\S+ [^\n]*\\\n +--hash=sha256:[0-9a-f]{64}\b", block)]


def test_every_package_is_pinned_by_hash():
    text = (ROOT / "requirements.lock").read_text("utf-8")
    assert without_hash(text) == []
    assert without_hash(text + "numpy>=2\n") == ["numpy>=2\n"]  # the control
    assert "://" not in text


def test_the_lock_has_the_versions_of_the_constraints(locked):
    """Packages for other systems and Pythons are in the lock alone."""
    asked = pins(ROOT / "constraints.txt")
    assert {name: asked[name] for name in locked.keys() & asked.keys()} == {
        name: locked[name] for name in locked.keys() & asked.keys()
    }
    assert len(locked.keys() & asked.keys()) > 90


def test_what_the_project_asks_for_is_in_the_lock(locked):
    peers = ("peers", "oracle", "bngl")
    asked = [line for line in requires("wellmixed") if not any(f'extra == "{extra}"' in line for extra in peers)]
    names = {normal(re.match(r"[\w.-]+", line)[0]) for line in asked} - {"wellmixed"}
    assert len(names) > 20
    assert names <= locked.keys()


def test_the_builder_is_the_one_of_the_lock(locked):
    assert PROJECT["build-system"]["requires"] == [f"setuptools=={locked['setuptools']}"]


def test_one_version():
    assert kinetics.__version__ == version("wellmixed")


def test_it_names_the_pythons_that_ci_tests():
    """The oldest by `make test`, the newest by `.ci/run`; mechanics where PyBullet has wheels."""
    oldest, newest = re.fullmatch(r">=3\.(\d+),<3\.(\d+)", PROJECT["project"]["requires-python"]).groups()
    assert f"PYTHON ?= python3.{oldest}" in (ROOT / "Makefile").read_text("utf-8")
    assert f"for version in 3.{int(newest) - 1} " in (ROOT / ".ci/run").read_text("utf-8")
    assert all("python_version < '3.12'" in line for line in PROJECT["project"]["optional-dependencies"]["mech"])


def test_tests_and_the_demo_get_home_and_path_alone():
    """Nothing can lean on what a machine sets; set-up gets all of it, for pip may need certificates or an index."""
    lines = (ROOT / "Makefile").read_text("utf-8").splitlines()
    (bare,) = [line.partition(":=")[2].split() for line in lines if line.startswith("BARE")]
    assert bare == ["env", "-i", 'HOME="$(HOME)"', 'PATH="$(PATH)"', "$(if", '$(CI),CI="$(CI)")']
    tests = [line for line in lines if re.search(r"-m (pytest|tests\.(?!results|benchmarks))|wellmixed demo", line)]
    assert len(tests) == 7
    assert all(line.startswith("\t$(BARE) $(BIN)/") for line in tests)
    assert not any("pip install" in line and "BARE" in line for line in lines)
    commands = [line for line in (ROOT / ".ci/run").read_text("utf-8").splitlines() if not line.startswith("#")]
    assert not any(".venv" in line and "VENV=" not in line for line in commands)  # all of them by `make`
