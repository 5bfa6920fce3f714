"""The page of a scan in a headless browser: what it draws, what sliders change, and names that are markup."""

import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from browser import in_browser

from kinetics import Model, Network, scan
from kinetics.predicting.scanning.page import scan_page
from kinetics.support.page import json_in_html

MODEL = "time unit: s\nbind: A + B -> AB, k\nunbind: AB -> A + B, u\nk = 1e-2\nu = 0.1\nA = 6\nB = 4"
OVER = {"k": [1e-3, 1e-2, 1e-1], "A": [8, 4, 6], "B": [2, 3, 4], "u": [0.1, 0.2]}
ASKED = ["sd[AB] @ 10", "P=? [ F<=10 AB >= 2 ]"]
HOSTILE = "</script><script>document.title='broken'</script>&<b>{0}"
DRAWN = """
  await wait(200);
  const plot = page.getElementById("plot"), input = (node, value) => {
    node.value = value;
    node.dispatchEvent(new view.Event("input"));
  };
  const sliders = () => [...page.querySelectorAll("input[type=range]")];
  const shown = () => ({
    types: plot.data.map(each => each.type), values: plot.data.map(each => each.z || each.y), x: plot.data[0].x,
    texts: plot.data[0].text, xs: plot.layout.xaxis.title.text, ys: plot.layout.yaxis.title.text,
    answer: page.getElementById("answer").textContent, empty: page.getElementById("empty").textContent,
    labels: [...page.querySelectorAll("label span")].map(each => each.textContent), title: page.title,
    high: plot.data.map(each => each.error_y && each.error_y.array), names: plot.data.map(each => each.name),
    symbols: plot.data[0].marker && plot.data[0].marker.symbol, z: [plot.data[0].zmin, plot.data[0].zmax],
    marks: [...page.querySelectorAll(".xtitle, .ytitle")].map(each => each.textContent),
    wide: page.documentElement.scrollWidth, here: view.innerWidth, sliders: sliders().length,
    drawn: page.querySelectorAll(".heatmaplayer image, .scatterlayer .trace").length,
    contours: page.querySelectorAll(".contourlevel path").length,
    legend: page.querySelectorAll(".legend .traces").length,
    fetched: view.performance.getEntriesByType("resource").map(each => each.name),
  });
"""


def binding(over, asked=ASKED, **given):
    return scan(Network.from_text(MODEL), over, asked, **given)


def shown(found, folder, script="return shown();", width=1280):
    return in_browser(scan_page(found, found.headline, found.questions), DRAWN + script, folder, width)


def some(*names):
    return {name: OVER[name] for name in names}


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize("names", ["k", "kA", "kAB", "kABu"])
def test_each_number_of_names_is_drawn_at_each_width(names, width, tmp_path):
    found = binding(some(*names))
    page = shown(found, tmp_path, width=width)
    assert page["wide"] <= page["here"] <= width
    assert page["sliders"] == max(len(names) - 2, 0)
    assert page["drawn"] == 1
    assert page["fetched"] == []
    assert page["answer"] == "standard deviation of AB at t = 10 s (count)"
    assert page["marks"][0].replace(" ", "").startswith("k,rateconstantofchannelbind(1/s)")
    order = np.argsort(OVER["A"])
    table = found.numbers("value")[..., 0]
    if len(names) == 1:
        assert page["types"] == ["scatter"]
        np.testing.assert_array_equal(page["values"][0], table)
        assert set(page["symbols"]) == {"circle"}
    else:
        assert page["types"] == ["heatmap", "contour", "contour"]
        assert page["contours"] > 0
        assert page["legend"] == 0
        first = table[(slice(None), slice(None), *[0] * (len(names) - 2))]
        np.testing.assert_array_equal(page["values"][0], first[:, order].T)
        assert page["z"] == [table.min(), table.max()]


def test_a_page_that_is_too_wide_is_seen(tmp_path):
    """The control of the test above."""
    found = binding(some("k"))
    page = scan_page(found, found.headline, found.questions).replace("<h2", '<p style="width:600px">wide</p><h2', 1)
    measured = in_browser(page, DRAWN + "return shown();", tmp_path, 390)
    assert measured["wide"] > measured["here"]


