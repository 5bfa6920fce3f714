"""The site: it builds without a warning, its links lead somewhere, and nothing on it comes from elsewhere."""

import base64
import json
import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import jupytext
import nbformat
import pytest
import yaml

ROOT = Path(__file__).parents[1]
PACKAGES = ("kinetics", "kinetics.assembly", "kinetics.markov", "kinetics.formats", "mechsim", "calibration")
# Addresses in the theme's own script: for diagrams and repositories, of which we have none, for a browser from before
# 2020, and in a licence.
NEVER_ASKED = {"api.github.com", "unpkg.com", "clipboardjs.com"}
LOADED = {"img": "src", "script": "src", "link": "href", "iframe": "src", "source": "src", "video": "src"}


class Page(HTMLParser):
    """What a page links to, loads and holds."""

    def __init__(self, path):
        super().__init__()
        self.links, self.loads, self.anchors, self.classes = [], [], set(), set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.anchors |= {found[key] for key in ("id", "name") if found.get(key)}
        self.classes |= set((found.get("class") or "").split())
        if tag == "a" and found.get("href"):
            self.links.append(found["href"])
        if tag in LOADED and found.get(LOADED[tag]) and found.get("rel") != "canonical":
            self.loads.append(found[LOADED[tag]])


PIXEL = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
TABLE = "<style>.x {}</style>\n<table border='1' class='dataframe'>\n<tr><th colspan=\"2\">n</th></tr></table>"
# How wide the page is, and what of a table or code is cut off without a bar to scroll by.
MEASURE = """<!DOCTYPE html><body style="margin:0">
<iframe style="border:0;width:390px;height:844px" src="{page}"></iframe>
<script>const frame = document.querySelector("iframe"); frame.onload = () => setTimeout(() => {{
  const page = frame.contentDocument, style = cell => getComputedStyle(cell);
  const cells = [...page.querySelectorAll("td, th")];
  const found = {{width: page.documentElement.scrollWidth, tables: page.querySelectorAll("table").length,
    broken: cells.filter(cell => style(cell).overflowWrap != "normal").length,
    loose: [...page.querySelectorAll("article table")].filter(table => {{
      const box = table.closest(".md-typeset__scrollwrap");
      return !box || (box.scrollWidth > box.clientWidth && box.offsetHeight - box.clientHeight < 5);
    }}).length}};
  document.body.innerHTML = "<pre>" + btoa(JSON.stringify(found)) + "</pre>";
}}, 1500);</script></body>"""


def ran(folder):
    """One notebook as if it had been run: a folder for the site that has its outputs."""
    notebook = jupytext.read(ROOT / "notebooks" / "04_chains.py")
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    data = ({"image/png": PIXEL}, {"text/html": TABLE}, {"text/plain": "<Chain: 4 states>"}, {"text/plain": "<Axes: >"})
    cells[1].outputs = [nbformat.v4.new_output("display_data", each) for each in data]
    folder.mkdir()
    jupytext.write(notebook, folder / "04_chains.ipynb")
    return folder


