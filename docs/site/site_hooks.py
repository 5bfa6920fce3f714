"""What the site shows beyond the pages of this folder: figures of results, and pages that are made when it is built."""

from __future__ import annotations

import json
import re
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import click
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

from kinetics.support.cli.lazy_commands import below
from wellmixed import main

sys.path.append(str(Path(__file__).parent))  # hooks are no package
from notebook_pages import NOTEBOOKS, page

ROOT = Path(__file__).parents[2]
OUTSIDE = re.compile(r"\]\(((?:\.\./)+)(results/[^)]+\.(?:svg|png))\)")
PACKAGES = {
    "kinetics": "Networks, rates, runs, solutions and questions: what happens, and how often.",
    "kinetics.assembly": "Rule books, structures, and the network that follows from them.",
    "kinetics.markov": "Markov chains from anywhere, and questions asked of them.",
    "kinetics.formats": "Network files, in and out.",
    "mechsim": "Scenes, runs of the mechanics, and the store that keeps them.",
    "calibration": "Rates from paths, with intervals, models, diagnostics and validation.",
}
# Tables fit the page if they can, words stay whole, and what is wider scrolls under a bar that is seen on phones too.
WIDE_TABLES = """
.md-typeset table:not([class]) :is(th, td) { min-width: 0; padding: .7em .8em; overflow-wrap: normal }
.md-typeset table:not([class]) :is(th, td) code { word-break: normal }
.md-typeset__table { min-width: 0 }
:is(.md-typeset__scrollwrap, .md-typeset pre > code)::-webkit-scrollbar { height: .5rem; background: #eee }
:is(.md-typeset__scrollwrap, .md-typeset pre > code)::-webkit-scrollbar-thumb { background: #888 }
"""
SCHEMAS = """# JSON schemas

Every command takes `--json` and then prints one object on standard output. The files below are JSON Schema (draft
2020-12), for a validator or a generator of types. They are not written by hand: `python -m tests.results.schemas` reads
keys and types off what commands print in the tests, and every later output there must keep to them. A type that no
call gave may be missing. A `number` that is not finite is `null`."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add figures that lie outside the folder, the reference of each package, and the commands."""
    pages = [page.content_string for page in files.documentation_pages()]
    for name in sorted({name for text in pages for _, name in OUTSIDE.findall(text)}):
        files.append(File.generated(config, name, abs_src_path=str(ROOT / name)))
    for package, text in PACKAGES.items():
        files.append(File.generated(config, f"api/{package}.md", content=reference(package, text)))
    files.append(File.generated(config, "tables.css", content=WIDE_TABLES))
    files.append(File.generated(config, "commands.md", content=command_page()))
    for path in NOTEBOOKS:
        text, pictures = page(path)
        files.append(File.generated(config, f"notebooks/{path.stem}.md", content=text))
        for name, content in pictures.items():
            files.append(File.generated(config, f"notebooks/{name}", content=content))
    files.append(File.generated(config, "schemas.md", content=schema_page()))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Point at the figures where the site has them: beside the pages, not above them."""
    return OUTSIDE.sub(lambda link: f"]({link[1][3:]}{link[2]})", markdown)


def public_names(package: str) -> list[str]:
    """The public names of a package, but for its version."""
    return [name for name in import_module(package).__all__ if not name.startswith("__")]


def reference(package: str, text: str) -> str:
    """A page with every public name of a package."""
    names = "\n\n".join(f"::: {package}.{name}" for name in public_names(package))
    return f"# {package}\n\n{text}\n\n{names}\n"


def command_page() -> str:
    """What every command says of itself."""
    parts = ["# Commands\n\n`wellmixed COMMAND --help` says the same."]
    for words, command in below(main):
        context = click.Context(command, info_name=f"wellmixed {words}".strip(), max_content_width=100)
        parts.append(f"## {context.info_name}\n\n```text\n{command.get_help(context)}\n```")
    return "\n\n".join(parts) + "\n"


def schema_page() -> str:
    """The schemas of the commands' JSON, a table for each form of an output, from the files beside."""
    parts = [SCHEMAS]
    for path in sorted((ROOT / "docs" / "schemas").glob("*.json")):
        schema = json.loads(path.read_text(encoding="utf-8"))
        parts.append(f"## {schema['title'].removesuffix(' --json')}\n\n[{path.name}](schemas/{path.name})")
        for form in schema.get("anyOf", [schema]):
            rows = [
                f"| `{name}` | {shape_of(part)} | {'always' if name in form['required'] else 'sometimes'} |"
                for name, part in form["properties"].items()
            ]
            parts.append("\n".join(["| key | value | there |", "|---|---|---|", *rows]))
    return "\n\n".join(parts) + "\n"


def shape_of(schema: dict[str, Any]) -> str:
    """A schema in a few words: `list of number or null`."""
    found = []
    kinds = schema.get("type", ["anything"])
    for kind in kinds if "number" not in kinds else [kind for kind in kinds if kind != "null"]:
        if kind == "array":
            found.append(f"list of ({shape_of(schema['items'])})" if schema.get("items") else "list")
        elif kind == "object" and isinstance(schema.get("additionalProperties"), dict):
            found.append(f"map to {shape_of(schema['additionalProperties'])}")
        elif kind == "object":
            found.append("object of " + ", ".join(f"`{name}`" for name in schema.get("properties", {})))
        else:
            found.append(kind)
    return " or ".join(found)
