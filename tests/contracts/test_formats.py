"""What every format of network files must do: keep the network, refuse what it cannot hold, name what is wrong."""

import re
import warnings

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose, assert_array_equal

from kinetics import Model
from kinetics.formats import FORMATS, SUFFIXES, WRITTEN, read, write
from kinetics.network import Network
from kinetics.network.laws import Event
from kinetics.network.sparse_tables import SparseTable
from kinetics.sampling import General
from wellmixed import main

FORMAT = pytest.mark.parametrize("kind", FORMATS, ids=lambda kind: kind.name)
WRITES = pytest.mark.parametrize("kind", [kind for kind in FORMATS if kind.is_written], ids=lambda kind: kind.name)
READS = pytest.mark.parametrize("kind", [kind for kind in FORMATS if not kind.is_written], ids=lambda kind: kind.name)
PAIR = {"pair": ({"A": 2}, {"B": 1}), "part": ({"B": 1}, {"A": 2})}


def of_reactions(reactions, *rest, **more):
    return lambda: Network.from_reactions(reactions, *rest, **more)


KEPT = {
    "mass action": of_reactions(PAIR, [0.3, 1e-30]),
    "ways": of_reactions(PAIR, [0.1, 1 / 3], ways=[7, 0.1]),
    "ordered": of_reactions(PAIR, [2.0, 3e7], combinations="ordered"),
    "catalyst": of_reactions({"help": ({"C": 1, "A": 2}, {"C": 1, "B": 1})}, [5.0]),
    "of nothing": of_reactions({"in": ({}, {"A": 3}), "out": ({"A": 1}, {})}, [3.0, 0.0]),
    "no reaction": of_reactions({}, [], species=["A", "B"]),
    "odd names": of_reactions(
        {"3 a": ({"x y": 3}, {"2b": 1}), "#odd <&>": ({"2b": 2, "x y": 1}, {"x_y": 4})}, [0.1, 9.0]
    ),
    "names alike": of_reactions({"a b": ({"x-y": 1}, {"x+y": 1}), "a-b": ({"x+y": 1}, {"x_y": 1})}, [0.1, 0.2]),
    "words of the language": of_reactions(
        {"end": ({"time": 1}, {"begin": 1}), "t": ({"pi": 1}, {"species": 1})}, [1, 2]
    ),
}
# A format may hold these, or refuse them; it may not change them.
HARD = {
    "product": of_reactions(PAIR, [2.0, 1.0], combinations="product"),
    "law": of_reactions(PAIR, ["2 * A / (3 + A)", 1.0]),
    "timed law": of_reactions(PAIR, ["A * (1 + sin(t))", 1.0]),
    "law that refuses": of_reactions(PAIR, ["2 + A", 1.0], at_zero="refuse"),
    "event": of_reactions(PAIR, [1.0, 1.0], events=[Event("dose", "A < 5", {"A": "A + 10"})]),
    "high order": of_reactions({"all": ({"A": 180}, {"B": 1})}, [1.0]),
}


def model_of(network, copies=9):
    """With counts and observables that differ from species to species."""
    n = len(network.species)
    sums = {"sum": dict.fromkeys(network.species, 1.0), "some": {network.species[-1]: 2.5}, "none": {}}
    return Model(network, np.arange(n) + copies, sums)


def assert_same(again, model):
    """Copies, observables, all propensities, and runs where events act, in the order of species and channels.

    Names of species and channels may be respelled, those of observables may not.
    """
    assert_array_equal(again.initial, model.initial)
    assert_array_equal(again.network.stoichiometry, model.network.stoichiometry)
    assert_array_equal(again.network.reactants, model.network.reactants)
    assert len(again.network.events) == len(model.network.events)
    assert list(again.observables) == list(model.observables)
    for got, given in zip(again.observables.values(), model.observables.values(), strict=True):
        weights = np.zeros((2, len(model.network.species)))
        for row, net, side in zip(weights, (again.network, model.network), (got, given), strict=True):
            row[[net.index(name) for name in side]] = list(side.values())
        assert_array_equal(*weights)
    states = np.random.default_rng(1).integers(0, 20, (30, len(model.network.species)))
    time = 1.3  # other than 0, where many a law of time is as if there were none
    found, expected = (each.network.propensities(states, time) for each in (again, model))
    assert_allclose(found, expected, rtol=1e-14, atol=0)
    if model.network.events:
        with np.errstate(over="ignore"):  # random streams wrap around, of which numpy warns where nothing is compiled
            drawn = [
                General().simulate(each.network, each.initial, [0.5, 2.0], runs=20, seed=3, threads=1)
                for each in (again, model)
            ]
        assert_array_equal(*(each.counts for each in drawn))