def build(site, *options):
    """Build the site into a folder, as `make docs` does."""
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(site), *options]
    known = os.environ | {"NO_MKDOCS_2_WARNING": "1", "PYTHONPATH": str(ROOT)}
    known["WELLMIXED_NOTEBOOKS"] = str(site.parent / "ran")
    return subprocess.run(command, cwd=ROOT, env=known, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("built") / "site"
    ran(folder.parent / "ran")
    done = build(folder)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def pages(site):
    return {path: Page(path) for path in site.rglob("*.html")}


def places(part):
    """The pages of a part of the navigation, which may have parts of its own."""
    if isinstance(part, str):
        return [part]
    return [page for entry in (part.values() if isinstance(part, dict) else part) for page in places(entry)]


def dead(pages):
    """Links within the site that lead nowhere."""
    found = []
    for path, page in pages.items():
        for link in page.links + page.loads:
            if re.match(r"(https?:|mailto:|data:|javascript:)", link):
                continue
            where, _, anchor = link.partition("#")
            target = (path.parent / where.partition("?")[0]).resolve() if where else path
            target = target / "index.html" if target.is_dir() else target
            if not target.exists() or (anchor and target in pages and anchor not in pages[target].anchors):
                found.append(f"{path.name}: {link}")
    return found


def foreign(pages):
    """What pages would load from other servers."""
    return [
        f"{path.name}: {link}" for path, page in pages.items() for link in page.loads if re.match(r"(\w+:)?//", link)
    ]


def test_links_lead_somewhere(pages):
    own = {path: page for path, page in pages.items() if path.name != "404.html"}  # its links begin at a server's root
    assert len(own) > 20
    assert dead(own) == []


def test_nothing_is_fetched_from_elsewhere(site, pages):
    assert foreign(pages) == []
    styles = [path.read_text(encoding="utf-8") for path in site.rglob("*.css")]
    assert not any(re.search(r"(@import|url\()\s*[\"']?(https?:)?//", text) for text in styles)
    (script,) = (path.read_text(encoding="utf-8") for path in site.rglob("bundle.*.js"))
    assert set(re.findall(r"https?://([\w.]+)", script)) <= NEVER_ASKED
    assert "mermaid" not in {name for page in pages.values() for name in page.classes}


def test_dead_and_foreign_links_are_seen(tmp_path):
    """The control."""
    page = tmp_path / "page.html"
    page.write_text(
        '<a href="gone.html">a</a><a href="#gone">b</a><a id="here" href="#here">c</a><img src="//x.org/a.png">'
        '<script src="https://x.org/a.js"></script>',
        encoding="utf-8",
    )
    pages = {page: Page(page)}
    assert dead({page: pages[page]})[:2] == ["page.html: gone.html", "page.html: #gone"]
    assert len(foreign(pages)) == 2


def test_every_page_has_its_place():
    nav = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"]
    listed = set(places(nav))
    written = {path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")}
    made = {"commands.md", "schemas.md", *(f"api/{name}.md" for name in PACKAGES)}
    made |= {f"notebooks/{path.stem}.md" for path in (ROOT / "notebooks").glob("*.py")}
    assert listed == written | made


@pytest.mark.parametrize("package", PACKAGES)
def test_the_reference_has_every_public_name(pages, package):
    module = __import__(package, fromlist=["__all__"])
    (page,) = [page for path, page in pages.items() if path.parts[-2:] == ("api", f"{package}.html")]
    names = {name for name in module.__all__ if not name.startswith("__")}
    shown = {anchor.rpartition(".")[2] for anchor in page.anchors}
    assert len(names) >= 3
    assert names <= shown


def test_a_warning_ends_the_build(tmp_path):
    """The control: a page with a dead link."""
    settings = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    settings = re.sub(r"^(hooks|nav|plugins):.*?(?=^\S)", "", settings + "\nend: {}", flags=re.MULTILINE | re.DOTALL)
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "index.md").write_text("[gone](gone.md)\n", encoding="utf-8")
    (tmp_path / "mkdocs.yml").write_text(settings.replace("end: {}", ""), encoding="utf-8")
    done = build(tmp_path / "out", "--config-file", str(tmp_path / "mkdocs.yml"))
    assert done.returncode != 0
    assert "gone.md" in done.stderr


def test_notebooks_have_their_pictures_and_tables(site):
    page = (site / "notebooks" / "04_chains.html").read_text("utf-8")
    assert page.count("<img") == 1
    assert (site / "notebooks" / "04_chains_1.png").read_bytes() == base64.b64decode(PIXEL)
    assert re.search(r'<table>\s*<tr>\s*<th colspan="2">n</th>', page)  # as the site's own tables
    assert "&lt;Chain: 4 states&gt;" in page
    assert "&lt;Axes" not in page
    assert page.count("<summary>Imports") == 1
    assert "without running the notebook" not in page
    assert "without running the notebook" in (site / "notebooks" / "05_data.html").read_text("utf-8")  # the control


@pytest.mark.parametrize(
    "name", ["index", "questions", "trust", "rules", "coming_from/index", "coming_from/msm", "notebooks/04_chains"]
)
def test_pages_fit_a_phone(site, name, tmp_path):
    """Nothing is wider than the page, words in tables stay whole, and what is cut off has a bar to scroll by."""
    program = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if program is None:
        pytest.skip("no headless browser is installed")
    harness = tmp_path / "harness.html"
    harness.write_text(MEASURE.format(page=(site / f"{name}.html").as_uri()), encoding="utf-8")
    given = ["--headless", "--no-sandbox", "--disable-gpu", "--allow-file-access-from-files", "--dump-dom"]
    given += ["--window-size=800,900", "--virtual-time-budget=20000", f"--user-data-dir={tmp_path / 'profile'}"]
    done = subprocess.run([program, *given, harness.as_uri()], capture_output=True, text=True, timeout=300, check=True)
    found = json.loads(base64.b64decode(re.search(r"<pre>([\w+/=]+)</pre>", done.stdout)[1]))
    assert found["width"] <= 390
    assert (found["broken"], found["loose"]) == (0, 0)
    assert found["tables"] or name in ("trust", "questions", "notebooks/04_chains")
