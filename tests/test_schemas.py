"""Outputs of `--json` keep to the schemas that the site shows: here those of calls that no schema was read off.

`json_outputs.watch_outputs` checks the outputs of all other tests too, where they are printed.
"""

import copy
import json

import pytest
from command_tree import commands
from json_outputs import SCHEMAS, command_of, faults, file_of, merged, schema_of, validator

CALLS = [
    ["predict", "t5", "--rates", "classes.toml", "--cubes", 10, "--times", 5, "--runs", 50],
    ["predict", "decay.rxn", "--times", 1, 5, "--method", "dense", "--show", "A"],
    ["predict", "decay.rxn", "--times", 1, 5, "--accuracy", "1e-10%"],
    ["predict", "t5", "--rates", "classes.toml", "--cubes", 10, "--times", 5, "--accuracy", "20%"],
    ["passage", "decay.rxn", "--species", "B", "--copies", 3],
    ["ask", "decay.rxn", "P=? [ F<=2 B >= 3 ]", 'R{"B"}=? [ C<=4 ]'],
    ["rules", "derive", "t5"],
    ["rules", "check", "line4_as_printed"],
    ["rules", "draw", "t5", "--what", "book", "--out", "book.svg"],
    ["rules", "grow", "line4", "--cubes", 8, "--join", 1e-4, "--duration", 50],
    ["rules", "rank", "line4", "line4_pairs", "--rates", "table3", "--cubes", 8],
    ["trust", "accuracy", "kinetics", "decay.rxn", "--budget", 0.005],
    ["trust", "hardcases", "--only", "yule"],
    ["trust", "verify", "decay.rxn", "--times", 1, "--runs", 500, "--method", "lockstep", "--no-power"],
]
CLASSES = """
faces = "two"
tank = [2.0, 2.0, 2.0]
[convention]
combinations = "distinct"
[classes]
"join" = { rate = 7e-5, events = 40, exposure = 5.7e5 }
"break" = { rate = 3e-5, events = 9, exposure = 3e5 }
"""


@pytest.mark.parametrize("call", CALLS, ids=lambda call: " ".join(map(str, call[:2])))
def test_other_calls_keep_to_the_schemas(call, wellmixed_here, tmp_path):
    (tmp_path / "decay.rxn").write_text("A -> B, 0.3\nA = 7\ntime unit: h\n", encoding="utf-8")
    (tmp_path / "classes.toml").write_text(CLASSES, encoding="utf-8")
    data = wellmixed_here(*call, "--json", cwd=tmp_path)
    assert faults(command_of(call), json.loads(data.out)) == []


def test_every_command_has_a_schema():
    leaves = {name for name, command in commands() if not hasattr(command, "commands")}
    assert {path.name for path in SCHEMAS.glob("*.json")} == {file_of(name).name for name in leaves}
    for name in leaves:
        validator(name).check_schema(json.loads(file_of(name).read_text("utf-8")))


@pytest.mark.parametrize(
    ("key", "value"), [("claims", "none"), ("book", 3), ("claims", [{"claim": "a"}]), ("more", 1), ("book", None)]
)
def test_another_key_or_type_is_seen(key, value):
    """The control."""
    right = {"book": "line4.toml", "claims": [{"claim": "two letters", "holds": True}]}
    assert faults("rules certify", right) == []
    wrong = copy.deepcopy(right) | {key: value}
    assert len(faults("rules certify", wrong)) == 1


def test_schemas_are_the_narrowest_of_their_kind():
    one = schema_of({"a": 1, "initial": {"A": 2}, "b": []}, "x")
    other = schema_of({"a": 0.5, "initial": {"B": None}, "c": "text"}, "x")
    both = merged(one, other)
    assert both["required"] == ["a", "initial"]
    assert both["properties"]["a"] == {"type": ["number", "null"]}
    assert both["properties"]["initial"]["additionalProperties"] == {"type": ["integer", "null"]}
    assert both["properties"]["b"] == {"type": ["array"], "items": {}}
    assert merged(both, one) == merged(one, both, one)
