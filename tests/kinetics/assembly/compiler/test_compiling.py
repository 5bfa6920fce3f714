"""Books compiled for small targets: few letters, proven, and nothing but the target."""

import re
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from command_line import run_here
from growing import grown

from kinetics.assembly import RuleBook, Senses, check, derive
from kinetics.assembly.compiler import (
    InfeasibleError,
    Target,
    UndecidedError,
    all_books,
    compile_book,
    compiling,
)
from kinetics.assembly.compiler.budget import Budget
from kinetics.assembly.compiler.yields import yields_of
from kinetics.assembly.rules.writing import written
from kinetics.commands.compile import time_since_start

compile_unhurried = partial(compile_book, time_limit=float("inf"))  # the same book on any machine

# Fewest letters, that of a free cube among them, over all sets of joins; what cubes have to sense.
FEWEST = {"line4": 2, "line5": 3, "l3": 2, "t5": 2, "corner": 2, "screw": 2, "plate2x2": 3}
NEEDS = dict.fromkeys(FEWEST, "two face types") | {
    "corner": "two face types, across",
    "plate2x2": "two face types, roll, across, touched",
    "screw": "six face types, roll",
}


@pytest.fixture(scope="module")
def compiled():
    return {name: compile_unhurried(Target.load(name)) for name in FEWEST}


def sensing(target, **senses):
    return replace(Target.load(target), senses=Senses(**{"faces": "two"} | senses))


@pytest.mark.parametrize("name", FEWEST)
def test_weakest_senses_and_fewest_letters_over_all_joins(compiled, name):
    made = compiled[name]
    assert (made.letters, made.minimal) == (FEWEST[name], True)
    assert made.capability == NEEDS[name]
    tried = [sentence for sentence in made.searched if "any joins: none does, all were tried" in sentence]
    assert [int(sentence.split()[0]) for sentence in tried] == list(range(1, FEWEST[name]))
    assert any("all structures of one shape have the same letters" in sentence for sentence in made.searched)
    assert made.book.semantics.bonds == "break"


@pytest.mark.parametrize("name", FEWEST)
def test_the_book_makes_the_target_and_parts_of_it_only(compiled, name):
    made, target = compiled[name], Target.load(name)
    derived = derive(made.book)
    assert derived.is_closed
    assert check(made.book, slow_waves=False).is_correct
    scheme = made.book.scheme
    shapes = [s.with_letters(["#"] * len(s)).canonical(scheme) for s in derived.structures.values()]
    assert len(shapes) == len(set(shapes))  # each shape in one state only
    assert made.book.target.with_letters(["#"] * len(target)).canonical(scheme) in shapes
    assert max(map(len, shapes)) == len(target)
    assert sum(len(event.before) == 2 for event in derived.events) == len(made.joins)


@pytest.mark.parametrize("name", FEWEST)
@pytest.mark.parametrize("growths", [12, pytest.param(500, marks=pytest.mark.validate)])
def test_random_growth_makes_nothing_else(compiled, name, growths):
    book = compiled[name].book
    allowed = set(derive(book).structures.values())
    seen = set()
    for seed in range(growths):
        seen |= grown(book, 2 * len(book.target), 300, np.random.default_rng(seed))
    assert seen <= allowed
    assert len(seen) > 2


def test_random_growth_notices_a_guard_that_is_missing():
    """The control: Table I as printed makes lines of five and more."""
    book = RuleBook.load("line4_as_printed")
    seen = {s for seed in range(30) for s in grown(book, 8, 300, np.random.default_rng(seed))}
    assert max(map(len, seen)) > 4


def test_the_same_target_gives_the_same_book(compiled):
    assert compile_unhurried(Target.load("plate2x2")).book.fingerprint == compiled["plate2x2"].book.fingerprint


def test_a_compiled_book_is_written_and_loaded(compiled, tmp_path):
    for name, made in compiled.items():
        path = tmp_path / f"{name}.toml"
        path.write_text(written(made.book, made.capability))
        assert RuleBook.load(path).fingerprint == made.book.fingerprint


@pytest.mark.parametrize(
    ("joins", "breaks", "letters"),
    [
        (["1+1", "2+2"], True, 2),
        (["1+1", "1+2", "1+3", "2+2"], True, 3),
        (["1+1", "2+2"], False, 2),  # a cube that has a neighbour is no free one, whatever its letter
    ],
)
def test_lines_of_four_with_other_joins(joins, breaks, letters):
    made = compile_unhurried(Target.load("line4"), joins=joins, breaks=breaks)
    assert (made.letters, made.minimal) == (letters, True)
    assert made.book.semantics.bonds == ("break" if breaks else "hold")
    assert sorted(join.split("->")[0] for join in made.joins) == sorted(
        "+".join(sorted(join.split("+"), reverse=True)) for join in joins
    )


@pytest.fixture
def no_remedy(monkeypatch):
    """What would be enough is not looked for: that takes longer than the search itself."""
    monkeypatch.setattr(compiling._Asked, "remedy", lambda _: "")


