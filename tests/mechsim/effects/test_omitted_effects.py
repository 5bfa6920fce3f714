"""What a scene does not list is never built: its run is that of a program in which the effect does not exist."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import mechsim
from mechsim.effects import EFFECTS
from mechsim.runs.record import RunSpec, execute
from mechsim.scene import Scene

KEPT = {"agitation", "drag", "walls", "contact"}
# What only the others need.
WITH_THEM = ["effects/faces.py", "effects/latches.py", "kernels/loads.py", "kernels/fluid.py"]
RUN = """
import json, sys
import mechsim
from mechsim.effects import EFFECTS
from mechsim.runs.record import RunSpec, execute
from mechsim.scene import Scene
scene = Scene(**json.loads(sys.argv[1]))
record = execute(RunSpec(scene, {"monomer": 20, "quadmer": 2}, 1.0, seed=4, run=0, poses=0.25))
print(json.dumps([mechsim.__file__, len(EFFECTS), record.outcome, record.digest]))
"""


def cut_down(folder: Path) -> int:
    """A copy of the package without the effects that are not kept; returns how many are gone."""
    copy = folder / "mechsim"
    shutil.copytree(Path(mechsim.__file__).parent, copy)
    listing = copy / "effects" / "__init__.py"
    text, gone = listing.read_text(), 0
    for effect in EFFECTS:
        if effect.name() not in KEPT:
            (copy / Path(*effect.__module__.split(".")[1:]).with_suffix(".py")).unlink()
            text = re.sub(rf"^.*\b{effect.__name__}\b.*\n", "", text, flags=re.MULTILINE)
            gone += 1
    listing.write_text(text)
    for name in WITH_THEM:
        (copy / name).unlink()
    return gone


def run_there(folder: Path, scene: Scene) -> subprocess.CompletedProcess:
    """The run by the copy."""
    paths = os.pathsep.join([str(folder), str(Path(mechsim.__file__).parents[1])])
    return subprocess.run(
        [sys.executable, "-B", "-c", RUN, json.dumps(scene.as_dict())],
        env=os.environ | {"PYTHONPATH": paths}, capture_output=True, text=True, check=False, cwd=folder,
    )  # fmt: skip


def test_a_run_is_the_same_where_the_code_of_other_effects_does_not_exist(tmp_path, line4):
    gone = cut_down(tmp_path)
    scene = line4.without("breaking", "bonding")
    assert {effect.effect for effect in scene.effects} == KEPT
    done = run_there(tmp_path, scene)
    assert done.returncode == 0, done.stderr
    place, left, outcome, digest = json.loads(done.stdout.splitlines()[-1])
    assert Path(place).is_relative_to(tmp_path)
    assert left == len(EFFECTS) - gone == len(KEPT)
    here = execute(RunSpec(scene, {"monomer": 20, "quadmer": 2}, 1.0, seed=4, run=0, poses=0.25))
    assert (here.outcome, here.digest) == (outcome, digest)


def test_a_listed_effect_that_the_program_lacks_is_refused_by_name(tmp_path):
    """Control: the copy cannot run what it has no code for."""
    cut_down(tmp_path)
    done = run_there(tmp_path, Scene.load("line4"))
    assert done.returncode == 1
    assert "bonding" in done.stderr
