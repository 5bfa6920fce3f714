"""Certificates of compiled books: true ones hold, and every kind of false claim is found."""

import ast
import json
import subprocess
import sys
from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import pytest
from command_line import run_here

from kinetics.assembly import RuleBook
from kinetics.assembly.checking.certificate import certified
from kinetics.assembly.compiler import Target, compile_book
from kinetics.assembly.rules.writing import written

MOST_LINES = 300


@pytest.fixture(scope="module")
def compiled():
    """A book of three letters whose cubes need all senses of two face types."""
    made = compile_book(Target.load("plate2x2"), time_limit=float("inf"))
    return made.book, json.loads(json.dumps(made.certificate.as_json()))


def false(verdicts):
    return [verdict.claim for verdict in verdicts if verdict.holds is False]


def test_what_the_compiler_claims_holds(compiled):
    verdicts = certified(*compiled)
    assert all(verdict.holds for verdict in verdicts)
    assert sum("letters, whatever its joins" in verdict.claim for verdict in verdicts) == 2
    assert sum("pairs of situations" in verdict.claim for verdict in verdicts) == 7


def test_books_with_their_own_joins_alone(tmp_path):
    made = compile_book(Target.load("line4"), joins=["1+1", "1+2", "1+3", "2+2"], time_limit=float("inf"))
    claims = made.certificate.as_json()
    assert (claims["letters"], claims["any_joins"]) == (3, False)
    assert all(verdict.holds for verdict in certified(made.book, claims))
    claims["any_joins"] = True  # two letters do with other joins
    assert (
        false(certified(made.book, claims))
        == [claim for claim in false(certified(made.book, claims)) if "2 letters, whatever its joins" in claim]
        != []
    )


def test_another_book_and_other_numbers_are_seen(compiled):
    book, claims = compiled
    assert false(certified(RuleBook.load("line4"), claims))[0] == "the certificate is of this book"
    assert "the book has 2 letters" in false(certified(book, claims | {"letters": 2}))
    assert "the book makes 2 joins" in false(certified(book, claims | {"joins": claims["joins"][1:]}))


def test_a_book_that_lacks_a_rule_is_seen(compiled):
    """Each rule by itself; those of bonds also where the certificate names the mutilated book."""
    book, claims = compiled
    for kind, rules in book.rules.items():
        for rule in rules:
            mutant = replace(book, **{kind: tuple(other for other in rules if other != rule)})
            assert false(certified(mutant, claims))[0] == "the certificate is of this book"
            if kind == "combine":
                assert false(certified(mutant, claims | {"fingerprint": mutant.fingerprint})), rule.rule


def test_more_letters_than_it_takes_are_seen(compiled):
    """The same book with a letter that nothing uses: that three were tried is missing, or false."""
    book, claims = compiled
    idle = replace(book, letters=(*book.letters, "z"))
    claims = claims | {"letters": 4, "fingerprint": idle.fingerprint}
    assert false(certified(idle, claims)) == ["all fewer letters were tried"]
    tally = [*claims["exhausted"], {"letters": 3, "steps": 1}]
    assert not all(verdict.holds for verdict in certified(idle, claims | {"exhausted": tally}, 10_000))


def test_a_false_tally_is_seen(compiled):
    """Fewer tried than claimed, and a number of letters that does."""
    book, claims = compiled
    assert false(certified(book, claims | {"exhausted": claims["exhausted"][1:]})) == ["all fewer letters were tried"]
    line = compile_book(Target.load("line4"), time_limit=float("inf"))
    claims = line.certificate.as_json()
    claims["exhausted"] = [{"letters": n, "steps": 1} for n in (1, 2)]
    assert [claim for claim in false(certified(line.book, claims)) if "no book of 2 letters" in claim]


def test_the_checker_is_small_and_knows_no_compiler():
    import kinetics.assembly.checking.book_search as search
    import kinetics.assembly.checking.certificate as checker

    code = "import sys, kinetics.assembly.checking.certificate; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert checker.__name__ in loaded
    assert not [name for name in loaded if name.startswith("kinetics.assembly.compiler")]
    assert sum(map(lines_of_code, (search, checker))) < MOST_LINES


