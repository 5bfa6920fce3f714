"""Studies as data: a scene, factors with their levels, and runs per point, read from TOML.

A run of a study ends at the first copy of the target, or at the cap. Runs that several studies share are made once:
the runs of a point depend on its scene and its number of cubes, not on the study.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta, field

from kinetics.support.config import find, read_toml
from kinetics.support.output import checked_name
from kinetics.support.settings import AtLeastOne, Positive, Settings, validated
from kinetics.support.stream_keys import seed_of
from mechsim.runs.record import RunSpec, book_of
from mechsim.runs.species import single_cubes, species_of
from mechsim.scene import Scene

STUDIES = Path(__file__).parent / "shipped"
NUMBER = "number"  # the one setting that is not the scene's: cubes in the tank


class Factor(Settings):
    """A setting that is varied, and the levels it takes.

    name : short, for tables and for `--points`; label : with its unit, for axes
    setting : `number`, or where it stands in the scene: `cubes.edge`, `agitation.sigma` (an effect's); left out: the
        level is a plain multiple, and only `also` says of what
    also : settings that change with it: setting -> power of (level / the scene's own value) by which it is multiplied
    is_speed : the factor stands for the cubes' speed, and times are drawn and fitted against the speed measured
    paper_exponent : of the time to the first target, as the paper has it
    paper_speeds : the paper's mean speed at each level, length / tu
    """

    name: Annotated[str, Meta(pattern=r"^[a-z][a-z-]*\Z")]
    label: str
    setting: str | None = None
    levels: Annotated[tuple[float, ...], Meta(min_length=1)]
    also: dict[str, float] = field(default_factory=dict)
    is_speed: bool = False
    paper_exponent: float | None = None
    paper_speeds: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if any(level <= 0 for level in self.levels):
            raise ValueError(f"levels {list(self.levels)}; expected numbers above 0")
        if len(set(self.levels)) < len(self.levels):
            raise ValueError(f"levels {list(self.levels)} name one twice")
        if self.paper_speeds and len(self.paper_speeds) != len(self.levels):
            raise ValueError(f"{len(self.paper_speeds)} paper_speeds for {len(self.levels)} levels; expected one each")
        if self.setting is None and not self.also:
            raise ValueError("expected a `setting`, or an `also` that says what the level multiplies")


class PaperMedian(Settings):
    """A median of the paper, to stand beside ours. at : one level of each factor; median : tu."""

    at: tuple[float, ...]
    median: Positive


@dataclass(frozen=True)
class StudyPoint:
    """One combination of levels. levels : one of each factor; cubes : in the tank at the start, all free"""

    levels: tuple[float, ...]
    title: str
    scene: Scene
    cubes: int

    def specs(self, cap: float, runs: int, seed: int) -> list[RunSpec]:
        """Its runs. Their seed is 63 bits of the SHA-256 of ours and the scene's fingerprint: two points share their
        random numbers only where these agree, by chance one pair in 9e18.
        """
        derivation = book_of(self.scene.rules)[1]
        target = species_of(derivation, derivation.book.target)
        start = single_cubes(derivation, self.cubes)
        own = seed_of(f"{seed} {self.scene.fingerprint}")
        return [RunSpec(self.scene, start, cap, own, run, until=target) for run in range(runs)]


class Study(Settings, dict=True):
    """Time to the first target of a scene's book, at all combinations of the factors' levels.

    name : of its tables and figures, so it may name a file; cubes : in the tank, where no factor says otherwise
    runs : a point; cap : tu after which a run without a target ends, and counts as censored
    typical : first time at the scene's own settings and `cubes`, tu; only the prediction of the cost asks for it
    engine : of the mechanics; None for the scene's own
    """

    name: str
    title: str
    scene: str
    cubes: AtLeastOne
    runs: AtLeastOne
    cap: Positive
    typical: Positive
    factors: Annotated[tuple[Factor, ...], Meta(min_length=1)]
    paper: tuple[PaperMedian, ...] = ()
    engine: str | None = None

    def __post_init__(self) -> None:
        checked_name(self.name, "study name")
        names = [factor.name for factor in self.factors]
        if len(set(names)) < len(names):
            raise ValueError(f"factors {', '.join(names)}: a name appears twice")
        settings = [factor.setting for factor in self.factors if factor.setting is not None]
        if len(set(settings)) < len(settings):
            raise ValueError(f"two factors vary one setting; settings are {', '.join(settings)}")
        derivation = book_of(self.base.rules)[1]
        if species_of(derivation, derivation.book.target) is None:
            raise ValueError(
                f"book {self.base.rules} has no target that free cubes form: there is no first one to wait for"
            )
        grid = {point.levels for point in self.points}
        for known in self.paper:
            if known.at not in grid:
                raise ValueError(f"paper: at = {list(known.at)} is no point of the study")
        for point in self.points:
            point.specs(self.cap, 1, 0)  # a RunSpec checks that the cubes fit into the tank

    @classmethod
    def load(cls, name_or_path: str | Path) -> Study:
        """A shipped study by name (`number`), or the user's own TOML file."""
        path = find(name_or_path, STUDIES, "study")
        return validated(cls, read_toml(path), path.name)

    @cached_property
    def base(self) -> Scene:
        """The scene that the points start from."""
        return Scene.load(self.scene).by(self.engine)

    @cached_property
    def points(self) -> tuple[StudyPoint, ...]:
        """All combinations of levels, the last factor running fastest."""
        return tuple(self._point(levels) for levels in itertools.product(*(f.levels for f in self.factors)))

    def chosen(self, choices: Sequence[str]) -> tuple[StudyPoint, ...]:
        """Points with these levels: `number=40,60` takes two of the number's, and all of the other factors'."""
        wanted: dict[int, set[float]] = {}
        names = [factor.name for factor in self.factors]
        for choice in choices:
            name, equals, numbers = choice.partition("=")
            if not equals or name not in names:
                raise ValueError(f"--points {choice}; expected FACTOR=LEVEL,... with a factor of {', '.join(names)}")
            factor = self.factors[names.index(name)]
            try:
                levels = {float(number) for number in numbers.split(",")}
            except ValueError:
                raise ValueError(f"--points {choice}: {numbers!r} is no list of numbers, as in {name}=40,60") from None
            if unknown := sorted(levels - set(factor.levels)):
                known = ", ".join(f"{level:g}" for level in factor.levels)
                raise ValueError(f"--points {choice}: {name} has no level {unknown[0]:g}; it has {known}")
            wanted.setdefault(names.index(name), set()).update(levels)
        return tuple(p for p in self.points if all(p.levels[i] in levels for i, levels in wanted.items()))

    def _point(self, levels: tuple[float, ...]) -> StudyPoint:
        data: dict[str, Any] = self.base.as_dict()
        places = _Places(data, self.cubes)
        powers: list[tuple[str, float]] = []
        for factor, level in zip(self.factors, levels, strict=True):
            own = 1.0 if factor.setting is None or not factor.also else places.number(factor.setting)
            powers += [(name, _power(level, own, power, factor.name)) for name, power in factor.also.items()]
            if factor.setting is not None:
                places.put(factor.setting, level)
        for setting, times in powers:
            places.multiply(setting, times)
        title = ", ".join(f"{f.name}={level:g}" for f, level in zip(self.factors, levels, strict=True))
        return StudyPoint(levels, title, validated(Scene, data, f"{self.name} at {title}"), places.cubes)


class _Places:
    """Settings of a scene's data by their names; nothing new may come in, so a misspelt name is an error."""

    def __init__(self, data: dict[str, Any], cubes: int):
        self.data, self.cubes = data, cubes

    def number(self, name: str) -> float:
        """A setting's value. ValueError where it is no number."""
        value = self.cubes if name == NUMBER else dict(self._all()).get(name)
        if isinstance(value, bool) or not isinstance(value, int | float):
            numbers = [NUMBER, *(key for key, v in self._all() if not isinstance(v, bool | str | None | list))]
            raise ValueError(f"no number {name!r} to vary in scene {self.data['name']}; it has {', '.join(numbers)}")
        return value

    def put(self, name: str, value: float) -> None:
        """Set a number."""
        old = self.number(name)
        if name == NUMBER or isinstance(old, int):
            if not math.isfinite(value) or not math.isclose(value, round(value)):
                raise ValueError(f"{name} = {value:g}; expected a whole number")
            value = round(value)
        if name == NUMBER:
            self.cubes = int(value)
        else:
            table, key = self._table(name)
            table[key] = value

    def multiply(self, name: str, times: float) -> None:
        """Multiply a number, or all numbers of a list."""
        found = dict(self._all()).get(name)
        if isinstance(found, list) and all(isinstance(v, int | float) for v in found):
            table, key = self._table(name)
            table[key] = [v * times for v in found]
        elif times != 1.0:
            self.put(name, self.number(name) * times)
        else:
            self.number(name)  # it must be there, whatever it is multiplied by

    def _tables(self) -> Mapping[str, dict[str, Any]]:
        return {name: v for name, v in self.data.items() if isinstance(v, dict)} | {
            item["effect"]: item for item in self.data["effects"]
        }

    def _all(self) -> Iterator[tuple[str, Any]]:
        """Names and values of all settings, those of tables within tables too."""
        for name, table in self._tables().items():
            yield from _leaves(table, name)

    def _table(self, name: str) -> tuple[dict[str, Any], str]:
        first, *middle, last = name.split(".")
        table = self._tables()[first]
        for part in middle:
            table = table[part]
        return table, last


def _power(level: float, own: float, power: float, name: str) -> float:
    """(level / own) ** power. ValueError where that is no number that a double can hold."""
    try:
        return float((level / own) ** power)
    except (OverflowError, ZeroDivisionError):
        raise ValueError(
            f"factor {name}: ({level:g} / {own:g}) to the power {power:g} is no number; take other levels"
        ) from None


def _leaves(table: Mapping[str, Any], name: str) -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{name}.{key}")
        else:
            yield f"{name}.{key}", value
