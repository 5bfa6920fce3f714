"""Looks at intervals: what they do to rates is told, with its size, before anything else is blamed."""

import numpy as np
import pytest
from command_line import run_here

from calibration import diagnose, estimate
from calibration.estimating.coarse_looks import COARSE, CoarseLooks
from kinetics import JumpPath, Network, sample_path


def runs_of(text, start, end, runs=60):
    network = Network.from_text(text)
    return [sample_path(network, start, end=end, seed=1, run=run) for run in range(runs)]


def looked_at(paths, resolution):
    """The same runs, with every event written down at the look that first shows it."""
    late = [np.minimum(np.ceil(path.times / resolution) * resolution, path.end) for path in paths]
    return [
        JumpPath(path.network, path.initial, times, path.channels, path.end, resolution=resolution)
        for path, times in zip(paths, late, strict=True)
    ]


def rate(paths):
    return estimate(paths).estimates[0].rate


@pytest.mark.parametrize("k", [0.1, 0.5, 2.0])
@pytest.mark.parametrize("x", [0.1, 0.4, 1.0, 2.0])
def test_one_decay_has_its_grouped_likelihood(k, x):
    """The corrected rate is the closed form, and that of the exact times within 2 %; uncorrected it is x / 2 off."""
    exact = runs_of(f"die: A -> 0, {k}", {"A": 40}, end=10.0 / k)
    seen = looked_at(exact, x / k)
    (found,) = CoarseLooks(seen).channels
    total = estimate(seen).total
    looks = total.exposure[0] * k / x
    assert found.corrected == pytest.approx(-np.log1p(-total.events[0] / looks) * k / x, rel=1e-9)
    assert found.corrected == pytest.approx(rate(exact), rel=0.02)
    assert found.rate == rate(seen) == pytest.approx(rate(exact) * -np.expm1(-x) / x, rel=0.02)
    assert found.bias == pytest.approx(found.rate / found.corrected - 1)


@pytest.mark.parametrize(
    ("text", "start", "end", "resolution"),
    [
        ("birth: A -> 2 A, 0.3", {"A": 10}, 6.0, 0.5),  # rises: too large
        ("bind: A + B -> AB, 0.01", {"A": 30, "B": 20}, 60.0, 0.5),
        ("pair: 2 A -> AA, 0.02", {"A": 30}, 60.0, 0.3),
        ("die: A -> 0, 1\nmake: 0 -> A, 5", {"A": 100}, 40.0, 0.3),  # beside a channel that undoes it
    ],
)
def test_the_bias_of_any_channel_to_first_order(text, start, end, resolution):
    exact = runs_of(text, start, end)
    seen = looked_at(exact, resolution)
    found = max(CoarseLooks(seen).channels, key=lambda each: abs(each.bias))
    off = rate(seen) / rate(exact) - 1
    assert abs(off) > 0.04
    assert found.bias == pytest.approx(off, rel=0.15)
    assert found.corrected == pytest.approx(rate(exact), rel=0.01)


def test_a_process_that_has_settled_keeps_its_rate_but_not_its_tests():
    exact = runs_of("make: 0 -> A, 5\ndie: A -> 0, 1", {"A": 5}, end=40.0, runs=20)
    seen = looked_at(exact, 0.3)
    looks = CoarseLooks(seen)
    assert {each.channel for each in looks.channels} == {"make", "die"}
    assert max(abs(each.bias) for each in looks.channels) < 0.01
    assert "Rates are off" not in looks.sentence
    verdict = diagnose(seen)
    assert verdict.failed
    assert verdict.verdict.startswith("The looks are too coarse to tell")
    assert all(result.remedy == "observe at shorter intervals before judging" for result in verdict.results)


def test_fine_looks_and_exact_times_are_left_alone():
    exact = runs_of("die: A -> 0, 0.5", {"A": 1}, end=20.0, runs=200)
    assert CoarseLooks(exact).channels == ()
    assert CoarseLooks(looked_at(exact, COARSE)).channels == ()  # rate * resolution is half of what is coarse
    assert CoarseLooks(looked_at(exact, 3 * COARSE)).channels
    assert CoarseLooks(exact).sentence == ""


def test_all_is_over_by_the_first_look():
    network = Network.from_text("die: A -> 0, 0.5")
    (found,) = CoarseLooks([JumpPath(network, {"A": 3}, [1.0] * 3, [0] * 3, end=1.0, resolution=1.0)]).channels
    assert (found.fall, found.bias, found.corrected) == (1.0, -1.0, None)


def test_runs_with_their_own_resolutions_and_tanks():
    """Each run adds its own lateness, in the tank of the first."""
    exact = runs_of("pair: 2 A -> AA, 0.02", {"A": 30}, end=60.0)
    mixed = [*exact[:30], *looked_at(exact[30:], 0.3)]
    (found,) = CoarseLooks(mixed).channels
    (alone,) = CoarseLooks(looked_at(exact, 0.3)).channels
    assert 0.3 * alone.fall < found.fall < 0.7 * alone.fall
    assert found.corrected == pytest.approx(rate(exact), rel=0.01)


@pytest.fixture
def written(tmp_path):
    """198 deaths of 200 that are looked at once a time unit, at rate 0.5: 523 looks at what is alive."""
    path = looked_at(runs_of("die: A -> 0, 0.5", {"A": 200}, end=10.0, runs=1), 1.0)[0]
    (tmp_path / "die.rxn").write_text("die: A -> 0, 1\nA = 1\n")
    rows = "".join(f"r,{time!r},die\n" for time in path.times.tolist())
    (tmp_path / "events.csv").write_text(f"run,time,channel\n{rows}")
    (tmp_path / "runs.csv").write_text("run,start,end,A,resolution\nr,0,10,200,1\n")
    return tmp_path


def test_calibrate_says_so_first_in_every_form(written):
    def calibrated(*more):
        tables = ("events.csv", "--run-table", "runs.csv")
        return run_here("calibrate", "die.rxn", "--events", *tables, "--out", "rates.toml", *more, cwd=written)

    lines = calibrated("--report", "report.html").out.splitlines()
    assert lines[2].startswith("Looks are coarse: they are 1 apart")  # below the two lines of the rates
    assert "die: 0.4" in lines[2]
    assert "Look at shorter intervals: below 0.1" in lines[2]
    assert "crowded model" not in "".join(lines)
    page = (written / "report.html").read_text(encoding="utf-8")
    assert page.index("Looks are coarse") < page.index("Propensity = rate")
    assert "crowded model" not in page
    assert "the tank" not in page
    assert (written / "report_looks.csv").read_text().startswith("channel,resolution,rate,fall,bias,corrected,per_look")
    assert 'coarse_looks = "Looks are coarse' in (written / "rates.toml").read_text(encoding="utf-8")
    told = calibrated("--json").json
    (die,) = told["coarse_looks"]["channels"]
    assert die["corrected"] == pytest.approx(0.5, rel=0.2)
    assert told["coarse_looks"]["sentence"] == lines[2]