def test_sliders_and_the_question_change_what_is_shown(tmp_path):
    found = binding(some("k", "A", "B", "u"))
    steps = """
      const first = shown(), found = [];
      input(sliders()[0], 2); found.push(shown());
      input(sliders()[1], 1); found.push(shown());
      input(page.querySelector("select"), 1); found.push(shown());
      input(sliders()[0], 0); input(sliders()[1], 0); input(page.querySelector("select"), 0);
      return [first, ...found, shown()];
    """
    pages = shown(found, tmp_path, steps)
    order = np.argsort(OVER["A"])
    at = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (2, 1, 1), (0, 0, 0)]
    for page, (b, u, q) in zip(pages, at, strict=True):
        np.testing.assert_array_equal(page["values"][0], found.numbers("value")[:, order, b, u, q].T)
    assert len({json.dumps(page["values"]) for page in pages}) == 4  # the last is the first again
    assert pages[1]["labels"] == ["question", "B at time 0 (count): 4", "u, rate constant of channel unbind (1/s): 0.1"]
    assert pages[3]["answer"] == "probability of reaching AB >= 2 by t = 10 s"
    hovered = pages[2]["texts"][0][1]
    value = found.numbers("value")[1, order[0], 2, 1, 0]
    assert hovered.startswith(f"k = 0.01<br>A = 4<br>B = 4<br>u = 0.2<br>answer {value:.6g}<br>± ")
    assert "e-14 (proven)" in hovered


@pytest.mark.parametrize("names", ["k", "kA", "kAB"])
def test_pointing_shows_the_point_its_answer_and_bounds(names, tmp_path):
    pointed = """
      const layer = page.querySelector(".nsewdrag"), box = layer.getBoundingClientRect(), drawn = plot._fullLayout;
      const y = plot.data[0].type === "heatmap" ? 6 : plot.data[0].y[1];
      const [clientX, clientY] = [box.left + drawn.xaxis.d2p(0.01), box.top + drawn.yaxis.d2p(y)];
      layer.dispatchEvent(new view.MouseEvent("mousemove", {clientX, clientY, bubbles: true, view}));
      await wait(500);
      return [...page.querySelectorAll(".hoverlayer .hovertext")].map(each => each.textContent);
    """
    found = binding(some(*names), max_states=4, runs=100)  # B = 4 is sampled
    (text,) = shown(found, tmp_path, pointed)
    at = tuple(OVER[name].index({"k": 1e-2, "A": 6, "B": 2}[name]) for name in names)
    value, low, high = (found.numbers(what)[(*at, 0)] for what in ("value", "low", "high"))
    assert text.startswith("k = 0.01")
    assert ("A = 6" in text) == ("A" in names)
    assert f"answer {value:.6g}" in text
    if "B" in names:
        assert f"± {high - value:.1g}"[:2] in text
        assert "(proven)" in text
    else:
        assert f"{low:.6g} to {high:.6g} (95 % confidence)" in text


def test_few_values_give_lines_and_sampled_points_are_hollow(tmp_path):
    found = binding({"A": [4, 6], "k": OVER["k"]}, ASKED[0], max_states=0, runs=200)
    page = shown(found, tmp_path)
    assert page["types"] == ["scatter", "scatter"]
    assert page["names"] == ["A = 4", "A = 6"]
    np.testing.assert_array_equal(page["values"], found.numbers("value")[..., 0])
    np.testing.assert_allclose(page["high"], (found.numbers("high") - found.numbers("value"))[..., 0])
    assert set(page["symbols"]) == {"circle-open"}
    assert "95 % confidence" in page["texts"][0]
    assert "standard error" in page["texts"][0].replace("<br>", " ")


