"""What the checker says about recoverability, against small tanks in which everything was tried."""

from collections import Counter
from dataclasses import replace

import pytest

from kinetics.assembly import RuleBook, Semantics, Senses, Structure, check
from kinetics.assembly.checking import cubes, exploration_index, recoverability, tanks
from kinetics.assembly.checking.compositions import compositions
from kinetics.assembly.checking.exploration_index import ExplorationIndex
from kinetics.assembly.deriving.explore import explore
from kinetics.assembly.rules.conditions import Combination, Dissociation, Internal
from tests.helpers.brute_tanks import BruteBook, BruteTank
from tests.helpers.claims import claims_of, compared
from tests.helpers.compiled_faults import faulty
from tests.helpers.mutated_books import line3
from tests.helpers.planted_faults import planted
from tests.helpers.tree_books import tree_book

CLAIMS = ("cubes called lost", "cubes not called lost", "finished with enough cubes", "tanks proven not to starve",
          "tanks said not to starve", "starving tanks", "steps repeated", "books with waves")  # fmt: skip
FINDINGS = ("off-target", "trap", "dead end", "starvation", "livelock", "squeezed", "target not reached", "not closed")


def counted(seeds):
    return sum(map(claims_of, seeds), Counter())


def test_claims_hold_where_everything_was_tried():
    """A share of the long test below."""
    said = counted(range(100))
    assert said["correct"] >= 10
    assert min(said[what] for what in (*CLAIMS, *FINDINGS)) >= 1, said


def of_compiled_books(seeds):
    return sum((compared(book, 24) for book in map(faulty, seeds) if book is not None), Counter())


def test_claims_hold_of_compiled_books_with_faults():
    """Loops, corners and screws, which the other books do not have; a share of the long test below."""
    said = of_compiled_books(range(60))
    assert said["correct"] >= 1
    assert min(said[what] for what in ("cubes called lost", "tanks searched", "off-target", "trap")) >= 1, said


@pytest.mark.validate
def test_claims_hold_of_a_thousand_compiled_books_with_faults():
    """Two minutes of CPU time."""
    said = of_compiled_books(range(1000, 2400))
    assert said["books"] >= 1000
    assert min(said[what] for what in ("correct", *CLAIMS[:6], *FINDINGS[:3])) >= 10, said


@pytest.mark.validate
def test_claims_hold_in_ten_thousand_books():
    """Ten minutes of CPU time.

    Of 10,041 books 2,609 are correct; 5,422 have off-target ends, 1,713 traps, 1,670 dead ends, 1,408 starve, 293 have
    no rest, 284 squeeze a cube. Compared: 6,083 cubes called lost and 47,244 that are not, 8,225 structures said to be
    finished with enough free cubes, 6,874 tanks proven not to starve, 673 said not to, 1,408 starving, 32,759 steps.
    """
    said = counted(range(1000, 11_200))
    assert said["books"] >= 10_000
    assert min(said[what] for what in ("correct", *CLAIMS, *FINDINGS)) >= 100, said


def starves(book, cubes):
    return BruteTank.of_free_cubes(BruteBook(book), cubes).starves()


def exchanging():
    """Pairs part into y and z, which take each other alone: no tank starves, but free cubes are no help to either."""
    rules = [
        Combination(rule=f"pair {own}", letter=own, partner=partners, face="f1", partner_face="f1", neighbours=[],
                    becomes="b")
        for own, partners in (("a", ["a", "b"]), ("y", ["z", "b"]), ("z", ["y", "b"]))
    ]  # fmt: skip
    parting = (
        Dissociation(rule="y", letter="b", lost="b", becomes="y"),
        Dissociation(rule="z", letter="b", lost="y", becomes="z"),
    )
    return replace(pairs(), letters=("a", "b", "y", "z"), combine=tuple(rules), dissociate=parting)


