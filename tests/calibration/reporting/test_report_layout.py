"""What a reader of a report sees first: verdict, counts and rates; the rest is folded, and nothing is off the page."""

import base64
import html
import json
import re
import shutil
import subprocess
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from browser import in_browser as browsed
from synthetic_runs import line_network

from calibration import HtmlReport, ReportTable, Text, crossvalidate
from calibration.estimating.diagnosing.diagnosis import MOST_NAMED
from calibration.estimating.study import CalibrationStudy
from calibration.pipeline.bars import Bar
from calibration.pipeline.held_out_study import ValidationStudy
from calibration.reporting.overview import calibration_report, full_report, validation_report
from kinetics.sampling import sample_path

WIDTH, HEIGHT = 1280, 800
START, END = [40, 0, 0, 0], 30.0
MEASURE = """<script>
const open = [...document.querySelectorAll("details")].filter(fold => fold.open).length;
const seen = [...document.querySelectorAll("body > *")].map(part => {
  const box = part.getBoundingClientRect();
  return {tag: part.tagName, text: part.textContent.slice(0, 200), top: box.top, bottom: box.bottom, right: box.right};
});
const closed = document.documentElement.scrollWidth;
document.querySelectorAll("details").forEach(fold => fold.open = true);
const tables = [...document.querySelectorAll("table")].map(table => {
  const box = table.parentElement;
  return {right: box.getBoundingClientRect().right, wider: box.scrollWidth > box.clientWidth,
          bar: box.offsetHeight - box.clientHeight};
});
const found = {open, seen, closed, opened: document.documentElement.scrollWidth, page: innerWidth, tables};
document.body.innerHTML = "<pre>" + btoa(unescape(encodeURIComponent(JSON.stringify(found)))) + "</pre>";
</script>"""


def runs_of(seed, squeezed=False, rates=None):
    """Six runs of the line; `squeezed` : events of the first half come in its first tenth."""
    network = line_network() if rates is None else line_network().with_rates(rates)
    paths = [sample_path(network, START, END, seed=seed, run=run) for run in range(6)]
    if not squeezed:
        return paths
    return [type(p)(p.network, p.initial, p.times * (1 - 0.9 * (p.times < END / 2)), p.channels, p.end) for p in paths]


@cache
def calibrated(squeezed=False):
    return CalibrationStudy("line", runs_of(1, squeezed), {"seed": 1}, "six runs", "Sampled.", breaks="first-order")


@cache
def validated(factor=1.0):
    """Two sizes; `factor` : of all true rates."""
    rates, network = calibrated().rates, line_network()
    grid, found, records = np.linspace(0, END, 11), [], []
    for number, label in enumerate(("40 cubes", "40 cubes again")):
        paths = runs_of(2 + number, rates=factor * network.known_rates)
        records += [SimpleNamespace(path=path, arrays={"bonds": np.full((path.times.size, 2), -1)}) for path in paths]
        one = crossvalidate(rates, paths, grid, "quadmer", seed=1, number=number, groups=399, most_groups=399)
        found.append(one.__class__(**vars(one) | {"label": label, "mechanics_cpu": 1.0}))
    return ValidationStudy(tuple(found), rates, SimpleNamespace(sound=records, problems=[], digest=""))


RULES = (Bar("p of every row at least 0.01", "least of 6: 0.2", True), Bar("a rule", "what came", False))
PAGES = {
    "calibrate": lambda: calibration_report(calibrated()),
    "validate": lambda: validation_report(validated(), RULES),
    "demo": lambda: full_report(calibrated(), validated(), lambda ax: ax.plot([0, 1])),
}


def first_part(page):
    """The page above the first fold."""
    return html.unescape(page.partition("<details")[0].partition("<body>")[2])


