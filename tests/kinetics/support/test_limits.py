"""Limits of files: what is beyond them is refused by its size, before it is read."""

import pytest

from kinetics.formats import blocks, read, sbmlfile
from kinetics.markov.explicit_files import read_explicit
from kinetics.markov.questions import parse
from kinetics.support import limits

NET = """begin species
1 A() 1
2 B() 0
end species
begin reactions
1 1 2 0.5
2 2 1 0.5
end reactions
"""


@pytest.mark.parametrize(
    ("suffix", "size"), [(".net", limits.TEXT_BYTES), (".xml", limits.XML_BYTES), (".tra", limits.TEXT_BYTES)]
)
def test_large_files_are_refused_unread(suffix, size, tmp_path):
    path = tmp_path / f"large{suffix}"
    with path.open("wb") as file:
        file.truncate(size + 1)  # a hole, which takes no space
    with pytest.raises(ValueError, match=f"large{suffix} has {size + 1} bytes; at most {size} are read"):
        (read_explicit if suffix == ".tra" else read)(path)


@pytest.mark.parametrize(("name", "what"), [("MOST_SPECIES", "species"), ("MOST_REACTIONS", "reactions")])
def test_counts_in_a_net_file(name, what, tmp_path, monkeypatch):
    path = tmp_path / "two.net"
    path.write_text(NET, encoding="utf-8")
    monkeypatch.setattr(blocks, name, 2)
    assert len(read(path).network.species) == 2
    monkeypatch.setattr(blocks, name, 1)
    with pytest.raises(ValueError, match=f"two.net has 2 {what}; at most 1 are read"):
        read(path)


@pytest.mark.parametrize(("name", "what"), [("MOST_SPECIES", "species"), ("MOST_REACTIONS", "reactions")])
def test_counts_in_an_sbml_file(name, what, tmp_path, monkeypatch):
    pytest.importorskip("libsbml")
    from kinetics.formats import write

    (tmp_path / "two.net").write_text(NET, encoding="utf-8")
    write(read(tmp_path / "two.net"), tmp_path / "two.xml")
    monkeypatch.setattr(sbmlfile, name, 1)
    with pytest.raises(ValueError, match=f"two.xml has 2 {what}; at most 1 are read"):
        read(tmp_path / "two.xml")


def test_names(tmp_path, monkeypatch):
    path = tmp_path / "long.net"
    path.write_text(NET.replace("B()", "B" * 50 + "()"), encoding="utf-8")
    monkeypatch.setattr(limits, "LONGEST_NAME", 52)
    assert len(read(path).network.species) == 2
    monkeypatch.setattr(limits, "LONGEST_NAME", 51)
    with pytest.raises(ValueError, match=r"a name of 52 characters, 'B+'\.\.\.; at most 51 are read"):
        read(path)


def test_a_chain_that_claims_many_states(tmp_path):
    (tmp_path / "many.tra").write_text("1000000000000 1\n0 1 0.5\n", encoding="utf-8")
    with pytest.raises(ValueError, match="1000000000000 states, but 1 transitions"):
        read_explicit(tmp_path / "many.tra")


def test_long_questions():
    with pytest.raises(ValueError, match="a question of 200007 characters; at most 100000 are read"):
        parse(f"P=? [ {' ' * 200_000}]"[:200_007])
