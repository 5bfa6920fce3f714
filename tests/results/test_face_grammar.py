"""Per-face grammars make what their books make, move for move, and what they cost is counted rightly."""

from dataclasses import replace

import numpy as np
import pytest

from kinetics.assembly import RuleBook, Semantics
from kinetics.assembly.compiler import Target, compile_book
from tests.results import grammar_effort as effort
from tests.results.face_grammar import FaceGrammar, letter_of
from tests.results.grammar_effort import COSTS, growth_costs, star_book

T5, PYRAMID = RuleBook.load("t5"), RuleBook.load("pyramid45")


def column(costs, name):
    return costs[:, 1 + COSTS.index(name)]


@pytest.mark.parametrize("n_faces", range(1, 7))
def test_a_star_is_the_worst_case(n_faces):
    """Closed form: F letters a cube, F² on its faces, F (F + 1) / 2 on those that are open."""
    costs = growth_costs(star_book(n_faces), seed=3)
    assert len(costs) == n_faces + 1
    middle = costs[:1]
    assert middle[0, 0] == n_faces
    for name, value in (
        ("cube writes", n_faces),
        ("cube look-ups", n_faces),
        ("face writes", n_faces**2),
        ("face look-ups", n_faces**2),
        ("face writes, open faces only", n_faces * (n_faces + 1) / 2),
        ("cube look-ups in waves", 0),
    ):
        assert column(middle, name) == value, name


@pytest.mark.parametrize("name", ["line4", "line4_pairs", "t5", "t5_bar", "t5_all", "pyramid45", "pyramid45_compiled"])
def test_faces_show_their_cubes_letters_all_along(name):
    """A difference would raise; each letter is read through the faces that carry it."""
    book = RuleBook.load(name)
    seeds = range(12 if book.seed_letter is None else 2)  # without breaks, small tanks may end without a target
    costs = np.concatenate([growth_costs(book, seed) for seed in seeds])
    assert len(costs) % len(book.target) == 0
    assert len(costs) > 0
    faces = costs[:, 0]
    for kind in ("writes", "look-ups", "writes in waves", "look-ups in waves"):
        assert np.array_equal(column(costs, f"face {kind}"), faces * column(costs, f"cube {kind}")), kind
    assert (column(costs, "face writes, open faces only") <= column(costs, "face writes")).all()


def test_the_sense_across_is_read_through_the_faces():
    costs = growth_costs(compile_book(Target.load("corner"), time_limit=1e9).book, seed=2)
    assert len(costs) > 0


@pytest.mark.parametrize("kind", ["combine", "internal"])
def test_a_face_that_is_not_rewritten_is_seen(kind, monkeypatch):
    """The control: a grammar without the productions of side faces."""
    whole = FaceGrammar.productions.func

    def partial(grammar):
        return {key: () if key == (kind, "f2") else rules for key, rules in whole(grammar).items()}

    monkeypatch.setattr(FaceGrammar, "productions", property(partial))
    with pytest.raises(RuntimeError, match="the per-face grammar of book 'pyramid45' comes to"):
        growth_costs(PYRAMID, 0)


def test_what_a_wave_costs_is_counted_by_hand():
    """The fourth arm of the pyramid: guest, seed, and round by round all cubes beside a change."""
    part = effort._part(FaceGrammar(PYRAMID), PYRAMID.seed())
    rng = np.random.default_rng(0)
    for _ in range(4):
        part = effort._joined(FaceGrammar(PYRAMID), part, effort._part(FaceGrammar(PYRAMID), PYRAMID.monomer()), rng)
    seed, *arms = part.work
    assert part.structure.letters == ("g", "c", "c", "c", "c")
    assert seed.writes.tolist() == [0, 1]
    assert seed.lookups.tolist() == [4, 5]  # at each arm, and once more in the round after its own change
    # in waves an arm looks up at its own docking, at later ones beside the seed, and after the seed's change
    assert [arm.writes.tolist() for arm in arms] == [[1, 0]] * 4
    assert [arm.lookups.tolist() for arm in arms] == [[1, 5], [1, 4], [1, 3], [1, 2]]


def test_sizes():
    grammar = FaceGrammar(T5)
    assert (grammar.n_letters, grammar.n_productions) == (8, 22)
    assert letter_of("s1.f2") == "s1"


def test_books_without_a_grammar_are_refused():
    for semantics in (Semantics(update="sequential"), Semantics(gate="any")):
        with pytest.raises(ValueError, match="gate mutual, update synchronous"):
            FaceGrammar(replace(T5, semantics=semantics))
    with pytest.raises(ValueError, match="has no target"):
        growth_costs(replace(T5, target=None), 0)
    with pytest.raises(ValueError, match="n_faces = 7"):
        star_book(7)