@pytest.mark.parametrize("name", PAGES)
def test_verdict_counts_and_rates_come_first(name):
    first, study = first_part(page := PAGES[name]().html()), calibrated()
    assert "<details open" not in page
    assert page.count("<details>") == page.count("</details>") > 4
    assert first.count("<table") == 1
    assert re.search(r"<th>rate \(?.*<td>1\+1->2</td>", first, re.DOTALL)
    if name != "validate":
        assert study.diagnosis.short_verdict in first
        assert f"6 runs, {study.counts['joins']} joins, {study.counts['breaks']} breaks" in first
    if name != "calibrate":
        assert validated().verdict.sentence in first
        joins = next(row for row in validated().pooled if row.group == "joins")
        assert f"12 held-out runs, {joins.seen} joins (" in first
    assert ("Rules of the plan: 1 kept; 1 broken (a rule: what came)." in first) == (name == "validate")


@pytest.mark.parametrize("squeezed", [False, True])
def test_only_diagnostics_that_failed_are_drawn(squeezed, tmp_path):
    """Each has a line in the folded table; the control is of runs whose early events are too early."""
    study = calibrated(squeezed)
    failed = {result.test for result in study.diagnosis.failed}
    assert bool(failed) == squeezed
    report = calibration_report(study)
    written = {path.name for path in report.write(tmp_path / "page.html", data=True)}
    drawn = {name.removeprefix("page_diagnostics-").removesuffix(".svg") for name in written if name.endswith(".svg")}
    assert drawn - {"page_forest"} == failed
    assert {f"page_diagnostics{part}.csv" for part in ("", "-p", "-verdicts")} <= written
    folded = html.unescape(report.html().partition("<details")[2])
    assert all(f"<td>{test.name}</td>" in folded for test in study.diagnosis.tests)
    assert report.html().count("<img") == 1 + len(failed)


@pytest.mark.parametrize("factor", [1.0, 3.0])
def test_single_runs_are_drawn_if_they_fail(factor, tmp_path):
    """The control is of rates that are three times as high."""
    study = validated(factor)
    written = {path.name for path in validation_report(study).write(tmp_path / "page.html", data=True)}
    assert ("page_pit.svg" in written) == (study.p_single_runs < 0.01) == (factor > 1)
    assert {"page_events.csv", "page_events-figure.svg", "page_40-cubes.svg", "page_summary.csv"} <= written


def test_single_runs_are_drawn_if_the_plan_asks_for_more(tmp_path):
    missed = Bar("p of the PIT of all single runs above 0.999", "what came", False)
    assert "page_pit.svg" in {
        path.name for path in validation_report(validated(), [missed]).write(tmp_path / "page.html", data=True)
    }


def in_browser(page, folder):
    """What a browser of 1280 x 800 measures of the page, first as it is, then with all folds open."""
    program = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if program is None:
        pytest.skip("no headless browser is installed; the order of the page is tested above")
    free = re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", page)  # else it would run no script
    (folder / "page.html").write_text(free.replace("</body>", f"{MEASURE}</body>"), encoding="utf-8")
    given = ["--headless", "--no-sandbox", "--disable-gpu", f"--window-size={WIDTH},{HEIGHT}", "--dump-dom"]
    command = [program, *given, f"--user-data-dir={folder / 'profile'}", (folder / "page.html").as_uri()]
    shown = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    return json.loads(base64.b64decode(re.search(r"<pre>(.*?)</pre>", shown)[1]))


@pytest.mark.parametrize("name", PAGES)
def test_pages_fit_the_screen(name, tmp_path):
    found = in_browser(PAGES[name]().html(), tmp_path)
    assert found["open"] == 0
    assert max(found["closed"], found["opened"]) <= found["page"] <= WIDTH
    for table in found["tables"]:
        assert table["right"] <= found["page"]
        assert not table["wider"] or table["bar"] > 5  # its scroll bar shows
    verdict, *rest = [part for part in found["seen"] if part["tag"] == "P"]
    assert re.match("Rules of the plan|Verdict|Calibration", verdict["text"])
    rates = next(part for part in found["seen"] if part["tag"] == "FIGURE")
    assert "1+1->2" in rates["text"]
    for part in (verdict, *rest, rates):
        assert part["bottom"] <= HEIGHT
    picture = [part for part in found["seen"] if part["tag"] == "FIGURE"][1]
    assert picture["bottom"] <= HEIGHT


