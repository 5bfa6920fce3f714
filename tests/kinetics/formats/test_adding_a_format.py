"""A format is added by one file and its line in the tuple: shown in a scratch copy, where the contract tests it."""

import re

import pytest
from scratch import add_line, run_contract, scratch_copy

SHEET = '''"""A sheet of JSON: species, channels and sparse tables."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from kinetics.formats.base import Format, Model
from kinetics.network import Network
from kinetics.network.sparse_tables import SparseTable


@dataclass(frozen=True)
class Sheet(Format):
    """Reader and writer of sheets."""

    name: ClassVar[str] = "sheet"
    suffixes: ClassVar[tuple[str, ...]] = (".sheet", ".sht")

    def read(self, path: Path, copies_per_unit: float | None = None) -> Model:
        """The network of a sheet."""
        if copies_per_unit is not None:
            raise ValueError(f"{path} has whole counts; it takes no copies_per_unit")
        if path.stat().st_size > 2**20:
            raise ValueError(f"{path} has {path.stat().st_size} bytes; at most {2**20} are read")
        try:
            data = json.loads(path.read_text(encoding="utf-8"))
            shape = len(data["channels"]), len(data["species"])
            tables = [SparseTable.of_entries(shape, *data[name]) for name in ("needs", "change")]
            network = Network(
                data["species"], data["channels"], *tables, data["ways"], data["rates"], data["combinations"]
            )
            return Model(network, data["initial"], data["observables"])
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"{path} is no sheet: {error}") from None

    def text(self, model: Model) -> str:
        """A sheet of mass action."""
        net = model.network
        if not net.is_mass_action:
            raise ValueError(f"a sheet has mass action alone; {[*net.laws]} or {[*net.events]} do not fit")
        tables = {"needs": net.sparse_reactants, "change": net.sparse_stoichiometry}
        return json.dumps(
            {name: [part.tolist() for part in (t.rows, t.columns, t.copies)] for name, t in tables.items()}
            | {"species": net.species, "channels": net.channels, "combinations": net.combinations}
            | {"ways": net.ways.tolist(), "rates": net.known_rates.tolist()}
            | {"initial": model.initial.tolist(), "observables": dict(model.observables)}
        )
'''
# Each is (in the place of, this) and a case of the contract that sees it.
MISTAKES = (
    ('net.ways.tolist(), "rates"', '[1.0] * len(net.channels), "rates"', "test_a_network_comes_back[ways-sheet]"),
    ("if not net.is_mass_action:", "if False:", "test_what_it_cannot_hold_is_refused_and_not_changed[law-sheet]"),
    ("(ValueError, KeyError,", "(KeyError,", "test_a_damaged_file_is_refused_by_name[sheet]"),
    ('".sheet", ".sht"', '".sheet", ".sHt"', "test_it_says_what_it_is[sheet]"),
    ("model.initial.tolist()", "(model.initial // 2).tolist()", "test_large_counts_and_extreme_rates_come_back[sheet]"),
)
# The same with rate laws and events: (in the place of, this).
MORE = (
    ("not net.is_mass_action", 'net.at_zero != "block"'),
    ("alone; {[*net.laws]} or", "with zeros that block; {[*net.laws]} or"),
    (
        'data["rates"], data["combinations"]\n',
        'data["rates"], data["combinations"],\nlaws=data["laws"], events=[Event(*each) for each in data["events"]],\n',
    ),
    (
        '            | {"initial"',
        """            | {"laws": {name: str(law) for name, law in net.laws.items()}}
            | {"events": [[e.name, str(e.when), {k: str(v) for k, v in e.assign.items()}] for e in net.events]}
            | {"initial\"""",
    ),
    ("from kinetics.network.sparse", "from kinetics.network.laws import Event\nfrom kinetics.network.sparse"),
)
LOSSES = (
    ("str(e.when)", '"1 < 0"', "test_what_it_cannot_hold_is_refused_and_not_changed[event-sheet]"),
    (
        "str(law) for",
        '"0" if law.reads_time else str(law) for',
        "test_what_it_cannot_hold_is_refused_and_not_changed[timed law-sheet]",
    ),
    (
        "dict(model.observables)",
        "{name * (1 + (len(net.species) == 3)): each for name, each in model.observables.items()}",
        "test_a_network_comes_back[catalyst-sheet]",
    ),
)


def changed(text, changes):
    """The text with one thing in the place of another, which must stand there once."""
    for right, wrong, *_ in changes:
        assert text.count(right) == 1, right
        text = text.replace(right, wrong)
    return text


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A copy in which the new format has its line in the tuple, and the import that the line needs."""
    made = scratch_copy(tmp_path_factory.mktemp("scratch"))
    formats = made / "kinetics" / "formats" / "__init__.py"
    add_line(formats, "import Sbml", "from kinetics.formats.sheet import Sheet")
    return made


def contract_of(copy, text):
    """The contract's cases for a format that is this file; nothing is compiled for so small networks."""
    (copy / "kinetics" / "formats" / "sheet.py").write_text(text, encoding="utf-8")
    return run_contract(copy, "test_formats.py", "-k", "sheet", "-rf", "--tb=no", plain=True)


@pytest.mark.parametrize("text", [SHEET, changed(SHEET, MORE)], ids=["plain", "laws"])
def test_one_file_and_its_line_add_a_format(text, copy):
    code, said = contract_of(copy, text)
    assert code == 0, said
    assert re.search(r"\b[12][0-9] passed", said), said


@pytest.mark.parametrize(
    ("base", "mistakes"), [(SHEET, MISTAKES), (changed(SHEET, MORE), LOSSES)], ids=["plain", "laws"]
)
def test_the_contract_sees_what_is_wrong_with_it(base, mistakes, copy):
    code, said = contract_of(copy, changed(base, mistakes))
    assert code == 1, said
    for *_, case in mistakes:
        assert f"::{case}" in said, f"{case} did not fail: {said}"
