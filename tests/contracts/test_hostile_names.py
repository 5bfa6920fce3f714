"""Networks whose names mean something to another program, written in every format and read back equal.

Constants in any case, keywords of every format, names that differ in one character, patterns, letters of other
scripts, digits first, spaces and quotes: as species, channels, observables and parameters.
"""

import re
from itertools import cycle, islice

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from kinetics import Chain, Model, Reward
from kinetics.formats import FORMATS, read, write
from kinetics.markov import prism_text, read_explicit, write_explicit
from kinetics.markov.prism.writing import TAKEN, prism_names
from kinetics.network import Network
from kinetics.network.laws import Expression
from kinetics.network.laws.writing import quoted

CONSTANTS = (
    "pi",
    "time",
    "t",
    "e",
    "exponentiale",
    "avogadro",
    "true",
    "false",
    "inf",
    "infinity",
    "nan",
    "notanumber",
)
FUNCTIONS = ("sin", "log", "ln", "exp", "delay", "rateOf", "piecewise", "max", "min", "and", "or", "not", "xor", "root")
WORDS = (
    "begin",
    "end",
    "species",
    "reactions",
    "groups",
    "parameters",
    "observable",
    "combinations",
    "time unit",
    "k1",
)
PYTHONS = ("lambda", "None", "True", "if", "else", "in", "is", "for", "__init__", "x1", "n_A", "r1", "tank")
PRISMS = (*sorted(TAKEN - {*CONSTANTS, *FUNCTIONS}), "begin_", "end_")
ALIKE = (
    "A-B",
    "A_B",
    "A B",
    "A.B",
    "A,B",
    "A+B",
    "A*B",
    "A/B",
    "A:B",
    "A;B",
    "A=B",
    "A#B",
    "A$B",
    "A!B",
    "A&B",
    "A<B",
    "A>B",
)
PATTERNS = (
    "A(b)",
    "A(b!1).B(a!1)",
    "A()",
    "A",
    "B(a)",
    "A(s~u)",
    "A(s~p)",
    "@c::A()",
    "$A()",
    "@c:$A()",
    "0",
    "1",
    "2 A",
    "->",
)
LETTERS = (
    "é",
    "É",
    "ß",
    "µ",
    "α",
    "Ω",
    "名前",
    "имя",
    "ÿ",
    "A·B",
    "ﬁ",
    "x²",
    "٣",
    "😀",
    "مرحبا",
    "K",
)  # the last a Kelvin
QUOTES = (
    "'",
    '"',
    "''",
    "it's",
    'say "so"',
    "\\",
    "\\n",
    "a\\",
    "`",
    "#",
    "<&>",
    "]]>",
    "<!--",
    "&amp;",
    "a&#",
    "&#0;",
    "&#x41;",
    "%",
    "1e5",
    ".5",
    "-1",
)
NAMES = [
    *(spelled for name in CONSTANTS for spelled in (name, name.capitalize(), name.upper())),
    *FUNCTIONS, *(name.capitalize() for name in FUNCTIONS), *WORDS, *PYTHONS, *PRISMS,
    *ALIKE, *PATTERNS, *LETTERS, *QUOTES,
]  # fmt: skip
NAMES = list(dict.fromkeys(NAMES))
PARTS = [NAMES[i : i + 20] for i in range(0, len(NAMES), 20)]
WRITES = pytest.mark.parametrize("kind", [kind for kind in FORMATS if kind.is_written], ids=lambda kind: kind.name)
PART = pytest.mark.parametrize("part", range(len(PARTS)))


def model_of(part):
    """A network whose species, channels and observables have 20 of the names, in different orders."""
    names = PARTS[part]
    n = len(names)
    ring = list(islice(cycle(names), n + 3))
    reactions = {
        names[-1 - i]: ({ring[i]: 1 + i % 2, ring[i + 1]: 1}, {ring[i + 2]: 1}) if n > 2 else ({ring[i]: 1}, {})
        for i in range(n)
    }
    network = Network.from_reactions(reactions, np.arange(n) / 7 + 0.1, names)
    sums = {name: {ring[i]: 1.0, ring[i + 3]: 2.5} for i, name in enumerate(names)}
    return Model(network, np.arange(n) + 2, sums)


def assert_alike(again, model):
    assert_array_equal(again.initial, model.initial)
    assert_array_equal(again.network.stoichiometry, model.network.stoichiometry)
    states = np.random.default_rng(3).integers(0, 9, (20, len(model.network.species)))
    assert_allclose(again.network.propensities(states), model.network.propensities(states), rtol=1e-13, atol=0)
    assert len(again.observables) == len(model.observables)
    for got, given in zip(again.observables.values(), model.observables.values(), strict=True):
        weights = np.zeros((2, len(model.network.species)))
        for row, net, side in zip(weights, (again.network, model.network), (got, given), strict=True):
            for name, weight in side.items():
                row[net.index(name)] += weight
        assert_array_equal(*weights)


