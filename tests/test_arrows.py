"""Who may import whom: the arrows of ARCHITECTURE.md, read from the source."""

import ast
import functools
import json
import re
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import NamedTuple

import pytest

from kinetics.native import library

ROOT = Path(__file__).parents[1]
ROOMS = ("kinetics", "mechsim", "calibration")
SOURCES = [*sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py")), ROOT / "wellmixed.py"]
# the parts of kinetics that never heard of cubes
LATTICE_FREE = ("support", "network", "formats", "runs", "sampling", "markov", "trust")
DOTTED = re.compile(rf"({'|'.join(ROOMS)})(\.\w+)+")
# the one file that imports numba: its cache sees an edit of any kernel
COMPILER = "kinetics.kernels.compiled"
HEAVY = ("numba", "pandas", "matplotlib", "pybullet", "scipy")


class Import(NamedTuple):
    """One import in a module of ours: of what, and whether it happens when the program runs."""

    module: str
    target: str
    at_run_time: bool


def module_name(path: Path) -> str:
    """kinetics/sampling/__init__.py -> kinetics.sampling"""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports_of(source: str, module: str, is_package: bool = False) -> list[Import]:
    """All imports of a module, those within functions too. `from a import b` gives a.b, whatever b is.

    A text that is the dotted name of something in our rooms counts as an import, for `import_module`, `__import__` and
    tables of names that are imported on demand.
    """
    found: list[Import] = []

    def walk(node: ast.AST, at_run_time: bool) -> None:
        if isinstance(node, ast.Import):
            found.extend(Import(module, alias.name, at_run_time) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = module.split(".")[: len(module.split(".")) - node.level + is_package] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            found.extend(Import(module, f"{base}.{alias.name}", at_run_time) for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and DOTTED.fullmatch(node.value):
            if node.value != module:
                found.append(Import(module, node.value, at_run_time))
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            for child in node.body:
                walk(child, at_run_time=False)
            for child in node.orelse:
                walk(child, at_run_time)
            return
        for child in ast.iter_child_nodes(node):
            walk(child, at_run_time)

    walk(ast.parse(source), at_run_time=True)
    return found


def lies_in(name: str, *packages: str) -> bool:
    """Is a module or name one of these packages, or inside one?"""
    return any(name == package or name.startswith(f"{package}.") for package in packages)


def objections(found: Import) -> list[str]:
    """The arrows that an import breaks."""
    module, target, at_run_time = found
    parts = module.split(".")
    broken = []
    if "kernels" in parts[:-1] and module != COMPILER:
        own = ".".join(parts[: parts.index("kernels") + 1])
        if not lies_in(target, "numpy", "math", "typing", own, COMPILER):
            broken.append(f"kernels take arrays and numbers; of ours they import kernels only, and {COMPILER}")
    if parts[0] == "kinetics" and lies_in(target, "mechsim", "calibration"):
        broken.append("kinetics knows no engine and no calibration")
    if parts[0] == "kinetics" and parts[1:2] and parts[1] in LATTICE_FREE and lies_in(target, "kinetics.assembly"):
        broken.append("a network has never heard of cubes")
    if parts[0] == "mechsim" and lies_in(target, "calibration"):
        broken.append("mechanics does not know what its runs are for")
    is_apart = not lies_in(module, "calibration.pipeline", "calibration.commands")
    if parts[0] == "calibration" and is_apart and at_run_time and lies_in(target, "mechsim"):
        broken.append("in calibration only the pipeline and the commands know the mechanics")
    if module != "mechsim.world.engines.pybullet_engine" and lies_in(target, "pybullet"):
        broken.append("mechsim.world.engines.pybullet_engine is the only door to PyBullet")
    return [f"{module} imports {target}: {why}" for why in broken]


@functools.cache
def all_imports() -> list[Import]:
    """Every import of every module of ours."""
    return [
        each
        for path in SOURCES
        for each in imports_of(path.read_text(encoding="utf-8"), module_name(path), path.name == "__init__.py")
    ]


def needs(imports: Iterable[Import], modules: set[str]) -> dict[str, set[str]]:
    """Module -> the modules of ours that it imports, deferred or for types alone as well."""
    found: dict[str, set[str]] = defaultdict(set)
    for module, target, _ in imports:
        home = target
        while home and home not in modules:
            home = home.rpartition(".")[0]
        if home and home != module:
            found[module].add(home)
    return found


def room_of(module: str) -> str:
    """kinetics.sampling.direct -> kinetics.sampling; mechanics and calibration are a room each."""
    parts = module.split(".")
    return ".".join(parts[:2]) if parts[0] == "kinetics" else parts[0]


def test_no_two_files_need_each_other():
    modules = {module_name(path) for path in SOURCES}
    TopologicalSorter(needs(all_imports(), modules)).prepare()


def test_no_two_rooms_need_each_other():
    modules = {module_name(path) for path in SOURCES}
    rooms: dict[str, set[str]] = defaultdict(set)
    for module, others in needs(all_imports(), modules).items():
        rooms[room_of(module)] |= {room_of(other) for other in others} - {room_of(module)}
    assert {"kinetics.network", "kinetics.assembly", "mechsim"} <= rooms["mechsim"] | rooms["calibration"]
    TopologicalSorter(rooms).prepare()


@pytest.mark.parametrize(
    "source",
    [
        "from kinetics.b import f",
        "def g():\n    import kinetics.b",
        "if TYPE_CHECKING:\n    from kinetics.b import B",
        "from kinetics import b",
        "def g():\n    return importlib.import_module('kinetics.b').f",
        "def g():\n    return __import__('kinetics.b', fromlist=['f'])",
        "HOMES = {'kinetics.b': ('f',)}",
    ],
)
def test_a_circle_is_seen(source):
    """A control that must fail: at import, deferred, or for types alone."""
    modules = {"kinetics.a", "kinetics.b"}
    there = imports_of("from kinetics.a import Network", "kinetics.b")
    TopologicalSorter(needs(there, modules)).prepare()
    with pytest.raises(CycleError):
        TopologicalSorter(needs([*there, *imports_of(source, "kinetics.a")], modules)).prepare()


def test_class_names_are_unique():
    names = Counter(
        node.name
        for path in SOURCES
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ClassDef)
    )
    assert len(names) > 100
    assert [name for name, n in names.items() if n > 1] == []


def test_arrows():
    found = all_imports()
    modules = {each.module for each in found}
    assert {
        "kinetics.sampling.direct",
        "mechsim.world.engines.pybullet_engine",
        "calibration.pipeline.held_out_study",
    } <= modules
    assert any(each.target == "pybullet" for each in found)
    assert [text for each in found for text in objections(each)] == []


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("kinetics.kernels.direct", "from kinetics.support.arrays import Floats"),
        ("kinetics.kernels.direct", "from numba import njit"),
        ("mechsim.kernels.motion", "from kinetics.kernels.streams import next_word"),
        ("mechsim.kernels.motion", "def f():\n    import scipy.stats"),
        ("kinetics.rates.rates", "import mechsim.scene"),
        ("kinetics.commands.predict", "def f():\n    from calibration import estimate"),
        ("kinetics.network.network", "from kinetics.assembly import RuleBook"),
        ("kinetics.sampling.direct", "from kinetics import assembly"),
        ("kinetics.markov.transient.states", "from ...assembly import faces"),
        ("mechsim.runs.record", "try:\n    import calibration\nexcept ImportError:\n    pass"),
        ("calibration.reporting.report", "from mechsim.inspection.pictures.tank import draw_tank"),
        ("calibration.reporting.overview", "if TYPE_CHECKING:\n    pass\nelse:\n    import mechsim"),
        ("mechsim.world.world", "import pybullet as p"),
        ("mechsim.world.engines.base", "import pybullet"),
        (
            "kinetics.support.lazy_names",
            "COMMANDS = {'runs loads': ('mechsim.commands.loads', 'loads')}",
        ),
    ],
)
def test_forbidden_imports_are_seen(module, source):
    """A control that must fail: a module with such an import is caught."""
    (text,) = [text for each in imports_of(source, module) for text in objections(each)]
    assert text.startswith(f"{module} imports ")


