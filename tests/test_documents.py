"""Documents agree with the tree: the map of ARCHITECTURE.md, and every path and name that a document mentions."""

import importlib
import re
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
PAGES = sorted(str(path.relative_to(ROOT)) for path in (ROOT / "docs").rglob("*.md"))
DOCUMENTS = ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", *PAGES)
PACKAGES = ("kinetics", "mechsim", "calibration")
MENTION = r"`((?:kinetics|mechsim|calibration|tests|results|notebooks|docs)[./][\w./]*\w/?)`"


def mapped(text: str) -> set[str]:
    """Paths in the map: one or more names a line, under the folder that is indented less."""
    (tree,) = re.findall(r"^```\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
    found, folders = set(), [""]
    for line in tree.splitlines():
        depth = (len(line) - len(line.lstrip())) // 2
        names = line.strip().split("  ", 1)[0].split()
        del folders[depth + 1 :]
        found |= {folders[-1] + name for name in names}
        folders.append(folders[-1] + names[0])
    return found


def test_the_map_shows_what_is_there():
    found = mapped((ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8"))
    assert len(found) > 50
    assert [path for path in sorted(found) if not (ROOT / path).exists()] == []


def test_the_map_shows_every_room():
    """Folders of modules, two deep; deeper ones where they are worth a line."""
    found = mapped((ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8"))
    rooms = [path.parent for package in PACKAGES for path in (ROOT / package).glob("*/__init__.py")]
    assert len(rooms) > 20
    assert [str(room) for room in rooms if f"{room.relative_to(ROOT)}/" not in found] == []


def exists(mention: str) -> bool:
    """Is there such a file or folder, or such a name in a module?"""
    if "/" in mention:
        return (ROOT / mention).exists()
    parts = mention.split(".")
    for n in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:n]))
        except ModuleNotFoundError:
            continue
        for name in parts[n:]:
            if not hasattr(found, name):
                return False
            found = getattr(found, name)
        return True
    return False


@pytest.mark.parametrize("document", DOCUMENTS)
def test_what_documents_mention_exists(document):
    text = (ROOT / document).read_text(encoding="utf-8")
    mentions = set(re.findall(MENTION, text))
    assert mentions or document in PAGES
    # a results figure is named without its suffix, a notebook too
    missing = [each for each in mentions if not exists(each) and not list(ROOT.glob(f"{each}.*"))]
    assert missing == []


@pytest.mark.parametrize("mention", ["kinetics/methods/", "kinetics.watching", "kinetics.sampling.direct.Indirect"])
def test_what_is_not_there_is_seen(mention):
    """A control that must fail."""
    assert not exists(mention)


def test_the_citation_is_of_the_released_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    newest = re.search(r"^## (\d\S*) \((\d{4}-\d\d-\d\d)\)$", changes, flags=re.MULTILINE)
    assert (citation["version"], str(citation["date-released"])) == newest.groups()
