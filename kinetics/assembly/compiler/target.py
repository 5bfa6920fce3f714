"""Targets: the structures that rule books are compiled for, as a person writes them down."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta

from kinetics.assembly.compiler.orientation import MOST, chosen_tops
from kinetics.assembly.faces import Position, scheme_of
from kinetics.assembly.rules.conditions import BookTarget, Direction, Senses
from kinetics.assembly.structure import Structure
from kinetics.support.config import find, read_toml
from kinetics.support.settings import Settings, validated
from kinetics.support.tables import counted

TARGETS = Path(__file__).parent.parent / "targets"
MAX_TARGET = 250  # cubes
MAX_COORDINATE = 1000
NO_CUBE = ". "
MARKS = "xyz"  # a cube whose top looks along that axis; # is a cube whose axis the compiler chooses
PLACEHOLDER = "#"  # the letter of a target's cubes until they have been given theirs
_JOIN = re.compile(r"[1-9]\d*(\.[a-z]+)?\+[1-9]\d*(\.[a-z]+)?(->[1-9]\d*(\.[a-z]+)?)?")


class TargetFile(Settings):
    """A target as it is written down: `layers`, or `cubes`.

    layers : one text a layer, from the lowest z up; rows from the highest y down, x to the right. A dot or a space is
        no cube, # a cube, x, y or z a cube whose top and bottom lie along that axis (mark all cubes or none)
    cubes : their places; tops, fronts : as in a book's target; left out, the compiler turns the cubes
    seed : the place of the cube from which the assembly grows (in layers: column, row from below, layer, from 0)
    joins : `all`, or those allowed: by sizes, `1+2`, or as the compiler names them, `2.a+1->3.b`
    """

    layers: Annotated[tuple[str, ...], Meta(min_length=1)] | None = None
    cubes: tuple[tuple[int, int, int], ...] | None = None
    tops: tuple[Direction, ...] | None = None
    fronts: tuple[Direction, ...] | None = None
    seed: tuple[int, int, int] | None = None
    senses: Senses | None = None
    joins: tuple[str, ...] | Literal["all"] | None = None
    breaks: bool = True
    max_letters: Annotated[int, Meta(ge=2)] | None = None

    @property
    def allowed(self) -> tuple[str, ...] | None:
        """The joins without spaces, `1 + 2` as `1+2`; None: all."""
        if self.joins is None or isinstance(self.joins, str):
            return None
        return tuple(join.replace(" ", "") for join in self.joins)


@dataclass(frozen=True)
class Target:
    """The structure to build, and the means that the rules may use.

    positions : lattice places, all different, connected through faces
    tops, fronts : direction in which each cube's top, and its front, point; None: the compiler turns the cubes
    senses : what the cubes can sense; None: the least that is enough
    seed : the place of the cube from which the assembly grows; None: it grows from free cubes alone
    joins : those allowed, by sizes (`1+2`) or by name (`2.a+1->3.b`); None: all
    breaks : whether bonds break
    max_letters : most letters of a book; None: as many as it takes
    """

    name: str
    positions: tuple[Position, ...]
    tops: tuple[Direction, ...] | None = None
    fronts: tuple[Direction, ...] | None = None
    senses: Senses | None = None
    seed: Position | None = None
    joins: tuple[str, ...] | None = None
    breaks: bool = True
    max_letters: int | None = None

    def __post_init__(self) -> None:
        n = len(self.positions)
        if not 2 <= n <= MAX_TARGET:
            raise ValueError(f"a target of {counted(n, 'cube')}; it must have 2 to {MAX_TARGET}")
        for position in self.positions:
            if max(map(abs, position)) > MAX_COORDINATE:
                raise ValueError(f"a cube at {position}; coordinates reach from -{MAX_COORDINATE} to {MAX_COORDINATE}")
        if self.seed is not None and self.seed not in self.positions:
            raise ValueError(f"seed: there is no cube at {self.seed}; give the place of one of the target's cubes")
        if self.fronts is not None and self.tops is None:
            raise ValueError("fronts without tops; give both, or tops alone")
        for join in self.joins or ():
            check_join(join)
        if self.joins is not None and not self.joins:
            raise ValueError("joins: an empty list allows none; leave it out to allow all")
        if self.max_letters is not None and self.max_letters < 2:
            raise ValueError(f"max_letters = {self.max_letters}; a book needs at least 2")
        self.structure("two")  # checks overlap, connection and directions

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def is_seeded(self) -> bool:
        """Whether it is grown from a seed: asked for, or too large to try all its parts."""
        return self.seed is not None or len(self) > MOST

    @classmethod
    def load(cls, name_or_path: str | Path) -> Target:
        """A shipped target by its name (`line4`), or one's own TOML file."""
        path = find(name_or_path, TARGETS, "target")
        content = validated(TargetFile, read_toml(path), path)
        fields = {
            name: getattr(content, name) for name in ("tops", "fronts", "seed", "senses", "breaks", "max_letters")
        }
        fields["joins"] = content.allowed
        try:
            if (content.layers is None) == (content.cubes is None):
                raise ValueError("give the cubes' places either as `layers` or as `cubes`")
            if content.layers is None:
                return cls(name=path.stem, positions=content.cubes or (), **fields)
            if content.tops is not None or content.fronts is not None:
                raise ValueError("tops and fronts go with `cubes`; in `layers`, draw cubes as x, y or z")
            positions, tops = read_layers(content.layers)
            return cls(name=path.stem, positions=positions, **fields | {"tops": tops})
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None

    def structure(self, scheme: str) -> Structure:
        """The target of cubes with that face scheme, letters open (#); cubes are turned as asked, or as suits best."""
        tops = self.tops
        if tops is None:
            tops = chosen_tops(self.positions) if scheme_of(scheme).name == "two" else None
        letters = (PLACEHOLDER,) * len(self.positions)
        return BookTarget(cubes=self.positions, letters=letters, tops=tops, fronts=self.fronts).structure()