@pytest.mark.usefixtures("no_remedy")
def test_fewer_letters_than_it_takes_are_refused_after_all_were_tried():
    with pytest.raises(InfeasibleError, match="takes more than 2 letters: all were tried"):
        compile_unhurried(sensing("line4"), max_letters=2, joins=["1+1", "1+2", "1+3", "2+2"])
    with pytest.raises(InfeasibleError, match="takes more than 2 letters: all were tried"):
        compile_unhurried(sensing("line5"), max_letters=2)


@pytest.mark.parametrize(
    ("senses", "says"),
    [
        ({}, "the join 1+1->2 must form, axes parallel"),
        ({"roll": True}, "the join 2+1->3 must form"),
        ({"roll": True, "across": True}, "the join 2+2->4 must form"),
        ({"roll": True, "touched": True}, "the join 2+1->3 must form"),
    ],
)
def test_the_plate_tells_what_cubes_cannot_tell_apart_and_what_it_takes(senses, says):
    with pytest.raises(InfeasibleError) as caught:
        compile_unhurried(sensing("plate2x2", **senses))
    text = str(caught.value)
    assert "infeasible with this sensing" in text
    assert "whatever joins are chosen, because" in text
    assert says in text
    assert "read the same, whatever the letters are" in text
    assert "two face types, roll, across, touched are enough: a book of 3 letters does it" in text


@pytest.mark.usefixtures("no_remedy")
def test_joins_that_cannot_be_told_apart_are_named():
    with pytest.raises(InfeasibleError, match="and these joins because\nthe join 2\\+2->4 must form"):
        compile_unhurried(sensing("plate2x2", roll=True, across=True, touched=True), joins=["1+1", "1+2", "2+2"])


@pytest.mark.parametrize(("faces", "letters"), [("one", None), ("six", 2)])
def test_lines_with_other_faces(faces, letters):
    target = sensing("line4", faces=faces, roll=faces == "six")
    if letters is None:
        with pytest.raises(InfeasibleError, match="two face types are enough"):
            compile_unhurried(target)
    else:
        assert compile_unhurried(target).letters == letters


