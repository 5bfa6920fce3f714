"""The shipped books: their names by content, what they make, and each defect of the paper's tables."""

import random
from dataclasses import replace

import pytest

from kinetics.assembly import RuleBook, Semantics, derive, explore, placements

T5, T5_PRINTED = RuleBook.load("t5"), RuleBook.load("t5_as_printed")
PYRAMID = RuleBook.load("pyramid45")


def test_fingerprints_stay():
    """Stored mechanics runs are named by them."""
    assert RuleBook.load("line4").fingerprint == "a34d4fd77ece4ebfa2ec80e0a33ec5dce5fc9231c022f3c19f9a88db59edca0a"
    assert (
        RuleBook.load("line4_as_printed").fingerprint
        == "1dcfddfc5413ab927e679db7b3f243b9f68434a11a29a7a9c9d0a713f2523fd4"
    )


def without(book, dissociate=None, **combine):
    """The book with other conditions in some rules: P2={"neighbours": None}."""
    kinds = {"combine": combine, "dissociate": dissociate or {}}
    return replace(
        book,
        **{
            kind: tuple(rule.replace(**changes.get(rule.rule, {})) for rule in getattr(book, kind))
            for kind, changes in kinds.items()
        },
    )


LINE4 = RuleBook.load("line4")


def shapes(book, **caps):
    return {"".join(s.letters) for s in explore(book, **caps).structures}


LINES = {"a", "bb", "bcb", "bddb"}


def test_the_repaired_line_has_none_of_the_defects():
    assert shapes(LINE4) == LINES
    assert {"bdddb", "bddddb"} <= shapes(RuleBook.load("line4_as_printed"))  # L1 and L2, under the best reading


@pytest.mark.parametrize(
    ("book", "wrong"),
    [
        pytest.param(without(LINE4, P2={"neighbours": None}), {"bdddb", "bddddb"}, id="L1: P2 without its guard"),
        pytest.param(replace(LINE4, semantics=Semantics(gate="any")), {"bcbcb"}, id="L3: one rule is enough"),
        pytest.param(replace(LINE4, semantics=Semantics(update="sequential")), {"acb"}, id="L4: one after the other"),
        pytest.param(without(LINE4, dissociate={"P1'": {"letter": ("b",), "lost": ("b",), "neighbours": None}}),
                     {"b"}, id="L5: P1' as printed"),
    ],
)  # fmt: skip
def test_each_defect_of_table_one_shows(book, wrong):
    assert wrong <= shapes(book, max_cubes=6) - LINES


def test_p3_without_its_guard_contradicts_p4():
    """Defect L2: refused; and read in the printed order, lines grow without end."""
    with pytest.raises(ValueError, match="rules P3 and P4 contradict each other"):
        without(LINE4, P3={"neighbours": None})
    first = replace(LINE4, semantics=Semantics(conflict="first"))
    assert {"bccb", "bcccb", "bccccb"} <= shapes(without(first, P3={"neighbours": None}), max_cubes=6)


def test_the_sentence_on_finished_cubes_is_not_needed():
    """Defect L6 is one of the printed table alone: without the sentence it grows without end."""
    printed = RuleBook.load("line4_as_printed")
    lit = replace(printed, semantics=printed.semantics.replace(finished=()))
    assert explore(lit, max_cubes=6).beyond is not None
    assert LINE4.semantics.finished == ()


def test_internal_rules_have_to_rest_before_the_next_event():
    """Defect L7: the table names no event for P5 and P5'. A collision that comes first finds the end of a trimer."""
    hasty = {"".join(s.letters) for s in explore(LINE4, slow_waves=True).structures}
    assert "bdcdb" in hasty


def test_the_neighbour_is_the_one_that_stays():
    """L8: read with the partner among the neighbours, no guard of Table I could ever hold."""
    own = {name: {"neighbours": ("b", partner)} for name, partner in (("P2", "b"), ("P3", "a"))}
    assert shapes(without(LINE4, **own)) == {"a", "bb"}


def test_a_free_cube_meets_free_cubes_and_ends():
    """L10: with `a` alone among P1's partners, 1+2 and 1+3 have no rule."""
    made = derive(without(LINE4, P1={"partner": ("a",)}))
    assert [c for c in made.network.channels if "+" in c.split("->")[0]] == ["1+1->2", "2+2->4"]


