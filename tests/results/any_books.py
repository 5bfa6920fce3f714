"""Books of any kind against the compiler's kind: how many letters each target of up to four cubes takes.

    python -m tests.results.any_books [LETTERS ...]

asks, for books of so many letters (1 2), whether any is right, for all senses that the compiler tries and all ways in
which it turns the cubes. What results/rules/any_books.csv holds is not asked again, but for what is open. A minute a
target for one and two letters; for three, asked about senses that the compiler says are not enough, far more.
"""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

from kinetics.assembly import check
from kinetics.assembly.compiler import Target, compile_book
from kinetics.assembly.compiler.compiling import LADDER
from kinetics.assembly.compiler.orientation import turnings
from kinetics.assembly.compiler.result import sensing
from kinetics.assembly.rules.conditions import Senses
from kinetics.assembly.structure import Structure
from kinetics.support.output import write_whole
from tests.helpers.book_oracle import Oracle
from tests.helpers.polycubes import SHAPES
from tests.results.studies import ROOT

STORE = ROOT / "results" / "rules" / "any_books.csv"
MOST = 200_000  # conflicts of the solver


class Case(NamedTuple):
    """A target under some senses, its cubes turned in one of the ways tried, and what the compiler says.

    compiler : the fewest letters of its kind of books, `infeasible`, or `` where it had found a book before
    """

    target: str
    senses: Senses
    turn: int
    structure: Structure
    compiler: str


class Row(NamedTuple):
    """Whether there is a book of so many letters: `none`, `found` (and it is right) or `open`."""

    target: str
    senses: str
    turn: int
    compiler: str
    letters: int
    any_book: str
    conflicts: int


def cases(name: str) -> Iterator[Case]:
    """All that the compiler tries for a target, up to the senses with which it finds a book."""
    target = Target(name, SHAPES[name])
    made = compile_book(target, time_limit=float("inf"))
    assert made.certificate is not None
    ruled_out = {ruled.senses for ruled in made.certificate.weaker}
    for senses in LADDER:
        tops = turnings(target.positions) if senses.faces == "two" else [None]
        for turn, axes in enumerate(tops):
            structure = replace(target, tops=axes).structure(senses.faces)
            says = "infeasible" if senses in ruled_out else ""
            if senses == made.book.senses and _bare(structure, senses) == _bare(made.book.target, senses):
                says = str(made.letters)
            yield Case(name, senses, turn, structure, says)
        if senses == made.book.senses:
            return


def _bare(structure: Structure | None, senses: Senses) -> Structure:
    assert structure is not None
    return structure.with_letters(("#",) * len(structure)).canonical(senses.faces)


def asked(case: Case, letters: int, most: int = MOST) -> Row:
    """Whether there is a book of so many letters."""
    oracle = Oracle(case.structure, case.senses, True, letters, most)
    found = oracle.finds_one()
    if found and not check(oracle.book).is_correct:
        raise AssertionError(f"{case}: the checker finds fault with a book of {letters} letters: {check(oracle.book)}")
    said = {None: "open", False: "none", True: "found"}[found]
    return Row(case.target, sensing(case.senses), case.turn, case.compiler, letters, said, oracle.conflicts)


def stored() -> list[Row]:
    """What was asked before."""
    if not STORE.exists():
        return []
    with STORE.open(encoding="utf-8", newline="") as file:
        return [
            Row(each["target"], each["senses"], int(each["turn"]), each["compiler"], int(each["letters"]),
                each["any_book"], int(each["conflicts"]))
            for each in csv.DictReader(file)
        ]  # fmt: skip


def written(rows: Iterable[Row]) -> None:
    """Store the rows."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(Row._fields)
    table.writerows(sorted(rows, key=lambda row: (list(SHAPES).index(row.target), row.letters)))
    write_whole(STORE, text.getvalue())


def main(numbers: Iterable[int]) -> None:
    """Ask for each number of letters in turn; where there is a book, more letters do as well."""
    rows = stored()
    known = {(*row[:3], row.letters) for row in rows if row.any_book != "open"}
    done = {row[:3] for row in rows if row.any_book == "found"}
    for letters in numbers:
        for name in SHAPES:
            for case in cases(name):
                key = (case.target, sensing(case.senses), case.turn)
                is_idle = letters > 2 and case.compiler != "infeasible"
                if is_idle or key in done or (*key, letters) in known:
                    continue
                rows = [row for row in rows if (*row[:3], row.letters) != (*key, letters)]
                rows.append(asked(case, letters))
                if rows[-1].any_book == "found":
                    done.add(key)
                written(rows)
                print(*rows[-1], flush=True)  # noqa: T201  a command


if __name__ == "__main__":
    main([int(number) for number in sys.argv[1:]] or [1, 2])
