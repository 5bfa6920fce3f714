"""Rule books: what the repaired book does, how the semantics differ, and which files are refused."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinetics.assembly import LivelockError, RuleBook, Semantics, Senses, Structure, View, placements
from kinetics.assembly.rules.conditions import Combination, Dissociation, Internal
from kinetics.assembly.rules.rule_book import BOOKS

LINE4 = RuleBook.load("line4")
TEXT = (BOOKS / "line4.toml").read_text()


def line(letters):
    """Cubes end to end along their own z."""
    n = len(letters)
    return Structure(tuple((0, 0, z) for z in range(n)), (0,) * n, tuple(letters))


def joined(book, a, b):
    """Letters after the top of line a docks on the bottom of line b; None where refused."""
    a, b = line(a), line(b)
    outcomes = {book.join(a, len(a) - 1, b, 0, p) for p in placements(a, len(a) - 1, 4, b, 0, 5)}
    assert len({structure and structure.letters for structure in outcomes}) == 1  # the twist does not matter
    structure = outcomes.pop()
    return structure and "".join(structure.letters)


def broken(book, letters, bond):
    return tuple("".join(part.letters) for _, part in book.break_bond(line(letters), *bond))


def test_line4_joins():
    assert joined(LINE4, "a", "a") == "bb"
    assert joined(LINE4, "bb", "a") == "bcb"
    assert joined(LINE4, "a", "bcb") == "bddb"
    assert joined(LINE4, "bb", "bb") == "bddb"


def test_line4_refuses_more():
    lines = ("a", "bb", "bcb", "bddb")
    refused = [(a, b) for a in lines for b in lines if len(a) + len(b) > 4]
    assert all(joined(LINE4, a, b) is None for a, b in refused)


def test_line4_breaks():
    assert broken(LINE4, "bb", (0, 1)) == ("a", "a")
    assert broken(LINE4, "bcb", (1, 2)) == ("bb", "a")
    assert broken(LINE4, "bddb", (1, 2)) == ("bb", "bb")
    assert broken(LINE4, "bddb", (0, 1)) == ("a", "bcb")


def test_break_tells_the_members_and_leaves_the_places():
    (low, free), (high, rest) = LINE4.break_bond(line("bddb"), 1, 0)[::-1]
    assert (low, high) == ((0,), (1, 2, 3))
    assert free.positions == ((0, 0, 0),)
    assert rest.positions == ((0, 0, 1), (0, 0, 2), (0, 0, 3))


def test_side_faces_and_covered_faces():
    free, dimer = LINE4.monomer(), line("bb")
    assert LINE4.view(free, 0, 4) == LINE4.view(free, 0, 5) == View("a", "f1", ())
    assert LINE4.view(free, 0, 0) == View("a", "f2", ())
    assert LINE4.view(dimer, 0, 4) is None
    assert LINE4.view(dimer, 0, 5) == View("b", "f1", ("b",))
    assert LINE4.allows(LINE4.view(free, 0, 4), LINE4.view(dimer, 0, 5))
    assert not LINE4.allows(LINE4.view(free, 0, 0), LINE4.view(dimer, 0, 5))
    assert not LINE4.allows(None, LINE4.view(free, 0, 4))
    assert LINE4.join(free, 0, dimer, 0, placements(free, 0, 0, dimer, 0, 5)[0]) is None


def test_a_join_needs_the_two_cubes_side_by_side():
    free = LINE4.monomer()
    placement = placements(free, 0, 4, free, 0, 5)[0]
    with pytest.raises(ValueError, match="is not beside cube 0"):
        LINE4.join(free, 0, line("bb"), 1, placement)


def sticky(**changes):
    """A book in which everything sticks, and stays a."""
    rule = Combination(rule="stick", becomes="a")
    return RuleBook(
        **{"name": "sticky", "letters": ("a",), "initial": "a", "senses": Senses(faces="one"), "combine": (rule,)}
        | changes
    )


def test_overlap_is_refused_and_loops_do_not_break():
    book = sticky()
    corner = Structure(((0, 0, 0), (1, 0, 0), (1, 1, 0)), (0, 0, 0), ("a", "a", "a"))
    free = book.monomer()
    square = book.join(corner, 0, free, 0, placements(corner, 0, 2, free, 0, 3)[0])
    assert square is not None
    assert len(square.bonds) == 4
    with pytest.raises(ValueError, match="lies in a loop"):
        book.break_bond(square, 0, 1)
    with pytest.raises(ValueError, match="do not touch"):
        book.break_bond(square, 0, 2)
    assert any(
        book.join(corner, 0, corner, 2, placement) is None for placement in placements(corner, 0, 2, corner, 2, 0)
    )


def test_gate_any_lets_one_rule_be_enough():
    one_sided = Combination(rule="P", letter="a", partner="b", becomes="b")
    book = sticky(letters=("a", "b"), combine=(one_sided,))
    assert joined(book, "a", "b") is None
    assert joined(replace(book, semantics=Semantics(gate="any")), "a", "b") == "bb"


def test_update_order():
    copy = [Combination(rule=f"copy {x}", letter=y, partner=x, becomes=x) for x, y in ("ab", "ba")]
    book = sticky(letters=("a", "b"), combine=tuple(copy))
    assert joined(book, "a", "b") == "ba"
    # the second cube reads what the first has become: b beside b has no rule
    assert joined(replace(book, semantics=Semantics(update="sequential")), "a", "b") == "bb"
    lose = [Dissociation(rule=f"lose {x}", letter=y, lost=x, becomes=x) for x, y in ("ab", "ba")]
    book = replace(book, dissociate=tuple(lose))
    assert broken(book, "ab", (0, 1)) == ("b", "a")
    assert broken(replace(book, semantics=Semantics(update="sequential")), "ab", (0, 1)) == ("b", "b")


def test_conflicts():
    wide = Combination(rule="wide", letter="a", becomes="b")
    narrow = Combination(rule="narrow", letter="a", neighbours=[], becomes="c")
    fields = {"letters": ("a", "b", "c"), "combine": (wide, narrow)}
    with pytest.raises(ValueError, match="rules wide and narrow contradict each other"):
        sticky(**fields)
    assert joined(sticky(**fields, semantics=Semantics(conflict="first")), "a", "a") == "bb"
    assert joined(sticky(**fields, semantics=Semantics(conflict="most-specific")), "a", "a") == "cc"
    crossing = Combination(rule="crossing", letter=["a", "b"], neighbours=[], becomes="c")
    with pytest.raises(ValueError, match="most-specific needs one rule to fit only where the other does"):
        sticky(letters=("a", "b", "c"), combine=(wide, crossing), semantics=Semantics(conflict="most-specific"))


def test_finished_cubes_accept_no_more():
    rules = Combination(rule="grow", letter="a", becomes="a")
    dark = Semantics(finished=({"letter": "a", "neighbour": "b"},))
    assert joined(sticky(letters=("a", "b"), combine=(rules,)), "ba", "a") == "baa"
    assert joined(sticky(letters=("a", "b"), combine=(rules,), semantics=dark), "ba", "a") is None


def test_internal_rules_run_as_a_wave():
    spread = Internal(rule="spread", letter="a", neighbours=["a", "b"], becomes="b")
    book = sticky(letters=("a", "b"), internal=(spread,))
    assert "".join(book.settle(line("baaaa")).letters) == "bbbba"


def test_internal_rules_that_never_rest_are_named():
    flip = [Internal(rule=f"flip {x}", letter=x, neighbours=x, becomes=y) for x, y in ("ab", "ba")]
    book = sticky(letters=("a", "b"), internal=tuple(flip))
    with pytest.raises(LivelockError, match="never come to rest"):
        joined(book, "a", "a")


def test_fingerprint_follows_the_content(tmp_path):
    copy = tmp_path / "mine.toml"
    copy.write_text("# my copy\n" + TEXT)
    assert RuleBook.load(copy).fingerprint == LINE4.fingerprint
    assert RuleBook.load(copy).name == "mine"
    copy.write_text(TEXT.replace('gate = "mutual"', 'gate = "any"'))
    assert RuleBook.load(copy).fingerprint != LINE4.fingerprint


def test_target_is_the_finished_line():
    assert LINE4.target is not None
    assert LINE4.target.letters == tuple("bddb")
    assert LINE4.settle(LINE4.target) is LINE4.target


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9), st.booleans()), max_size=12))
def test_any_history_keeps_the_cubes_and_the_alphabet(moves):
    pool = [LINE4.monomer()] * 6
    for first, second, joins in moves:
        a = pool.pop(first % len(pool))
        if joins and pool:
            b = pool.pop(second % len(pool))
            pairs = [(fa, fb) for fa in a.open_faces() for fb in b.open_faces()]
            (i, face_i), (j, face_j) = pairs[second % len(pairs)] if second % 2 else (pairs[0][0], pairs[-1][1])
            whole = LINE4.join(a, i, b, j, placements(a, i, face_i, b, j, face_j)[first % 4])
            pool += [a, b] if whole is None else [whole]
        elif a.bonds:
            parts = LINE4.break_bond(a, *a.bonds[second % len(a.bonds)])
            assert sorted(cube for members, _ in parts for cube in members) == list(range(len(a)))
            pool += [part for _, part in parts]
        else:
            pool.append(a)
        assert sum(map(len, pool)) == 6
        for structure in pool:
            assert set(structure.letters) <= set(LINE4.letters)
            assert len(structure) > 1 or structure.letters == ("a",)


def changed(old, new):
    assert old in TEXT
    return TEXT.replace(old, new, 1)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (changed('initial = "a"', ""), "'initial' is missing"),
        (changed('initial = "a"', 'initial = "a"\nseed = "e"'), "seed: unknown letter 'e'"),
        (changed('initial = "a"', 'initial = "a"\nseed = "a"'), "seed: 'a' is the letter of every free cube"),
        (changed('"synchronous"', '"synchronous"\nbonds = "melt"'), "'break' or 'hold'"),
        (changed("neighbours = []", 'has = "x"'), "rule P1, has: unknown letter 'x'"),
        (changed('initial = "a"', 'initial = "e"'), "initial: unknown letter 'e'; the book's letters are a, b, c, d"),
        (changed('partner = ["a", "b"]', 'partner = ["a", "x"]'), "rule P1, partner: unknown letter 'x'"),
        (
            changed('face = "f1"', 'face = "f7"'),
            "rule P1, face: unknown face 'f7'; the faces of scheme 'two' are f1, f2",
        ),
        (changed('becomes = "b"', 'becomes = "B"'), "rule P1, becomes: unknown letter 'B'"),
        (changed('becomes = "b"', 'becomes = "b"\npartners = "b"'), r"unknown key 'combine.0.partners'"),
        (changed("[semantics]", "[semantic]"), "unknown key 'semantic'"),
        (changed('"mutual"', '"both"'), "'mutual' or 'any'"),
        (changed('faces = "two"', 'faces = "three"'), "unknown face scheme 'three'"),
        (changed('rule = "P2"', 'rule = "P1"'), "two rules are called 'P1'"),
        (changed('neighbours = ["c"]', 'neighbours = ["b"]'), "rules P3 and P4 contradict each other"),
        (changed('letters = ["a", "b", "c", "d"]', 'letters = ["a", "a"]'), "each named once"),
        (changed('letters = ["a", "b", "c", "d"]', "letters = []"), "each named once"),
        (changed('partner = ["a", "b"]', "partner = []"), "combine.0.partner"),
        (changed("[0, 0, 1]", "[0, 0, 7]"), "do not all hang together"),
        (changed("[0, 0, 1]", "[0, 0, 0]"), "overlap"),
        (changed("[0, 0, 1]", "[0, 0, nan]"), "target.cubes.1.2"),
        (changed("[0, 0, 1], ", ""), "3 positions, 3 rotations, 4 letters"),
        ("letters = [", "not valid TOML"),
        (".".join("a" * 32_000) + " = 1", "may have at most"),
    ],
)
def test_mistakes_in_a_book_are_explained(tmp_path, text, message):
    path = tmp_path / "book.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        RuleBook.load(path)
    assert str(path) in str(caught.value)


def test_unknown_books_are_named_with_the_shipped_ones():
    with pytest.raises(ValueError, match="unknown rule book 'line5'; shipped are jack13, line4, line4_as_printed"):
        RuleBook.load("line5")
