"""Hostile BNGL and Antimony files: nothing of what is handed on creates, changes or reads a file."""

import os
import shutil

import pytest

from tests.helpers.canaries import before, campaign
from tests.helpers.canary_judges import evaluated, imports
from tests.helpers.canary_runs import ran

SEED = 0


def test_2000_hostile_files(tmp_path):
    counts, failures, _ = campaign(tmp_path, SEED, 0, 2000)
    assert failures == []
    assert sum(counts.values()) == 2000
    for suffix in (".bngl", ".ant"):  # the power: a share of both, or the door is shut to all
        assert min(counts[suffix, "harmless"], counts[suffix, "refused"]) > 50, counts


def test_the_filter_of_before_let_some_through(tmp_path):
    """The control: the same files past a filter of lines, as they once went."""
    counts, failures, _ = campaign(tmp_path, SEED, 0, 500, before)
    assert counts[".bngl", "through"] > 3
    assert counts[".ant", "through"] > 30
    assert any("touch" in why for _, _, why in failures)


@pytest.mark.parametrize(
    ("text", "is_seen"),
    [
        ("begin model\nsetOption('x',1)\nend model", True),
        ("begin parameters\nsetOption('x',1)\nend parameters", False),
        ("begin parameters\nend \\\nparameters\nsystem('x')", True),
        ("begin parameters\n# end \\\nsystem('x')\nend parameters", False),
        ("0\nsystem('x')", False),
        ("Begin actions\nsystem('x')", True),
        ("beginactions\n1 system('x')\nend  actions # y", True),
        ("parameter k system('x')", False),
    ],
)
def test_what_bionetgen_evaluates(text, is_seen):
    """By hand, after its source: the judge of the campaign."""
    assert bool(evaluated(text, skips_actions=False)) == is_seen


@pytest.mark.parametrize(
    ("text", "older", "newer"),
    [
        ('import "x"', True, True),
        ("important = 3", False, False),
        ('k is "import"', False, False),
        ("1e3import", True, True),
        ("A -oimport", True, True),
        ("/*/ import */", False, False),
        ("# x\\\nimport", True, True),
        ('A is "x\\" import "', True, False),
        ("A notes ```import```", False, False),
        ('Import\n "x"', True, True),
        ("Import: A -> B", False, False),
    ],
)
def test_what_antimony_imports(text, older, newer):
    assert (imports(text, is_newer=False), imports(text, is_newer=True)) == (older, newer)


@pytest.mark.validate
@pytest.mark.skipif(shutil.which("perl") is None or "BNGPATH" not in os.environ, reason="BioNetGen is not installed")
def test_the_programs_themselves_touch_nothing(tmp_path):
    """The programs run on what is harmless by our judge, and, as the control, on some of what got through before."""
    pytest.importorskip("antimony")
    _, _, given = campaign(tmp_path, SEED, 0, 1000)
    assert ran(tmp_path, given) == []
    _, failures, given = campaign(tmp_path, SEED, 0, 400, before)
    done = ran(tmp_path, {number: given[number] for number, *_ in failures})
    assert {why for _, why in done} == {"created or changed a file", "read a file"}
