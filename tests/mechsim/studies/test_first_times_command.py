"""`wellmixed study first-times`: the cost comes first, nothing is made twice, mistakes are told before any work."""

import pytest
from command_line import run_here


def command(*arguments, cwd):
    return run_here("study", "first-times", *arguments, cwd=cwd)


OWN = """
name = "own"
title = "A tiny study"
scene = "t5"
cubes = 10
runs = 1
cap = 0.5
typical = 0.4

[[factors]]
name = "number"
label = "cubes"
setting = "number"
levels = [8.0, 12.0]
"""


def test_the_command_tells_the_cost_first_and_goes_on_where_it_was(tmp_path):
    (tmp_path / "own.toml").write_text(OWN)
    first = command("own.toml", "--points", "number=8", "--seed", 1, cwd=tmp_path)
    assert first.code == 0, first.err
    assert first.out.index("1 runs to make: about") < first.out.index("A tiny study")
    again = command("own.toml", "--seed", 1, "--json", "--out", "out", cwd=tmp_path)
    assert "1 runs to make: about" in again.err
    told = again.json
    assert [(row["number"], row["runs"], row["censored"]) for row in told["points"]] == [(8, 1, 1), (12, 1, 1)]
    assert "0 of 2 first times were observed before the cap" in told["why"]
    assert len(list((tmp_path / "runs").glob("*.run"))) == 2
    assert (tmp_path / "out" / "own.svg").exists()


def test_cost_only_and_collect_make_no_run(tmp_path):
    (tmp_path / "own.toml").write_text(OWN)
    asked = command("own.toml", "--cost-only", "--json", cwd=tmp_path)
    assert asked.json["runs_to_make"] == 2
    told = command("own.toml", "--collect", "--json", cwd=tmp_path).json
    assert [row["runs"] for row in told["points"]] == [0, 0]
    assert not list((tmp_path / "runs").glob("*.run"))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("nostudy",), "unknown study 'nostudy'; shipped are interactions"),
        (("own.toml", "--points", "edge=1"), "expected FACTOR=LEVEL"),
        (("own.toml", "--cost-only", "--collect"), "either --cost-only or --collect"),
        (("full.toml",), "do not fit"),
    ],
)
def test_mistakes_are_told_before_any_work(tmp_path, arguments, said):
    (tmp_path / "own.toml").write_text(OWN)
    (tmp_path / "full.toml").write_text(
        OWN.replace('setting = "number"', 'setting = "cubes.edge"').replace("8.0, 12.0", "0.95")
    )
    done = command(*arguments, cwd=tmp_path)
    assert done.code == 2, done.out
    assert said in done.err
    assert not list(tmp_path.glob("runs/*.run"))
