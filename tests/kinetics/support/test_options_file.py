"""`wellmixed --config FILE`, `--quiet`, and what the shell completes."""

import json
import warnings

import click
import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner
from command_tree import commands

from kinetics.support.cli import completion
from wellmixed import main

OPTIONS = """
[predict]
runs = 30
rates = "table3"
cubes = 20
times = [10, 20]
seed = 4
[rules.check]
json = true
"""


SMALL = {"cubes": 12, "held-out": 12, "duration": 20, "held-out-duration": 20, "along": 800, "cpu-hours": 0.001}


@pytest.fixture
def run(tmp_path):
    def run_with(text, *arguments):
        (tmp_path / "options.toml").write_text(text, encoding="utf-8")
        return CliRunner().invoke(main, ["--config", str(tmp_path / "options.toml"), *map(str, arguments)])

    return run_with


def test_a_file_gives_what_the_command_line_leaves_open(run):
    spelled = ["--rates", "table3", "--cubes", "20", "--times", "10", "20", "--seed", "4", "--json"]
    for chosen in (["--runs", "30"], ["--runs", "7"]):
        expected = json.loads(CliRunner().invoke(main, ["predict", "line4", *chosen, *spelled]).output)
        found = json.loads(run(OPTIONS, "predict", "line4", "--json", *(chosen if "7" in chosen else [])).output)
        assert {key: value for key, value in found.items() if "seconds" not in key} == {
            key: value for key, value in expected.items() if "seconds" not in key
        }
    assert json.loads(run(OPTIONS, "rules", "check", "t5").output)["correct"]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("runs", "rnus", "rnus in [predict] is no option of predict; did you mean runs?"),
        ("[predict]", "[predicts]", "[predicts] is no table of a command; did you mean predict?"),
        ("[predict]", "predict = 3\n[ask]", "[predict] is no table of a command"),
        ("rules.check", "rules.checks", "[rules.checks] is no table of a command; did you mean check?"),
        ("runs = 30", 'runs = "many"', "Invalid value for '--runs'"),
        ("runs = 30", "runs = ", "is not valid TOML"),
        ("runs = 30", "runs = [1, 2]", "runs = [1, 2] in [predict]; expected one number or text"),
        ("runs = 30", "runs = true", "runs = True in [predict]; expected one number or text"),
        ("times = [10, 20]", "times = true", "times = True in [predict]; expected one value or a list"),
        ("rules.check", "trust.accuracy.wrong", "[trust.accuracy.wrong] is no table of a command; expected one of"),
        ("json = true", "json = 1", "json = 1 in [check]; expected true or false"),
        ("runs = 30", "source = 'line4'", "source in [predict] is no option of predict"),
    ],
)
def test_slips_are_told(run, old, new, said):
    command = ["rules", "check", "t5"] if "rules" in old or "json" in old else ["predict", "line4"]
    done = run(OPTIONS.replace(old, new), *command)
    assert done.exit_code == 2
    assert said in " ".join(done.output.split())
    assert "there is no such file" in CliRunner().invoke(main, ["--config", "none.toml", "predict", "line4"]).output


def test_the_folder_of_a_study_gives_way_to_the_file(run, tmp_path):
    """As it does to the command line: what the user asks for is no default."""
    folder = tmp_path / "study"
    made = CliRunner().invoke(
        main, ["new", "line4", str(folder), *(f"--{name}={value}" for name, value in SMALL.items())]
    )
    assert made.exit_code == 0, made.output
    assert "holds no rates.toml" in run("", "predict", folder).output
    done = run("[predict]\nrates = 'table3'\ncubes = 8\ntimes = [1]\nruns = 9", "predict", folder, "--json")
    assert "these rates are for another network" in done.output  # so that they were taken


def test_quiet_leaves_results_and_errors(monkeypatch):
    from kinetics.commands import predict

    command = ["predict", "line4", "--rates", "table3", "--cubes", "8", "--times", "5", "--runs", "9", "--json"]

    def warning(*_, **__):
        warnings.warn("doubtful", stacklevel=1)
        return time_grid(*_, **__)

    time_grid = predict.time_grid
    monkeypatch.setattr(predict, "time_grid", warning)
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        loud, quiet = (CliRunner().invoke(main, [*words, *command]) for words in ([], ["--quiet"]))
    assert "Warning: doubtful" in loud.stderr
    assert quiet.stderr == ""
    assert json.loads(quiet.stdout)["mean"] == json.loads(loud.stdout)["mean"]
    wrong = CliRunner().invoke(main, ["--quiet", "predict", "nothing.toml", "--rates", "table3", "--cubes", "8"])
    assert wrong.exit_code == 2
    assert "Error: " in wrong.stderr


def completed(*words, begun=""):
    found = ShellComplete(main, {}, "wellmixed", "_WELLMIXED_COMPLETE").get_completions(list(words), begun)
    return [item.value for item in found]


def test_the_shell_completes_what_is_shipped():
    assert completed("rules", "check", begun="t5_a") == ["t5_all", "t5_as_printed", "t5_a"]
    assert completed("predict", "line4", "--rates", begun="table3") == [
        "table3", "table3_geometric", "table3_literal", "table3"
    ]  # fmt: skip
    assert "--copies-per-unit" in completed("predict", begun="--c")
    assert completed(begun="val") == ["validate"]


def test_every_argument_that_takes_what_is_shipped_is_completed():
    plain = click.Argument(["book"])._custom_shell_complete
    for name, command in commands():
        for parameter in command.params:
            if parameter.name in ("book", "books", "scene", "study", "target", "source", "rates_name"):
                assert parameter._custom_shell_complete is not plain, f"{name}: {parameter.name}"
    for kind, folder in completion.SHIPPED.items():
        assert list((completion.ROOT / folder).glob("*.toml")), kind