def refusal_of(act, *arguments):
    """The message with which it is refused, or None."""
    try:
        act(*arguments)
    except ValueError as error:
        return str(error)
    return None


def put(kind, model, path):
    """Not by `write`, whose own proof of a file would hide what is wrong with its format."""
    path.write_text(kind.text(model), encoding="utf-8")


def through(kind, model, folder):
    path = folder / f"model{kind.suffixes[0]}"
    put(kind, model, path)
    return read(path)


def test_names_and_suffixes_are_one_formats_own():
    assert len({kind.name for kind in FORMATS}) == len(FORMATS)
    assert len(set(SUFFIXES)) == len(SUFFIXES)
    assert ".toml" not in SUFFIXES  # that of a rule book


@FORMAT
def test_it_says_what_it_is(kind):
    for what in (type(kind), kind.read, kind.text):
        assert what.__doc__
    assert re.fullmatch(r"[a-z][a-z0-9]*", kind.name)
    assert kind.suffixes
    assert all(re.fullmatch(r"\.[a-z0-9]+", suffix) for suffix in kind.suffixes)


@WRITES
@pytest.mark.parametrize("name", KEPT)
def test_a_network_comes_back(kind, name, tmp_path):
    model = model_of(KEPT[name]())
    again = through(kind, model, tmp_path)
    assert_same(again, model)
    assert_same(through(kind, again, tmp_path), again)


@WRITES
@pytest.mark.parametrize("name", HARD)
def test_what_it_cannot_hold_is_refused_and_not_changed(kind, name, tmp_path):
    assert_kept_or_refused(kind, model_of(HARD[name](), copies=6), tmp_path)


def assert_kept_or_refused(kind, model, folder):
    folder.mkdir(exist_ok=True)
    path = folder / f"model{kind.suffixes[0]}"
    refusal = refusal_of(put, kind, model, path)
    if refusal is None:
        assert_same(read(path), model)
        write(model, path)
    else:
        assert refusal_of(write, model, path) == refusal
        assert re.search("['`]", refusal), f"{refusal} names nothing"
        assert not path.exists()


@WRITES
def test_large_counts_and_extreme_rates_come_back(kind, tmp_path):
    network = KEPT["mass action"]().with_rates([4.9e-300, 1.7e300])
    model = Model(network, [10**14 + 1, 0])
    assert_same(through(kind, model, tmp_path), model)
    for count in (10**15 + 1, 2**53 + 1, 2**63 - 1):
        assert_kept_or_refused(kind, Model(network, [0, count]), tmp_path / str(count))


@WRITES
def test_a_scale_keeps_the_rate_equations_or_is_refused(kind, tmp_path):
    """Ten copies to a unit of amount: ten times the counts, and of order 0 and 1 ten times the propensities there."""
    model = model_of(KEPT["of nothing"]())
    path = tmp_path / f"model{kind.suffixes[0]}"
    write(model, path)
    for scale in (0.0, float("nan")):
        with pytest.raises(ValueError, match="copies"):
            read(path, scale)
    refusal = refusal_of(read, path, 10.0)
    if refusal is not None:
        assert str(path) in refusal
        return
    again = read(path, 10.0)
    assert_array_equal(again.initial, 10 * model.initial)
    states = np.arange(5)[:, None]
    found, expected = (each.network.propensities(scale * states) for each, scale in ((again, 10), (model, 1)))
    assert_allclose(found, 10 * expected, rtol=1e-14)


@WRITES
def test_its_files_are_found_by_every_suffix_in_any_case(kind, tmp_path):
    model = model_of(KEPT["mass action"]())
    for suffix in kind.suffixes:
        for name in (f"m{suffix}", f"m{suffix.upper()}", f"two.dots{suffix}"):
            write(model, tmp_path / name)
            assert_same(read(tmp_path / name), model)
            assert (tmp_path / name).read_text(encoding="utf-8") == kind.text(model)


