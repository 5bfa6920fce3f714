"""From a target or a rule book to the folder of a study: book, scene in a tank that suits it, plan with its cost."""

from __future__ import annotations

import math
import re
import unicodedata
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from calibration.pipeline.growth_planner import SPARE, make_growth_plan
from calibration.pipeline.planned import PlannedStudy, PlanRequest
from calibration.pipeline.planner import make_plan
from calibration.pipeline.run_costs import RunCosts
from kinetics.assembly import Derivation, RuleBook, Structure, derive
from kinetics.assembly.compiler import Compiled, Target, compile_book
from kinetics.assembly.compiler.target import TARGETS, describes_target
from kinetics.assembly.compiler.yields import Yields, yields_of
from kinetics.assembly.rules.rule_book import BOOKS
from kinetics.assembly.rules.writing import written
from kinetics.rates import ClassRates, Rates
from kinetics.support.cli.progress import stage
from kinetics.support.cli.study_folder import BOOK, PLAN, RUNS, SCENE, TARGET
from kinetics.support.config import find, is_path, write_toml
from kinetics.support.limits import bytes_in
from kinetics.support.output import new_folder, write_whole
from kinetics.support.settings import validated
from mechsim.scene import Scene

LINE, OTHER = "line4", "t5"  # scenes whose physics a new study gets: bonds of a T are stronger, for it has levers
ROOM = 1.6  # the shortest edge of the tank over the length of the target, so that it can turn
# Of lines of four and Ts (results/line4, results/t5): joins of every class within a factor of 1.6, breaks within six
JOIN, BREAK = 3e-5, 1e-4  # 1/tu per way, joins in a tank of PLACE
PLACE = (2.0, 2.0, 3.0)
CUBES = {"cubes": (60, 120), "held_out": (40, 80, 160)}  # in such a tank; more in a larger one


@dataclass(frozen=True, eq=False)
class NewStudy:
    """The result of `new_study`: its folder, the rule book, the scene, and the plan with its cost.

    compiled : how the book was made; None for a book that was given
    yields : of the book; None without a target, or if it grows from a seed
    """

    folder: Path
    book: RuleBook
    compiled: Compiled | None
    yields: Yields | None
    scene: Scene
    planned: PlannedStudy


def new_study(name_or_path: str, folder: str | Path, time_limit: float = 600.0, **wanted: Any) -> NewStudy:
    """Write a rule book, with a scene and a plan, into a new folder, whole or not at all; that of a target is compiled.

    name_or_path : a target, see `Target.load`, or a rule book, which is used as it is; a name that is shipped as both
        means the target
    wanted : what the plan is to reach, see `PlanRequest`

    The plan's path is predicted by rates like those of lines and Ts (`guessed_rates`), because nothing has run yet.
    A target that grows from a seed is studied by rate class, see `make_growth_plan`.
    ValueError: the folder is there already; the structures of its growth are too many to be listed.
    """
    goal = Path(folder)
    with new_folder(goal) as made:
        is_book, source = _source_of(name_or_path)
        compiled = None
        if is_book:
            book = RuleBook.load(name_or_path)
            write_whole(made / BOOK, bytes_in(source))
        else:
            compiled = compile_book(Target.load(name_or_path), time_limit=time_limit, progress=stage)
            book = compiled.book
            write_whole(made / TARGET, bytes_in(source))
            write_whole(made / BOOK, written(book, "\n".join(compiled.verified)))
        try:
            stage("deriving the network of the book")
            derivation = derive(book)
        except ValueError as error:
            raise ValueError(
                f"{book.name} has a book, but mechanics runs need a list of all structures: {error}; grow it without "
                f"a network by `wellmixed rules compile` and `wellmixed rules grow`"
            ) from None
        name = plain_name(book.name)
        scene = scene_for(name, derivation).by(wanted.get("engine"))
        write_toml(scene.as_dict(none=False), made / SCENE)
        scale = math.prod(scene.tank.size) / math.prod(PLACE)
        size = max(map(len, derivation.structures.values())) if book.target is None else len(book.target)
        least = 1 if book.seed() is None else SPARE * size
        sizes = {
            name: tuple(dict.fromkeys(max(round(n * scale), least) for n in cubes)) for name, cubes in CUBES.items()
        }
        request = PlanRequest(name=name, scene=str(made / SCENE), **sizes | wanted)
        costs = RunCosts(made / RUNS)
        planned = (
            make_plan(request, guessed_rates(derivation, scene.tank.size), costs)
            if book.seed() is None
            else make_growth_plan(request, JOIN / scale, costs)
        )
        planned.plan.save(made / PLAN)
    here = replace(planned, request=replace(request, scene=str(goal / SCENE)))
    return NewStudy(goal, book, compiled, yields_of(derivation), scene, here)


def _source_of(name_or_path: str) -> tuple[bool, Path]:
    """Whether this is a rule book, not a target; and its file."""
    if is_path(name_or_path):
        path = find(name_or_path, TARGETS, "target or rule book")
        return not describes_target(path), path
    is_book = not (TARGETS / f"{name_or_path}.toml").exists() and (BOOKS / f"{name_or_path}.toml").exists()
    return is_book, find(name_or_path, BOOKS if is_book else TARGETS, "target or rule book")


def plain_name(name: str) -> str:
    """The name of a target without accents and spaces, as the names of plans, scenes and their files have to be."""
    ascii_only = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    return re.sub(r"[^A-Za-z0-9._-]+", "-", ascii_only).lstrip("._-")[:80] or "study"


def scene_for(name: str, derivation: Derivation) -> Scene:
    """The physics of line4, or of t5 unless the target is a line, in their tank or one that the target can turn in."""
    largest = max(derivation.structures.values(), key=len)
    is_line = np.count_nonzero(np.ptp(np.array(largest.positions), axis=0)) == 1
    like = Scene.load(LINE if is_line else OTHER)
    longest = max(extent(structure) for structure in derivation.structures.values())
    factor = max(1.0, ROOM * longest * like.cubes.edge / min(like.tank.size))
    data = like.as_dict() | {
        "name": name,
        "rules": BOOK,
        "tank": {"size": [round(factor * edge, 3) for edge in like.tank.size]},
    }
    scene = validated(Scene, data, f"a scene for {name}")
    return scene.without("breaking") if derivation.book.semantics.bonds == "hold" else scene


def extent(structure: Structure) -> float:
    """Largest distance between corners of its cubes, in edges."""
    places = np.array(structure.positions, dtype=float)
    corners = (places[:, None] + np.array(list(product((-0.5, 0.5), repeat=3)))).reshape(-1, 3)
    return float(np.linalg.norm(corners[:, None] - corners, axis=2).max())


def guessed_rates(derivation: Derivation, tank: tuple[float, float, float]) -> Rates:
    """Rates before anything is measured: one for all joins, by the tank's volume, and one of first order for breaks."""
    network = derivation.network
    join = JOIN * math.prod(PLACE) / math.prod(tank)
    ordered = [ClassRates.uniform(join, BREAK).base(derivation).known_rates, network.ways]
    channels = {
        name: {"rate": rate, "ways": ways}
        for name, rate, ways in zip(network.channels, *map(np.ndarray.tolist, map(np.asarray, ordered)), strict=True)
    }
    data = {"convention": {"combinations": "distinct"}, "tank": tank, "channels": channels}
    return validated(Rates, data, "guessed rates")
