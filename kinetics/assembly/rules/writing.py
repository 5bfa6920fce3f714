"""Rule books as the TOML text that `RuleBook.load` reads, laid out for people."""

from __future__ import annotations

import json
from collections.abc import Sequence
from textwrap import wrap
from typing import Any

from msgspec.structs import asdict

from kinetics.assembly.faces import turned
from kinetics.assembly.rules.conditions import DIRECTIONS, EXACT, BookTarget, Rule, Semantics, Senses
from kinetics.assembly.rules.rule_book import RuleBook
from kinetics.assembly.structure import Structure
from kinetics.support.settings import Settings

WIDTH = 118
KINDS = {
    "combine": "a bond forms",
    "dissociate": "a bond breaks",
    "internal": "then the others follow",
}
MULTISETS = (*EXACT, "has")  # lists even where they hold one letter or none


def written(book: RuleBook, note: str = "") -> str:
    """The book as TOML: what differs from the defaults, one table a rule.

    note : comment at the top, in lines or paragraphs
    Comments of a file that the book was loaded from are not known to it; its content, and so its fingerprint, stays.
    """
    lines = [f"# {line}".rstrip() for text in note.splitlines() for line in wrap(text, WIDTH - 2) or [""]]
    lines += [""] if lines else []
    lines += [*_entry("letters", book.letters), *_entry("initial", book.initial)]
    if book.seed_letter is not None:
        lines += _entry("seed", book.seed_letter)
    lines += ["", "[senses]", *_entry("faces", book.senses.faces)]
    lines += _changed(book.senses, Senses(faces=book.senses.faces))
    if semantics := _changed(book.semantics, Semantics()):
        lines += ["", "[semantics]", *semantics]
    if book.target is not None:
        lines += ["", "[target]", *_target(book.target)]
    for kind, meaning in KINDS.items():
        rules: Sequence[Rule] = getattr(book, kind)
        if rules:
            lines += ["", f"# --- {meaning} ---"]
        for rule in rules:
            lines += ["", f"[[{kind}]]", *_entry("rule", rule.rule)]
            for name, admitted in rule.conditions.items():
                if admitted is not None:
                    single = len(admitted) == 1 and name not in MULTISETS
                    lines += _entry(name, admitted[0] if single else admitted)
            lines += _entry("becomes", rule.becomes)
    return "\n".join(lines) + "\n"


def _changed(settings: Senses | Semantics, usual: Senses | Semantics) -> list[str]:
    """What is set other than usual."""
    values = ((name, getattr(settings, name)) for name in type(settings).__struct_fields__)
    return [line for name, value in values if value != getattr(usual, name) for line in _entry(name, value)]


def _target(target: Structure) -> list[str]:
    """The target's cubes; tops and fronts where they do not stand as they would without them."""
    cubes: dict[str, Any] = {"cubes": target.positions, "letters": target.letters}
    directions = [[DIRECTIONS[turned[rotation, face]] for rotation in target.rotations] for face in (4, 0)]
    for name, given in zip(("tops", "fronts"), directions, strict=True):
        if BookTarget(**cubes).structure().rotations != target.rotations:
            cubes[name] = tuple(given)
    return [line for name, value in cubes.items() for line in _entry(name, value)]


def _entry(key: str, value: Any) -> list[str]:
    """`key = value`, a long list over several lines."""
    line = f"{key} = {_value(value)}"
    if len(line) <= WIDTH or not isinstance(value, list | tuple):
        return [line]
    lines = [f"{key} = ["]
    for item in value:
        text = f"{_value(item)},"
        if len(lines) == 1 or len(lines[-1]) + 1 + len(text) > WIDTH:
            lines.append(f"  {text}")
        else:
            lines[-1] += f" {text}"
    return [*lines, "]"]


def _value(value: Any) -> str:
    if isinstance(value, Settings):
        return f"{{ {', '.join(f'{name} = {_value(item)}' for name, item in asdict(value).items())} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    # a JSON string is a TOML string except for the one control character that JSON leaves bare
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
