"""Drawings of counterexamples: each fault of a rule book with the shortest sequence of events to it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from kinetics.assembly.drawing.drawable_cubes import DrawableCubes
from kinetics.assembly.drawing.drawing import Drawing, width_of
from kinetics.assembly.drawing.pictures import GAP, arranged, below_left, face_key, note, posed, structure_drawing
from kinetics.support.plots import COLOURS

ERROR, WARNING = COLOURS[5], COLOURS[0]
HEADING = 0.42  # font size
SIGN = 0.6  # font size of + between structures


class Counterexample(NamedTuple):
    """A fault of a rule book as it is drawn.

    text : what is wrong
    is_error : else it is a warning
    steps : the events that lead there, in words; changes : their structures before and after, as they are to lie
    structure : where it leads to; drawn by itself if there are no changes
    """

    text: str
    is_error: bool
    steps: Sequence[str] = ()
    changes: Sequence[tuple[Sequence[DrawableCubes], Sequence[DrawableCubes]]] = ()
    structure: DrawableCubes | None = None


def report_drawing(
    title: str, findings: Sequence[Counterexample], scheme: str = "two", most_wide: float = 24.0
) -> Drawing:
    """All findings one below the other, in their order."""
    sheet = Drawing()
    sheet.put(note(title, HEADING))
    gap = GAP
    for finding in findings:
        below_left(sheet, counterexample_drawing(finding, scheme, most_wide), gap)
        gap = 2 * GAP if finding.structure or finding.changes else GAP
    if any(finding.structure or finding.changes for finding in findings):
        below_left(sheet, face_key(scheme), 2 * GAP)
    return sheet


def counterexample_drawing(finding: Counterexample, scheme: str, most_wide: float = 24.0) -> Drawing:
    """A text that says what is wrong, then the steps that lead there; the last picture is the counterexample."""
    sheet = Drawing()
    colour, word = (ERROR, "error") if finding.is_error else (WARNING, "warning")
    text = f"{word}: {finding.text}"
    for number, line in enumerate(wrapped(text, HEADING, most_wide)):
        sheet.write(line, 0, -1.3 * HEADING * number, HEADING, align=0, colour=colour)
    if finding.changes:
        pictures = [change_drawing(*change, scheme) for change in finding.changes]
        captions = [f"{n}.  {step.split(':')[0].replace('->', '→')}" for n, step in enumerate(finding.steps, 1)]
        below_left(sheet, arranged(pictures, captions, most_wide, 3 * GAP))
    elif finding.structure is not None:
        below_left(sheet, structure_drawing(posed(finding.structure), scheme))
    return sheet


def change_drawing(before: Sequence[DrawableCubes], after: Sequence[DrawableCubes], scheme: str) -> Drawing:
    """Structures before, an arrow, structures after, as they lie."""
    row = Drawing()
    x = _row(row, before, scheme, 0.0)
    row.arrow([(x + 0.1, 0.0), (x + 0.9, 0.0)], width=1.2)
    _row(row, after, scheme, x + 1.0)
    return row


def wrapped(text: str, size: float, most_wide: float) -> list[str]:
    """Words in lines no wider than `most_wide`; a longer word has a line for itself."""
    lines: list[str] = []
    for word in text.split():
        if lines and width_of(f"{lines[-1]} {word}", size) <= most_wide:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines


def _row(row: Drawing, structures: Sequence[DrawableCubes], scheme: str, x: float) -> float:
    """Structures with a plus between them, from x to the right; where they end."""
    for number, structure in enumerate(structures):
        if number:
            row.write("+", x + 0.35, 0, SIGN)
            x += 0.7
        picture = structure_drawing(structure, scheme)
        left, bottom, right, top = picture.bounds
        row.put(picture, x - left + 0.1, -(bottom + top) / 2)
        x += right - left + 0.2
    return x