def describes_target(path: Path) -> bool:
    """Whether a TOML file describes a target rather than a book: it places cubes, and has no letters."""
    content = read_toml(path)
    return "letters" not in content and not {"layers", "cubes"}.isdisjoint(content)


def check_join(join: str) -> None:
    """ValueError if a join is not written as one."""
    if not _JOIN.fullmatch(join):
        raise ValueError(f"joins: {join!r} is none; write sizes, as in 1+2, or names, as in 2.a+1->3.b")


def read_layers(layers: tuple[str, ...]) -> tuple[tuple[Position, ...], tuple[Direction, ...] | None]:
    """Places, and tops if they are marked, of cubes drawn in layers (see TargetFile)."""
    drawn = [layer.strip("\n").split("\n") for layer in layers]
    shapes = {(len(layer), len(row)): (z, y) for z, layer in enumerate(drawn) for y, row in enumerate(layer)}
    if len(shapes) > 1:
        (rows, columns), (other_rows, other_columns) = list(shapes)[:2]
        z, y = shapes[other_rows, other_columns]
        raise ValueError(
            f"layers: row {y + 1} of layer {z + 1} is one of {other_rows} rows and has {other_columns} characters, "
            f"others have {rows} rows of {columns}; fill up with dots"
        )
    positions: list[Position] = []
    marks = []
    for z, layer in enumerate(drawn):
        for y, row in enumerate(reversed(layer)):
            for x, mark in enumerate(row):
                if mark in NO_CUBE:
                    continue
                if mark not in MARKS + PLACEHOLDER:
                    raise ValueError(
                        f"layers: {mark!r} in row {len(layer) - y} of layer {z + 1}; draw a cube as #, or as x, y or z "
                        "where its top looks along that axis, and no cube as a dot"
                    )
                positions.append((x, y, z))
                marks.append(mark)
    if PLACEHOLDER in marks and len(set(marks)) > 1:
        raise ValueError("layers: some cubes are drawn as #, others as x, y or z; mark the axes of all or of none")
    tops = None if PLACEHOLDER in marks or not marks else tuple(marks)
    return tuple(positions), tops  # type: ignore[return-value]  # marks are directions