def test_there_are_200_names_of_all_kinds():
    assert len(NAMES) >= 200
    assert max(map(len, PARTS)) == 20


@PART
@WRITES
def test_hostile_names_come_back(kind, part, tmp_path):
    model = model_of(part)
    path = tmp_path / f"m{kind.suffixes[0]}"
    write(model, path)
    again = read(path)
    assert_alike(again, model)
    if kind.name == "rxn":  # which takes every name as it is
        assert again.network.species == model.network.species
        assert again.network.channels == model.network.channels
        assert list(again.observables) == list(model.observables)
    if kind.name == "sbml":  # whose ids are the names, where these can be ids
        kept = [name for name in model.network.species if re.fullmatch("[A-Za-z_][A-Za-z0-9_]*", name)]
        assert set(kept) - {"tank"} <= set(again.network.species)


@PART
def test_hostile_names_of_parameters_come_back(part, tmp_path):
    """In reactions as text, the one format that is written with them."""
    names = PARTS[part]
    lines = [f"{quoted(name)} = {place + 1}" for place, name in enumerate(names)]
    lines += [f"A -> B, 2 * {quoted(name)}" for name in names]
    lines += [f"B -> A, {quoted(name)} * 'B' / (1 + B)" for name in names]
    text = "\n".join(lines) if not {"A", "B"} & set(names) else "A -> B, 1"
    (tmp_path / "first.rxn").write_text(text, encoding="utf-8")
    model = read(tmp_path / "first.rxn")
    write(model, tmp_path / "second.rxn")
    again = read(tmp_path / "second.rxn")
    assert again.network.given.values == model.network.given.values
    assert_alike(again, model)
    changed = dict.fromkeys(model.network.given.given, 3.5)
    assert_alike(again.with_parameters(**changed), model.with_parameters(**changed))


@PART
def test_hostile_names_in_a_prism_model_are_identifiers(part):
    model = model_of(part)
    text = prism_text(model, model.initial + 5)
    variables = re.findall(r"^  (\S+) : \[", text, re.MULTILINE)
    rewards = re.findall(r'^rewards "(.*)"$', text, re.MULTILINE)
    for names in (variables, rewards):
        assert len(set(names)) == len(names) == len(PARTS[part])
        assert all(re.fullmatch("[A-Za-z_][A-Za-z0-9_]*", name, re.ASCII) for name in names)
        assert not TAKEN & set(names)
    assert len(re.findall("->", "\n".join(line for line in text.splitlines() if "//" not in line))) == len(PARTS[part])


@PART
def test_hostile_names_of_a_chain_come_back_as_identifiers(part, tmp_path):
    names = [name for name in PARTS[part] if '"' not in name]
    rng = np.random.default_rng(4)
    labels = {f"{name}": rng.random(3) < 0.5 for name in names}
    rewards = {name: Reward(rng.random(3)) for name in names}
    variables = [f"{name}?" for name in names]
    chain = Chain(
        rng.random((3, 3)) * (1 - np.eye(3)), 1, labels, rewards, variables, rng.integers(0, 9, (3, len(names)))
    )
    write_explicit(chain, tmp_path / "m.tra")
    back = read_explicit(tmp_path / "m.tra")
    assert_array_equal(back.counts, chain.counts)
    for name, spelled in prism_names(list(rewards)).items():
        assert_array_equal(back.rewards[spelled].rates, chain.rewards[name].rates)
    own = [name for name in labels if name not in ("init", "deadlock")]
    for name, spelled in prism_names(own, back.variables).items():
        assert_array_equal(back.labels[spelled], chain.labels[name])
    for spelled in (*back.rewards, *back.variables, *back.labels):
        assert re.fullmatch("[A-Za-z_][A-Za-z0-9_]*", spelled, re.ASCII)


def test_a_formula_reads_back_whatever_its_names():
    for name in NAMES:
        law = Expression(f"2 * {quoted(name)} + 1")
        assert law.species == (name,)
        assert Expression(law.text).species == (name,)


@WRITES
@pytest.mark.parametrize("name", ["a\x1bb", "a\u202eb", "a\nb", "a\ud800b"], ids=ascii)
def test_a_name_that_no_reader_takes_is_not_written(kind, name, tmp_path):
    """Or is spelled otherwise: never is there a file that cannot be read."""
    model = Model(Network.from_reactions({"r": ({name: 1}, {})}, [1.0]), [3])
    path = tmp_path / f"m{kind.suffixes[0]}"
    try:
        write(model, path)
    except ValueError:
        assert list(tmp_path.iterdir()) == []
    else:
        assert_alike(read(path), model)
