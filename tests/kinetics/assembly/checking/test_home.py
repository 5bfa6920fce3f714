"""What the checker says about coming home, against small tanks in which everything was tried."""

from collections import Counter
from dataclasses import replace

import pytest

from kinetics.assembly import RuleBook, Semantics, Senses, Structure, check
from kinetics.assembly.checking import home
from kinetics.assembly.deriving.explore import explore
from kinetics.assembly.rules.conditions import Combination, Dissociation
from tests.helpers.brute_tanks import BruteTank, marked
from tests.helpers.mutated_books import line3, mutated

MOST_STATES = 600


def compared(book):
    """What was claimed, in words to be counted; AssertionError where a claim is false or a fault was missed."""
    report = check(book, max_cubes=7, max_species=60, slow_waves=False)
    found = explore(book, 7, 60)
    target = book.target.canonical(book.scheme)
    if not found.is_closed or target not in found.structures:
        return ["no end or no target"]
    said = []
    lost = home.lost_cubes(found, {found.structures.index(target)})
    claimed = {marked(found.structures[c.structure], c.number).canonical(book.scheme) for c in lost}
    starving = [finding for finding in report.findings if finding.kind == "starvation"]
    for cubes in (len(target), len(target) + 1):
        tank = BruteTank(book, cubes, MOST_STATES)
        if not tank.is_complete:
            said.append("too many states")
            break
        seen, good = tank.homeless()
        assert claimed.isdisjoint(good), f"{book.name}: a cube called lost comes home in a tank of {cubes}"
        said.append("lost" if claimed & seen else "none lost")
        can_starve, must_starve = tank.starves()
        if report.home.proven == "any tank":
            assert not can_starve, f"{book.name}: {cubes} cubes starve"
            said.append("any tank")
        if starving and cubes == report.home.searched[-1]:
            assert can_starve
            assert starving[0].is_error == must_starve
            said.append("starvation")
        elif cubes in report.home.searched:
            assert not can_starve
            said.append("searched")
        if can_starve:
            assert starving or not report.is_correct, f"{book.name}: starving with {cubes} cubes was missed"
    return said


def counted(seeds):
    said = Counter()
    for book in filter(None, map(mutated, seeds)):
        said.update(compared(book))
    return said


def test_claims_hold_where_everything_was_tried():
    """Of 150 faulty books; no claim is false, no tank starves unseen."""
    said = counted(range(150))
    assert min(said[what] for what in ("lost", "none lost", "any tank", "searched", "starvation")) >= 3, said


@pytest.mark.validate
def test_claims_hold_in_ten_thousand_books():
    said = counted(range(1000, 11_000))
    assert min(said[what] for what in ("lost", "none lost", "any tank", "searched", "starvation")) >= 100, said


class Everything(set):
    """Equal to whatever it is compared with."""

    __hash__ = None

    def __eq__(self, other):
        return True


@pytest.mark.parametrize(
    "mutant",
    [
        {"falling_apart": lambda events, free: Everything()},
        {"lost_cubes": lambda found, targets: home.sources_of_cubes(found).keys() - {(min(targets), 0)}},
        {"lost_cubes": lambda found, targets: [], "falling_apart": lambda events, free: Everything()},
    ],
    ids=["all fall apart", "all are lost", "none are lost"],
)
def test_a_wrong_argument_is_found_out(mutant, monkeypatch):
    """The control: proofs that prove too much, or find too much lost."""
    from kinetics.assembly.checking import examined

    for name, wrong in mutant.items():
        monkeypatch.setattr(home, name, wrong)
        if hasattr(examined, name):
            monkeypatch.setattr(examined, name, wrong)
    with pytest.raises(AssertionError):
        counted(range(150))


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
    apart = [rule.model_copy(update={"letter": ("b",)}) for rule in kept]
    return replace(
        book,
        letters=("a", "b", "c", "x", "y"),
        combine=(*book.combine, *catching),
        dissociate=(fall, *letting, *apart),
    )


def test_endless_pairing_is_an_error():
    """A free cube always comes out of it, but the cube that catches it never comes home (R2 of the review)."""
    report = check(trapping())
    (finding,) = (f for f in report.findings if f.kind == "trap")
    assert finding.is_error
    assert not report.is_correct
    assert "x" in finding.structure.letters
    assert report.home.proven == "nothing"
    found = explore(trapping())
    lost = home.lost_cubes(found, {found.structures.index(trapping().target.canonical("two"))})
    assert [found.structures[cube.structure].letters[cube.number] for cube in lost] == ["x", "x", "x"]


def test_a_target_that_takes_more_cubes_than_it_has_starves_for_certain():
    """Lines of three that come only of lines of four."""
    pairs = RuleBook.load("line4_pairs")
    line = Structure(((0, 0, 0), (0, 0, 1), (0, 0, 2)), (0, 0, 0), ("b", "d", "b"))
    report = check(replace(pairs, target=line), slow_waves=False)
    (finding,) = (f for f in report.findings if f.kind == "starvation")
    assert finding.is_error
    assert finding.text == "3 cubes never make 1 target, whatever happens"


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
    assert report.home.searched == (2, 3, 4)
    assert report.findings[0].text.startswith("4 cubes can end as")
    assert [BruteTank(book, cubes).starves() for cubes in (2, 3, 4)] == [(False, False)] * 2 + [(True, False)]


def test_one_lost_structure_is_enough():
    """A pair leaves two cubes that wait for free ones; with none that bonds to x, this single structure is lost."""
    book = pairs(Dissociation(rule="stay", letter="b", becomes="x"))
    barren = replace(book, combine=tuple(r.model_copy(update={"partner": ("a", "b")}) for r in book.combine[:1]))
    report = check(barren)
    (finding,) = (f for f in report.findings if f.kind == "dead end")
    assert finding.text == "1 structures can neither grow nor break; the nearest"
    assert finding.structure.letters == ("x",)
    assert finding.steps == ("monomer.a + monomer.a -> dimer: b(0,0,0) b(0,0,1)", "dimer -> monomer.b + monomer.b")
    assert not report.is_correct


def test_what_is_proven_is_said():
    assert check(RuleBook.load("line4")).home.proven == "any tank"
    assert check(RuleBook.load("t5")).home.proven == "any tank"
    stay = Dissociation(rule="stay", letter="b", becomes="x")
    report = check(pairs(stay))  # two x wait for two free cubes
    assert report.home.proven == "enough free cubes"
    assert report.home.text.endswith("proven for every structure that has free cubes enough around it")


def test_what_free_cubes_alone_do_not_finish_is_not_proven():
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
    book = replace(pairs(), letters=("a", "b", "y", "z"), combine=tuple(rules), dissociate=parting)
    report = check(book)
    assert report.findings == ()
    assert report.home == ("nothing", (2, 3, 4), "searched: tanks of 2 to 4 cubes, none of which starves")
    assert not any(BruteTank(book, cubes).starves()[0] for cubes in (2, 3, 4, 5))
