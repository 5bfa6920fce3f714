"""What comes out of a bounce, and what a tank shows of it: the tables of results/accuracy/README.md.

`python -m tests.results.restitution bounces` writes today's rows of results/accuracy/bounces.csv (seconds), `... tank`
those of tank.csv (minutes); rows of an earlier physics stay. Both write the tables of the page anew.
"""

from __future__ import annotations

import csv
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from kinetics.assembly import RuleBook, derive
from mechsim.accuracy.trial import AccuracyTrial, compositions, execute_trial
from mechsim.runs.record import PHYSICS
from mechsim.scene import Scene
from mechsim.world.engines import ENGINES
from mechsim.world.world import World

FOLDER = Path(__file__).parents[2] / "results" / "accuracy"
RESTITUTIONS, SPEEDS, PHASES = (0.0, 0.3, 0.7, 1.0), (0.3, 1.0, 3.0), 24
RUNS, DURATION, CUBES = 4, 100.0, 120


def scene_of(engine: str) -> Scene:
    """The line of four by this engine."""
    data = Scene.load("line4").as_dict()
    data["numerics"]["engine"] = engine
    return Scene(**data)


def rebounds(engine: str, restitution: float, speed: float) -> np.ndarray:
    """Speeds (24,) of a cube after it met a wall flat at this speed, at each of 24 moments of a step."""
    scene = scene_of(engine).without("agitation", "drag", "bonding", "breaking")
    book = RuleBook.load("line4")
    world = World(scene.changed("contact", restitution=restitution), book, 1, np.random.SeedSequence(1))
    world.populate([derive(book).structures["monomer"]])
    b, found = world.bodies, []
    for phase in range(PHASES):
        ahead = b.edge / 2 + speed * world.step_size * phase / PHASES
        b.position[0], b.orientation[0], b.spin[0] = [0, 0, world.half[2] - ahead], [0, 0, 0, 1], 0.0
        b.velocity[0] = [0, 0, speed]
        world.engine.put(0)
        b.locate()
        for _ in range(8):
            world.step()
        found.append(-b.velocity[0, 2])
    world.engine.close()
    return np.array(found)


def bounce_rows() -> Iterator[dict[str, object]]:
    """Least and largest ratio of speeds after and before, for each engine, restitution and speed."""
    for entry in ENGINES:
        for restitution in RESTITUTIONS:
            for speed in SPEEDS:
                ratios = rebounds(entry.name, restitution, speed) / speed
                yield {
                    "physics": PHYSICS, "engine": entry.name, "restitution": restitution, "speed": speed,
                    "least": round(float(ratios.min()), 4) + 0.0, "largest": round(float(ratios.max()), 4),
                }  # fmt: skip


def tank_rows() -> Iterator[dict[str, object]]:
    """Mean and standard error over runs of each quantity of trial tanks, for each engine."""
    for entry in ENGINES:
        scene = scene_of(entry.name)
        for composition in compositions(scene, CUBES):
            trials = [AccuracyTrial(scene, composition, DURATION, seed=1, run=run) for run in range(RUNS)]
            records = [execute_trial(trial) for trial in trials]
            for quantity in trials[0].measured:
                per = records[0].facts["block"] if quantity.is_count else 1.0
                carriers = quantity.carriers(trials[0]) if quantity.is_count else 1.0
                values = np.concatenate([record.arrays[quantity.name] for record in records]) / per / carriers
                yield {
                    "physics": PHYSICS, "engine": entry.name, "quantity": quantity.title, "unit": quantity.unit,
                    "mean": f"{values.mean():.4g}", "standard_error": f"{values.std(ddof=1) / values.size**0.5:.2g}",
                }  # fmt: skip


def stored(name: str) -> list[dict[str, str]]:
    """The rows of a table that is kept."""
    with (FOLDER / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def written(text: str) -> str:
    """The page with its two tables made anew from what is stored."""
    for name in ("bounces", "tank"):
        rows = stored(name)
        lines = [f"| {' | '.join(rows[0]).replace('_', ' ')} |", "|---" * len(rows[0]) + "|"]
        lines += [f"| {' | '.join(row.values())} |" for row in rows]
        block = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        text = block.sub(lambda found, made=lines: found[1] + "\n".join(made) + "\n" + found[2], text)
    return text


def main(asked: str) -> None:
    """Write a table; rows of another physics stay."""
    path, rows = (FOLDER / "bounces.csv", bounce_rows) if asked == "bounces" else (FOLDER / "tank.csv", tank_rows)
    kept = []
    if path.exists():
        with path.open(encoding="utf-8", newline="") as file:
            kept = [row for row in csv.DictReader(file) if row["physics"] != str(PHYSICS)]
    made = [*kept, *rows()]
    page = FOLDER / "README.md"
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(made[-1]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(made)
    page.write_text(written(page.read_text("utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
