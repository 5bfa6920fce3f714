"""Files are proven before they take their names: writers that say something else are caught, and leave nothing."""

import re

import numpy as np
import pytest

from kinetics import Chain, Model, Reward
from kinetics.formats import FORMATS, read, write
from kinetics.markov import explicit_files, prism_text, write_explicit
from kinetics.markov.prism import writing
from kinetics.network import Network

WRITTEN = [kind for kind in FORMATS if kind.is_written]
# What the writers write -> what a faulty one would: in .net, SBML and .rxn.
FAULTS = {
    "count": (("1 A() 5", "1 A() 6"), ('initialAmount="5"', 'initialAmount="6"'), ("A = 5", "A = 6"), "species 'A'"),
    "rate": (("k1 0.25", "k1 0.26"), ("0.25", "0.26"), (", 0.25", ", 0.26"), "the propensity of channel 'bind'"),
    "reactants": (
        ("1 1,2 3", "1 1 3"),
        ('species="B"', 'species="A"'),
        ("A + B ->", "A ->"),
        "channel 'bind'|species 'B'",
    ),
    "observable": (("all 1,2*3", "all 1,3"), ("2 * C", "3 * C"), ("A + 2.0 * C", "A + C"), "observable 'all'"),
    "no observable": (
        ("1 all 1,2*3\n", ""),
        ("assignmentRule", "noRule"),
        ("observable: all", "#"),
        "observables|read",
    ),
    "text": (("begin species", "begin"), ("<listOfSpecies>", ""), ("species:", "sorts:"), "cannot be read back"),
}


def model():
    network = Network.from_reactions({"bind": ({"A": 1, "B": 1}, {"C": 1}), "part": ({"C": 1}, {"A": 1})}, [0.25, 1.75])
    return Model(network, [5, 4, 0], {"all": {"A": 1.0, "C": 2.0}})


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("kind", WRITTEN, ids=lambda kind: kind.name)
def test_a_faulty_writer_is_caught_and_leaves_nothing(kind, fault, tmp_path, monkeypatch):
    (*exchanged, named), right = FAULTS[fault], kind.text(model())
    old, new = dict(zip(("net", "sbml", "rxn"), exchanged, strict=True))[kind.name]
    if kind.name == "sbml" and fault in ("rate", "observable"):  # in MathML
        old, new = {"rate": ("0.25", "0.26"), "observable": ("<cn> 2 </cn>", "<cn> 3 </cn>")}[fault]
    assert old in right
    monkeypatch.setattr(type(kind), "text", lambda *_: right.replace(old, new))
    path = tmp_path / f"m{kind.suffixes[0]}"
    path.write_text("older", encoding="utf-8")
    with pytest.raises(ValueError, match=f"{re.escape(str(path))} is not written, because .*({named})") as refused:
        write(model(), path)
    assert path.read_text(encoding="utf-8") == "older"
    assert "rename" in str(refused.value)
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("kind", WRITTEN, ids=lambda kind: kind.name)
def test_a_sound_file_is_the_writers_text(kind, tmp_path):
    path = tmp_path / f"m{kind.suffixes[0]}"
    write(model(), path)
    assert path.read_text(encoding="utf-8") == kind.text(model())
    assert read(path).initial.tolist() == [5, 4, 0]


def chain():
    rates = np.array([[0, 1.0, 0.5], [2.0, 0, 0], [0, 0, 0]])
    rewards = {"gain": Reward([0.0, 1.5, 0.0], np.where(rates > 0, 0.5, 0.0)), "x": [1.0, 2.0, 3.0]}
    return Chain(rates, 1, {"up": [False, True, True]}, rewards, ("a",), [[4], [5], [6]])


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("m.tra", "1 0 2.0", "1 0 2.5", "its rates would differ"),
        ("m.tra", "3 3", "3 4", "it cannot be read back: m.tra"),
        ("m.lab", "1: 0 2", "1: 0", "its labels would differ"),
        ("m.sta", "1:(5)", "1:(4)", "its variables would differ"),
        ("m1.srew", "1 1.5", "1 1.25", "its reward 'gain' would differ"),
        ("m1.trew", "1 0 0.5", "1 0 0.25", "its reward 'gain' would differ"),
        ("m2.srew", "# Reward", "# Rewarding", None),
    ],
)
def test_a_faulty_writer_of_a_chain_is_caught(file, old, new, said, tmp_path, monkeypatch):
    checked = explicit_files._check_written

    def spoil(chain, target, contents):
        assert file in {path.name for path in contents}
        checked(chain, target, {p: t.replace(old, new) if p.name == file else t for p, t in contents.items()})

    monkeypatch.setattr(explicit_files, "_check_written", spoil)
    if said is None:  # the control: what says the same passes
        write_explicit(chain(), tmp_path / "m.tra")
        return
    with pytest.raises(ValueError, match=rf"m\.tra is not written, because .*{said}"):
        write_explicit(chain(), tmp_path / "m.tra")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "names",
    [lambda names: dict.fromkeys(names, "max"), lambda names: dict.fromkeys(names, "x y"),
     lambda names: dict.fromkeys(names, "same"), lambda names: {name: f"{name}\n" for name in names}],
)  # fmt: skip
def test_faulty_names_in_a_prism_model_are_caught(names, monkeypatch):
    assert prism_text(model(), np.array([9, 9, 9]))
    monkeypatch.setattr(writing, "prism_names", names)
    with pytest.raises(ValueError, match=r"the model would hold .*, which PRISM would misread"):
        prism_text(model(), np.array([9, 9, 9]))


def test_a_channels_name_cannot_leave_its_comment():
    network = Network.from_reactions({"a\nconst int x = 1; //": ({"A": 1}, {"B": 1})}, [1.0])
    text = prism_text(Model(network, [5, 0], {"none": {}}), np.array([5, 5]))
    assert "  // a const int x = 1; //\n" in text
    assert 'rewards "none"\n  true : 0;\nendrewards' in text
