"""Who answers the points: the same numbers from a Dask cluster, and a worker that dies is told in words."""

import os

import numpy as np
import pytest
from distributed import LocalCluster

from kinetics import Network, scan
from kinetics.scanning.crews import crew, results


def test_a_dask_cluster_gives_the_same_numbers():
    network = Network.from_text("A -> 0, k\nA = 10", k=1.0)
    asked = ({"k": [0.5, 1.0, 2.0, 4.0, 8.0]}, ["E[A] @ 0.3", "P=? [ F<=0.3 A < 8 ]"])
    here = scan(network, *asked, max_states=0, runs=20)
    with LocalCluster(n_workers=1, processes=False, dashboard_address=None) as cluster:
        there = scan(network, *asked, max_states=0, runs=20, scheduler=cluster.scheduler_address)
    for what in ("value", "low", "high"):
        np.testing.assert_array_equal(here.numbers(what), there.numbers(what))


def die(number):
    if number == 3:
        os._exit(1)
    return number


def test_a_worker_that_dies_is_told_and_one_that_does_not_is_heard():
    with crew(2, None) as pool:
        assert sorted(results(pool, die, [(1,), (2,)])) == [(0, 1), (1, 2)]
    with pytest.raises(ChildProcessError, match="start again with fewer workers"), crew(2, None) as pool:
        list(results(pool, die, [(3,)]))
