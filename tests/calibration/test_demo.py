"""What the demonstration says of the time it takes."""

import re

import pytest
from click.testing import CliRunner

from calibration.commands import demo
from mechsim.world.engines import ENGINES


def test_every_engine_has_a_measured_time():
    assert set(demo.SECONDS) == {engine.name for engine in ENGINES}


@pytest.mark.parametrize("engine", demo.SECONDS)
def test_the_whole_demonstration_takes_less_than_five_minutes(engine):
    ((alone, unit),) = re.findall(r"about ([\d.]+) (s|min) with one worker", demo.how_long(1.0, engine))
    assert float(alone) < {"s": 60, "min": 5}[unit]


def test_times_follow_the_scale():
    assert "about 3.8 min with one worker" in demo.how_long(2.0, "pybullet")
    assert "about 13 s with one worker, 12 s" in demo.how_long(0.02, "pybullet")


@pytest.mark.parametrize("more", [[], ["--engine", "own"], ["--json"]])
def test_the_first_line_is_the_time_it_takes(more, monkeypatch, tmp_path):
    def stop(*_, **__):
        raise ValueError("no runs in this test")

    monkeypatch.setattr(demo, "run_calibration", stop)
    done = CliRunner().invoke(demo.demo, ["--folder", str(tmp_path), "--scale", "1", *more])
    engine = "own" if "own" in more else "pybullet"
    expected = "" if "--json" in more else demo.how_long(1.0, engine) + "\n"  # JSON stays one object
    assert done.stdout == expected
