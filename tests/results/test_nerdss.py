"""The page on another group's simulator says what its files hold; geometry and likelihood come out again."""

import re

import numpy as np
import pandas as pd
import pytest

from kinetics.markov.panels import PanelData, PanelLikelihood, PanelRun
from tests.results.nerdss import (
    FITS,
    GRID,
    JUDGED,
    LOST,
    PREDICTED,
    RATES,
    SCORES,
    TABLE,
    WEIGHTS,
    chosen,
    fitted_of,
    judged,
    predicted,
    stored_fits,
    stored_weights,
    summary,
)
from tests.results.nerdss_judge import TIMES, Judge, lost_of
from tests.results.nerdss_models import COLUMNS, SUMS, candidates, fewest_breaks, frame, panel_of, read_runs
from tests.results.nerdss_page import FIGURE, PAGE, figure, filled, scores
from tests.results.nerdss_shapes import PAIRS, Shapes

needs_table = pytest.mark.skipif(not TABLE.exists(), reason="the table of runs is not ours and is not here")


@pytest.fixture(scope="module")
def shapes():
    return Shapes()


@pytest.fixture(scope="module")
def models():
    return candidates(stored_weights())


def test_the_page_says_what_the_files_hold():
    page = PAGE.read_text(encoding="utf-8")
    assert filled(page) == page
    changed = re.sub(r"(?<=\d\.)\d", lambda digit: str((int(digit[0]) + 1) % 10), page)  # control: other decimals
    assert filled(changed) != changed


def test_the_table_of_rates_is_that_of_the_fits():
    fits = stored_fits()
    rows = [(name, key, *row.values()) for name in fits for key, row in fits[name]["parameters"].items()]
    kept = pd.read_csv(RATES)
    assert list(zip(kept["fit"], kept["parameter"], strict=True)) == [row[:2] for row in rows]
    known = np.array([row[2:] for row in rows], dtype=float)
    assert kept[["per_s", "low", "high"]].to_numpy() == pytest.approx(known, rel=1e-5, nan_ok=True)


def test_what_the_verdict_rests_on_follows_from_the_scores():
    for by_run in scores().values():
        for score in by_run.values():
            ratios = np.array(score["lost_seen"]) / score["lost_expected"]
            assert ratios == pytest.approx(score["lost_ratio"], abs=2e-3)
            assert score["rules"]["outside"] == (score["outside"] <= score["outside_allowed"])
            assert score["rules"]["misfit"] == (score["misfit_p"] >= 0.05)
            assert score["rules"]["lost"] == all(0.85 <= ratio <= 1.15 for ratio in ratios[1:])
            assert len(score["outside_where"]) == score["outside"]
            assert score["holds"] == all(score["rules"].values())


def test_shapes_of_part_of_a_dodecahedron(shapes):
    """Connected sets of faces up to rotation: one of 1, 2, 11 and 12 faces, two of 3, five of 4."""
    assert np.bincount(shapes.sizes).tolist() == [0, 1, 1, 2, 5, 9, 20, 13, 12, 5, 3, 1, 1]
    assert sorted(shapes.number) == sorted(m for m in range(1, 4096) if len(shapes.parts(shapes.faces(m))) == 1)
    assert shapes.dockings[0, 0].total() == 25  # any of five edges at any of five
    eleven = shapes.sizes.tolist().index(11)
    assert shapes.dockings[0, eleven].total() == 25  # the hole has five edges
    assert (eleven, eleven) not in shapes.dockings
    assert shapes.bridges[1] == {(0, 0): 1}
    line, triangle = (shape for shape in range(len(shapes.masks)) if shapes.sizes[shape] == 3)
    if line not in shapes.bridges:
        line, triangle = triangle, line
    assert shapes.bridges[line] == {(0, 1): 2}
    assert triangle not in shapes.bridges  # three bonds in a ring


def test_weights_lie_between_those_of_single_shapes(shapes):
    weights = stored_weights()
    for i, j in PAIRS:
        ways = [
            shapes.dockings.get((a, b), {0: 0})
            for a in np.flatnonzero(shapes.sizes == i).tolist()
            for b in np.flatnonzero(shapes.sizes == j).tolist()
            if a <= b
        ]
        totals = [sum(made.values()) for made in ways]
        assert min(totals) - 1e-5 <= weights.dockings[i, j] <= max(totals) + 1e-5


def test_sums_never_fall():
    """Over random joins and breaks, each sum with its share of the breaks."""
    rng = np.random.default_rng(5)
    counts, n_breaks = np.zeros(12, dtype=int), 0
    counts[0] = 60
    before = np.array([f @ counts for f, _ in SUMS])
    for _ in range(3000):
        i, j = PAIRS[rng.integers(len(PAIRS))]
        is_join = bool(rng.integers(2))
        after = counts.copy()
        for size, change in ((i, -1), (j, -1), (i + j, 1)):
            after[size - 1] += change if is_join else -change
        if (after < 0).any():
            continue
        counts, n_breaks = after, n_breaks + (not is_join)
        now = np.array([f @ counts + most * n_breaks for f, most in SUMS])
        assert (now >= before).all()
        before = now
    assert n_breaks > 20


