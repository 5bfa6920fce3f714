"""Reaction networks as graphs: structures in columns by size, a small disc for each reaction between them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from kinetics.assembly.drawing.drawable_cubes import DrawableCubes
from kinetics.assembly.drawing.drawing import HEAD, INK, Drawing, width_of
from kinetics.assembly.drawing.pictures import (
    CAPTION,
    GAP,
    NOT_ALL,
    below_left,
    face_key,
    note,
    posed,
    structure_drawing,
)
from kinetics.support.packages import optimize
from kinetics.support.plots import COLOURS

MOST_SPECIES = 24  # drawn one by one
MOST_REACTIONS = 60
SMALL, WIDEST = 0.55, 2.4  # scale of the pictures, and their greatest width
WORDS = 0.3  # font size
JOIN, BREAK = COLOURS[0], COLOURS[5]
BREAK_STYLE = (0, (4, 2))
COLOUR = {"join": JOIN, "break": BREAK}
SIGNS = {"join": "→", "break": "←"}
SWEEPS = 12
NEAR, FAR, SLOPE = 0.6, 1.5, 0.5  # room between layers: least, most, and how it grows with a line's rise


class DrawnChannel(NamedTuple):
    """A channel of a network: a join of two species or a break of one, given by their numbers, with its ways N."""

    before: Sequence[int]
    after: Sequence[int]
    ways: float


class SpeciesGroup(NamedTuple):
    """Species that are drawn as one: a single one, or all of one size."""

    name: str
    shown: DrawableCubes
    n_species: int


@dataclass
class DrawnReaction:
    """A join and the break that undoes it, if there are both; of lumped species, all such.

    larger, smaller : the parts; the smaller one is named at the disc
    join, break : ways N, or of lumped species the number of channels; 0 if there are none
    """

    larger: int
    smaller: int
    whole: int
    ways: dict[str, float] = field(default_factory=lambda: {"join": 0.0, "break": 0.0})


@dataclass(eq=False)
class Item:
    """Something with a place in a layer: a group, a reaction's disc, or a reaction's line that passes by."""

    high: float
    wide: float
    group: int | None = None
    reaction: DrawnReaction | None = None
    is_disc: bool = False
    before: list[Item] = field(default_factory=list)  # in the layer to the left
    after: list[Item] = field(default_factory=list)
    x: float = 0.0
    y: float = 0.0


class Link(NamedTuple):
    """A piece of a reaction's line, from one layer to the next."""

    left: Item
    right: Item
    reaction: DrawnReaction


def network_drawing(
    species: Mapping[str, DrawableCubes],
    channels: Sequence[DrawnChannel],
    scheme: str = "two",
    is_closed: bool = True,
    max_species: int = MOST_SPECIES,
    max_reactions: int = MOST_REACTIONS,
    most_wide: float = 26.0,
) -> Drawing:
    """Species by size from left to right, in rows no wider than `most_wide` cube edges.

    is_closed : whether these are known to be all species; the drawing says if they are not
    max_species, max_reactions : of a larger network, all species of one size are drawn as one, with their number and
        that of the channels between them; the drawing says so
    """
    if max_species < 1 or max_reactions < 1:
        raise ValueError(f"max_species = {max_species}, max_reactions = {max_reactions}; both must be at least 1")
    groups, reactions = grouped(species, channels, lump=False)
    is_lumped = len(groups) > max_species or len(reactions) > max_reactions
    if is_lumped:
        groups, reactions = grouped(species, channels, lump=True)
    pictures = [structure_drawing(posed(group.shown), scheme) for group in groups]
    scale = min(SMALL, WIDEST / max(right - left for left, _, right, _ in (picture.bounds for picture in pictures)))
    layers, links = _layers(groups, reactions, pictures, scale)
    _order(layers)
    _settle(layers)
    drawing = Drawing()
    for row in _rows(layers, most_wide):
        part = Drawing()
        _draw_links(part, row, links, groups)
        for item in (item for layer in row for item in layer):
            if item.group is not None:
                _draw_group(part, item, groups[item.group], pictures[item.group], scale)
            elif item.reaction is not None and item.is_disc:
                _draw_disc(part, item, item.reaction, groups)
        if drawing.shapes:
            below_left(drawing, part)
        else:
            drawing.put(part)
    if reactions:
        below_left(drawing, _key(reactions, is_lumped), 2 * GAP)
    notes = [_lumped_note(len(species), len(channels), len(groups))] if is_lumped else []
    for line in [*notes, *([] if is_closed else [NOT_ALL])]:
        below_left(drawing, note(line), 0.3)
    below_left(drawing, face_key(scheme), 0.4)
    return drawing


