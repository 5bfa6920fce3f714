"""Network-free runs under class rates: break models against the expanded network, draws from the evidence."""

from math import sqrt

import numpy as np
import pytest
from derived_books import derived
from grown_paths import path_of
from scipy.stats import binom

from kinetics import Transient, solve
from kinetics.networkfree import grow
from kinetics.rates import ClassRates

LINE = derived("line4")
JOIN = {"join": {"rate": 4e-3}}
SHAPES = {"first-order": {}, "collision": {"alpha": 1.4}, "collision-wall": {"alpha": 1.4, "wall": 3.0}}


def rates(model, break_=2e-3):
    """Joins of one constant, breaks of another, by a break model."""
    return ClassRates(classes=JOIN | {"break": {"rate": break_}}, breaks={"model": model, "shape": SHAPES[model]})


@pytest.mark.parametrize("model", SHAPES)
def test_breaks_agree_with_the_master_equation_of_the_expanded_network(model):
    """Mean counts of eight cubes at two times; a body that counts as its own partner is seen."""
    times, runs = [20.0, 100.0], 1500
    known = rates(model, 2e-3 if model != "first-order" else 2e-2)
    network = known.apply(LINE)
    exact = solve(network, Transient(), [8, 0, 0, 0], times)
    made = grow(LINE.book, known, 8, times[-1], runs, seed=1)
    counts = np.stack([path_of(run, LINE).at(times) for run in made.runs])
    error = exact.sd() / sqrt(runs)
    assert (np.abs(counts.mean(axis=0) - exact.mean()) < 5 * error + 1e-9).all()
    if model == "collision":
        own = {f"break {n} f1 + {m} f1": 1 + 0.15 * (n + m) for n, m in ((1, 1), (1, 2), (1, 3), (2, 2))}
        wrong = known.replace(classes=known.classes | {key: known.classes["break"].replace(rate=2e-3 * f)
                                                for key, f in own.items()}
        )  # fmt: skip
        mistaken = solve(wrong.apply(LINE), Transient(), [8, 0, 0, 0], times)
        assert (np.abs(counts.mean(axis=0) - mistaken.mean()) > 5 * error).any()


def test_a_lone_structure_is_not_broken_by_itself():
    alone = {LINE.structures["quadmer"]: 1}
    assert not grow(LINE.book, rates("collision", 1.0), alone, 100.0).runs[0].times.size
    assert grow(LINE.book, rates("collision-wall", 1.0), alone, 100.0).runs[0].times.size


def test_runs_are_spread_over_draws_of_the_rates():
    """Two cubes that join at a rate from Gamma(n + 1/2, exposure): the chance that they do not, in closed form."""
    known = ClassRates(classes={"join": {"rate": 2e-3, "events": 2, "exposure": 1e3}, "break": {"rate": 0.0}})
    end, runs = 400.0, 2000
    apart = {}
    for draws in (runs, 0):
        made = grow(LINE.book, known, 2, end, runs, seed=3, draws=draws)
        apart[draws] = sum(run.times.size == 0 for run in made.runs)
    (ways,) = (sum(w.values()) for event, w in LINE.events.items() if event.before == (0, 0))
    chance = (1 + ways * end / 1e3) ** -2.5
    for seen, p in ((apart[runs], chance), (apart[0], np.exp(-2e-3 * ways * end))):
        assert min(binom.cdf(seen, runs, p), binom.sf(seen - 1, runs, p)) > 1e-6
    assert min(binom.cdf(apart[0], runs, chance), binom.sf(apart[0] - 1, runs, chance)) < 1e-6


def test_draws_without_a_file_are_refused():
    with pytest.raises(ValueError, match="give ClassRates, or leave draws out"):
        grow(LINE.book, lambda _: 1.0, 2, 1.0, draws=3)


def test_models_by_species_are_refused():
    known = rates("first-order").replace(breaks=rates("collision").breaks.replace(model="collision-species"))
    with pytest.raises(ValueError, match="weights partners by species, which differ between books"):
        grow(LINE.book, known, 4, 1.0)
    known = rates("collision").replace(breaks=rates("collision").breaks.replace(shape={}))
    with pytest.raises(ValueError, match="has the shape parameters alpha; none came"):
        grow(LINE.book, known, 4, 1.0)


def test_predict_reads_rates_by_class(wellmixed_here, tmp_path):
    """The seed of a seeded book is there; means are those of the network under these rates."""
    known = ClassRates(
        classes={"join": {"rate": 2e-4}, "break": {"rate": 1e-5}},
        breaks={"model": "collision", "shape": SHAPES["collision"]},
    )
    known.save(tmp_path / "classes.toml")
    command = ["predict", "line4", "--rates", "classes.toml", "--times", "50", "--method", "transient", "--json"]
    made = wellmixed_here(*command, "--cubes", "8", cwd=tmp_path).json
    exact = solve(known.apply(LINE), Transient(), [8, 0, 0, 0], [50.0])
    assert made["mean"][0] == pytest.approx(exact.mean()[0].tolist())
    assert made["interval"] is None
    assert made["breaks"] == {"model": "collision", "shape": SHAPES["collision"]}
    command = [
        "predict",
        "jack13",
        "--rates",
        "classes.toml",
        "--times",
        "1",
        "--runs",
        "10",
        "--show",
        "seed",
        "--json",
    ]
    made = wellmixed_here(*command, "--cubes", "30", cwd=tmp_path).json
    assert made["initial"]["seed"] == 1
    failed = wellmixed_here(*command, "--cubes", "30", "--tank", "2", "2", "2", cwd=tmp_path)
    assert failed.code == 2
    assert "do not state the tank in which they were measured" in failed.err