def test_two_faces_have_the_known_law(models):
    """Joined at a = 25 k, broken at b: together and never broken with a / (b - a) (exp(-a t) - exp(-b t))."""
    k, b = 4.0, 300.0
    a, t = 25 * k, 1e-3
    model = models["docking"].model.at({"k": k, "b": b})
    two, pair = (2, *[0] * 11), (0, 1, *[0] * 10)
    apart = PanelLikelihood(model, PanelData(COLUMNS, [frame(two, two, 0)])).value()
    together = PanelLikelihood(model, PanelData(COLUMNS, [frame(two, pair, 0)])).value()
    assert apart.value == pytest.approx(-a * t, abs=1e-12)
    assert together.value == pytest.approx(np.log(a / (b - a) * (np.exp(-a * t) - np.exp(-b * t))), abs=1e-10)


def test_sums_change_no_probability(models):
    """They only keep states away that cannot lead to the frame."""
    model = models["docking"].model.at({"k": 4.0, "b": 300.0})
    run = frame((6, 2, *[0] * 10), (3, 2, 1, *[0] * 9), 0)
    counted = {name: COLUMNS[name] for name in (*(f"n{i}" for i in range(1, 13)), "broken")}
    bare = PanelRun(run.initial, run.times, run.seen[:, :13])
    short, whole = (PanelLikelihood(model, PanelData(*each)).value() for each in ((counted, [bare]), (COLUMNS, [run])))
    assert short.value == pytest.approx(whole.value, abs=1e-9)


def test_fewest_breaks(models):
    any_way = models["control"].model
    one = (0, 0, 0, 0, 0, 2, *[0] * 6)
    assert fewest_breaks(any_way, one, (1, 0, 0, 0, 1, 1, *[0] * 6)) == 1
    assert fewest_breaks(any_way, one, (0, 0, 0, 0, 1, 0, 1, *[0] * 5)) == 1  # a face changes over
    assert fewest_breaks(any_way, (4, *[0] * 11), (0, 2, *[0] * 10)) == 0


def test_the_judge_accepts_its_own_runs_and_refuses_others():
    rng = np.random.default_rng(2)
    judge = Judge(rng.poisson(5.0, (2000, 4, 12)))
    own = [judge.verdict(rng.poisson(5.0, (4, 12)))["rules"] for _ in range(200)]
    for rule in ("outside", "misfit"):
        assert 180 <= sum(each[rule] for each in own) <= 200  # 95 % of 200, 3.2 standard deviations
    assert not any(judge.verdict(rng.poisson(8.0, (4, 12)))["rules"]["misfit"] for _ in range(20))


def test_predictions_come_out_again(models):
    name = chosen(stored_fits())
    counts = predicted(models[name].model, fitted_of(stored_fits()[name]))[..., :12]
    sizes, lost = summary({name: counts})
    for path, found in ((PREDICTED, sizes), (LOST, lost)):
        kept = pd.read_csv(path)
        pd.testing.assert_frame_equal(kept[kept["fit"] == name].reset_index(drop=True), found, check_dtype=False)
    assert GRID[JUDGED].tolist() == TIMES.tolist()
    assert (lost_of(counts) >= 0).all()


@needs_table
def test_run_3_is_judged_again(models):
    name = chosen(stored_fits())
    counts = predicted(models[name].model, fitted_of(stored_fits()[name]))[..., :12]
    assert judged({name: counts}, read_runs(TABLE))[name] == scores()[name]


@needs_table
def test_the_figure_shows_them():
    def paths(text):
        return re.findall(r'<path d="[^"]*" clip-path', text)

    assert paths(figure().decode()) == paths(FIGURE.read_text(encoding="utf-8"))


@needs_table
@pytest.mark.validate
def test_the_likelihood_comes_out_again(models):
    """At the stored constants, with the stored error."""
    runs = read_runs(TABLE)
    data = panel_of([runs[1], runs[2]], models["control"].model)
    for name in ("control", "docking"):
        stored = stored_fits()[name]
        found = PanelLikelihood(models[name].model, data, 300_000).value(
            {key: row["value"] for key, row in stored["parameters"].items()}
        )
        assert found.value == pytest.approx(stored["log_likelihood"], abs=1e-5)


def test_files_are_small():
    assert sum(path.stat().st_size for path in FITS.parent.iterdir()) < 300_000
    assert {path.name for path in (WEIGHTS, FITS, SCORES)} <= {path.name for path in FITS.parent.iterdir()}