def test_a_table_without_a_container_would_widen_the_page(tmp_path):
    """The control: a wide table scrolls by itself, and without its container it does not."""
    row = {f"a column with a name of its own {i}": 10.0**-i for i in range(40)}
    page = HtmlReport("", [Text("Verdict"), ReportTable("wide", [row])]).html()
    held = in_browser(page, tmp_path)
    assert held["closed"] <= held["page"]
    assert held["tables"][0]["wider"]
    assert held["tables"][0]["bar"] > 5
    loose = in_browser(page.replace('class="table"', ""), tmp_path)
    assert loose["closed"] > loose["page"]


LOOK = """
  await wait(100);
  const folds = [...page.querySelectorAll("details")], bodies = [...page.body.children];
  const rates = page.querySelector("body > figure .table"), styled = part => view.getComputedStyle(part);
  const box = node => node.getBoundingClientRect();
  const meet = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 &&
    Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
  const look = () => ({
    here: view.innerWidth, wide: page.documentElement.scrollWidth, open: folds.filter(fold => fold.open).length,
    overlaps: bodies.flatMap((a, i) => bodies.slice(i + 1).map(b => meet(box(a), box(b)))).filter(Boolean).length,
    within: [...page.querySelectorAll("table")].every(table => box(table.parentElement).right <= view.innerWidth),
    first: rates.scrollWidth - rates.clientWidth,
    tables: [...page.querySelectorAll("table")].map(table => box(table).right),
    seen: folds.map(fold => fold.lastElementChild.checkVisibility()),
    unbroken: [...page.querySelectorAll("td span")].every(part => part.getClientRects().length <= 1),
    kept: [...page.querySelectorAll("tr, img")].map(part => styled(part).breakInside),
    followed: [...page.querySelectorAll("summary, figcaption, thead")].map(part => styled(part).breakAfter),
  });
"""
PAPER = 718  # CSS pixels between the margins of an A4 page


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize("name", PAGES)
def test_pages_neither_scroll_sideways_nor_overlap(name, width, tmp_path):
    script = "const closed = look(); folds.forEach(fold => { fold.open = true; }); return [closed, look()];"
    for page in browsed(PAGES[name]().html(), LOOK + script, tmp_path, width):
        assert page["wide"] <= page["here"] <= width
        assert page["overlaps"] == 0
        assert page["within"]
        assert page["first"] == 0  # the rates are seen whole on a phone, too
        assert page["unbroken"]
    assert page["open"] == len(page["seen"]) > 4


@pytest.mark.parametrize("name", PAGES)
def test_paper_shows_what_is_folded_and_cuts_nothing_off(name, tmp_path):
    """The style of paper, shown on a screen that is as wide."""
    html_text = PAGES[name]().html()
    page = browsed(html_text.replace("@media print", "@media screen"), LOOK + "return look();", tmp_path, PAPER)
    assert page["open"] == 0  # their content is shown all the same
    assert all(page["seen"])
    assert max(page["tables"]) <= page["here"] <= PAPER
    assert page["wide"] <= page["here"]
    assert set(page["kept"]) == set(page["followed"]) == {"avoid"}
    shut = browsed(html_text, LOOK + "return look();", tmp_path, PAPER)  # the control
    assert not any(shut["seen"])


def test_a_verdict_of_many_failed_tests_is_short_on_the_first_screen():
    study = calibrated(squeezed=True)
    short, whole = study.diagnosis.short_verdict, study.diagnosis.verdict
    n = len(study.diagnosis.failed)
    assert (short != whole) == (n > MOST_NAMED)
    page = calibration_report(study).html()
    assert short in first_part(page)
    assert whole in html.unescape(page)
    few = calibrated().diagnosis
    assert few.short_verdict == few.verdict
