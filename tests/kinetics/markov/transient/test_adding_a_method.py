"""A solving method is added by one file, its import and its line in the tuple: then the contract tests it."""

import os
import subprocess
import sys

from scratch import add_line, run_contract, scratch_copy

MEMBER = '''"""Krylov-like action of the matrix exponential by scipy."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kinetics.markov.transient.base import SolvingMethod
from kinetics.markov.transient.distribution import Distribution
from kinetics.markov.transient.states import reachable
from kinetics.support.memory import check_memory


@dataclass(frozen=True)
class ExponentialAction(SolvingMethod):
    """From one time to the next by `expm_multiply`, and once more in two halves for an estimate of the error."""

    name: ClassVar[str] = "newmember"

    max_states: int = 1000

    def distribution(self, network, start, grid):
        from scipy.sparse.linalg import expm_multiply

        space = reachable(network, start, max_states=self.max_states)
        check_memory("all states", 8.0 * len(space) * grid.size, "ask for fewer times")
        forward = space.generator().T.tocsr()
        events = abs(forward.diagonal()).max() * grid[-1]
        if events > 1e4:
            raise ValueError("the chain is too stiff; use the method 'dense'")
        one = two = np.eye(1, len(space))[0]
        rows, gap = [], 0.0
        for length in np.diff(grid, prepend=0.0):
            if length and forward.nnz:
                one = expm_multiply(forward * length, one)
                two = expm_multiply(forward * (length / 2), expm_multiply(forward * (length / 2), two))
            gap = max(gap, abs(one - two).sum())
            rows.append(np.maximum(one, 0.0))
        error = 4.0 * gap + 1e-13 * (1.0 + events)
        return Distribution(space, grid, np.array(rows), float(error), is_bound=False)
'''


def run(folder, text, chosen):
    """Those tests of the contract that are chosen, in a copy that has the new method."""
    copy = scratch_copy(folder)
    (copy / "kinetics/markov/transient/action.py").write_text(text, encoding="utf-8")
    methods = copy / "kinetics/markov/transient/methods.py"
    add_line(methods, "import FiniteStateProjection", "from kinetics.markov.transient.action import ExponentialAction")
    overflow = ("-W", "ignore:overflow encountered:RuntimeWarning")
    return run_contract(copy, "test_solving.py", "-k", chosen, *overflow, plain=True)


def test_a_method_is_added_by_one_file_and_its_line(tmp_path):
    code, said = run(tmp_path, MEMBER, "newmember or differ")
    assert code == 0, said
    asked = "from kinetics.predicting.methods import names; from kinetics.trust.accuracy.curves import CURVES; "
    asked += "assert 'newmember' in names(); assert 'newmember' in [curve.name for curve in CURVES]"
    subprocess.run([sys.executable, "-c", asked], cwd=tmp_path, env=os.environ | {"PYTHONPATH": "."}, check=True)


def test_a_method_that_claims_no_error_fails_the_contract(tmp_path):
    right = "error = 4.0 * gap + 1e-13 * (1.0 + events)"
    assert right in MEMBER
    code, said = run(tmp_path, MEMBER.replace(right, "error = 1e-300"), "newmember and digits")
    assert code == 1
    assert "test_the_error_covers_the_distance_from_a_hundred_digits[newmember-" in said
