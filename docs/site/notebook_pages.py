"""Notebooks as pages: run when the site is built, with their pictures and tables.

`python docs/site/notebook_pages.py FOLDER` runs all notebooks and keeps them in FOLDER, where the site looks for them.
"""

from __future__ import annotations

import base64
import os
import re
import sys
from pathlib import Path
from typing import Any

import jupytext
from nbclient import NotebookClient

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.py"))
KEPT = ROOT / ".notebooks"
NOT_RUN = "\n\n!!! note\n    This copy of the site was built without running the notebook: it has no pictures.\n"


def kept() -> Path:
    """The folder of notebooks that have been run; WELLMIXED_NOTEBOOKS names another one."""
    return Path(os.environ.get("WELLMIXED_NOTEBOOKS", KEPT))


def execute(path: Path, folder: Path) -> None:
    """Run a notebook in its own folder, by a kernel of this environment, and keep it with its outputs."""
    notebook = jupytext.read(path)
    notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    NotebookClient(notebook, resources={"metadata": {"path": path.parent}}).execute()
    folder.mkdir(exist_ok=True)
    jupytext.write(notebook, folder / f"{path.stem}.ipynb")


def page(path: Path) -> tuple[str, dict[str, bytes]]:
    """A notebook as Markdown, and its pictures by file name; as it is written if it has not been run."""
    ran = kept() / f"{path.stem}.ipynb"
    notebook = jupytext.read(ran if ran.exists() else path)
    parts, pictures, heading = [], dict[str, bytes](), path.stem
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            headings = re.findall(r"^#+ (.+)$", cell.source, flags=re.MULTILINE)
            heading = headings[-1] if headings else heading
            parts.append(cell.source + ("" if ran.exists() or parts else NOT_RUN))
        else:
            parts.append(code(cell.source))
            parts += [shown(output, path.stem, heading, pictures) for output in cell.get("outputs", [])]
    return "\n\n".join(part for part in parts if part) + "\n", pictures


def code(source: str) -> str:
    """A cell between fences; imports are folded."""
    fenced = f"```python\n{source}\n```"
    if not source.startswith(("import ", "from ")):
        return fenced
    return '??? abstract "Imports"\n' + "\n".join(f"    {line}".rstrip() for line in fenced.splitlines())


def shown(output: dict[str, Any], stem: str, heading: str, pictures: dict[str, bytes]) -> str:
    """An output: a picture, a table or text; `pictures` receives the file."""
    data = output.get("data", {})
    for kind, suffix in (("image/png", "png"), ("image/svg+xml", "svg")):
        if kind in data:
            name = f"{stem}_{len(pictures) + 1}.{suffix}"
            is_text = suffix == "svg"
            pictures[name] = data[kind].encode() if is_text else base64.b64decode(data[kind])
            return f"![{re.sub('[`*$]', '', heading)}, picture {len(pictures)}]({name})"
    if "<table" in data.get("text/html", ""):
        return table(data["text/html"])
    text = output["text"] if output["output_type"] == "stream" else data.get("text/plain", "")
    if text.startswith(("<Figure", "<Axes")) or not text.strip():
        return ""
    return f"```text\n{text.rstrip()}\n```"


def table(html: str) -> str:
    """The first table without the look of notebooks, so that it looks and scrolls as all tables of the site."""
    inner = html[html.index("<table") : html.index("</table>")] + "</table>"
    bare = re.sub(r"<(table|thead|tbody|tr|th|td)\b([^>]*)>", _without_look, inner)
    return re.sub(r"\n\s*", "\n", bare)


def _without_look(tag: re.Match[str]) -> str:
    kept_attributes = "".join(re.findall(r' (?:row|col)span="\d+"', tag[2]))
    return f"<{tag[1]}{kept_attributes}>"


if __name__ == "__main__":
    for each in NOTEBOOKS:
        execute(each, Path(sys.argv[1]))
