"""What commands print with `--json`, seen where they print it: held against docs/schemas, or written down.

Nobody states these objects; they are put together where each command ends. So their schemas are read off the outputs of
all tests (`python -m tests.results.schemas`), and every later output of a test must keep to them.
"""

from __future__ import annotations

import functools
import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click

SCHEMAS = Path(__file__).parents[2] / "docs" / "schemas"
RECORD = "WELLMIXED_JSON_OUTPUTS"  # a file that gets a line for each output, in the place of a check
KINDS = {dict: "object", list: "array", bool: "boolean", str: "string", int: "integer", float: "number"}

Schema = dict[str, Any]


# By the ends of their paths: objects whose keys are data, such as names of species; objects that may have more keys.
MAPS = (
    *("calibrate/parameters", "calibrate/evidence/observed", "calibrate/fixed", "/r_hat", "/effective"),
    *("/initial", "/conserved", "/shape", "/slopes", "mechanics/reference", "/floor", "/composition", "/versions"),
    *("runs/final", "runs/events", "tanks/events", "/quantiles", "/sensitivity_quantiles"),
    *("grow/series", "/curves", "rates/classes", "/pathways", "/refusals", "/refused", "/plans"),
)
OPEN = ("/evidence", "first-times/points", "first-times/times", "/request")


def schema_of(value: Any, path: str) -> Schema:
    """The schema of one value at a path, which begins with its command."""
    found: Schema = {"type": [KINDS.get(type(value), "null")]}
    if isinstance(value, float):
        found["type"] += ["null"]  # which takes the place of what is not finite
    if isinstance(value, list):
        found["items"] = merged(*(schema_of(item, path) for item in value))
    elif isinstance(value, dict) and path.endswith(MAPS):
        found["additionalProperties"] = merged(*(schema_of(item, f"{path}/*") for item in value.values()))
    elif isinstance(value, dict):
        found["properties"] = {key: schema_of(item, f"{path}/{key}") for key, item in value.items()}
        found["required"] = list(value)
        found["additionalProperties"] = path.endswith(OPEN)
    return found


def merged(*schemas: Schema) -> Schema:
    """The narrowest schema of this kind that takes what any of these does; {} of none."""
    return functools.reduce(_merged, schemas) if schemas else {}


def _merged(one: Schema, other: Schema) -> Schema:
    if not one or not other:
        return one or other
    types = list(dict.fromkeys(one["type"] + other["type"]))
    found: Schema = {"type": [kind for kind in types if kind != "integer" or "number" not in types]}
    if "items" in one or "items" in other:
        found["items"] = _merged(one.get("items", {}), other.get("items", {}))
    if "properties" in one or "properties" in other:
        mine, yours = one.get("properties", {}), other.get("properties", {})
        lists = [schema["required"] for schema in (one, other) if "required" in schema]
        found["properties"] = {key: _merged(mine.get(key, {}), yours.get(key, {})) for key in mine | yours}
        found["required"] = [key for key in lists[0] if key in lists[-1]]
        found["additionalProperties"] = any(schema.get("additionalProperties") for schema in (one, other))
    elif "object" in types:
        rest = [schema["additionalProperties"] for schema in (one, other) if "additionalProperties" in schema]
        found["additionalProperties"] = merged(*rest)
    return found


def command_at(path: str) -> str:
    """The command that click knows under this path, whatever a test calls the program; "" for one of a test's own."""
    from wellmixed import COMMANDS

    return next((name for name in COMMANDS if f" {path}".endswith(f" {name}") or name.endswith(f" {path}")), "")


def command_of(call: Iterable[Any]) -> str:
    """The command that these words call, without its arguments; "" if they call none."""
    from wellmixed import COMMANDS

    words = f"{' '.join(map(str, call))} "
    return next((name for name in COMMANDS if words.startswith(f"{name} ")), "")


def schema_of_command(command: str, outputs: Iterable[Any]) -> Schema:
    """The schema of all outputs of one command; those that begin with another key are another form of it."""
    forms: dict[str, list[Schema]] = {}
    for output in outputs:
        forms.setdefault(next(iter(output)), []).append(schema_of(output, command))
    found = [merged(*schemas) for schemas in forms.values()]
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": f"wellmixed {command} --json"}
    return head | (found[0] if len(found) == 1 else {"anyOf": found})


def file_of(command: str) -> Path:
    """Where the schema of a command is."""
    return SCHEMAS / f"{command.replace(' ', '-')}.json"


@functools.cache
def validator(command: str) -> Any:
    """Of the outputs of one command; FileNotFoundError: it has no schema."""
    from jsonschema import Draft202012Validator

    return Draft202012Validator(json.loads(file_of(command).read_text(encoding="utf-8")))


def faults(command: str, data: Any) -> list[str]:
    """Where an output does not keep to the schema of its command."""
    return [f"{'/'.join(map(str, error.path))}: {error.message}" for error in validator(command).iter_errors(data)]


def see(command: str, data: Any) -> None:
    """Check an output, or write it down where `RECORD` names a file; that of a test's own command ("") is let pass."""
    if command and os.environ.get(RECORD):
        with Path(os.environ[RECORD]).open("a", encoding="utf-8") as file:
            file.write(json.dumps([command, data]) + "\n")
    elif command:
        found = faults(command, data)
        assert not found, (
            f"{command} --json: {found[:3]}; add it to docs/schemas, or run `python -m tests.results.schemas`"
        )


def watch_outputs() -> None:
    """From now on each output that is printed in this process is seen.

    To be called before the commands are imported: they take the function that prints by its name.
    """
    from kinetics.support.cli import options

    echo = options.echo_json

    def echo_and_see(data: dict[str, Any]) -> None:
        see(command_at(click.get_current_context().command_path), options.plain(data))
        echo(data)

    options.echo_json = echo_and_see