def grouped(
    species: Mapping[str, DrawableCubes], channels: Iterable[DrawnChannel], lump: bool
) -> tuple[list[SpeciesGroup], list[DrawnReaction]]:
    """Groups by size, and the reactions between them. Lumped: one group a size, the seed apart from free cubes."""
    structures = list(species.values())
    keys = [(len(s), name if len(s) == 1 or not lump else "") for name, s in species.items()]
    order = sorted(set(keys), key=keys.index)
    groups = []
    for key in order:
        members = [number for number, other in enumerate(keys) if other == key]
        name = key[1] or f"{key[0]} cubes"
        groups.append(SpeciesGroup(name, structures[members[0]], len(members)))
    if not lump:
        groups = [SpeciesGroup(name, structure, 1) for name, structure in species.items()]
    place = {key: number for number, key in enumerate(order)}
    of = [place[key] for key in keys] if lump else list(range(len(structures)))
    found: dict[tuple[int, int, int], DrawnReaction] = {}
    for before, after, ways in channels:
        kind, parts, (whole,) = ("join", before, after) if len(before) == 2 else ("break", after, before)
        smaller, larger = sorted((of[n] for n in parts), key=lambda n: (len(groups[n].shown), n))
        reaction = found.setdefault((larger, smaller, of[whole]), DrawnReaction(larger, smaller, of[whole]))
        reaction.ways[kind] += 1 if lump else ways
    return groups, list(found.values())


def _layers(
    groups: Sequence[SpeciesGroup], reactions: Sequence[DrawnReaction], pictures: Sequence[Drawing], scale: float
) -> tuple[list[list[Item]], list[Link]]:
    """Columns of groups, with a layer of discs before each; what goes past a column has an item in it."""
    sizes = sorted({len(group.shown) for group in groups})
    layers: list[list[Item]] = [[] for _ in range(2 * len(sizes) - 1)]
    items = []
    layer_of = [2 * sizes.index(len(group.shown)) for group in groups]
    for number, group in enumerate(groups):
        left, bottom, right, top = pictures[number].bounds
        wide = max(scale * (right - left), *(width_of(text, WORDS) for text in _words(group)))
        high = scale * (top - bottom) + 1.4 * WORDS * len(_words(group)) + 0.3
        items.append(Item(high, wide, group=number))
        layers[layer_of[number]].append(items[-1])
    links = []
    for reaction in reactions:
        partner = width_of(f"+ {groups[reaction.smaller].name}", WORDS)
        disc = Item(1.15, max(partner, 1.2), None, reaction, is_disc=True)
        last = layer_of[reaction.whole] - 1
        way = [items[reaction.larger]]
        for layer in range(layer_of[reaction.larger] + 1, last):
            way.append(Item(0.5, 0.0, None, reaction))
            layers[layer].append(way[-1])
        layers[last].append(disc)
        links += [Link(left, right, reaction) for left, right in pairwise([*way, disc, items[reaction.whole]])]
    for link in links:
        link.left.after.append(link.right)
        link.right.before.append(link.left)
    return layers, links


def _order(layers: list[list[Item]]) -> None:
    """Fewer crossings: again and again each item goes to the mean height of its neighbours (Sugiyama et al. 1981)."""
    for layer in layers:
        for number, item in enumerate(layer):
            item.y = float(-number)
    for sweep in range(SWEEPS):
        for layer in layers if sweep % 2 == 0 else reversed(layers):
            for item in layer:
                beside = item.before if sweep % 2 == 0 else item.after
                if beside:
                    item.y = round(float(np.mean([other.y for other in beside])), 9)
            layer.sort(key=lambda item: -item.y)
            for number, item in enumerate(layer):
                item.y = (len(layer) - 1) / 2 - number


def _settle(layers: list[list[Item]]) -> None:
    """Heights as near to those of the neighbours as the room that each item needs allows."""
    for layer in layers:
        _spread(layer, [0.0] * len(layer))
    for _ in range(SWEEPS):
        for layer in layers:
            wanted = [float(np.mean([o.y for o in item.before + item.after] or [0.0])) for item in layer]
            _spread(layer, wanted)


def _spread(layer: Sequence[Item], wanted: Sequence[float]) -> None:
    """The heights in this order, without overlap, with the least squares from those wanted: isotonic regression."""
    if not layer:
        return
    tops = np.cumsum([0.0, *(-(a.high + b.high) / 2 for a, b in pairwise(layer))])
    heights = tops + optimize.isotonic_regression(np.array(wanted) - tops, increasing=False).x
    for item, height in zip(layer, heights.tolist(), strict=True):
        item.y = round(height, 9)


def _rows(layers: Sequence[Sequence[Item]], most_wide: float) -> list[list[Sequence[Item]]]:
    """Set the layers side by side, and begin a new row with a layer of discs where a column would not fit any more.

    Lines run level across the columns and bend in the room between them, which is wider where they rise more.
    """
    rows: list[list[Sequence[Item]]] = [[]]
    columns = [max((item.wide for item in layer), default=0.0) for layer in layers]
    for column, layer in zip(columns, layers, strict=True):
        for item in layer:
            if item.group is None:
                item.wide = column
    rises = [max((abs(item.y - o.y) for item in layer for o in item.after), default=0.0) for layer in layers]
    rooms = [min(NEAR + SLOPE * rise, FAR) for rise in rises]
    x = 0.0
    for number in range(0, len(layers), 2):
        step = range(max(number - 1, 0), number + 1)
        if rows[-1] and x + sum(columns[n] + rooms[n] for n in step) - rooms[number] > most_wide:
            rows.append([])
            x = 2.0  # room for the names of what comes from the row above
        for n in step:
            for item in layers[n]:
                item.x = x + columns[n] / 2
            x += columns[n] + rooms[n]
            rows[-1].append(layers[n])
    return rows