def test_t5_is_nine_species_and_25_reactions():
    made = derive(T5)
    structures = list(made.structures.values())
    assert [len(s) for s in structures] == [1, 2, 2, 3, 3, 3, 4, 4, 5]
    joins = made.network.stoichiometry.sum(axis=1) < 0
    assert (joins.sum(), (~joins).sum()) == (10, 15)
    assert structures[-1] == T5.target.canonical("two")
    ways = dict(zip(made.network.channels, made.network.ways.tolist(), strict=True))
    assert list(ways.values())[:10] == [4, 2, 4, 2, 4, 2, 32, 2, 2, 8]
    assert ways["1+1->dimer.a"] == 4
    assert ways["dimer.a+dimer.a->quadmer.b"] == 32  # a standing dimer's end on any side of either cube
    assert ways["dimer.a+trimer.a->5"] == 8
    assert ways["1+quadmer.b->5"] == 2


def test_printed_table_two_never_makes_the_t():
    """Defect T1: no rule for the fifth cube; T4: nothing happens when a bond breaks."""
    made = derive(replace(T5_PRINTED, target=None), max_cubes=8)
    joined = [s for s in made.structures.values() if len(s) > 1]
    assert max(map(len, joined)) == 4
    assert T5.target.canonical("two") not in made.structures.values()
    fragments = [s for s in made.structures.values() if len(s) == 1]
    assert {s.letters[0] for s in fragments} > {"a"}  # lone cubes that still believe in their partners


def test_printed_table_two_with_one_rule_enough():
    """Defect T1 with the other gate: the T forms, and goes on."""
    with pytest.raises(ValueError, match="not closed under max_cubes = 5"):
        derive(replace(T5_PRINTED, semantics=Semantics(gate="any", finished=T5_PRINTED.semantics.finished)), 5)


def test_table_two_grows_on_without_dark_leds_and_guards():
    """Defect T2: the sentence in the text, or the guards, are essential."""
    fifth = {"P1": {"partner": ("a", "d")}}
    lit = without(replace(T5_PRINTED, semantics=Semantics()), **fifth)
    with pytest.raises(ValueError, match="not closed under max_cubes = 5"):
        derive(lit, max_cubes=5)
    dark = derive(replace(without(T5_PRINTED, **fifth), target=None), max_cubes=8)
    assert T5.target.canonical("two") in dark.structures.values()


def test_a_t_without_dissociation_rules_leaves_cubes_that_are_not_free():
    """Defect T4."""
    assert {s.letters for s in explore(replace(T5, dissociate=())).structures if len(s) == 1} > {("a",)}
    assert {s.letters for s in explore(T5).structures if len(s) == 1} == {("a",)}
    held = T5_PRINTED.semantics.replace(bonds="hold")
    assert shapes(replace(T5_PRINTED, semantics=held)) == {"a", "bb", "bddb"}  # T1 alone


@pytest.mark.parametrize("rule", ["P2", "P3"])
def test_each_guard_of_the_t_is_needed(rule):
    with pytest.raises(ValueError, match="not closed"):
        derive(without(T5, **{rule: {"neighbours": None}}), max_cubes=8)


def grow(book, rng, most):
    """A seed that takes free cubes at random places until none fits."""
    structure, free = book.seed(), book.monomer()
    faces = [(face, book.view(free, 0, face)) for face in range(6)]
    while len(structure) < most:
        sites = [
            (cube, face, other, twist)
            for cube, face in structure.open_faces()
            for other, view in faces
            if book.allows(book.view(structure, cube, face), view)
            for twist in range(4)
        ]
        rng.shuffle(sites)
        for cube, face, other, twist in sites:
            grown = book.join(structure, cube, free, 0, placements(structure, cube, face, free, 0, other)[twist])
            if grown is not None:
                structure = grown
                break
        else:
            break
    return structure


def test_pyramid_grows_to_its_45_cubes_and_no_further():
    target = PYRAMID.target.canonical("two")
    assert len(target) == 45
    for run in range(8):
        assert grow(PYRAMID, random.Random(run), 50).canonical("two") == target


def test_pyramid_needs_its_senses():
    """The control: without the check of the twist, or of the cubes touched, growth goes wrong."""
    for sense in ("roll", "touched"):
        rules = tuple(rule.replace(**{sense: None}) for rule in PYRAMID.combine)
        blind = replace(
            PYRAMID, combine=rules, senses=PYRAMID.senses.replace(**{sense: False}),
            semantics=Semantics(conflict="first"),
        )  # fmt: skip
        grown = grow(blind, random.Random(1), 50)
        assert grown.canonical("two") != PYRAMID.target.canonical("two")


@pytest.mark.validate
def test_five_hundred_pyramids():
    target = PYRAMID.target.canonical("two")
    assert all(grow(PYRAMID, random.Random(run), 50).canonical("two") == target for run in range(500))