def test_imports_for_types_alone_are_allowed():
    source = "if TYPE_CHECKING:\n    from mechsim.runs.record import RunRecord"
    (found,) = imports_of(source, "calibration.reporting.overview")
    assert objections(found) == []
    assert objections(found._replace(at_run_time=True)) != []


def loaded(code: str) -> list[str]:
    """Top-level modules that are loaded once `code` has run in a fresh interpreter; it must end well."""
    tell = "import json, sys; print(json.dumps(sorted({name.split('.')[0] for name in sys.modules})), file=sys.stderr)"
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", f"{code}\n{tell}"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return json.loads(done.stderr.splitlines()[-1])


@pytest.mark.parametrize("room", ["kinetics", "calibration"])
def test_rooms_work_without_the_engine(room):
    """Every module of the room and every public name; the engine itself is loaded only where a run is made."""
    modules = [module_name(path) for path in sorted((ROOT / room).rglob("*.py"))]
    code = (
        "import sys, importlib; sys.modules['pybullet'] = None\n"
        f"for name in {modules}: importlib.import_module(name)\n"
        f"import {room}\nfor name in {room}.__all__: getattr({room}, name)"
    )
    assert "numpy" in loaded(code)


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], []])
def test_the_front_door_is_light(arguments):
    code = f"import click\nfrom wellmixed import main\ntry:\n    main({arguments})\nexcept SystemExit: pass"
    names = loaded(code)
    assert "click" in names
    assert not set(HEAVY) & set(names)


