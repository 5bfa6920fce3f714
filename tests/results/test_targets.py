"""The table of targets says what is stored, and what is stored of the quick targets comes out again."""

import re

import pytest

from tests.results.target_table import PAGE, QUICK, TARGETS, compiled, filled, stored, timeless


def test_the_table_says_what_is_stored():
    page, found = PAGE.read_text(encoding="utf-8"), stored()
    assert set(QUICK) <= found.keys() <= TARGETS.keys()
    assert filled(page, found) == page
    changed = re.sub(r"\| (\d+) / ", lambda match: f"| {int(match[1]) + 1} / ", page)  # control: other numbers of joins
    assert changed != page
    assert filled(changed, found) == page


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.validate) for name in stored()]
)
def test_what_is_stored_comes_out_again(name):
    assert timeless(compiled(name)) == timeless(stored()[name])
