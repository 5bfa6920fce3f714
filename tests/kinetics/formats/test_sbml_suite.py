"""Semantic cases of the SBML Test Suite, where a folder with them is given: --sbml-suite FOLDER.

The suite's files are not part of this repository. A case is a folder with its model in levels of SBML, `*-settings.txt`
and `*-results.csv`. The rate equations of the network that was read must equal the results within the case's
tolerances, or the file is refused with its reason. Files that start from fractions of a copy are read at a large scale.
"""

import csv
import logging
import re
import warnings
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from rate_equations import NegativeRateError, RateEquations

from kinetics.formats import read
from kinetics.network.laws.expression import Expression

LOG = logging.getLogger(__name__)  # shown by --log-cli-level=INFO
COPIES_PER_UNIT = 1e9
WHOLE_SUITE, LEAST_EQUAL = 1500, 120  # of a folder with so many cases, so many must be equal and not refused
OUTCOMES = Counter()


class Case(NamedTuple):
    """What a case expects: results (T, V), by amount or concentration, within tolerances."""

    file: Path
    variables: list[str]
    as_amounts: set[str]
    times: np.ndarray
    results: np.ndarray
    absolute: float
    relative: float


def load(folder):
    (settings,) = folder.glob("*-settings.txt")
    said = dict(re.findall(r"^(\w+):[ \t]*(.*)$", settings.read_text(encoding="utf-8"), re.MULTILINE))
    variables = said["variables"].replace(",", " ").split()
    (path,) = folder.glob("*-results.csv")
    with path.open(encoding="utf-8") as file:
        head, *rows = [[cell.strip() for cell in row] for row in csv.reader(file) if row]
    table = np.array([[float(cell) for cell in row] for row in rows])
    columns = [head.index(name) for name in variables]
    amounts = set(said["amount"].replace(",", " ").split())
    file = max(folder.glob("*-sbml-*.xml"))
    return Case(
        file, variables, amounts, table[:, 0], table[:, columns], float(said["absolute"]), float(said["relative"])
    )


def pytest_generate_tests(metafunc):
    if "folder" in metafunc.fixturenames:
        given = metafunc.config.getoption("--sbml-suite")
        folders = sorted(path for path in Path(given).iterdir() if path.is_dir()) if given else []
        if given and not folders:
            raise pytest.UsageError(f"--sbml-suite {given}: no case in this folder")
        if not folders:
            folders = [pytest.param(None, marks=pytest.mark.skip(reason="no folder of cases; see --sbml-suite"))]
        metafunc.parametrize("folder", folders, ids=lambda path: path.name if path else "none")


def model_of(file):
    """The model and its copies per unit of amount; a ValueError where it is refused."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of channels that change nothing
        try:
            return read(file), 1.0
        except ValueError as error:
            if "--copies-per-unit" not in str(error):
                raise
        return read(file, COPIES_PER_UNIT), COPIES_PER_UNIT


def compared(case, model, copies, rate=1.0):
    """Found and expected (T, V') of the variables that the network determines."""
    libsbml = pytest.importorskip("libsbml")
    source = libsbml.readSBMLFromFile(str(case.file))
    equations = RateEquations(model.network, rate)
    amounts = equations.solution(model.initial, case.times) / copies
    found, kept = [], []
    for v, name in enumerate(case.variables):
        if name not in model.formulas:
            continue
        formula = Expression(model.formulas[name])
        value = np.array([equations.value(formula, y, t) for y, t in zip(amounts, case.times, strict=True)])
        species = source.getModel().getSpecies(name)
        if species is not None and (name in case.as_amounts) != species.getHasOnlySubstanceUnits():
            place = Expression(model.formulas[species.getCompartment()])
            size = np.array([equations.value(place, y, t) for y, t in zip(amounts, case.times, strict=True)])
            value = value * size if name in case.as_amounts else value / size
        found.append(value)
        kept.append(v)
    return np.array(found).reshape(len(kept), case.times.size).T, case.results[:, kept]


def are_equal(case, found, expected):
    return np.abs(found - expected) <= case.absolute + case.relative * np.abs(expected)


def outcome_of(folder):
    case = load(folder)
    try:
        model, copies = model_of(case.file)
        found, expected = compared(case, model, copies)
    except NegativeRateError as error:
        return "refused in a run", str(error)
    except ValueError as error:
        return "refused" if str(case.file) in str(error) else "wrong", str(error)
    if not found.size:
        return "not compared", f"no formulas of {', '.join(case.variables)}"
    wrong = np.argwhere(~are_equal(case, found, expected))
    if wrong.size:
        t, v = wrong[0]
        return "wrong", f"{case.variables[v]} is {found[t, v]:g} at {case.times[t]:g}; expected {expected[t, v]:g}"
    return "equal", f"{found.shape[1]} of {len(case.variables)} variables, {copies:g} copies per unit"


def test_case(folder):
    outcome, why = outcome_of(folder)
    OUTCOMES[outcome] += 1
    LOG.info("%s: %s: %s", folder.name, outcome, why)
    assert outcome != "wrong", why


def test_a_wrong_rate_is_seen(folder):
    """A control that must fail: all rates 3 % too large, wherever something happens by them."""
    case = load(folder)
    try:
        model, copies = model_of(case.file)
        found, expected = compared(case, model, copies)
        other, _ = compared(case, model, copies, rate=1.03)
    except ValueError:
        pytest.skip("refused")
    if np.abs(other - found).max(initial=0) < 3 * (case.absolute + case.relative * np.abs(expected).max(initial=0)):
        pytest.skip("rates hardly matter to what is compared")
    assert not are_equal(case, other, expected).all()


def test_enough_of_the_suite_is_read():
    LOG.info("%s", dict(OUTCOMES))
    if sum(OUTCOMES.values()) >= WHOLE_SUITE:
        assert OUTCOMES["equal"] >= LEAST_EQUAL
