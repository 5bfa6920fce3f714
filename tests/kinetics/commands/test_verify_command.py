"""`wellmixed trust verify`: what it shows, and its exit code where a sampler is wrong."""

import json
from typing import ClassVar

import numpy as np

from kinetics import Direct
from kinetics.commands import verify
from kinetics.runs import Ensemble

LINE = ["trust", "verify", "line4", "--rates", "table3", "--cubes", "12", "--times", "60", "500", "--runs", "2000"]


class Twice(Direct):
    """Every run twice."""

    name: ClassVar[str] = "twice"

    def simulate(self, network, initial, times, runs=1000, seed=0, **options):
        made = super().simulate(network, initial, times, runs=(runs + 1) // 2, seed=seed, **options)
        return Ensemble(network, made.times, np.repeat(made.counts, 2, axis=0)[:runs])


def test_for_people(wellmixed_here, tmp_path):
    done = wellmixed_here(*LINE, "--method", "ssa", cwd=tmp_path)
    assert done.code == 0, done.out + done.err
    for text in ("itself, from time to time", "0 failed", "every run twice", "runs that detect 1 %", "1+1->2"):
        assert text in done.out


def test_as_json(wellmixed_here, tmp_path):
    done = wellmixed_here(*LINE, "--no-power", "--json", cwd=tmp_path)
    assert done.code == 0, done.out + done.err
    data = json.loads(done.out)
    assert data["failed"] == 0
    assert data["times"] == [60, 500]
    assert all(pair["agrees"] for pair in data["solvers"]["pairs"])
    assert {found["method"] for found in data["samplers"]} == set(verify.METHODS)
    assert all(found["passed"] and found["power"]["rates"] for found in data["samplers"])


def test_a_wrong_sampler_is_exit_code_1(wellmixed_here, tmp_path, monkeypatch):
    monkeypatch.setitem(verify.METHODS, "ssa", Twice)
    done = wellmixed_here(*LINE, "--method", "ssa", "--no-power", "--json", cwd=tmp_path)
    assert done.code == 1
    data = json.loads(done.out)
    assert data["failed"] == 1
    assert "repeated runs" in {failure["check"] for failure in data["samplers"][0]["failures"]}


def test_times_must_not_begin_at_0(wellmixed_here, tmp_path):
    done = wellmixed_here(*LINE[:7], "--times", "0", "5", cwd=tmp_path)
    assert done.code == 2
    assert "times begin at 0" in done.err
