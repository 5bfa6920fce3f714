"""The page of a prediction in a headless browser: what it draws, shows and hides, and names that are markup."""

import json
import re

import numpy as np
import pytest
from browser import in_browser

from kinetics import ChannelRate, Convention, Model, Network, Rates, predict
from kinetics.predicting.page import prediction_page
from kinetics.predicting.pictures import MOST_PANELS

PAIR = "time unit: s\nbind: A + B -> AB, 0.01\nunbind: AB -> A + B, 0.1\nA = 20\nB = 12"
TIMES = np.linspace(0.0, 30.0, 11)
HOSTILE = "</script><script>document.title='broken'</script>&<b>{0}"
LABELS = {
    "mean": "mean",
    "band": "middle 95 % of runs",
    "interval": "95 % interval of the mean",
    "field": "mean field (approximate)",
    "run": "single run",
}
LOOK = """
  await wait(300);
  const panels = [...page.getElementById("panels").children], boxes = [...page.querySelectorAll("#legend input")];
  const overlap = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 &&
    Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
  const shown = () => ({
    wide: page.documentElement.scrollWidth, here: view.innerWidth, title: page.title,
    legend: [...page.querySelectorAll("#legend label")].map(each => each.textContent),
    names: panels.map(plot => plot.querySelector(".gtitle") && plot.querySelector(".gtitle").textContent),
    axes: panels.map(plot => [...plot.querySelectorAll(".xtitle, .ytitle")].map(each => each.textContent)),
    traces: panels.map(plot => plot.data.map(each => ({
      kind: each.meta, y: each.y, x: each.x, shape: each.line.shape, mode: each.mode, visible: each.visible,
      texts: each.text, error: each.error_y && each.error_y.array,
    }))),
    drawn: panels.map(plot => plot.querySelectorAll(".scatterlayer .trace").length),
    words: panels.map(plot => [...plot.querySelectorAll(".legendtext")].map(each => each.textContent)),
    table: [...page.querySelectorAll("tr")].map(row => [...row.children].map(each => each.textContent)),
    notes: [...page.querySelectorAll("li, p")].map(each => each.textContent),
    fetched: view.performance.getEntriesByType("resource").map(each => each.name),
    columns: new Set(panels.map(plot => plot.getBoundingClientRect().left)).size,
    overlaps: panels.flatMap((a, i) => panels.slice(i + 1).map(b =>
      overlap(a.getBoundingClientRect(), b.getBoundingClientRect()))).filter(Boolean).length,
  });
"""


def pair(**given):
    return predict(Model(Network.from_text(PAIR)), times=TIMES, **given)


def shown(made, folder, script="return shown();", width=1280):
    return in_browser(prediction_page(made), LOOK + script, folder, width)


def of_kind(traces, kind):
    return [trace for trace in traces if trace["kind"] == kind]


@pytest.mark.parametrize("width", [1280, 390])
def test_three_species_have_panels_at_each_width(width, tmp_path):
    made = pair(runs=200, trajectories=2)
    page = shown(made, tmp_path, width=width)
    assert page["wide"] <= page["here"] <= width
    assert (page["overlaps"], page["columns"]) == (0, 3 if width == 1280 else 1)
    assert page["fetched"] == []
    assert page["names"] == ["A", "B", "AB"]
    assert page["axes"] == [["time (s)", "count"]] * 3
    assert page["legend"] == [LABELS["mean"], LABELS["band"], LABELS["run"]]
    low, high = made.result.quantile(0.025), made.result.quantile(0.975)
    for s, traces in enumerate(page["traces"]):
        bottom, top = of_kind(traces, "band")
        np.testing.assert_array_equal([bottom["y"], top["y"]], [low[:, s], high[:, s]])
        assert {bottom["shape"], top["shape"]} == {"hvh"}
        (mean,) = of_kind(traces, "mean")
        np.testing.assert_array_equal(mean["y"], made.mean[:, s])
        for number, run in enumerate(of_kind(traces, "run")):
            times, counts = made.trajectories.moments(number)
            assert run["shape"] == "hv"
            reached = np.searchsorted(run["x"], times, side="right") - 1  # only changes of this species are there
            np.testing.assert_array_equal(np.array(run["y"])[reached], counts[:, s])
        assert len(of_kind(traces, "run")) == 2
    assert page["table"][0] == ["", "mean", "standard deviation of a run", "middle 95 % of runs"]
    assert page["table"][3] == [
        "AB", f"{made.mean[-1, 2]:.4g}", f"{made.sd[-1, 2]:.3g}", f"{low[-1, 2]:g} to {high[-1, 2]:g}",
    ]  # fmt: skip
    assert set(made.notes) | {made.headline} <= set(page["notes"])


