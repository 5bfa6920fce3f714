"""The answers that a scan keeps on disk as they come: a line of JSON a point, in one file a scan.

    folder/KEY.jsonl    KEY is of the questions and settings; each line has the key of its point, and a checksum

A point is found again by all that its answers depend on, so a grid may grow, and a file may serve other grids. What is
no whole line, or fails its checksum, is left out and its point made anew. The store of mechanics runs is a room of the
mechanics, for large records that many machines write; here a point is a few hundred bytes, and one process writes.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from kinetics.predicting.scanning.answering import ScanRequest
from kinetics.support.answer import Answer
from kinetics.support.output import append_line

NUMBERS = ("value", "low", "high", "cpu_seconds")  # of an answer
FORMAT = 4  # raised by hand when the same question would get another answer
SHOWN = 16  # of the digits of a SHA-256


class Checkpoints:
    """The answers that are on disk, by the key of their point; None as the folder keeps nothing."""

    def __init__(self, folder: str | Path | None, asked: ScanRequest) -> None:
        self.path: Path | None = None
        self.found: dict[str, tuple[Answer, ...]] = {}
        if folder is None:
            return
        place = Path(folder)
        if place.exists() and not place.is_dir():
            raise ValueError(f"{place} is a file; expected a folder for the points of scans: name another")
        place.mkdir(parents=True, exist_ok=True)
        self.path = place / f"{sha256(f'{FORMAT} {asked!r}')[:SHOWN]}.jsonl"
        if self.path.is_file():
            lines = self.path.read_bytes().decode(errors="replace").split("\n")
            self.found = dict(point for line in lines if (point := _read(line, len(asked.questions))) is not None)

    def get(self, key: str) -> tuple[Answer, ...] | None:
        """The answers at a point, if they are there."""
        return self.found.get(sha256(f"{FORMAT} {key}"))

    def add(self, key: str, answers: Sequence[Answer]) -> None:
        """Keep the answers at a point."""
        if self.path is None:
            return
        content = {"key": sha256(f"{FORMAT} {key}"), "answers": [_plain(each.to_dict()) for each in answers]}
        append_line(self.path, json.dumps({**content, "check": _checksum(content)}, allow_nan=False))


def sha256(text: str) -> str:
    """The SHA-256 digest of a text, in hexadecimal."""
    return hashlib.sha256(text.encode()).hexdigest()


def _read(line: str, n_questions: int) -> tuple[str, tuple[Answer, ...]] | None:
    """Key and answers of a line; None if it is none, or damaged."""
    try:
        content = json.loads(line)
        check = content.pop("check")
        if check != _checksum(content) or len(content["answers"]) != n_questions:
            return None
        answers = tuple(Answer(**_numbers(each)) for each in content["answers"])
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return None
    return str(content["key"]), answers


def _checksum(content: dict[str, Any]) -> str:
    return sha256(json.dumps(content, sort_keys=True))[:SHOWN]


def _plain(answer: dict[str, Any]) -> dict[str, Any]:
    """Non-finite numbers as text, since JSON has none."""
    return {
        name: repr(value) if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in answer.items()
    }


def _numbers(answer: dict[str, Any]) -> dict[str, Any]:
    return {name: float(value) if name in NUMBERS else value for name, value in answer.items()}
