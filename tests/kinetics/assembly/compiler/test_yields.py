"""The yields that the compiler chooses by: those of the plan, of the derived network, and of the exact chain."""

from dataclasses import replace

import numpy as np
import pytest

from kinetics import ClassRates, Model
from kinetics.assembly import RuleBook, derive
from kinetics.assembly.compiler import Target, all_books, choice, compile_book, yields
from kinetics.assembly.compiler.budget import Budget
from kinetics.assembly.compiler.choice import tried
from kinetics.assembly.compiler.search import first_letter
from kinetics.assembly.compiler.target import read_layers
from kinetics.assembly.compiler.yields import BREAK, CUBES, DURATION, JOIN, Yields, yields_of
from kinetics.predicting.ranking.yield_and_first_time import yield_and_first_time

L = Target("L", read_layers(("#..\n#..\n###",))[0])
UNHURRIED = {"time_limit": float("inf")}


def exact(book, break_):
    """Of the chain: targets over those possible, solved or from 1,000 runs."""
    derived = derive(book)
    network = ClassRates.uniform(JOIN, break_).apply(derived)
    free, target = (network.species[derived.species_of(each)] for each in (book.monomer(), book.target))
    model = Model.of(network, {free: CUBES})
    return yield_and_first_time(model, target, CUBES // len(book.target), DURATION, 1000, 0, 20_000).yield_.value


@pytest.fixture(scope="module")
def made():
    return compile_book(L, **UNHURRIED)


def test_the_l_of_five_yields_more_than_half(made):
    """Review 3: the book with the fewest rules yields .02."""
    assert made.letters == 3
    assert (len(made.joins), made.gain) == (3, 0.0)
    assert min(made.yields.holding, made.yields.breaking) >= 0.6
    assert exact(made.book, BREAK) >= 0.5
    few = compile_book(L, joins=["1+1->2.a", "2.a+1->3.c", "3.c+1->4.b", "4.b+1->5"], **UNHURRIED)  # the control
    assert few.letters == made.letters
    assert exact(few.book, BREAK) < 0.2


@pytest.mark.parametrize("name", ["l3", "line4", "corner"])
def test_no_set_of_joins_yields_more(name):
    """Against every book of every set of joins, by their own networks."""
    own = compile_book(Target.load(name), **UNHURRIED)
    others = [each for each in all_books(Target.load(name), **UNHURRIED) if each.letters == own.letters]
    worth = [yields_of(derive(each.book)).mean - choice.EARNED * len(each.joins) for each in others]
    assert own.yields.mean - choice.EARNED * len(own.joins) >= max(worth) - 1e-9
    assert min(worth) < max(worth), "the control: some of them are worse"


@pytest.mark.parametrize("name", ["l3", "line4", "corner", "screw", "plate2x2"])
def test_the_plan_knows_the_yield_of_its_books(name):
    """Counted by geometry before there are letters, and by the rules afterwards; the control has other ways."""
    own = compile_book(Target.load(name), **UNHURRIED)
    assert own.yields == yields_of(derive(own.book))
    derived = derive(own.book)
    event, ways = next(iter(derived.events.items()))
    more = replace(derived, events=derived.events | {event: {kind: 2 * n for kind, n in ways.items()}})
    assert yields_of(more) != own.yields


@pytest.mark.parametrize("name", ["line4", "line4_pairs", "t5"])
def test_they_are_near_the_exact_ones(name):
    book = RuleBook.load(name)
    found = yields_of(derive(book))
    assert found.holding == pytest.approx(exact(book, 0.0), abs=0.06)
    assert found.breaking == pytest.approx(exact(book, BREAK), abs=0.06)
    assert abs(found.holding - exact(book, 10 * BREAK)) > 0.12, "the control: other rates give another yield"


def test_two_cubes_have_a_closed_form(monkeypatch):
    """x' = -k x^2 without breaks, so that k x0 t / (1 + k x0 t) of the cubes are in pairs."""
    pair = compile_book(Target("pair", ((0, 0, 0), (1, 0, 0))), breaks=False, **UNHURRIED)
    derived = derive(pair.book)
    (ways,) = (sum(ways.values()) for ways in derived.events.values())
    reach = ways * JOIN * CUBES * DURATION
    assert pair.yields.holding == pytest.approx(reach / (1 + reach), abs=1e-3)
    assert pair.yields.breaking is None
    monkeypatch.setattr(yields, "JOIN", 0.3 * JOIN)
    assert yields_of(derived).holding < pair.yields.holding


def test_what_has_no_yield():
    assert yields_of(derive(RuleBook.load("t5"))) is not None
    assert yields_of(replace(derive(RuleBook.load("t5")), book=replace(RuleBook.load("t5"), target=None))) is None


def test_low_yields_are_warned_of():
    assert Yields(0.1, 0.5).warning is None
    assert "(break = 0.0001)" in Yields(0.5, 0.09).warning
    assert "(no breaks)" in Yields(0.09, None).warning
    assert str(Yields(0.5, None)) == "yield 0.50 (no breaks)"


def test_what_a_longer_search_could_gain(made, monkeypatch):
    """If letters are found for no set but those known before, the ones that yield more stay undecided."""

    def refused(search, joins, steps, prefer=first_letter):
        return tried(search, joins, steps, prefer) if joins is None or prefer is not first_letter else (None, False)

    monkeypatch.setattr(choice, "tried", refused)
    hasty = compile_book(L, **UNHURRIED)
    best = compile_book(L, joins=["1+1->2.a", "2.a+1->3.a", "3.a+2.a->5"], **UNHURRIED)
    assert hasty.gain == pytest.approx(best.yields.mean - hasty.yields.mean, abs=0.02)
    assert hasty.gain > 0.2 > made.gain
    assert f"a longer search could gain {hasty.gain:.2f} of yield" in hasty.searched[-1]


def test_the_budget_bounds_the_comparison():
    assert Budget(effort=0.1).times(choice.COMPARED) == 10
    assert np.isfinite(compile_book(L, effort=0.1, **UNHURRIED).gain)
