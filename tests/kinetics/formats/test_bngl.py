"""BNGL files: what is handed to BioNetGen, and, where it is installed, the network that comes back."""

import importlib.util
import os
import shutil

import numpy as np
import pytest
from numpy.testing import assert_allclose

from kinetics.formats import read
from kinetics.formats.bngl import model_blocks

MODEL = """begin model
begin parameters
 kp 0.01  # per second
 km 0.1
 A0 100
end parameters
begin molecule types
 A(b,s~u~p)
 B(a)
end molecule types
begin seed species
 A(b,s~u) A0
 B(a) 80
end seed species
begin observables
 Molecules AB A(b!1).B(a!1)
end observables
begin reaction rules
 bind: A(b) + B(a) <-> A(b!1).B(a!1) kp, km
 phos: A(b!+,s~u) -> A(b!+,s~p) 0.02
end reaction rules
end model
"""
# Stands for BioNetGen: says what it was given, and makes a network.
STAND_IN = """
open(my $in, '<', 'model.bngl'); my $text = join('', <$in>); close $in;
die "ABORT: $text" if $text =~ /refuse/;
open(my $out, '>', 'model.net');
print $out "begin parameters\\n 1 k 0.5\\nend parameters\\n";
print $out "begin species\\n 1 A() 7\\n 2 B() 0\\nend species\\nbegin reactions\\n 1 1 2 k\\nend reactions\\n";
"""

has_perl = pytest.mark.skipif(shutil.which("perl") is None, reason="there is no perl")
has_bionetgen = pytest.mark.skipif(
    "BNGPATH" not in os.environ and importlib.util.find_spec("bionetgen") is None, reason="BioNetGen is not installed"
)


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "model.bngl"
    file.write_text(MODEL, encoding="utf-8")
    return file


@pytest.fixture
def stand_in(tmp_path, monkeypatch):
    (tmp_path / "BNG2.pl").write_text(STAND_IN, encoding="utf-8")
    monkeypatch.setenv("BNGPATH", str(tmp_path))


def test_blocks_are_kept_and_actions_are_not(path):
    assert model_blocks(path, MODEL) == (MODEL.splitlines()[1:-1], False)
    acting = MODEL + 'generate_network()\nbegin actions\nsystem("x")\nend actions\n'
    assert model_blocks(path, acting) == (MODEL.splitlines()[1:-1], True)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("begin parameters", "begin parameter", "line 2: unknown block 'parameter'"),
        ("end parameters", "", "line 7: 'begin molecule types'; expected 'end parameters'"),
        ("begin parameters", "", "line 6: 'end parameters'; expected 'begin parameters'"),
        ("end reaction rules\n", "", "block 'reaction rules' has no end"),
        ("km 0.1", "km tfun('secret', 't')", "line 4: a function from a file"),
        (MODEL, "# nothing\n", "no block of a model"),
    ],
)
def test_damage_is_told_by_line(path, old, new, said):
    with pytest.raises(ValueError, match=said):
        model_blocks(path, MODEL.replace(old, new))


@has_perl
def test_the_network_that_comes_back_is_read(path, stand_in):
    assert read(path).notes == ()
    path.write_text(MODEL + 'simulate({method=>"ssa"})\n', encoding="utf-8")
    model = read(path)
    assert model.initial.tolist() == [7, 0]
    assert "actions of the file are not carried out" in model.notes[-1]
    path.write_text(MODEL.replace("AB", "refuse"), encoding="utf-8")
    with pytest.raises(ValueError, match=r"model\.bngl: BioNetGen refused it: .*refuse"):
        read(path)


@has_perl
def test_without_bionetgen_it_says_what_to_do(path, monkeypatch, tmp_path):
    monkeypatch.setenv("BNGPATH", str(tmp_path))
    with pytest.raises(ValueError, match=r"there is no BNG2\.pl"):
        read(path)
    monkeypatch.delenv("BNGPATH")
    monkeypatch.setattr("kinetics.support.extras.find_spec", lambda name: None)
    with pytest.raises(ModuleNotFoundError, match="bionetgen"):
        read(path)
    monkeypatch.setattr("kinetics.formats.bngl._program", lambda: tmp_path)
    monkeypatch.setattr("shutil.which", lambda name: None)
    with pytest.raises(ValueError, match="no perl here"):
        read(path)


@has_bionetgen
def test_the_network_of_rules(path):
    """By hand: A binds and lets go in both states, and changes state only while bound."""
    model = read(path)
    n = model.network
    assert len(n.species) == 5
    assert len(n.channels) == 5
    free, other = n.index("A(b,s~u)"), n.index("B(a)")
    state = np.zeros(5, dtype=int)
    state[[free, other]] = 3, 4
    assert_allclose(n.propensities(state).sum(), 0.01 * 3 * 4)
    assert model.initial[[free, other]].tolist() == [100, 80]
    assert sorted(model.observables["AB"]) == ["A(b!1,s~p).B(a!1)", "A(b!1,s~u).B(a!1)"]
