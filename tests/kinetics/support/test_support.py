"""The lowest room: what it may import."""

import ast
from pathlib import Path

import kinetics.support

ROOM = Path(kinetics.support.__file__).parent


def foreign_imports(source):
    """Modules of other rooms that a source imports, at any depth, for types too."""
    names = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    ours = [name for name in names if name.split(".")[0] in ("kinetics", "mechsim", "calibration")]
    return [name for name in ours if not name.startswith("kinetics.support")]


def test_support_imports_no_other_room():
    sources = {path: path.read_text(encoding="utf-8") for path in ROOM.rglob("*.py")}
    assert len(sources) > 8
    assert {path.name: found for path, text in sources.items() if (found := foreign_imports(text))} == {}


def test_an_import_of_another_room_is_seen():
    for source in (
        "from kinetics.network import Network",
        "def f():\n    import mechsim.scene",
        "from kinetics import rates",
        "if TYPE_CHECKING:\n    from calibration import estimate",
    ):
        assert foreign_imports(source)