def test_a_page_that_is_too_wide_is_seen(tmp_path):
    """The control of the test above."""
    page = prediction_page(pair(runs=20)).replace("<h2", '<p style="width:600px">wide</p><h2', 1)
    measured = in_browser(page, LOOK + "return shown();", tmp_path, 390)
    assert measured["wide"] > measured["here"]


def test_boxes_of_the_legend_show_and_hide_kinds_of_curves(tmp_path):
    steps = """
      const first = shown();
      boxes[1].click(); await wait(100);
      const without = shown();
      boxes[1].click(); await wait(100);
      return [first, without, shown()];
    """
    pages = shown(pair(method="mean-field"), tmp_path, steps)
    assert pages[0]["legend"] == [LABELS[kind] for kind in ("mean", "band", "field")]
    for page, is_visible in zip(pages, (True, False, True), strict=True):
        for traces in page["traces"]:
            assert {trace["visible"] for trace in of_kind(traces, "band")} == {is_visible}
            assert {trace["visible"] for trace in traces if trace["kind"] != "band"} == {True}
    assert pages[0]["drawn"] == pages[2]["drawn"] != pages[1]["drawn"]


def test_pointing_shows_the_values(tmp_path):
    pointed = """
      const plot = panels[2], layer = plot.querySelector(".nsewdrag"), box = layer.getBoundingClientRect();
      const clientX = box.left + plot._fullLayout.xaxis.d2p(6), clientY = box.top + box.height / 2;
      layer.dispatchEvent(new view.MouseEvent("mousemove", {clientX, clientY, bubbles: true, view}));
      await wait(500);
      return [...plot.querySelectorAll(".hoverlayer .hovertext")].map(each => each.textContent);
    """
    made = pair(method="transient")
    (text,) = shown(made, tmp_path, pointed)
    low, high = made.result.quantile(0.025)[2, 2], made.result.quantile(0.975)[2, 2]
    assert text.startswith(f"AB at t = 6 smean {made.mean[2, 2]:.6g} ± {made.sd[2, 2]:.6g}")
    assert text.endswith(f"middle 95 % of runs: {low:g} to {high:g}")


@pytest.mark.parametrize("width", [1280, 390])
def test_one_species_with_the_interval_of_its_mean(width, tmp_path):
    rates = Rates(
        convention=Convention(combinations="distinct"),
        channels={"decay": ChannelRate(rate=0.1, events=40, exposure=400.0, ways=1)},
    )
    made = predict(Model(Network.from_text("decay: A -> 0, 1"), {"A": 100}), rates, TIMES, draws=20, seed=1)
    page = shown(made, tmp_path, width=width)
    assert page["wide"] <= page["here"] <= width
    assert page["legend"] == [LABELS[kind] for kind in ("mean", "band", "interval")]
    (traces,) = page["traces"]
    np.testing.assert_array_equal(
        [each["y"] for each in of_kind(traces, "interval")], [made.low[:, 0], made.high[:, 0]]
    )
    (mean,) = of_kind(traces, "mean")
    text = mean["texts"][5].replace("<br>", " ")
    assert f"95 % interval of the mean: {made.low[5, 0]:.6g} to {made.high[5, 0]:.6g}" in text
    assert page["table"][0][-1] == "95 % interval of the mean"
    assert page["axes"] == [["time", "count"]]


