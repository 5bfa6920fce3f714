"""Tables by rows and classes of states: as SciPy has them, in C and without it."""

from unittest.mock import patch

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import sparse

from kinetics.native import library, rate_tables
from kinetics.native.rate_tables import RateTable, connected_classes

WAYS = [False, pytest.param(True, marks=pytest.mark.skipif(not library.is_built(), reason="no C kernels"))]


@pytest.fixture(params=WAYS, ids=["without C", "in C"])
def _way(request, monkeypatch):
    monkeypatch.setattr(rate_tables, "is_built", lambda: request.param)


def entries(rng):
    """Up to 40 states, with places that come more than once and rows without entries."""
    n = int(rng.integers(1, 40))
    size = int(rng.integers(0, 4 * n))
    return *rng.integers(0, n, size=(2, size)), rng.standard_normal(size), n


@pytest.mark.usefixtures("_way")
def test_tables_are_those_of_scipy():
    rng = np.random.default_rng(2)
    for _ in range(300):
        rows, columns, values, n = entries(rng)
        table, peer = RateTable.of(rows, columns, values, n), sparse.csr_array((values, (rows, columns)), shape=(n, n))
        peer.sum_duplicates()
        assert_array_equal(table.indptr, peer.indptr)
        assert_array_equal(table.indices, peer.indices)
        assert_allclose(table.data, peer.data, rtol=1e-13, atol=1e-13)
        assert table.nnz == peer.nnz
        assert_array_equal(table.toarray().T, table.transposed().toarray())
        back = table.transposed().transposed()
        for one, other in zip(table, back, strict=True):
            assert_array_equal(one, other)


@pytest.mark.skipif(not library.is_built(), reason="no C kernels")
def test_tables_have_the_same_bits_in_c_and_without():
    rng = np.random.default_rng(3)
    for _ in range(200):
        rows, columns = rng.integers(0, 3, size=(2, 200))  # each place some twenty times
        values = rng.standard_normal(200)
        found = RateTable.of(rows, columns, values, 3)
        with patch.object(rate_tables, "is_built", return_value=False):
            same = RateTable.of(rows, columns, values, 3)
        for one, other in zip(found, same, strict=True):
            assert_array_equal(one, other)


@pytest.mark.usefixtures("_way")
def test_classes_are_those_of_scipy_in_the_order_of_their_first_states():
    rng = np.random.default_rng(4)
    for _ in range(300):
        rows, columns, _, n = entries(rng)
        count, label = connected_classes(rows, columns, n)
        graph = sparse.csr_array((np.ones(rows.size), (rows, columns)), shape=(n, n))
        expected, peer = sparse.csgraph.connected_components(graph, connection="strong")
        assert count == expected == label.max() + 1
        assert_array_equal(label[:, None] == label, peer[:, None] == peer)
        _, first = np.unique(label, return_index=True)
        assert (np.diff(first) > 0).all()


@pytest.mark.usefixtures("_way")
def test_a_long_way_needs_no_recursion():
    n = 200_000
    states = np.arange(n - 1)
    count, label = connected_classes(states, states + 1, n)
    assert count == n
    assert_array_equal(label, np.arange(n))
    count, label = connected_classes(np.append(states, n - 1), np.append(states + 1, 0), n)
    assert count == 1
    assert not label.any()
