"""Reading and checking of an SBML file by libsbml: a document that is safe to walk, or a clear message."""

from __future__ import annotations

from collections.abc import Set
from pathlib import Path
from typing import Any
from xml.parsers import expat

from kinetics.formats.sbmlchecks import check_consistency
from kinetics.support.limits import (
    MOST_REACTIONS,
    MOST_SPECIES,
    check_count,
    check_names,
)
from kinetics.support.packages import libsbml

MAX_DEPTH = 100  # of tags; libsbml ends the whole process on some files that are thousands deep
MAX_ERRORS = 5  # reported at once
MATH = "l3v2extendedmath"  # the package whose operators are read, or refused if they are used
LOOKS = ("layout", "render", "annot")  # those that say how a model looks, not what it does


def document_of(path: Path, data: bytes) -> Any:
    """The document in a file's bytes: with a model, and nothing that libsbml faults or that we do not know."""
    _check_depth(path, data)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path} is not UTF-8 text: {error}") from None
    document = libsbml.readSBMLFromString(text)
    passed = _optional_packages(path, document)
    _raise_errors(path, document, passed)
    if document.getModel() is None:
        raise ValueError(f"{path} holds no model")
    _check_counts(path, document.getModel())
    for category in (libsbml.LIBSBML_CAT_UNITS_CONSISTENCY, libsbml.LIBSBML_CAT_MODELING_PRACTICE):
        document.setConsistencyChecks(category, False)
    check_consistency(document)
    _raise_errors(path, document, passed)
    return document


def _optional_packages(path: Path, document: Any) -> set[str]:
    """The packages that the document does not require, which are taken off it: without them it means what it says."""
    plugins = [document.getPlugin(i) for i in range(document.getNumPlugins())]
    used = {each.getPackageName(): (each.getURI(), each.getPrefix()) for each in plugins}
    for package in used.keys() - {MATH}:
        if document.getPackageRequired(package) and package not in LOOKS:
            raise ValueError(f"{path} requires the package {package!r} of SBML, which is not read here")
        document.enablePackage(*used[package], False)
    return used.keys() - {MATH}


def _check_counts(path: Path, model: Any) -> None:
    check_count(path, "species", model.getNumSpecies(), MOST_SPECIES)
    check_count(path, "reactions", model.getNumReactions(), MOST_REACTIONS)
    check_names(path, (model.getSpecies(i).getId() for i in range(model.getNumSpecies())))


def _check_depth(path: Path, data: bytes) -> None:
    depth = 0

    def enter(*_: object) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_DEPTH:
            raise ValueError(f"{path}, line {parser.CurrentLineNumber}: tags over {MAX_DEPTH} deep")

    def leave(_: str) -> None:
        nonlocal depth
        depth -= 1

    def refuse(*_: object) -> None:
        raise ValueError(f"{path}, line {parser.CurrentLineNumber}: a document type or an entity, which is not read")

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = enter, leave
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, LookupError) as error:  # the latter of an unknown encoding
        raise ValueError(f"{path} is not XML: {error}") from None


def _raise_errors(path: Path, document: Any, passed: Set[str]) -> None:

    found = []
    for i in range(document.getNumErrors()):
        error = document.getError(i)
        if error.getSeverity() >= libsbml.LIBSBML_SEV_ERROR and error.getPackage() not in passed:
            # The message is the rule of the specification, then what broke it.
            lines = [line.strip() for line in error.getMessage().splitlines() if line.strip()]
            found.append(f"line {error.getLine()}: {error.getShortMessage()}: {lines[-1][:200] if lines else ''}")
    if found:
        more = f"; and {len(found) - MAX_ERRORS} more" if len(found) > MAX_ERRORS else ""
        raise ValueError(f"{path}, {'; '.join(found[:MAX_ERRORS])}{more}")
