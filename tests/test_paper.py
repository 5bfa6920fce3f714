"""The paper on this software: what it cites is listed, and what it names is here."""

import re
from pathlib import Path

from tests.results.study_pages import numbers

FOLDER = Path(__file__).parents[1] / "paper"
PAPER, BOOKS = ((FOLDER / name).read_text(encoding="utf-8") for name in ("paper.md", "paper.bib"))
TEXT = PAPER.split("---\n", 2)[2]
CUBES = {"40", "120", "240"}  # of the held-out runs, as test_line4 knows them from their plan


def test_every_source_is_cited_and_listed_once():
    listed = re.findall(r"^@\w+\{(\w+),", BOOKS, re.MULTILINE)
    assert sorted(listed) == sorted(set(re.findall(r"@(\w+)", TEXT)))
    assert BOOKS.count("{") == BOOKS.count("}")


def test_pictures_and_pages_exist():
    named = re.findall(r"\]\(([^)]+)\)", TEXT) + [f"../{name}" for name in re.findall(r"`(docs/[^`]+)`", TEXT)]
    assert named
    assert [name for name in named if not (FOLDER / name).is_file()] == []


def test_its_numbers_are_made_by_the_study():
    assert set(numbers(re.sub("gillespy2", "", TEXT, flags=re.IGNORECASE))) == CUBES


def test_it_is_as_long_as_a_journal_of_software_asks():
    assert 750 <= len(TEXT.split()) <= 1750