@pytest.mark.parametrize("room", ["kinetics", "mechsim", "calibration"])
def test_rooms_are_light_to_enter(room):
    assert not set(HEAVY) & set(loaded(f"import {room}"))


@pytest.mark.skipif(not library.is_built(), reason="the C kernels were not built: there was no compiler")
@pytest.mark.parametrize(
    "asked",
    [
        ["P=? [ F<=5 AB >= 5 ]", "P=? [ F[1,5] AB >= 5 ]", "P=? [ A > 2 U AB >= 9 ]", "S=? [ AB >= 5 ]"],
        ['R{"AB"}=? [ C<=5 ]', 'R{"AB"}=? [ I=5 ]', 'R{"A"}=? [ F AB >= 5 ]', 'R{"AB"}=? [ S ]'],
        ["P=? [ F<=5 AB >= 5 ]", "S=? [ AB >= 5 ]", "P=? [ A > 2 U AB >= 9 ]", "--sensitivity"],
    ],
)
def test_questions_start_neither_the_compiler_nor_scipy(asked, tmp_path):
    """Neither for values nor for derivatives; the control shows that it would be seen."""
    network = tmp_path / "pair.rxn"
    network.write_text("bind: A + B <-> AB, 1e-2, 0.1\nA = 10\nB = 10\n", encoding="utf-8")
    code = "from wellmixed import main\ntry:\n    main({})\nexcept SystemExit: pass"
    assert not {"numba", "scipy"} & set(loaded(code.format(["ask", str(network), *asked])))
    stiff = tmp_path / "large.rxn"  # 441 states, which are solved by iteration
    stiff.write_text("grow: A <-> B, 1, 2\nturn: C <-> D, 1, 2\nA = 20\nC = 20\n", encoding="utf-8")
    steady = loaded(code.format(["ask", str(stiff), "S=? [ B + D >= 5 ]", "P=? [ A > 2 U B + D >= 38 ]"]))
    assert "numba" not in steady
    assert "numba" in loaded("from kinetics.kernels import markov")
