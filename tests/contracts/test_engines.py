"""What every engine must be: each case runs for each member of ENGINES."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from kinetics.support.extras import EXTRAS
from mechsim.runs.record import RunSpec
from mechsim.scene import Scene
from mechsim.world import engines
from mechsim.world.engines import ENGINES, Engine, EngineEntry, engine_named

every_engine = pytest.mark.parametrize("entry", ENGINES, ids=lambda entry: entry.name)


def scene_with(engine, scene="line4"):
    """A shipped scene computed by this engine."""
    data = Scene.load(scene).model_dump(mode="json")
    data["numerics"]["engine"] = engine
    return Scene.model_validate(data)


@every_engine
def test_it_has_a_name_of_its_own_and_lives_in_the_file_of_that_name(entry):
    assert re.fullmatch(r"[a-z]+", entry.name)
    assert [other.name for other in ENGINES].count(entry.name) == 1
    assert entry.home == f"mechsim.world.engines.{entry.name}_engine"
    kind = entry.load()
    assert issubclass(kind, Engine)
    assert kind.__doc__.strip()


def test_every_file_of_an_engine_is_listed():
    """A file that no scene can name would be dead code."""
    files = Path(engines.__file__).parent.glob("*_engine.py")
    assert {file.stem for file in files} == {entry.home.rpartition(".")[2] for entry in ENGINES}


@every_engine
def test_another_engine_is_not_imported_with_it(entry):
    """Nor is a package that only another needs, so that one engine works where another cannot be installed."""
    others = [other for other in ENGINES if other is not entry]
    extra = {package for other in others for package in other.packages} & set(EXTRAS)
    code = (
        f"import sys\nfor name in {sorted(extra)}: sys.modules[name] = None\n"
        f"from mechsim.world.engines import engine_named\nengine_named({entry.name!r}).load()\n"
        f"assert not set({[other.home for other in others]}) & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True, cwd=Path(__file__).parents[2])


@every_engine
def test_a_scene_names_it_and_so_does_a_record(entry):
    """Except the first, whose scenes and runs keep the names that they had before there were several."""
    scene, plain = scene_with(entry.name), Scene.load("line4")
    spec = RunSpec(scene, {"monomer": 2}, 1.0, seed=1, run=0)
    assert set(spec.inputs["physics"]) == {"wellmixed", "numpy", *entry.packages}
    assert (scene.fingerprint == plain.fingerprint) == (entry is ENGINES[0])
    assert spec.inputs["scene"]["numerics"].get("engine", ENGINES[0].name) == entry.name
    assert RunSpec.of_inputs(spec.inputs, "a.run").key == spec.key


def test_scenes_keep_the_name_that_they_had_before_there_were_engines():
    """The hash with which the rates of results/line4 were measured."""
    assert Scene.load("line4").fingerprint == "e3298ccab5ff07e54bac37d60153c37ded9a7ac654ba92faeca70ba284572be6"


def test_an_unknown_engine_is_refused():
    with pytest.raises(ValueError, match=f"unknown engine 'bullet'; expected one of {ENGINES[0].name}"):
        scene_with("bullet")


def test_an_engine_that_lacks_an_effect_of_the_scene_is_refused_before_it_is_imported(monkeypatch):
    lacking = EngineEntry("lacking", "no.such.module", "Nothing", (), lacks=("walls",))
    monkeypatch.setattr(engines, "ENGINES", (*ENGINES, lacking))
    assert engine_named("lacking") is lacking
    with pytest.raises(ValueError, match=r"engine 'lacking' lacks effect 'walls', .* choose numerics.engine from pyb"):
        scene_with("lacking")