class Clock:
    """A clock that ticks whenever it is looked at."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        self.now += 1.0
        return self.now


def test_time_that_is_up_is_not_called_infeasible():
    """It ends at the next look at the clock, and says what was decided and what would come next."""
    looks = Clock()
    compile_book(Target.load("corner"), time_limit=1e9, clock=looks)
    for share in (0.01, 0.5, 0.9):
        limit, clock = share * looks.now, Clock()
        with pytest.raises(UndecidedError, match=f"not decided within {limit:g} s\nso far: ") as caught:
            compile_book(Target.load("corner"), time_limit=limit, clock=clock)
        assert clock.now <= limit + 3
        assert "at work: two face types" in str(caught.value)
    assert "two face types: infeasible" in str(caught.value)  # the last
    assert "next: two face types, touched" in str(caught.value)


def test_a_time_limit_that_is_not_met_changes_nothing(compiled):
    assert compile_book(Target.load("l3"), time_limit=1e6, clock=Clock()).book == compiled["l3"].book


def test_steps_that_are_used_up_end_a_rung_and_the_next_one_follows(monkeypatch):
    """The ladder goes on where nothing was decided, and the message says so."""
    monkeypatch.setattr(compiling, "RUNG_STEPS", 20)
    monkeypatch.setattr(compiling, "REMEDY_STEPS", 20)
    with pytest.raises(UndecidedError, match="with two face types, roll, across, touched: not decided") as caught:
        compile_unhurried(Target.load("plate2x2"))
    assert "with six face types, roll: not decided" in str(caught.value)


def test_less_effort_leaves_more_undecided(compiled):
    """And is no other search: what is found, is found again."""
    with pytest.raises(UndecidedError, match="with two face types, roll, across, touched: not decided"):
        compile_unhurried(Target.load("plate2x2"), effort=5e-6)
    assert compile_unhurried(Target.load("l3"), effort=0.5).book == compiled["l3"].book


def test_time_that_ends_while_a_remedy_is_sought_leaves_the_reason(monkeypatch):
    looks = Clock()
    asked = sensing("l3", faces="one", roll=False)
    with pytest.raises(InfeasibleError, match="are enough: a book of 2 letters does it"):
        compile_book(asked, time_limit=1e9, clock=looks)
    ends = set()
    for limit in range(1, int(looks.now), max(1, int(looks.now) // 15)):
        with pytest.raises((InfeasibleError, UndecidedError)) as caught:
            compile_book(asked, time_limit=limit, clock=Clock())
        ends.add(type(caught.value))
    assert ends == {InfeasibleError, UndecidedError}


def test_all_choices_of_joins_of_a_line():
    books = list(all_books(Target.load("line4"), time_limit=float("inf")))
    joins = [frozenset(made.joins) for made in books]
    assert len(set(joins)) == len(joins) == 5
    assert [len(choice) for choice in joins] == sorted(map(len, joins))
    assert frozenset({"1+1->2", "2+2->4"}) in joins
    assert sorted(made.letters for made in books) == [2, 2, 2, 3, 3]
    among = list(all_books(Target.load("line4"), joins=["1+1", "1+2", "1+3"], breaks=False, time_limit=float("inf")))
    assert [made.joins for made in among] == [("1+1->2", "2+1->3", "3+1->4")]


def test_a_target_that_is_grown_has_no_choice_of_joins():
    with pytest.raises(ValueError, match="'cube3', of 27 cubes, is grown from a seed, so that there is no choice"):
        next(all_books(Target.load("cube3")))


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"joins": ["1+9"]}, "'1+9' makes no part of target 'line4'; there are 1+1->2"),
        ({"joins": ["first"]}, "'first' is none"),
        ({"joins": []}, "allows none"),
        ({"joins": ["1+2"]}, "infeasible with these joins"),
        ({"joins": ["1+1", "1+2"]}, "infeasible with these joins"),
        ({"max_letters": 1}, "a book needs at least 2"),
        ({"max_letters": 16}, "it must be 2 to 15"),
        ({"time_limit": 0}, "it must be more than 0"),
        ({"effort": 0}, "effort = 0; it must be more than 0"),
    ],
)
def test_bad_requests(arguments, says):
    with pytest.raises(ValueError, match=re.escape(says)):
        compile_unhurried(Target.load("line4"), **arguments)


def test_joins_do_not_go_with_growth_from_a_seed():
    with pytest.raises(ValueError, match="grown from a seed"):
        compile_unhurried(replace(Target.load("line4"), seed=(0, 0, 0)), joins=["1+1"], breaks=False)


def test_the_command_writes_a_book_that_checks(tmp_path):
    done = run_here("rules", "compile", "l3", "--out", "made.toml", cwd=tmp_path)
    assert done.code == 0, done.err
    assert "l3: 2 letters, the fewest of their kind; " in done.out
    assert "1 letter, any joins: none does, all were tried" in done.out
    assert len(RuleBook.load(tmp_path / "made.toml").letters) == 2
    assert run_here("rules", "check", "made.toml", cwd=tmp_path).code == 0
    assert yields_of(derive(RuleBook.load(tmp_path / "made.toml"))).holding > 0.9
    assert "yield 0.98 (no breaks), 0.84 (break = 0.0001) (60 cubes, 2,000 tu, join = 0.0001" in done.out
    assert "all 7 sets of joins (a longer search of these sets gains nothing" in done.out
    assert "warning" not in done.err
    given = run_here("rules", "compile", "line4", "--joins", "1+1, 2+2", "--json", cwd=tmp_path).json
    assert (given["letters"], given["gain"]) == (2, None)


def test_the_command_warns_of_a_low_yield(tmp_path):
    """And says what a longer search could gain: with few steps, sets that yield more are not decided."""
    said = run_here("rules", "compile", "screw", "--joins", "1+1, 1+2, 1+3", "--out", "made.toml", cwd=tmp_path)
    assert "warning: yield below 0.1 (no breaks, break = 0.0001)" in said.err
    (tmp_path / "L.toml").write_text('layers = ["#..\\n#..\\n###"]\n')
    hasty, usual = (
        run_here("rules", "compile", "L.toml", "--effort", effort, "--json", cwd=tmp_path).json for effort in (0.05, 1)
    )
    assert usual["yields"]["no_breaks"] >= hasty["yields"]["no_breaks"]
    assert (hasty["effort"], usual["gain"]) == (0.05, 0.0)


def test_the_time_limit_counts_from_the_start_of_the_process(tmp_path, monkeypatch):
    """And leaves some for its end: the command ends in time, not the search alone."""
    asked = {}

    def compile_late(_, **arguments):
        asked.update(arguments)
        raise UndecidedError

    monkeypatch.setattr("kinetics.commands.compile.compile_book", compile_late)
    for started in (0.0, 4.0):
        monkeypatch.setattr("kinetics.commands.compile.time_since_start", lambda started=started: started)
        now = time.monotonic()
        run_here("rules", "compile", "l3", cwd=tmp_path)
        assert now - asked["started"] <= 1.5 * started
        assert time.monotonic() - asked["started"] >= 1.5 * started
    Budget(10.0, clock=lambda: 7.0).check()
    with pytest.raises(TimeoutError):
        Budget(10.0, clock=lambda: 7.0, started=-4.0).check()


@pytest.mark.parametrize("command", ["compile", "check"])
def test_how_long_ago_the_process_began_is_known(command):
    """From the operating system; a command called from Python, as by this test, has no start of its own."""
    code = "import time; time.sleep(0.2); from kinetics.commands.compile import time_since_start as t; print(t())"
    before = time.monotonic()
    done = subprocess.run([sys.executable, "-c", code, "rules", command], capture_output=True, check=True, text=True)
    lasted = time.monotonic() - before
    assert time_since_start() == 0.0
    assert (0.2 <= float(done.stdout) <= lasted + 0.02) == (command == "compile")


def test_the_command_ends_with_the_reason(tmp_path):
    done = run_here("rules", "compile", "plate2x2", "--roll", cwd=tmp_path)
    assert (done.code, done.out) == (2, "")
    assert "infeasible with this sensing (two face types, roll)" in done.err