@WRITES
def test_large_networks_need_no_dense_table(kind, tmp_path, monkeypatch):
    n = 600
    names = [f"s{i}" for i in range(n)]
    network = Network.from_reactions(
        {f"r{i}": ({names[i]: 1}, {names[(i + 1) % n]: 1}) for i in range(n)}, np.arange(n) + 0.5
    )

    def refuse(table):
        raise AssertionError(f"a dense table of {table.shape}")

    monkeypatch.setattr(SparseTable, "dense", refuse)
    again = through(kind, Model(network, np.arange(n)), tmp_path)
    assert_array_equal(again.initial, np.arange(n))
    assert_allclose(again.network.propensities(np.ones(n)), np.arange(n) + 0.5, rtol=1e-15)


@WRITES
def test_a_damaged_file_is_refused_by_name(kind, tmp_path):
    """Cut short, with bytes exchanged, empty, not text, too large: never anything but a ValueError, or a network."""
    path = tmp_path / f"model{kind.suffixes[0]}"
    text = kind.text(model_of(KEPT["ways"]())).encode()
    rng = np.random.default_rng(2)
    damaged = [b"", b"\xff\xfe\x00", b"\x00" * 50, text[: len(text) // 2], text + text]
    for _ in range(15):
        changed = bytearray(text)
        for place in rng.integers(0, len(text), 3):
            changed[place] = rng.integers(32, 127)
        damaged.append(bytes(changed))
    refused = []
    for content in damaged:
        path.write_bytes(content)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of copies that are not whole, and the like
            refused.append(refusal_of(read, path))
    assert all(str(path) in refusal for refusal in refused if refusal)
    assert all(refused[:5])
    with path.open("wb") as file:
        file.truncate(2**30)
    with pytest.raises(ValueError, match=f"{re.escape(str(path))} has {2**30} bytes; at most"):
        read(path)


@WRITES
def test_the_commands_know_it(kind, tmp_path):
    run = CliRunner().invoke
    assert all(suffix in run(main, ["rules", "derive", "--help"]).output for suffix in kind.suffixes)
    path = str(tmp_path / f"model{kind.suffixes[-1]}")
    write(model_of(KEPT["mass action"](), copies=3), path)
    assert "2 A -> B" in run(main, ["rules", "derive", path]).output
    done = run(main, ["rules", "derive", path, "--out", str(tmp_path / f"other{kind.suffixes[0]}")])
    assert "2 species and 2 channels are in" in done.output


@READS
def test_what_is_read_only_is_not_written_and_refused_by_name(kind, tmp_path):
    for suffix in kind.suffixes:
        path = tmp_path / f"model{suffix}"
        with pytest.raises(ValueError, match="must end in"):
            write(model_of(KEPT["mass action"]()), path)
        for damaged in (b"", b"\xff\xfe\x00", b"\x00" * 50, b"begin model\nA ->"):
            path.write_bytes(damaged)
            with pytest.raises((ValueError, ModuleNotFoundError)) as refused:
                read(path)
            assert isinstance(refused.value, ModuleNotFoundError) or str(path) in str(refused.value)
        with path.open("wb") as file:
            file.truncate(2**30)
        with pytest.raises(ValueError, match=f"{re.escape(str(path))} has {2**30} bytes; at most"):
            read(path)


def test_other_files_are_refused_with_all_suffixes(tmp_path):
    model = model_of(KEPT["mass action"]())
    for act, suffixes in ((lambda path: write(model, path), WRITTEN), (read, SUFFIXES)):
        with pytest.raises(ValueError, match=r"must end in " + ", ".join(map(re.escape, suffixes)) + "$"):
            act(tmp_path / "model.csv")
    with pytest.raises(ValueError, match=f"network file .*model{SUFFIXES[0]} does not exist"):
        read(tmp_path / f"model{SUFFIXES[0]}")


def test_a_model_has_rates_counts_and_observables_of_its_own_species():
    network = KEPT["mass action"]()
    with pytest.raises(ValueError, match="no rate constants yet"):
        write(Model(Network.from_reactions(PAIR), [1, 1]), f"model{WRITTEN[0]}")
    with pytest.raises(ValueError, match="state has shape"):
        Model(network, [1])
    with pytest.raises(ValueError, match="observable 'sum' counts 'C', which is not a species"):
        Model(network, [1, 1], {"sum": {"C": 1.0}})
