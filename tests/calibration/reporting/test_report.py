import csv
import html
import re

import pytest

from calibration import Chart, Heading, HtmlReport, ReportTable, Text
from calibration.reporting.overview import NOTABLE, notable
from calibration.reporting.words import IN_WORDS
from calibration.validating.events import EventRow

NASTY = "<script>alert(\"1\")</script> & 'co'"
ROWS = [
    {"channel": "1+1->2", "rate": 1.23456789e-5, "note": NASTY},
    {"channel": NASTY, "rate": float("nan"), "note": ""},
]


def line(ax):
    ax.plot([0, 1], [0, 1], label="a line")
    ax.set_xlabel("time (tu)")


def sample():
    return HtmlReport(
        NASTY,
        [
            Heading(NASTY),
            Text(f"One.\n\nTwo {NASTY}."),
            ReportTable(NASTY, ROWS, "rates"),
            Chart(NASTY, line, rows=[{"x": 0.1 + 0.2}], name="line"),
            Chart("three", lambda axes: [line(ax) for ax in axes], panels=3),
        ],
        {"seeds": [1, 2], "versions": {"numpy": "2", NASTY: NASTY}, "cost": 3.5},
    )


def test_escapes_all_text():
    page = sample().html()
    assert "<script" not in page
    assert page.count("&lt;script&gt;") == 11
    assert "<p>One.</p>\n<p>Two &lt;script" in page


def test_loads_nothing_from_elsewhere():
    page = sample().html()
    assert set(re.findall(r"(?:src|href|url)\s*[=(]\s*[\"']?(.{5})", page)) == {"data:"}
    assert "http://" not in page.replace("http-equiv", "")
    assert "https://" not in page
    assert page.count('src="data:image/svg+xml;base64,') == 2
    assert "default-src 'none'" in page


def test_is_readable():
    page = sample().html()
    assert "<td><span>1.235e-05</span></td>" in page  # four figures
    assert "<td>–</td>" in page  # nan
    assert "<td>seeds</td><td>1, 2</td>" in page
    assert "<td>versions.numpy</td><td>2</td>" in page
    assert "No rows." in ReportTable("empty", []).html()


def test_is_the_same_every_time():
    assert sample().html() == sample().html()


def test_writes_page_and_data(tmp_path):
    written = sample().write(tmp_path / "report.html", data=True)
    assert [path.name for path in written] == ["report_rates.csv", "report_line.csv", "report_line.svg", "report.html"]
    assert sorted(tmp_path.iterdir()) == sorted(written)
    assert written[-1].read_text(encoding="utf-8") == sample().html()
    with written[0].open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert rows[0] == {"channel": "1+1->2", "rate": "1.23456789e-05", "note": NASTY}
    assert (tmp_path / "report_line.csv").read_text() == "x\n0.30000000000000004\n"
    assert [path.name for path in sample().write(tmp_path / "plain.html")] == ["plain.html"]


def test_a_failing_chart_leaves_the_old_report(tmp_path):
    page = tmp_path / "report.html"
    page.write_text("old")

    def fail(ax):
        raise ValueError("no data")

    with pytest.raises(ValueError, match="no data"):
        HtmlReport("new", [ReportTable("t", ROWS, "t"), Chart("c", fail)]).write(page, data=True)
    assert page.read_text() == "old"
    assert list(tmp_path.iterdir()) == [page]


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ([ReportTable("", ROWS, "../up")], "part name '../up'"),
        ([ReportTable("", ROWS, "a"), Chart("", line, rows=ROWS, name="a")], "two parts are named 'a'"),
    ],
)
def test_refuses_names_that_make_no_files(parts, message):
    with pytest.raises(ValueError, match=message):
        HtmlReport("r", parts)


def test_panels_of_many_lines_are_higher():
    def height(lines):
        return re.search(rb'<svg [^>]*height="([0-9.]+)pt"', Chart("", lambda axes: None, panels=2, lines=lines).svg)[1]

    assert height(0) == height(10)
    assert float(height(40)) > 2 * float(height(10))


def test_channels_without_anything_to_show_are_left_out_at_every_size():
    def row(size, group, seen, expected):
        return EventRow(size, 8, None, None, group, seen, expected, 0.0, 1.0, 1.0, 1e-4, 1.0, 0.5, 1.5, 0.5, 1e-4)

    small = [row("small", "joins", 9, 8.0), row("small", "rare", 0, NOTABLE / 2), row("small", "odd", 0, 0.0)]
    large = [row("large", "joins", 9, 8.0), row("large", "rare", 0, NOTABLE / 2), row("large", "odd", 1, 0.0)]
    shown = notable([small, large])
    assert [[r.group for r in rows] for rows in shown] == [["joins", "odd"]] * 2
    assert [[r.group for r in rows] for rows in notable([small])] == [["joins"]]


def test_columns_are_named_in_words():
    """Every short name has words of its own, which are no short name."""
    assert len(set(IN_WORDS.values())) == len(IN_WORDS)
    assert not set(IN_WORDS) & set(IN_WORDS.values())
    page = HtmlReport(
        "", [ReportTable("", [{"channel": "a", "low": 1.0, "p_scatter": 0.1, "free_parameters": 2}])]
    ).html()
    assert re.findall(r"<th>(.*?)</th>", page) == ["channel", "95 % from", "p of the scatter", "free parameters"]


def test_a_channel_is_not_broken_and_stays_what_it_is():
    """Names with characters of HTML too: what is not broken is found in the text, before they are written for HTML."""
    for text in ("a->b&c", "x <b>->y", "1+1->2: 3.2e-05, ->;"):
        page = HtmlReport("", [ReportTable("", [{"channel": "a", "note": text}])]).html()
        (cell,) = re.findall(r"<td>((?:(?!</td>).)*)</td></tr>", page)[-1:]
        assert "<span>" in cell
        assert html.unescape(re.sub("</?span>", "", cell.rpartition("<td>")[2])) == text
