"""The checker: shipped books pass, and each fault that can be made is found, with the shortest way to it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from kinetics.assembly import LivelockError, RuleBook, Semantics, Senses, Structure, check, derive
from kinetics.assembly.checking.checker import SLOW
from kinetics.assembly.rules.conditions import Combination, Dissociation, Internal
from tests.helpers.planted_faults import squeezed
from tests.helpers.tree_books import tree_book
from wellmixed import main

LINE4, T5 = RuleBook.load("line4"), RuleBook.load("t5")
HOLD = Semantics(bonds="hold")


def kinds(report):
    return [finding.kind for finding in report.findings]


def only(report, kind):
    (finding,) = (f for f in report.findings if f.kind == kind)
    return finding


def test_shipped_books_are_correct():
    assert kinds(check(T5)) == []
    report = check(LINE4, slow_waves=False)
    assert report.is_correct
    assert kinds(report) == []
    assert str(report) == (
        "book 'line4': 4 structures, 8 joins and breaks; 0 errors, 0 warnings\n"
        "recoverability: proven for any number of cubes: every other structure can fall apart into free cubes, which "
        "make the target\n"
        "delayed state updates: left out"
    )


def test_slow_waves_spoil_the_line():
    """A quadmer whose middle has not yet followed offers the end of a trimer: a line of five."""
    report = check(LINE4)
    assert report.is_correct  # a warning: it takes waves slower than collisions
    finding = only(report, "delayed state updates: off-target")
    assert finding.structure.letters == tuple("bdcdb")
    assert len(finding.steps) == 4


def test_printed_line_goes_off_target_and_gets_caught():
    report = check(RuleBook.load("line4_as_printed"))
    assert not report.is_correct
    off = only(report, "off-target")
    assert len(off.structure) == 5
    assert [step.split(":")[0] for step in off.steps] == [
        "monomer.a + monomer.a -> dimer.a",
        "monomer.a + dimer.a -> trimer.a",
        "dimer.a + trimer.a -> pentamer.a",
    ]
    assert "b   d   d   d   b" in str(off)
    assert {"dead end", "trap"} <= set(kinds(report))  # L5: lone cubes that are not free


def test_growth_without_end_is_not_closed():
    book = replace(LINE4, semantics=Semantics(gate="any"))
    finding = only(check(book, max_cubes=6), "not closed")
    assert len(finding.structure) == 7
    assert "beyond 6 cubes" in finding.text
    assert finding.is_error
    assert only(check(book, max_cubes=6, max_species=5), "not proven").is_error


def test_printed_t_is_never_reached():
    report = check(RuleBook.load("t5_as_printed"))
    assert {"target not reached", "unreachable rule", "unused letter"} == set(kinds(report))
    assert "rule P4" in only(report, "unreachable rule").text


def test_a_t_with_its_fifth_cube_but_without_guards_makes_all_but_the_t():
    """Defect T2."""
    printed = RuleBook.load("t5_as_printed")
    fifth = tuple(r.replace(partner=("a", "d")) if r.rule == "P1" else r for r in printed.combine)
    report = check(replace(printed, combine=fifth, semantics=HOLD), max_cubes=8)
    assert only(report, "off-target").text.startswith("95 of 99 structures are no part of the target")
    assert {"not closed", "off-target", "target not final"} == set(kinds(report))


def test_a_t_without_breaks_starves():
    """Defect T3: six cubes pair up to an L and a dimer, which wait for a free cube for ever."""
    report = check(replace(T5, semantics=HOLD))
    finding = only(report, "starvation")
    assert "6 cubes can end as dimer + quadmer, where nothing happens any more: 0 targets instead of 1" in finding.text
    assert len(finding.steps) == 4


def book(letters, combine, internal=(), target=None, **changes):
    line = target and Structure(tuple((0, 0, z) for z in range(len(target))), (0,) * len(target), tuple(target))
    fields = {"senses": Senses(faces="two"), "semantics": HOLD} | changes
    return RuleBook(
        "made up", tuple(letters), letters[0], target=line, combine=tuple(combine), internal=tuple(internal), **fields
    )


def pair(letter, partner, becomes, face="f1"):
    name = f"{letter}{partner}{face}"
    return Combination(
        rule=name, letter=letter, partner=partner, face=face, partner_face=face, neighbours=[], becomes=becomes
    )


def test_dead_end_and_trap():
    rules = [pair("a", "a", "b"), pair("a", "a", "b", "f2")]
    finding = only(check(book("ab", rules, target="bb")), "dead end")
    assert finding.steps[0].startswith("monomer + monomer -> dimer")
    assert finding.structure.canonical("two") != book("ab", rules, target="bb").target.canonical("two")


def test_target_with_other_letters_and_target_that_grows():
    finding = only(check(book("ab", [pair("a", "a", "b")], target="aa")), "target not reached")
    assert "made with other letters" in finding.text
    more = Combination(rule="more", letter="b", partner="a", face="f1", partner_face="f1", becomes="b")
    short = only(check(book("ab", [pair("a", "a", "b")], target="bbb")), "target not reached")
    assert short.text == "no structure has the target's shape"  # the pair, a part of it, has not
    joined = [pair("a", ["a", "b"], "b"), more]
    report = check(book("ab", joined, target="bb"), max_cubes=5)
    assert {"not closed", "off-target", "target not final"} <= set(kinds(report))


def test_livelock_is_named():
    flip = [Internal(rule=f"flip {x}", letter=x, has=x, becomes=y) for x, y in ("bc", "cb")]
    finding = only(check(book("abc", [pair("a", "a", "b")], flip)), "livelock")
    assert "never come to rest" in finding.text
    joins = [
        Combination(rule=f"{one} {other}", letter=one, partner=list(other), face="f2", partner_face="f2", becomes="b")
        for one, other in (("a", "g"), ("g", "ag"))
    ]
    twice = check(
        book("abcg", [pair("a", "a", "g"), *joins], flip)
    )  # a pair restless with a free cube, or another pair
    assert only(twice, "livelock").text.endswith("(2 such events)")


def test_a_cube_that_never_rests_is_a_finding():
    flip = [Internal(rule=f"flip {x}", letter=x, becomes=y) for x, y in ("ab", "ba")]
    restless = book("ab", [pair("a", "a", "b")], flip, target="bb")
    report = check(restless)
    assert kinds(report) == ["livelock"]
    assert report.findings[0].text.startswith("a cube by itself: ")
    with pytest.raises(LivelockError):
        derive(restless)


def test_a_seed_that_becomes_a_free_cube_at_once_is_none():
    settling = [Internal(rule="settle", letter="s", becomes="a")]
    made = book("asb", [pair("a", "a", "b")], settling, target="bb", seed_letter="s", semantics=Semantics())
    free = Dissociation(rule="free", neighbours=[], becomes="a")
    report = check(replace(made, dissociate=(free,)))
    assert report.is_correct
    assert report.recoverability.proven == "any tank"


def test_what_is_left_out_may_still_make_the_target():
    """Pairs part into c and c, which make the target; with a cap before that, nothing is said about it."""
    made = replace(book("abc", [pair("a", "a", "c"), pair("c", "c", "b")], target="bb"), semantics=Semantics())
    assert only(check(replace(made, combine=made.combine[:1])), "target not reached").is_error
    assert kinds(check(made, max_species=2)) == ["not proven"]
    assert "target not reached" not in kinds(check(made))


def test_slow_waves_may_starve():
    """A pair that breaks while one cube has followed and the other has not leaves a cube that waits for its like."""
    waiting = [
        Dissociation(rule="wait", letter="p", neighbours=[], becomes="z"),
        Dissociation(rule="back", letter="b", becomes="a"),
    ]
    follow = [Internal(rule="follow", letter="p", becomes="b")]
    made = book("abpz", [pair("a", "a", "p"), pair("z", "z", "p")], follow, target="bb", semantics=Semantics())
    report = check(replace(made, dissociate=tuple(waiting)))
    finding = only(report, SLOW + "starvation")
    assert not finding.is_error
    assert finding.steps[-1].startswith("dimer")
    assert "2 cubes can end as" in finding.text
    assert report.recoverability.proven == "any tank"  # while waves come to rest at once
    assert "starvation" not in kinds(report)


def test_slow_waves_are_followed_to_twice_what_is_at_rest():
    """A pair whose cubes have not yet followed takes free cubes on and on."""
    follow = [Internal(rule="follow", letter="b", has="b", becomes="c")]
    end = Combination(rule="end", letter="b", partner="a", face="f1", partner_face="f1", becomes="b")
    made = book("abc", [pair("a", ["a", "b"], "b"), end], follow, target="cc")
    report = check(made)
    assert report.is_correct
    finding = only(report, SLOW + "not closed")
    assert finding.text.startswith("structures grow beyond 4 cubes")
    assert len(finding.structure) == 5
    assert "beyond 3 cubes" in only(check(made, max_cubes=3), SLOW + "not closed").text


def test_slow_waves_may_squeeze():
    """The place between two cubes is offered only while its host has not yet followed."""
    sound = tree_book(0, 5, bonds="hold", seeded=True, has_gap=True)
    faulty = squeezed(sound, np.random.default_rng(0))
    host = faulty.combine[0].partner[0]
    late = tuple(
        rule.replace(**{"partner": ("y",)} if n == 0 else {"letter": ("y",)} if n == 1 else {"becomes": "y"}
            if rule.becomes == host else {}
        )
        for n, rule in enumerate(faulty.combine)
    )  # fmt: skip
    report = check(replace(faulty, combine=late, internal=(Internal(rule="follow", letter="y", becomes=host),)))
    assert "squeezed" not in kinds(report)
    assert not only(report, SLOW + "squeezed").is_error


def test_a_cube_squeezed_between_two_is_seen():
    """A U of five takes a cube into its mouth."""
    rules = [
        Combination(rule="grow", letter="a", face="f2", partner=["a", "s"], partner_face="f2", roll="parallel",
                    neighbours=[], touched=["s"], becomes="s"),
        Combination(rule="gap", letter="a", face="f2", partner="s", partner_face="f2", roll="parallel",
                    neighbours=[], touched=["s", "s", "s"], becomes="s"),
        Combination(rule="host", letter="s", face="f2", partner="a", becomes="s"),
    ]  # fmt: skip
    made = book("as", rules, senses=Senses(faces="two", roll=True, touched=True), seed_letter="s")
    finding = only(check(made, max_cubes=6), "squeezed")
    assert not finding.is_error
    assert len(finding.structure) == 6


def test_command():
    ran = CliRunner().invoke(main, ["rules", "check", "t5", "--json"])
    assert ran.exit_code == 0
    said = json.loads(ran.output)
    home = said.pop("recoverability")
    assert said.pop("delayed_updates") == "none, as there are no internal rules"
    assert said == {"book": "t5", "correct": True, "structures": 9, "events": 25, "findings": []}
    assert (home["proven"], home["searched"]) == ("any tank", [])
    ran = CliRunner().invoke(main, ["rules", "check", "line4_as_printed", "--no-delayed-updates"])
    assert ran.exit_code == 1
    assert "error: off-target: 3 of 20 structures are no part of the target" in ran.output


@pytest.mark.validate
def test_pyramid_is_correct():
    report = check(RuleBook.load("pyramid45"))
    assert kinds(report) == []  # not even while waves are under way
    assert report.n_structures == 809
