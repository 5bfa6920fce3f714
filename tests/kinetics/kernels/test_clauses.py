"""The solver of clauses against a trial of all values."""

from itertools import product

import numpy as np
import pytest

from kinetics.kernels.clauses import OPEN, SATISFIABLE, UNSATISFIABLE, solve

ENOUGH = 100_000


def solved(n, clauses, assumed=(), most=ENOUGH):
    literals, starts = np.zeros(1 << 16, np.int64), np.zeros(1 << 12, np.int64)
    flat = [literal for clause in clauses for literal in clause]
    literals[: len(flat)] = flat
    starts[1 : len(clauses) + 1] = np.cumsum([len(clause) for clause in clauses])
    values, phase = np.zeros(2 * n, np.int8), np.zeros(n, np.bool_)
    status, _, _ = solve(literals, starts, len(clauses), np.array(assumed, np.int64), np.zeros(n), phase, values, most)
    return status, values


def has_values(n, clauses):
    return any(
        all(any(chosen[literal >> 1] != literal & 1 for literal in clause) for clause in clauses)
        for chosen in product((0, 1), repeat=n)
    )


def pigeons(n, holes):
    """None shares its hole; without values where there are more than holes."""
    each = [[2 * (p * holes + h) for h in range(holes)] for p in range(n)]
    apart = [[each[p][h] ^ 1, each[q][h] ^ 1] for h in range(holes) for p in range(n) for q in range(p)]
    return each + apart


def test_random_clauses_as_by_trying_all_values():
    rng = np.random.default_rng(0)
    counts = [0, 0]
    for _ in range(500):
        n, sizes = 8, rng.choice([1, 2, 3], int(rng.integers(20, 45)), p=[0.05, 0.1, 0.85])
        clauses = [[int(2 * v + rng.integers(2)) for v in rng.choice(n, size, replace=False)] for size in sizes]
        assumed = [int(2 * v + rng.integers(2)) for v in rng.choice(n, int(rng.integers(3)), replace=False)]
        asked = [*clauses, *([literal] for literal in assumed)]
        status, values = solved(n, clauses, assumed)
        truth = has_values(n, asked)
        assert status == (SATISFIABLE if truth else UNSATISFIABLE)
        assert not truth or all(any(values[literal] == 1 for literal in clause) for clause in asked)
        counts[truth] += 1
    assert min(counts) > 100


@pytest.mark.parametrize(("n", "status"), [(6, SATISFIABLE), (7, UNSATISFIABLE)])
def test_pigeons(n, status):
    assert solved(n * 6, pigeons(n, 6))[0] == status


def test_conflicts_that_are_used_up_leave_it_open():
    assert solved(7 * 6, pigeons(7, 6), most=5)[0] == OPEN
