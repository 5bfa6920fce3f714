"""Docstrings as Markdown: their fields as a list, errors, source and cost as paragraphs, examples as code.

Ours say `times : (T,) tu, rising`, a field a line, with what follows indented; nothing else is read into them.
"""

from __future__ import annotations

import re
from typing import Any

import griffe

FIELD = re.compile(r"(\*{0,2}\w+(?:, \*{0,2}\w+)*) : (?=\S)")
PARAGRAPH = re.compile(r"(\w*(?:Error|Warning)|Sources?|Cost|Example)(?=:)")


class DocstringFields(griffe.Extension):
    """Rewrites every docstring as it is read. An extension of griffe, which reads sources without importing them."""

    def on_instance(self, *, obj: griffe.Object, **_: Any) -> None:
        """Of a module, class, function or attribute."""
        if obj.docstring is not None:
            obj.docstring.value = markdown(obj.docstring.value)


def markdown(docstring: str) -> str:
    """The docstring with its fields as a list and its examples between fences."""
    found: list[str] = []
    is_listed = is_code = False
    for line in docstring.splitlines():
        if is_code and not line.strip():
            found.append("```")
            is_code = False
        elif line.startswith(">>> ") and not is_code:
            found += ["", "```pycon"]
            is_code = True
        if not is_code:
            field, paragraph = FIELD.match(line), PARAGRAPH.match(line)
            if field:
                found += [] if is_listed else [""]
                line = f"- `{field[1]}` : {line[field.end() :]}"  # noqa: PLW2901
            elif paragraph or (is_listed and line[:1].strip()):
                found.append("")
            is_listed = bool(field) or (is_listed and not line[:1].strip())
        found.append(line)
    return "\n".join([*found, "```"] if is_code else found)