def test_two_species_share_a_panel_and_have_a_legend(tmp_path):
    page = shown(predict(Model(Network.from_text("A <-> B, 1, 1"), {"A": 9}), times=TIMES, runs=50), tmp_path)
    assert (len(page["traces"]), page["words"]) == (1, [["A", "B"]])


def test_a_mean_field_that_is_not_compared(tmp_path):
    page = shown(predict(Model(Network.from_text("0 -> A, 5\nA -> 0, 1")), times=TIMES, method="mean-field"), tmp_path)
    assert page["legend"] == ["mean field (approximate)"]
    (traces,) = page["traces"]
    assert [trace["kind"] for trace in traces] == ["field"]
    assert "mean field (approximate) " in traces[0]["texts"][3].replace("<br>", " ")
    assert page["table"][0] == ["", "mean field (approximate)"]


def test_a_single_time_is_a_point_with_a_bar(tmp_path):
    made = predict(Model(Network.from_text(PAIR)), times=[3.0], runs=200)
    page = shown(made, tmp_path)
    for s, traces in enumerate(page["traces"]):
        (mean,), (band,) = of_kind(traces, "mean"), of_kind(traces, "band")
        assert mean["mode"] == "markers"
        assert band["error"] == [pytest.approx(made.result.quantile(0.975)[0, s] - made.mean[0, s])]
    assert page["drawn"] == [2, 2, 2]


def test_names_that_are_markup_stay_text(tmp_path):
    names = [HOSTILE.format(i) for i in range(3)]
    network = Network.from_reactions({"bind": ({names[0]: 1}, {names[1]: 1, names[2]: 1})}, [1.0])
    page = shown(predict(Model(network, {names[0]: 5}), times=TIMES, runs=20), tmp_path, width=390)
    assert page["wide"] <= page["here"]
    assert page["title"] == f"Predicted counts of {', '.join(names)}"  # as text; its script would have changed it
    blanks = re.compile(r"\s")
    assert [blanks.sub("", name) for name in page["names"]] == [blanks.sub("", name) for name in names]
    assert [row[0] for row in page["table"][1:]] == names
    assert "<b>" not in page["traces"][0][2]["texts"][0]


def test_a_page_whose_data_is_not_escaped_breaks(tmp_path, monkeypatch):
    """The control: the same names, in JSON as it is."""
    monkeypatch.setattr("kinetics.support.page.json_in_html", json.dumps)
    with pytest.raises(AssertionError):
        test_names_that_are_markup_stay_text(tmp_path)


def test_of_many_species_those_with_the_largest_means_are_drawn():
    n = MOST_PANELS + 2
    network = Network.from_reactions({f"r{i}": ({f"S{i}": 1}, {}) for i in range(n)}, np.full(n, 1e-3))
    page = prediction_page(predict(Model(network, np.arange(n)), times=TIMES, runs=5))
    drawn = json.loads(re.search(r'id="data">(.*?)</script>', page)[1])["species"]
    assert [each["name"] for each in drawn] == [f"S{i}" for i in range(2, n)]
    assert f"{MOST_PANELS} of {n} are drawn, those with the largest means" in page
    assert "<td>S0</td><td>0</td>" in page  # the table has all
    assert f"Predicted counts of {n} species" in page


def test_the_page_is_saved(tmp_path):
    path = pair(runs=5).save_page(tmp_path / "pair.html")
    page = path.read_text(encoding="utf-8")
    assert page.startswith("<!DOCTYPE html>")
    assert "default-src 'none'; script-src 'unsafe-inline'" in page.partition("</head>")[0]