def _draw_links(
    drawing: Drawing, row: Sequence[Sequence[Item]], links: Sequence[Link], groups: Sequence[SpeciesGroup]
) -> None:
    """The lines within a row; one that leaves it ends there, and goes on in the next row from a name."""
    here = {id(item) for layer in row for item in layer}
    for item in (item for layer in row for item in layer):
        if item.reaction is not None:
            colour, style = _look(item.reaction)
            drawing.curve([(item.x - item.wide / 2, item.y), (item.x + item.wide / 2, item.y)], colour, 0.9, style)
    for left, right, reaction in links:
        starts, ends = id(left) in here, id(right) in here
        if not starts and not ends:
            continue
        start, end = (left.x + _half(left), left.y), (right.x - _half(right), right.y)
        if not ends:
            end = (start[0] + 0.5, start[1])
            drawing.write("…", end[0] + 0.25, end[1], WORDS)
        if not starts:
            start = (end[0] - 0.6, end[1])
            drawing.write(groups[reaction.larger].name, start[0] - 0.1, start[1], WORDS, align=1)
        colour, style = _look(reaction)
        middle = (start[0] + end[0]) / 2
        points = [start, (middle, start[1]), (middle, end[1]), end]
        leads_on = reaction.ways["join"] > 0 and ends and right.group is not None
        (drawing.arrow if leads_on else drawing.curve)(points, colour, 0.9, style, ("link", reaction.whole))
        if reaction.ways["break"] and starts and left.group is not None:
            drawing.arrow([(start[0] + HEAD[0] + 0.01, start[1]), start], colour, 0.9)


def _look(reaction: DrawnReaction) -> tuple[str, Any]:
    """Colour and style of a reaction's line."""
    if all(reaction.ways.values()):
        return INK, "solid"
    return (JOIN, "solid") if reaction.ways["join"] else (BREAK, BREAK_STYLE)


def _half(item: Item) -> float:
    return item.wide / 2 + (0.08 if item.group is not None else 0.0)


def _draw_group(drawing: Drawing, item: Item, group: SpeciesGroup, picture: Drawing, scale: float) -> None:
    words = _words(group)
    left, bottom, right, top = picture.bounds
    middle = item.y + 0.7 * WORDS * len(words)
    drawing.put(picture, item.x - scale * (left + right) / 2, middle - scale * (bottom + top) / 2, scale)
    y = middle - scale * (top - bottom) / 2 - 0.25
    for line in words:
        drawing.write(line, item.x, y, WORDS)
        y -= 1.3 * WORDS


def _draw_disc(drawing: Drawing, item: Item, reaction: DrawnReaction, groups: Sequence[SpeciesGroup]) -> None:
    drawing.disc((item.x, item.y), 0.11, INK)
    drawing.write(f"+ {groups[reaction.smaller].name}", item.x, item.y - 0.36, WORDS)
    texts = [(f"{SIGNS[kind]} {n:g}", COLOUR[kind]) for kind, n in reaction.ways.items() if n]
    x = item.x - sum(width_of(text, WORDS) + 0.25 for text, _ in texts) / 2 + 0.125
    for text, colour in texts:
        drawing.write(text, x, item.y + 0.36, WORDS, align=0, colour=colour)
        x += width_of(text, WORDS) + 0.25


def _words(group: SpeciesGroup) -> list[str]:
    return [group.name, *([f"{group.n_species} species"] if group.n_species > 1 else [])]


def _key(reactions: Sequence[DrawnReaction], is_lumped: bool) -> Drawing:
    """What numbers and lines mean, as far as they occur."""
    key = Drawing()
    what = "channels" if is_lumped else "ways N"
    x = 0.0
    for kind, words in (("join", f"→ {what} to join"), ("break", f"← {what} to break")):
        if any(reaction.ways[kind] for reaction in reactions):
            key.write(words, x, 0, CAPTION, align=0, colour=COLOUR[kind])
            x += width_of(words, CAPTION) + 0.8
    looks = {_look(reaction)[0] for reaction in reactions}
    for colour, style, words in (
        (INK, "solid", "both ways"),
        (JOIN, "solid", "join only"),
        (BREAK, BREAK_STYLE, "break only"),
    ):
        if colour in looks:
            key.curve([(x, 0), (x + 0.9, 0)], colour, 0.9, style)
            key.write(words, x + 1.1, 0, CAPTION, align=0)
            x += 1.1 + width_of(words, CAPTION) + 0.8
    return key


def _lumped_note(n_species: int, n_channels: int, n_groups: int) -> str:
    return (
        f"{n_species} species and {n_channels} channels, lumped by size into {n_groups}; of each size one species is "
        "shown"
    )
