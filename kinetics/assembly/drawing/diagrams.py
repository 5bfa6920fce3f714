"""State diagrams: a node for each letter, an arrow for each change of letter, a key of the rules."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from itertools import pairwise, permutations
from typing import NamedTuple

import numpy as np

from kinetics.assembly.drawing.drawing import INK, Drawing, Point, width_of
from kinetics.support.arrays import Floats
from kinetics.support.plots import COLOURS

MOST_ORDERED = 8  # letters; of more, trying every order around the circle takes too long
NODE = 0.5  # radius
LOOP = 1.35  # how far a self loop reaches out
LETTER, TAG, WORDS = 0.6, 0.38, 0.36  # font sizes
SHORT = 4  # characters; longer names of rules are numbered in the diagram
ROW = 0.56  # of the key


class ArrowStyle(NamedTuple):
    """How arrows of a kind of rules look."""

    words: str
    colour: str
    style: str | tuple[float, tuple[float, ...]]


COMBINATION = ArrowStyle("a bond forms", COLOURS[0], "solid")
DISSOCIATION = ArrowStyle("a bond breaks", COLOURS[5], (0, (4, 2)))
INTERNAL = ArrowStyle("then the others follow", COLOURS[2], (0, (1, 1.2)))
STYLES = {"combine": COMBINATION, "dissociate": DISSOCIATION, "internal": INTERNAL}


class DrawnRule(NamedTuple):
    """A rule as a diagram shows it.

    kind : `combine`, `dissociate` or `internal`
    letters, becomes : those that it changes, and into what
    words : what it asks and does, in short
    """

    kind: str
    name: str
    letters: Sequence[str]
    becomes: str
    words: str


class Arrow(NamedTuple):
    """All rules of a kind that take one letter to another."""

    before: str
    after: str
    style: ArrowStyle
    rules: tuple[str, ...]


def state_diagram(
    letters: Sequence[str],
    rules: Sequence[DrawnRule],
    initial: str,
    seed: str | None = None,
    final: Collection[str] = (),
    notes: Iterable[str] = (),
) -> Drawing:
    """Letters around a circle and the rules between them, then the key with the notes below.

    initial, seed : the letters of a free cube and of the seed
    final : letters of the finished structure; they have a double ring
    A rule has an arrow from every letter that it changes.
    """
    tags = _tags(rules)
    arrows = _arrows(rules, tags)
    places = _places(letters, initial, arrows)
    drawing = Drawing()
    curves = [_curve(arrow, number, places) for arrow, number in _numbered(arrows)]
    for arrow, points in zip(arrows, curves, strict=True):
        drawing.arrow(points, arrow.style.colour, 1.3, arrow.style.style, ("arrow", arrow.before, arrow.after))
    loops = {arrow.before for arrow in arrows if arrow.before == arrow.after}
    for letter, place in places.items():
        drawing.disc(place, NODE, "#FFFFFF", INK, 1.2)
        if letter in final:
            drawing.disc(place, NODE - 0.08, None, INK, 0.8)
        drawing.write(letter, *place, min(LETTER, 0.7 * LETTER / max(width_of(letter, LETTER), 1e-9)))
        role = {initial: "free", seed: "seed"}.get(letter, "")
        angle = math.atan2(place[1], place[0]) + (1.1 if letter in loops else 0.0)
        reach = NODE + 0.3 + abs(math.cos(angle)) * width_of(role, WORDS) / 2
        drawing.write(role, place[0] + reach * math.cos(angle), place[1] + reach * math.sin(angle), WORDS)
    _label(drawing, arrows, curves, list(places.values()))
    _, _, right, _ = drawing.bounds
    key = _key(rules, tags, notes)
    _, bottom, _, top = key.bounds
    drawing.put(key, right + 1.0, -(bottom + top) / 2)
    return drawing


def _tags(rules: Sequence[DrawnRule]) -> dict[str, str]:
    """Rule -> what stands at its arrow: its name, or a number where names are long."""
    is_short = all(len(rule.name) <= SHORT for rule in rules)
    return {rule.name: rule.name if is_short else str(number) for number, rule in enumerate(rules, 1)}


def _arrows(rules: Sequence[DrawnRule], tags: dict[str, str]) -> list[Arrow]:
    bundles: dict[tuple[str, str, str], list[str]] = {}
    for rule in rules:
        for letter in rule.letters:
            bundles.setdefault((letter, rule.becomes, rule.kind), []).append(tags[rule.name])
    return [Arrow(before, after, STYLES[kind], tuple(names)) for (before, after, kind), names in bundles.items()]


def _places(letters: Sequence[str], first: str, arrows: Sequence[Arrow]) -> dict[str, Point]:
    """Letters around a circle from the left, clockwise, in the order that keeps arrows short."""
    n = len(letters)
    rest = [letter for letter in letters if letter != first]
    links = [(arrow.before, arrow.after) for arrow in arrows]

    def length(order: Sequence[str]) -> float:
        at = {letter: place for place, letter in enumerate((first, *order))}
        return sum(math.sin(math.pi * abs(at[a] - at[b]) / n) for a, b in links)

    # round: orders that differ by the last bit alone would come out as the machine likes
    order = min(permutations(rest), key=lambda o: round(length(o), 9)) if n <= MOST_ORDERED else rest
    radius = 0.0 if n == 1 else max(2.4, 3.0 / (2 * math.sin(math.pi / n)))
    angles = [math.pi - 2 * math.pi * place / n for place in range(n)]
    return {
        letter: (1.2 * radius * math.cos(angle), radius * math.sin(angle))
        for letter, angle in zip((first, *order), angles, strict=True)
    }


def _numbered(arrows: Sequence[Arrow]) -> list[tuple[Arrow, int]]:
    """Each arrow with its number among those with the same ends."""
    return [
        (arrow, sum((other.before, other.after) == (arrow.before, arrow.after) for other in arrows[:number]))
        for number, arrow in enumerate(arrows)
    ]


def _curve(arrow: Arrow, number: int, places: dict[str, Point]) -> list[Point]:
    """Bezier points of an arrow: to the left of its way, further out for each one beside it; or a loop outwards."""
    start, end = (np.array(places[letter]) for letter in (arrow.before, arrow.after))
    if arrow.before == arrow.after:
        outwards = math.atan2(start[1], start[0]) + (0.9 * (number + 1) // 2 * (-1) ** number)
        return [
            _polar(start, radius, outwards + turn)
            for radius, turn in ((NODE, 0.5), (NODE + LOOP, 0.55), (NODE + LOOP, -0.55), (NODE + 0.04, -0.5))
        ]
    along = end - start
    bend = 0.16 + 0.16 * number
    middle = (start + end) / 2 + bend * np.array([-along[1], along[0]])
    first, last = (math.atan2(*(middle - node)[::-1]) for node in (start, end))
    return [_polar(start, NODE, first), _as_point(middle), _polar(end, NODE + 0.04, last)]


def _label(drawing: Drawing, arrows: Sequence[Arrow], curves: Sequence[list[Point]], nodes: Sequence[Point]) -> None:
    """Write the rules on their arrows where they cover least of anything else."""
    sampled = [_sampled(points) for points in curves]
    taken = [(x - NODE, y - NODE, x + NODE, y + NODE) for x, y in nodes]
    for number, arrow in enumerate(arrows):
        lines = [", ".join(arrow.rules[at : at + 3]) for at in range(0, len(arrow.rules), 3)]
        wide, high = max(width_of(line, TAG) for line in lines) + 0.16, 1.15 * TAG * len(lines) + 0.06
        others = np.vstack([curve for other, curve in enumerate(sampled) if other != number] or [np.empty((0, 2))])

        def cost(spot: Floats, wide: float = wide, high: float = high, others: Floats = others) -> float:
            box = (spot[0] - wide / 2, spot[1] - high / 2, spot[0] + wide / 2, spot[1] + high / 2)
            inside = np.abs(others - spot) < (wide / 2, high / 2)
            return 20 * sum(_overlap(box, other) for other in taken) + float(inside.all(axis=1).sum())

        spots = sampled[number]
        middle = len(spots) // 2
        if arrow.before == arrow.after:  # just outside the loop
            outwards = spots[middle] - (spots[0] + spots[-1]) / 2
            outwards /= math.hypot(*outwards)
            room = np.abs(outwards) @ (wide / 2, high / 2) + 0.06
            x, y = (spots[middle] + room * outwards).tolist()
        else:
            order = sorted(range(6, len(spots) - 6), key=lambda at: (abs(at - middle), at))
            x, y = min((spots[at] for at in order), key=lambda spot: round(cost(spot), 6)).tolist()
        taken.append((x - wide / 2, y - high / 2, x + wide / 2, y + high / 2))
        left, bottom, right, top = taken[-1]
        drawing.polygon([(left, bottom), (right, bottom), (right, top), (left, top)], "#FFFFFF")
        for row, line in enumerate(lines):
            drawing.write(line, x, y + 1.15 * TAG * ((len(lines) - 1) / 2 - row), TAG, colour=arrow.style.colour)


def _key(rules: Sequence[DrawnRule], tags: dict[str, str], notes: Iterable[str]) -> Drawing:
    """Every rule in short, by kind."""
    key = Drawing()
    y = 0.0
    names = {rule.name: "" if tags[rule.name] == rule.name else rule.name for rule in rules}
    indent = 0.5 + max((width_of(tag, WORDS) for tag in tags.values()), default=0.0)
    column = indent + max((width_of(name, WORDS) + 0.4 for name in names.values() if name), default=0.0)
    for kind, style in STYLES.items():
        own = [rule for rule in rules if rule.kind == kind]
        if not own:
            continue
        key.arrow([(0, y), (1.3, y)], style.colour, 1.3, style.style)
        key.write(style.words, 1.6, y, WORDS, align=0, colour=style.colour)
        for rule in own:
            y -= ROW
            key.write(tags[rule.name], 0, y, WORDS, align=0, colour=style.colour)
            key.write(names[rule.name], indent, y, WORDS, align=0)
            key.write(rule.words, column, y, WORDS, align=0)
        y -= 1.5 * ROW
    for line in notes:
        key.write(line, 0, y, WORDS, align=0)
        y -= ROW
    return key


def _sampled(points: Sequence[Point], n: int = 41) -> Floats:
    """Points (n, 2) along a Bezier curve."""
    share = np.linspace(0, 1, n)[:, None]
    level = [np.array(point)[None] for point in points]
    while len(level) > 1:
        level = [(1 - share) * a + share * b for a, b in pairwise(level)]
    return level[0]


def _overlap(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    """The area that two boxes have in common."""
    wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    return max(wide, 0.0) * max(high, 0.0)


def _polar(centre: Floats, radius: float, angle: float) -> Point:
    return float(centre[0] + radius * math.cos(angle)), float(centre[1] + radius * math.sin(angle))


def _as_point(spot: Floats) -> Point:
    return float(spot[0]), float(spot[1])
