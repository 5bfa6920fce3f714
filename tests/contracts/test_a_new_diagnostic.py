"""A diagnostic is added by one file and one line: the contract tests it, and sees a bad one."""

import pytest
from scratch import add_line, run_contract, scratch_copy

NEW = '''"""Do runs come in pairs?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.estimating.diagnosing.groups import Groups, SpreadDiagnostic
from calibration.estimating.diagnosing.diagnosed_runs import DiagnosedRuns


@dataclass(frozen=True)
class Parity(SpreadDiagnostic):
    """Pearson's test of one rate in even and odd runs: a diagnostic made for this test, which has no other use."""

    name = "newmember"
    question = "Is a rate the same in even and in odd runs?"
    single = "all its exposure is in runs of one kind"
    remedy = "look for what alternates"
    measured = "size 5 % and power of BetweenRuns, at as many events"

    def groups(self, diagnosed: DiagnosedRuns) -> Groups:
        """Even and odd runs."""
        kinds = [np.full(c.path.times.size + 1, i % 2) for i, c in enumerate(diagnosed.clocked)]
        return Groups(["even", "odd"], *diagnosed.grouped(kinds, 2))
'''
SILENT = '''
    def unseen(self, diagnosed: DiagnosedRuns, channel: int) -> str:
        """Nothing to say, even of no events."""
        return ""

    def judge(self, diagnosed: DiagnosedRuns, channel: int) -> Judged:
        """A smallest p-value that is never small."""
        return Judged(0.0, 1.0, "nothing", "nothing", lambda ax: ax)
'''
ROOM = "calibration/estimating/diagnosing"


@pytest.fixture
def copy(tmp_path):
    found = scratch_copy(tmp_path)
    add_line(found / ROOM / "__init__.py", "import Rebinding", f"from {ROOM.replace('/', '.')}.parity import Parity")
    return found


def test_a_new_diagnostic_passes_the_contract(copy):
    (copy / ROOM / "parity.py").write_text(NEW)
    code, said = run_contract(copy, "test_diagnostics.py", "-k", "newmember")
    assert code == 0, said
    assert "7 passed" in said


def test_a_wrong_one_does_not(copy):
    """Control: p = 1 where there are no events, and the same p whatever the runs."""
    named = NEW.replace(
        "from calibration.estimating.diagnosing.groups",
        "from calibration.estimating.diagnosing.base import Judged\nfrom calibration.estimating.diagnosing.groups",
    )
    (copy / ROOM / "parity.py").write_text(named + SILENT)
    code, said = run_contract(copy, "test_diagnostics.py", "-k", "newmember", "-rf", "--tb=no")
    assert code == 1, said
    for case in ("test_silence_is_not_agreement", "test_sound_runs_fail_as_often_as_they_may"):
        assert f"::{case}[newmember]" in said, f"{case} did not fail: {said}"