def test_points_without_an_answer_and_open_intervals(tmp_path):
    found = binding({"A": [1, 4]}, ['R{"time"}=? [ F AB >= 2 ]', "q0.9999[A] @ 1"], max_states=99, runs=50)
    page = shown(found, tmp_path)
    assert page["values"] == [[None, found.numbers("value")[1, 0]]]
    assert page["empty"] == "1 of 2 points have no answer."
    assert "no answer" in page["texts"][0]
    sampled = binding({"A": [4, 5]}, "q0.9999[A] @ 1", max_states=0, runs=50)
    assert np.isinf(sampled.numbers("high")).all()
    open_end = shown(sampled, tmp_path)
    assert "to infinite (95 % confidence)" in open_end["texts"][0]
    assert open_end["high"] == [[0, 0]]


@pytest.mark.parametrize("names", ["k", "kA"])
def test_answers_that_are_all_alike_are_drawn(names, tmp_path):
    page = shown(binding(some(*names), "sd[AB] @ 0"), tmp_path)
    assert not np.any(page["values"][0])
    assert page["drawn"] == 1


def test_a_part_of_a_grid_is_shown(tmp_path):
    def stop(text):
        if text.startswith("3 of"):
            raise KeyboardInterrupt

    page = shown(binding(some("k", "A"), progress=stop), tmp_path)
    assert page["empty"] == "6 of 9 points have no answer."
    assert "not asked yet" in json.dumps(page["texts"])


def hostile(n):
    """A network whose species, channel and parameter are markup, scanned over n names."""
    names = [HOSTILE.format(i) for i in range(3)]
    network = Network.from_reactions({names[0]: ({names[1]: 1}, {names[2]: 1})}, [1.0])
    over = {names[0]: [1.0, 2.0, 3.0], names[1]: [2, 3, 4], names[2]: [0, 1, 2]}
    model = Model.of(network, {names[1]: 3})
    return scan(model, dict(list(over.items())[:n]), f'sd["{names[1]}"] @ 1'), names


@pytest.mark.parametrize("n", [1, 2, 3])
def test_names_that_are_markup_stay_text(n, tmp_path):
    found, names = hostile(n)
    page = shown(found, tmp_path, width=390)
    assert page["wide"] <= page["here"] <= 390
    assert page["title"] == f"Scan over {', '.join(names[:n])}"  # as text; the script in it would have changed it
    assert page["answer"] == f"standard deviation of {names[1]} at t = 1 (count)"
    blanks = re.compile(r"\s")
    assert blanks.sub("", page["marks"][0]) == blanks.sub("", f"rate constant of channel {names[0]}")
    assert page["drawn"] == 1
    if n == 3:
        assert page["labels"] == [f"{names[2]} at time 0 (count): 0"]
    text = page["texts"][0] if n == 1 else page["texts"][0][0]
    assert "<b>" not in text
    assert "<script" not in text


def test_a_page_whose_data_is_not_escaped_breaks(tmp_path, monkeypatch):
    """The control: the same names, in JSON as it is."""
    monkeypatch.setattr("kinetics.support.page.json_in_html", json.dumps)
    with pytest.raises(AssertionError):
        shown(hostile(2)[0], tmp_path)


@pytest.mark.parametrize("text", ["</script>", "<!--<script>", "]]>", "&lt;", "\u2028\\u003c\"'", "\U0001f600"])
def test_json_in_a_page_is_the_same_json(text):
    made = json_in_html({text: [text, 1.5, None]})
    assert json.loads(made) == {text: [text, 1.5, None]}
    assert not set(made) & set("<>&\u2028")


def test_the_page_needs_no_network():
    """Its policy allows none, and it names nothing to fetch; what it fetches is counted above."""
    found = binding(some("k"))
    page = scan_page(found, found.headline, found.questions)
    assert "default-src 'none'; script-src 'unsafe-inline'" in page.partition("</head>")[0]
    named = []
    parser = HTMLParser()
    parser.handle_starttag = lambda _, given: named.extend(value for key, value in given if key in ("src", "href"))
    parser.feed(page)
    assert named == ["data:,"]


def test_the_page_is_saved(tmp_path):
    path = binding(some("k")).save_page(tmp_path / "scan.html")
    assert path.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
