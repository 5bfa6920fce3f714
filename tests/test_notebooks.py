"""Every notebook runs from top to bottom, shows its pictures and tables, and gives no warning."""

import ast
from pathlib import Path

import jupytext
import pytest
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[1] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.py"))
# What the default run makes smaller, so that it takes a fifth of the time; --validate runs it as it is written.
SMALLER = {
    "01_from_rules_to_predictions": {
        "sizes = (60, 80, 120)": "sizes = (20, 30, 40)",
        "duration=30.0": "duration=3.0",
        "runs=1000": "runs=200",
        "groups=299, most_groups=299, exact_states=20_000": "groups=39, most_groups=39, exact_states=1",
        'sorted(folder.glob("*.run"))': 'sorted(folder.glob("*.run"))[::3]',
    },
    "02_rules": {"horizon=2000, runs=200": "horizon=2000, runs=20", "200, 1200.0, runs=20": "100, 1200.0, runs=4"},
}
SHOWN = {  # pictures, tables
    "01_from_rules_to_predictions": (8, 4),
    "02_rules": (8, 0),
    "03_mechanics": (4, 2),
    "04_chains": (2, 4),
    "05_data": (2, 3),
}


def test_there_are_notebooks():
    assert [path.name for path in NOTEBOOKS] == [
        "01_from_rules_to_predictions.py",
        "02_rules.py",
        "03_mechanics.py",
        "04_chains.py",
        "05_data.py",
    ]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_import_and_show_and_never_define(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.Lambda)
    assert [node.lineno for node in ast.walk(tree) if isinstance(node, kinds)] == []


@pytest.mark.filterwarnings("default")  # of the machinery that runs it; those of the notebook are in its own output
@pytest.mark.parametrize(
    ("path", "smaller"),
    [pytest.param(path, SMALLER.get(path.stem, {}), id=path.stem) for path in NOTEBOOKS]
    + [
        pytest.param(FOLDER / f"{name}.py", {}, id=f"{name} as written", marks=pytest.mark.validate) for name in SMALLER
    ],
)
def test_notebooks_run(path, smaller, monkeypatch):
    monkeypatch.delenv("MPLBACKEND")  # pictures go into the notebook
    text = path.read_text(encoding="utf-8")
    for written, less in smaller.items():
        assert text.count(written) == 1, written
        text = text.replace(written, less)
    notebook = jupytext.reads(text, "py:percent")
    # A kernel of this environment, whatever else is installed on the machine.
    notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    NotebookClient(notebook, resources={"metadata": {"path": FOLDER}}).execute()
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    outputs = [output for cell in cells for output in cell.outputs]
    said = [output.text for output in outputs if output.output_type == "stream" and output.name == "stderr"]
    assert said == []
    pictures = [output for output in outputs if "image/png" in output.get("data", {})]
    tables = [output for output in outputs if "<table" in output.get("data", {}).get("text/html", "")]
    assert len(pictures) >= SHOWN[path.stem][0]
    assert len({output["data"]["image/png"] for output in pictures}) == len(pictures)  # none is shown twice
    assert len(tables) >= SHOWN[path.stem][1]