def reseeding():
    """Lone cubes become seeds, so that free cubes run out in a tank that at first holds one seed."""
    book = tree_book(0, 3, seeded=True)
    return replace(book, dissociate=tuple(r.replace(becomes="0") for r in book.dissociate))


def trapping():
    """A cube of a line of three that loses its bond pairs with a free cube and lets it go again, for ever."""
    book = line3()
    fall = Dissociation(rule="fall", letter="c", neighbours=["b"], becomes="x")
    letting = [
        Dissociation(rule="let go", letter="x", neighbours=[], becomes="x"),
        Dissociation(rule="go", letter="y", becomes="a"),
    ]
    catching = [
        Combination(rule="catch", letter="x", partner="a", face="f1", partner_face="f1", neighbours=[], becomes="x"),
        Combination(rule="caught", letter="a", partner="x", face="f1", partner_face="f1", neighbours=[], becomes="y"),
    ]
    kept = [rule for rule in book.dissociate if rule.rule == "P1'"]
    apart = [rule.replace(letter=("b",)) for rule in kept]
    return replace(
        book,
        letters=("a", "b", "c", "x", "y"),
        combine=(*book.combine, *catching),
        dissociate=(fall, *letting, *apart),
    )


WRONG = {
    "all is proven": (tanks, "scope", lambda *_: "any tank", lambda: planted("holding", 0)[1]),
    "free cubes are enough": (tanks, "scope", lambda *_: "enough free cubes", exchanging),
    "seeds come and go": (recoverability, "_keeps", lambda event, seeds: True, reseeding),
    "all are lost": (
        exploration_index,
        "lost_cubes",
        lambda found, *_: list(recoverability.sources_of_cubes(found)),
        lambda: tree_book(0, 3),
    ),
    "none are lost": (exploration_index, "lost_cubes", lambda *_: [], trapping),
    "nothing starves": (tanks, "_starving", lambda *_: None, lambda: planted("holding", 0)[1]),
    "all is part of the target": (exploration_index, "fits_into", lambda *_: True, lambda: planted("off target", 0)[1]),
    "nothing is part of the target": (exploration_index, "fits_into", lambda *_: False, lambda: tree_book(0, 3)),
    "nothing is squeezed": (
        exploration_index.ExplorationIndex,
        "squeezes",
        lambda self: [],
        lambda: planted("squeezed", 0)[1],
    ),
    "all comes to rest": (
        exploration_index.ExplorationIndex,
        "closure",
        lambda self: [],
        lambda: planted("restless", 0)[1],
    ),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_argument_is_found_out(wrong, monkeypatch):
    """The control: proofs that prove too much, or find too much lost."""
    where, name, instead, book = WRONG[wrong]
    compared(book())
    monkeypatch.setattr(where, name, instead)
    with pytest.raises(AssertionError):
        compared(book())


def test_endless_pairing_is_an_error():
    """A free cube always comes out of it, but the cube that catches it never ends in the target (R2 of the review)."""
    report = check(trapping())
    (finding,) = (f for f in report.findings if f.kind == "trap")
    assert finding.is_error
    assert not report.is_correct
    assert "x" in finding.structure.letters
    assert report.recoverability.proven == "nothing"
    found = explore(trapping())
    lost = recoverability.lost_cubes(found, {found.structures.index(trapping().target.canonical("two"))})
    assert [found.structures[cube.structure].letters[cube.number] for cube in lost] == ["x", "x", "x"]


def symmetric():
    """Of a pair of like cubes one becomes the middle of a three, the other its end; only the middle stays with the
    target, and the end comes back as a cube that pairs again: all are recoverable.
    """

    def bond(letter, neighbours, partner, becomes):
        return Combination(rule=f"{letter} {partner}", letter=letter, neighbours=neighbours, partner=partner,
                           face="f1", partner_face="f1", becomes=becomes)  # fmt: skip

    combine = (
        bond("a", [], ["a", "z"], "b"),
        bond("z", [], ["a"], "b"),
        bond("a", [], ["b"], "d"),
        bond("b", ["b"], ["a"], "c"),
    )
    parting = (
        Dissociation(rule="free", letter="d", becomes="a"),
        Dissociation(rule="alone", letter="c", neighbours=[], becomes="a"),
        Dissociation(rule="pair", letter="c", lost="d", neighbours=["e"], becomes="b"),
        Dissociation(rule="end", letter=("b", "e"), neighbours=[], becomes="z"),
    )
    waves = (
        Internal(rule="follow", letter="b", has="c", becomes="e"),
        Internal(rule="back", letter="e", has="b", becomes="b"),
    )
    return replace(pairs(), letters=tuple("abcdez"), combine=combine, dissociate=parting, internal=waves,
                   target=Structure(((0, 0, 0), (0, 0, 1)), (0, 0), ("c", "d")), semantics=Semantics())  # fmt: skip


def test_either_of_two_like_cubes_may_be_the_one_that_comes_home(monkeypatch):
    found = explore(symmetric())
    targets = {found.structures.index(symmetric().target.canonical("two"))}
    assert recoverability.lost_cubes(found, targets) == []
    monkeypatch.setattr(cubes, "_firsts", lambda structure, scheme: list(range(len(structure))))  # the control
    assert recoverability.lost_cubes(found, targets) != []


def test_a_target_that_takes_more_cubes_than_it_has_starves_for_certain():
    """Lines of three that come only of lines of four."""
    pairs = RuleBook.load("line4_pairs")
    line = Structure(((0, 0, 0), (0, 0, 1), (0, 0, 2)), (0, 0, 0), ("b", "d", "b"))
    report = check(replace(pairs, target=line), slow_waves=False)
    (finding,) = (f for f in report.findings if f.kind == "starvation")
    assert finding.is_error
    assert finding.text == "3 cubes never make 1 target, whatever happens"
    assert report.recoverability.text.startswith("searched: tanks of 3 cubes, the last of which never")


def pairs(*left):
    """Pairs of free cubes, and what becomes of the cubes of a pair that breaks; x takes free cubes alone."""
    rules = [
        Combination(rule=f"pair {own}", letter=own, partner=partners, face="f1", partner_face="f1", neighbours=[],
                    becomes="b")
        for own, partners in (("a", ["a", "b", "x"]), ("x", ["a", "b"]))
    ]  # fmt: skip
    pair = Structure(((0, 0, 0), (0, 0, 1)), (0, 0), ("b", "b"))
    return RuleBook("pairs", ("a", "b", "x"), "a", Senses(faces="two"), pair, combine=tuple(rules), dissociate=left,
                    semantics=Semantics(update="sequential"))  # fmt: skip


def test_tanks_are_searched_up_to_two_targets():
    """One cube of a pair that breaks stays behind as x: four cubes, not fewer, can end with two that wait."""
    stay = Dissociation(rule="stay", letter="b", lost="b", becomes="x")
    book = pairs(stay, Dissociation(rule="go", letter="b", lost="x", becomes="a"))
    report = check(book)
    assert [finding.kind for finding in report.findings] == ["starvation"]
    assert report.recoverability.searched == (2, 3, 4)
    assert report.findings[0].text.startswith("4 cubes can end as")
    assert [starves(book, cubes) for cubes in (2, 3, 4)] == [(False, False)] * 2 + [(True, False)]


def test_one_lost_structure_is_enough():
    """A pair leaves two cubes that wait for free ones; with none that bonds to x, this single structure is lost."""
    book = pairs(Dissociation(rule="stay", letter="b", becomes="x"))
    barren = replace(book, combine=tuple(r.replace(partner=("a", "b")) for r in book.combine[:1]))
    report = check(barren)
    (finding,) = (f for f in report.findings if f.kind == "dead end")
    assert finding.text == "1 structures can neither grow nor break; the nearest"
    assert finding.structure.letters == ("x",)
    assert finding.steps == ("monomer.a + monomer.a -> dimer: b(0,0,0) b(0,0,1)", "dimer -> monomer.b + monomer.b")
    assert not report.is_correct


def test_what_is_proven_is_said():
    assert check(RuleBook.load("line4")).recoverability.proven == "any tank"
    assert check(RuleBook.load("t5")).recoverability.proven == "any tank"
    stay = Dissociation(rule="stay", letter="b", becomes="x")
    report = check(pairs(stay))  # two x wait for two free cubes
    assert report.recoverability.proven == "enough free cubes"
    assert report.recoverability.text.endswith("proven for every structure that has free cubes enough around it")


def test_the_search_of_tanks_can_be_ended():
    """Whoever limits the time is asked at each cube's event and at each composition."""
    book = pairs(Dissociation(rule="stay", letter="b", becomes="x"))
    found, told = explore(book), []
    tank = compositions((0,) * 4, found.events, lambda *so_far: told.append(so_far))
    assert len(told) == len(tank) > 5
    assert told[-1] == (len(tank), len(tank))

    def out_of_time(*_):
        raise TimeoutError

    late = ExplorationIndex(found, out_of_time)
    with pytest.raises(TimeoutError):
        _ = late.lost
    late.__dict__["lost"] = []
    with pytest.raises(TimeoutError):
        tanks.in_tanks(late)


def test_a_tank_is_searched_until_it_holds_what_is_sought():
    found = explore(RuleBook.load("line4"))
    goal = {max(range(len(found.structures)), key=lambda n: len(found.structures[n]))}
    tank, part = compositions((0,) * 8, found.events), compositions((0,) * 8, found.events, until=goal)
    assert any(not goal.isdisjoint(state) for state in part)
    assert sum(not goal.isdisjoint(state) for state in part) == 1
    assert len(part) < len(tank)


def test_what_free_cubes_alone_do_not_finish_is_not_proven():
    book = exchanging()
    report = check(book)
    assert report.findings == ()
    assert report.recoverability == ("nothing", (2, 3, 4), "searched: tanks of 2 to 4 cubes, none of which starves")
    assert not any(starves(book, cubes)[0] for cubes in (2, 3, 4, 5))


def test_free_cubes_that_become_seeds_are_no_proof():
    """All falls apart into free cubes and seeds, but three seeds wait for free cubes for ever."""
    report = check(reseeding())
    (finding,) = report.findings
    assert finding.text.startswith("3 cubes can end as seed + seed + seed, where nothing happens any more")
    assert report.recoverability.proven == "enough free cubes"
    assert check(tree_book(0, 3, seeded=True)).recoverability.proven == "any tank"


def test_seeds_that_come_from_free_cubes_are_no_proof():
    """Two free cubes pair at their sides and part as seeds: what there is grows, but in the end only seeds are left."""
    bonds = [
        Combination(rule="dock", letter="a", face="f1", partner="s", partner_face="f1", neighbours=[], becomes="b"),
        Combination(rule="host", letter="s", face="f1", partner="a", partner_face="f1", neighbours=[], becomes="s"),
        Combination(rule="pair", letter="a", face="f2", partner="a", partner_face="f2", neighbours=[], becomes="p"),
    ]
    parting = [Dissociation(rule="part", letter="p", becomes="s"), Dissociation(rule="go", letter="b", becomes="a")]
    target = Structure(((0, 0, 0), (0, 0, 1)), (0, 0), ("s", "b"))
    book = RuleBook("seeds", ("a", "s", "b", "p"), "a", Senses(faces="two"), target, "s", Semantics(),
                    combine=tuple(bonds), dissociate=tuple(parting))  # fmt: skip
    assert starves(book, 3) == (True, False)
    assert check(book).recoverability.proven == "enough free cubes"
