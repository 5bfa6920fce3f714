"""The mutants that once lived are where they were, and their tests see them."""

import json

import pytest

from tests.mutation.judging import ROOT, copy_of
from tests.mutation.known import STORED, Known, is_seen, known


@pytest.mark.parametrize("mutant", known(), ids=lambda mutant: mutant.name)
def test_a_known_mutant_has_its_place_and_its_test(mutant):
    assert (ROOT / mutant.module).read_text("utf-8").count(mutant.before) == 1
    file, _, test = mutant.test.partition("::")
    assert f"def {test}(" in (ROOT / file).read_text("utf-8")


def test_all_of_them_were_killed():
    """What `python -m tests.mutation.known` has kept."""
    assert json.loads(STORED.read_text("utf-8")) == dict.fromkeys((one.name for one in known()), "killed")


@pytest.mark.validate
@pytest.mark.parametrize("mutant", known(), ids=lambda mutant: mutant.name)
def test_a_known_mutant_is_seen(mutant):
    with copy_of() as tree:
        assert is_seen(mutant, tree)


def test_a_mutant_that_nobody_sees_lives():
    """The control: of a line that its test does not reach."""
    line = "    return _book_of(rules, written and"
    other = Known("", "mechsim/runs/record.py", line, f" {line[1:]}", known()[-1].test)
    with copy_of() as tree:
        assert not is_seen(other, tree)
        with pytest.raises(ValueError, match="expected it once"):
            is_seen(Known("", "mechsim/runs/record.py", "nowhere", "", other.test), tree)
