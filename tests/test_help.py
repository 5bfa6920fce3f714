"""The help texts of all commands: whole sentences, quick to show, with `--json` and `--seed` where they belong."""

import json
import os
import re
import subprocess
import sys
from functools import partial

import click
import pytest
from click.testing import CliRunner
from command_tree import commands

from kinetics.support.cli.options import FILES, RULES
from wellmixed import main

TREE = dict(commands())
LEAVES = {name: command for name, command in TREE.items() if not isinstance(command, click.Group)}
GROUPS = {name: command for name, command in TREE.items() if isinstance(command, click.Group)}
HEAVY = ("numba", "scipy", "pandas", "pyarrow", "matplotlib", "pybullet", "distributed", "libsbml")

# Commands that draw random numbers take --seed; all others give one answer, and a seed would promise another.
SEEDED = {
    "new", "simulate", "calibrate", "validate", "predict", "passage", "scan", "demo", "study plan", "study first-times",
    "study rates", "trust verify", "trust accuracy kinetics", "trust accuracy mechanics", "rules compile", "rules draw",
    "rules grow", "rules rank",
}  # fmt: skip


def faults(text: str | None) -> list[str]:
    """What keeps a help text from being whole sentences; a default may follow the last one."""
    text = " ".join(re.sub(r"\s+\[default: [^\]]*\]$", "", text or "").split())
    if not text:
        return ["is missing"]
    found = []
    if not (text[0].isupper() or text[0] in "`-") or len(text.split()) < 2:
        found.append("does not begin a sentence")
    if text.startswith("Of "):
        found.append("leans on the name of the option")
    if not text.endswith("."):
        found.append("does not end with a period")
    return found


def test_the_tree_is_whole():
    assert set(GROUPS) == {"", "rules", "study", "runs", "trust", "trust accuracy"}
    assert set(LEAVES) > SEEDED
    assert len(LEAVES) >= 20


@pytest.mark.parametrize("name", TREE)
def test_every_command_says_what_it_is_in_sentences(name):
    text = TREE[name].help or ""
    first = text.strip().split("\n\n")[0]
    assert {"first paragraph": faults(first), "text": faults(text)} == {"first paragraph": [], "text": []}


@pytest.mark.parametrize("name", TREE)
def test_every_option_has_a_sentence_of_its_own(name):
    options = [option for option in TREE[name].params if isinstance(option, click.Option)]
    texts = {option.opts[0]: getattr(option, "told_by", partial(getattr, option, "help"))() for option in options}
    assert {option: faults(text) for option, text in texts.items() if faults(text)} == {}


@pytest.mark.parametrize("name", GROUPS)
def test_every_line_of_a_list_of_commands_is_a_sentence(name):
    lines = {below: listed.help for below, listed in GROUPS[name].commands.items()}
    assert lines
    assert {below: faults(line) for below, line in lines.items() if faults(line)} == {}


def test_every_command_can_answer_in_json():
    assert {name for name, command in LEAVES.items() if not has(command, "--json")} == set()


def test_commands_that_draw_random_numbers_and_no_others_take_a_seed():
    assert {name for name, command in LEAVES.items() if has(command, "--seed")} == SEEDED


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (None, ["is missing"]),
        ("", ["is missing"]),
        ("tu for each run.", ["does not begin a sentence"]),
        ("Seconds.", ["does not begin a sentence"]),
        ("Of a run, tu.", ["leans on the name of the option"]),
        ("Length of a run, tu", ["does not end with a period"]),
        ("Length of a run, tu.", []),
        ("Length of a run, tu.  [default: as the study says]", []),
    ],
)
def test_faults_are_seen(text, found):
    assert faults(text) == found


def test_help_imports_nothing_heavy():
    """All commands are imported, as for their own help; a control sees an import that is made."""
    assert imported("pass") == []
    assert imported("import scipy") == ["scipy"]


def imported(code: str) -> list[str]:
    """Heavy packages that a fresh interpreter has imported after all commands and `code`."""
    code = f"import json, sys; from command_tree import commands; list(commands()); {code}; print(json.dumps([name "
    code += f"for name in {HEAVY} if name in sys.modules]))"
    known = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=known)
    return json.loads(done.stdout)


def has(command: click.Command, name: str) -> bool:
    return any(name in parameter.opts for parameter in command.params)


def shown(*words):
    """The lines of a help text, 80 columns wide."""
    return CliRunner().invoke(main, [*words, "--help"], terminal_width=80).output.splitlines()


def test_the_commands_stand_in_the_order_of_the_work():
    lines = shown()
    names = [line.split()[0] for line in lines[lines.index("Commands:") + 1 :]]
    assert names[:5] == ["demo", "new", "simulate", "calibrate", "validate"]
    assert names[5:] == ["predict", "ask", "passage", "scan", "rules", "study", "runs", "trust"]


def test_options_for_some_models_alone_stand_under_headings_of_their_own():
    lines = shown("predict")
    assert len(lines) <= 100
    places = [lines.index(f"{title}:") for title in ("Options", RULES, FILES)]
    options = ["--method", "--seed", "--cubes", "--posterior-draws", "--set"]
    found = [next(i for i, line in enumerate(lines) if line.startswith(f"  {option} ")) for option in options]
    assert places[0] < found[0] < found[1] < places[1] < found[2] < found[3] < places[2] < found[4]