def lines_of_code(module):
    """Without comments, docstrings and empty lines."""
    text = Path(module.__file__).read_text(encoding="utf-8")
    written = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            written |= set(range(node.lineno, node.end_lineno + 1))
    lines = enumerate(text.splitlines(), 1)
    return sum(n not in written and line.strip() != "" and not line.strip().startswith("#") for n, line in lines)


def test_situations_that_can_be_told_apart_are_seen(compiled):
    """Each change of a situation makes it another one: what must not bond does something else."""
    book, claims = compiled
    claims = claims | {"is_fewest": False, "exhausted": []}  # searched for elsewhere
    for each in claims["weaker_senses"]:
        for change, holds in ((None, True), (_swapped, False), (_alike, False), (_none, False)):
            changed = deepcopy(each)
            if change is not None:
                change(changed["situations"][0])
            verdicts = certified(book, claims | {"weaker_senses": [changed]})
            assert all(verdict.holds for verdict in verdicts) is holds, (each["senses"], change)
    stronger = deepcopy(claims["weaker_senses"][0])
    stronger["senses"] |= book.senses.as_dict()  # with these there is a book
    assert false(certified(book, claims | {"weaker_senses": [stronger]}))


def _swapped(situation):
    """What must bond and what must not, exchanged."""
    for pair in situation["pairs"]:
        pair["must"], pair["must_not"] = [pair["must_not"]] * 2, pair["must"][0]


def _alike(situation):
    """What must not bond is what must."""
    for pair in situation["pairs"]:
        pair["must_not"] = pair["must"][0]


def _none(situation):
    """No pair at all."""
    situation["pairs"] = []


def test_cubes_in_one_place_are_no_situation(compiled):
    """What cannot happen says nothing of what must not."""
    book, claims = compiled
    other = deepcopy(claims)
    pair = other["weaker_senses"][0]["situations"][0]["pairs"][0]
    pair["must_not"] = {"parts": [pair["must"][0]["parts"][0]] * 2, "docking": [0, 0]}
    with pytest.raises(ValueError, match="overlap"):
        certified(book, other)


def test_few_steps_decide_nothing(compiled):
    verdicts = certified(*compiled, most_steps=10)
    assert [verdict.holds for verdict in verdicts if "letters, whatever its joins" in verdict.claim] == [None, None]
    assert not false(verdicts)


@pytest.mark.parametrize(
    "broken",
    [
        {"weaker_senses": [{"senses": {"faces": 9}, "situations": [], "exhausted": []}]},
        {"weaker_senses": [{"senses": {"faces": "two"}}]},
        {"letters": "three"},
        {"weaker_senses": 7},
    ],
)
def test_garbled_certificates_are_refused(compiled, broken):
    book, claims = compiled
    for garbled in (claims | broken, {}, []):
        with pytest.raises(ValueError, match="write it by rules compile"):
            certified(book, garbled)
    with pytest.raises(ValueError, match="such books have no certificate"):
        certified(RuleBook.load("pyramid45"), claims)


def test_the_command(compiled, tmp_path):
    book, claims = compiled
    (tmp_path / "book.toml").write_text(written(book))
    (tmp_path / "claims.json").write_text(json.dumps(claims))
    done = run_here("rules", "certify", "book.toml", "claims.json", cwd=tmp_path)
    assert done.code == 0, done.err
    assert done.out.count("holds: ") == len(certified(book, claims))
    (tmp_path / "claims.json").write_text(json.dumps(claims | {"letters": 2}))
    done = run_here("rules", "certify", "book.toml", "claims.json", "--json", cwd=tmp_path)
    assert done.code == 1
    said = json.loads(done.out)["claims"]
    assert [claim["claim"] for claim in said if not claim["holds"]] == ["the book has 2 letters"]
    (tmp_path / "claims.json").write_text("no json")
    assert run_here("rules", "certify", "book.toml", "claims.json", cwd=tmp_path).code == 2
