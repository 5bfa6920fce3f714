"""The costs in docs/which_method.md are the stored ones."""

import pytest

from tests.results.cost_table import PAGE, SHOWN, table, written


def test_the_table_is_that_of_the_stored_results():
    text = PAGE.read_text("utf-8")
    assert written(text) == text
    assert table().count("\n") == len(SHOWN) + 2
    assert written(text.replace("10,000 runs", "11,000 runs")) == text  # the control
    with pytest.raises(ValueError, match="has no block"):
        written("")
