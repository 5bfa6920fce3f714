"""The public names of the packages: one list, one home each, and nothing besides."""

import importlib
import re
import subprocess
import sys
from doctest import SKIP, DocTestParser
from pathlib import Path
from types import SimpleNamespace

import pytest

import kinetics
from kinetics.support.lazy_names import homes_in

THREE = ["kinetics", "mechsim", "calibration"]
WITHOUT_EXAMPLES = {"assembly": "results/polycubes keeps digests of its sources, which a docstring would outdate"}
ROOT = Path(kinetics.__file__).parent
ROOMS = [  # that list their names
    listing.parent.relative_to(ROOT).parts
    for listing in sorted(ROOT.glob("*/**/__init__.py"))
    if re.search(r"^(__all__ = |.* = lazy_names\()", listing.read_text(encoding="utf-8"), re.MULTILINE)
]
LAZY = [*THREE, *(f"kinetics.{room}" for room in ("assembly", "markov", "network.laws", "predicting", "rates"))]
WITH_EXAMPLES = [*THREE, *(".".join(["kinetics", *room]) for room in ROOMS if room[0] not in WITHOUT_EXAMPLES)]

FAMILIES = [
    "kinetics.rates.breaks.BREAK_MODELS",
    "kinetics.sampling.SAMPLING_METHODS",
    "kinetics.markov.transient.SOLVING_METHODS",
]
FAMILIES += ["kinetics.network.laws.LAWS", "calibration.RATE_MODELS", "calibration.DIAGNOSTICS"]


@pytest.mark.parametrize("name", LAZY)
def test_names_are_declared_once_and_found_at_home(name):
    package = importlib.import_module(name)
    homes = homes_in(Path(package.__file__).read_text(encoding="utf-8"))
    assert dir(package) == package.__all__ == sorted([*homes, *["__version__"] * (name == "kinetics")])
    for public, module in homes.items():
        assert getattr(package, public) is getattr(importlib.import_module(module), public)
    taken: dict[str, object] = {}
    exec(f"from {name} import *", taken)
    assert set(taken) - {"__builtins__"} == set(package.__all__)
    with pytest.raises(AttributeError, match=f"module '{name}' has no attribute 'nothing'"):
        _ = package.nothing


def test_what_a_user_looks_for_is_there():
    assert {"General", "Network", "Rates", "__version__", "predict", "simulate", "solve"} <= set(
        dir(importlib.import_module("kinetics"))
    )


def has_example(found):
    """Whether its docstring shows a use with an outcome; pytest runs what docstrings show."""
    shown = DocTestParser().get_examples(found.__doc__ or "")
    return any(each.want and SKIP not in each.options for each in shown)


def without_example(package):
    """Public callables whose docstrings show no use."""
    return [name for name in package.__all__ if callable(found := getattr(package, name)) and not has_example(found)]


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_every_public_callable_has_an_example(name):
    assert without_example(importlib.import_module(name)) == []


@pytest.mark.parametrize("family", FAMILIES)
def test_every_member_of_a_family_has_an_example(family):
    package, name = family.rsplit(".", 1)
    members = getattr(importlib.import_module(package), name)
    kinds = [each if callable(each) else type(each) for each in members]
    assert [kind.__name__ for kind in kinds if not has_example(kind)] == []


def test_a_callable_without_an_example_is_seen():
    def shown():
        """>>> 1 + 1
        2
        """

    def promised():
        """>>> promised()"""

    def skipped():
        """>>> skipped()  # doctest: +SKIP
        2
        """

    class Told(list):
        """A list, whose own docstring has examples for all I know."""

    package = SimpleNamespace(shown=shown, promised=promised, skipped=skipped, Told=Told, number=2, bare=lambda: 0)
    package.__all__ = ["shown", "promised", "skipped", "Told", "number", "bare"]
    assert without_example(package) == ["promised", "skipped", "Told", "bare"]


def test_importing_the_packages_imports_none_of_their_rooms():
    code = "import sys, kinetics, mechsim, calibration; print(*[m for m in sys.modules if m.startswith('kinetics.')])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) == {"kinetics.support", "kinetics.support.lazy_names"}


def test_what_a_package_declares():
    source = "from math import e as e, pi\nif TYPE_CHECKING:\n    from a.b import absent as absent, c as d"
    assert homes_in(source) == {"e": "math", "absent": "a.b"}


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
