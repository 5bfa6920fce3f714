"""Calibration from mechanics runs: of the channels of one book, or of the rate classes of several."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from calibration.estimating.class_calibration import BookRuns
from calibration.estimating.study import CalibrationStudy, ClassStudy
from calibration.pipeline.logged_hits import bodies_in, logged_hits, path_of
from calibration.pipeline.study_runs import StudyRuns, bonds_of, made
from kinetics.assembly import RuleBook
from kinetics.runs import JumpPath
from mechsim.effects import EFFECTS
from mechsim.runs.ensemble import Outcome
from mechsim.runs.executors import Executor
from mechsim.runs.record import RunRecord, book_of, kinds
from mechsim.runs.species import some_of
from mechsim.scene import Scene


def check_measurable(scene: Scene, sizes: Sequence[int]) -> None:
    """ValueError if assembly from so many single cubes could not show every channel, however long it runs."""
    if RuleBook.load(scene.rules).seed() is not None:  # before a network is derived that may be large
        raise ValueError(
            f"book {scene.rules} grows from a seed: a tank holds one growing structure, so its channels are not "
            "measured one by one; take calibrate classes"
        )
    _, derivation = book_of(scene.rules)
    network = derivation.network
    for kind in dict.fromkeys(kinds(derivation)):
        if not scene.openers(kind):
            able = [effect.name() for effect in EFFECTS if kind in effect.opens]
            raise ValueError(
                f"scene {scene.name} lists no effect that makes {kind}s happen ({', '.join(able)}); calibration "
                f"measures every channel of book {scene.rules}"
            )
    needed = network.reactants @ [len(derivation.structures[name]) for name in network.species]
    beyond = [network.channels[i] for i in np.flatnonzero(needed > max(sizes, default=0))]
    if beyond:
        raise ValueError(f"cubes = {list(sizes)}: too few for the reactants of {some_of(beyond)}; take more")


def run_calibration(
    runs: StudyRuns,
    folder: str | Path,
    *,
    breaks: str | None = None,
    crowding: str | None = None,
    workers: int | Executor = 1,
    progress: bool | None = None,
) -> CalibrationStudy:
    """Make the missing calibration runs and read the others.

    breaks : name of a break model in the place of the plan's, such as that of its control, or `auto`
    crowding : name of a model of crowding in the place of the plan's, or `auto` for the one that logged hits choose

    ValueError: a scene that does not pass `check_measurable`; no run reached its end.
    """
    scene, plan = runs.scene, runs.plan
    if plan is None:
        check_measurable(scene, runs.sizes)
        asked = {"cubes": runs.sizes, "duration": runs.specs[0].duration, "seed": runs.seed}
        words = "Runs start from single cubes and are not restarted: rates are measured along the assembly itself."
    else:
        asked = {"plan": plan.name, "plan_hash": plan.fingerprint, "seed": runs.seed}
        words = f"Tanks, runs and lengths are those of the plan {plan.name}."
    outcome = runs.make(folder, workers, progress)
    sound = sound_of(outcome)
    cubes = ", ".join(map(str, sorted({record.spec.n_cubes for record in sound})))
    return CalibrationStudy(
        name=scene.name,
        paths=[path_of(record) for record in sound],
        evidence={
            "scene": scene.name,
            "scene_hash": scene.fingerprint,
            "rules": scene.content["rules"],
            "rules_hash": book_of(scene.rules)[0].fingerprint,
            **asked,
            **evidence_of(outcome, scene.packages),
        },
        source=f"{len(sound)} mechanics runs with {cubes} cubes, {outcome.cpu_seconds:.0f} s CPU",
        made=words,
        breaks=breaks or ("auto" if plan is None else plan.breaks),
        within=2 * scene.numerics.step,
        bonds=bonds_of(sound),
        crowding=crowding or ("none" if plan is None else plan.crowding),
        hits=logged_hits(sound),
        bodies=bodies_in(sound[0]),
        problems=outcome.problems,
    )


def run_class_calibration(
    parts: Sequence[StudyRuns],
    folder: str | Path,
    *,
    breaks: str | None = None,
    share: str = "auto",
    workers: int | Executor = 1,
    progress: bool | None = None,
) -> ClassStudy:
    """Make the missing runs of all scenes and plans and read the others; they may be of several books.

    breaks : name of a break model, or `auto`; None for that of the first plan, or else `auto`
    share : what the classes of one constant have in common, or `auto`

    ValueError: no run reached its end.
    """
    plans = [part.plan for part in parts if part.plan is not None]
    outcome = made([spec for part in parts for spec in part.specs], folder, workers, progress)
    sound = sound_of(outcome)
    scenes = {record.spec.scene.name: record.spec.scene for record in sound}
    books: dict[str, list[JumpPath]] = {}
    for record in sound:
        books.setdefault(record.spec.scene.rules, []).append(record.path)
    return ClassStudy(
        books=[BookRuns(book_of(rules)[1], tuple(paths)) for rules, paths in books.items()],
        evidence={
            "scenes": list(scenes),
            "scene_hashes": [scene.fingerprint for scene in scenes.values()],
            "rules": list(dict.fromkeys(scene.rules for scene in scenes.values())),
            "seeds": list(dict.fromkeys(part.seed for part in parts)),
            "plans": {plan.name: plan.fingerprint for plan in plans},
            **evidence_of(outcome, dict.fromkeys(name for scene in scenes.values() for name in scene.packages)),
        },
        source=f"{len(sound)} mechanics runs of {', '.join(scenes)}, {outcome.cpu_seconds:.0f} s CPU",
        breaks=breaks or next((plan.breaks for plan in plans), "auto"),
        share=share,
        problems=outcome.problems,
    )


def sound_of(outcome: Outcome) -> list[RunRecord]:
    """Calibration runs that reached their end; ValueError, with the first problem, where none did."""
    if not outcome.sound:
        raise ValueError(f"no calibration run reached its end; the first of them: {outcome.problems[0]}")
    return outcome.sound


def evidence_of(outcome: Outcome, packages: Iterable[str]) -> dict[str, Any]:
    """What a rates file says of the runs behind it, whatever they are of."""
    return {
        "runs": len(outcome.sound),
        "runs_left_out": len(outcome.problems),
        "runs_digest": outcome.digest,
        "cpu_seconds": round(outcome.cpu_seconds, 1),
        "physics": outcome.sound[0].spec.physics,
        "versions": {name: version(name) for name in ("wellmixed", *packages)},
    }
