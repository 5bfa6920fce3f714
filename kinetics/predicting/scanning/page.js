// Draws the answers of a scan: lines over one name, or over two of which one has fewer than three values; else coloured
// cells with contours.
"use strict";

const scan = data;
const [plot, controls, answer, empty] = ["plot", "controls", "answer", "empty"].map(id => document.getElementById(id));
const sizes = scan.axes.map(axis => axis.values.length);
const places = sizes.map(() => 0); // of the value of each name that is shown; the first two are drawn as axes
const SAMPLED = "95 % confidence";
const FEW = 8; // values that an axis marks one by one
const ENOUGH = 3; // values on each axis from which cells and contours are drawn
let question = 0;

/** An interval, or one error if all digits shown agree. */
function boundsOf(value, low, high) {
  const error = Math.max(high - value, value - low);
  return error <= 1e-5 * Math.abs(value) ? `± ${Number(error.toPrecision(1))}` : `${shown(low)} to ${shown(high)}`;
}

/** The place of a point in the flat lists of answers, the last name going fastest. */
const flat = at => at.reduce((place, each, axis) => place * sizes[axis] + each, 0);

/** The answer at a point, with what the pointer shows there. */
function answerAt(at) {
  const found = scan.answers[question], place = flat(at);
  const [value, low, high] = ["value", "low", "high"].map(what => number(found[what][place]));
  const kind = scan.kinds[found.kind[place]], note = scan.notes[found.note[place]];
  const point = scan.axes.map((axis, i) => `${axis.name} = ${shown(axis.values[at[i]])}`);
  const bounds = Number.isNaN(low) ? "no interval" : boundsOf(value, low, high);
  const told = Number.isNaN(value) ? ["no answer", note] : [`answer ${shown(value)}`, `${bounds} (${kind})`, note];
  const text = [...point, ...told].map(each => lines(each, 40)).join("<br>");
  return {value: Number.isFinite(value) ? value : null, low, high, kind, text};
}

/** The point that is shown, at other places of the axes drawn. */
const pointAt = changes => places.map((place, axis) => changes[axis] ?? place);

/** Smallest and largest of all values of a question, or of their bounds too, whatever the sliders say. */
function range(...what) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of what.flatMap(each => scan.answers[question][each]).map(number).filter(Number.isFinite)) {
    [low, high] = [Math.min(low, value), Math.max(high, value)];
  }
  if (low > high) return [0, 1];
  const size = Math.max(Math.abs(low), Math.abs(high));
  if (high - low > Math.max(1e-9 * size, 1e-300)) return [low, high];
  return size > 1e-300 ? [low - size / 2, high + size / 2] : [-0.5, 0.5]; // all alike but for rounding
}

/** The next larger of 1, 2 and 5 times a power of ten. */
function roundStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map(each => each * power).find(each => each >= least * (1 - 1e-9));
}

function lineTraces(across, other) {
  const span = (to, from) => (Number.isFinite(to - from) ? Math.max(to - from, 0) : 0);
  return (other === null ? [null] : scan.axes[other].values).map((value, row) => {
    const found = scan.axes[across].values.map((_, i) => {
      return answerAt(pointAt(other === null ? {[across]: i} : {[across]: i, [other]: row}));
    });
    const colour = scan.colours[row % scan.colours.length];
    return {
      type: "scatter", mode: "lines+markers", x: scan.axes[across].values, y: found.map(each => each.value),
      name: other === null ? "" : entities(`${scan.axes[other].name} = ${shown(value)}`), showlegend: other !== null,
      text: found.map(each => each.text), hoverinfo: "text", line: {color: colour, width: 1.5},
      marker: {size: 8, color: colour, symbol: found.map(each => (each.kind === SAMPLED ? "circle-open" : "circle"))},
      error_y: {
        type: "data", symmetric: false, color: colour, thickness: 1.2, width: 4,
        array: found.map(each => span(each.high, each.value)),
        arrayminus: found.map(each => span(each.value, each.low)),
      },
    };
  });
}

function cellTraces() {
  const [x, y] = scan.axes, [low, high] = range("value");
  const rows = y.values.map((_, j) => x.values.map((__, i) => answerAt(pointAt({0: i, 1: j}))));
  const z = rows.map(row => row.map(each => each.value));
  const step = roundStep((high - low) / 9);
  const [first, last] = [Math.ceil(low / step) * step, Math.floor(high / step) * step];
  const marks = {tickmode: "linear", tick0: first, dtick: step};
  const bar = {orientation: "h", x: 0.5, y: 1.01, yanchor: "bottom", thickness: 12, outlinewidth: 0, ...marks};
  const contours = (color, width) => ({
    type: "contour", x: x.values, y: y.values, z, zmin: low, zmax: high, line: {color, width}, hoverinfo: "skip",
    autocontour: false, contours: {coloring: "none", start: first, end: last, size: step},
    showscale: false, showlegend: false,
  });
  return [
    {
      type: "heatmap", x: x.edges, y: y.edges, z, zmin: low, zmax: high, colorscale: "Cividis", colorbar: bar,
      text: rows.map(row => row.map(each => each.text)), hoverinfo: "text", hoverongaps: true,
    },
    contours("black", 2.4),
    contours("white", 1.2),
  ];
}

function axisOf(axis, room) {
  const marks = !axis.log && axis.values.length <= FEW ? {tickvals: axis.values, ticktext: axis.values.map(shown)} : {};
  const title = {text: lines(axis.label, room), font: {size: 13}};
  const form = {exponentformat: "power", automargin: true, zeroline: false};
  return {title, type: axis.log ? "log" : "linear", ...form, ...marks};
}

function draw() {
  const isWide = plot.clientWidth > 600, room = Math.floor(plot.clientWidth / 9);
  const layout = {
    margin: {l: 40, r: 20, t: 30, b: 40}, hovermode: "closest", plot_bgcolor: "#e8e8e8", height: isWide ? 560 : 440,
    legend: {orientation: "h", x: 0, y: 1.02, yanchor: "bottom"}, hoverlabel: {align: "left"},
  };
  const isCells = sizes.length > 1 && Math.min(sizes[0], sizes[1]) >= ENOUGH;
  let traces;
  answer.textContent = scan.questions[question].title;
  if (isCells) {
    layout.xaxis = axisOf(scan.axes[0], room);
    layout.yaxis = axisOf(scan.axes[1], 40);
    traces = cellTraces();
  } else {
    const across = sizes.length > 1 && sizes[1] > sizes[0] ? 1 : 0, [low, high] = range("value", "low", "high");
    layout.plot_bgcolor = "#fff";
    layout.xaxis = {...axisOf(scan.axes[across], room), gridcolor: "#e4e4e4"};
    layout.yaxis = {
      title: {text: lines(scan.questions[question].title, 40), font: {size: 13}}, automargin: true, zeroline: false,
      exponentformat: "power", range: [low - 0.05 * (high - low), high + 0.05 * (high - low)], gridcolor: "#e4e4e4",
    };
    traces = lineTraces(across, sizes.length > 1 ? 1 - across : null);
  }
  const missing = scan.answers[question].value.filter(value => value === null).length;
  empty.textContent = missing ? `${missing} of ${scan.answers[question].value.length} points have no answer.` : "";
  const modeBarButtons = [["toImage", "zoom2d", "pan2d", "resetScale2d"]];
  Plotly.react(plot, traces, layout, {responsive: true, displaylogo: false, displayModeBar: isWide, modeBarButtons});
}

/** A labelled control; `told` gives the text of its label again after each change. */
function addControl(control, told, changed) {
  const label = document.createElement("label"), text = document.createElement("span");
  text.textContent = told();
  label.append(text, control);
  control.addEventListener("input", () => {
    changed(Number(control.value));
    text.textContent = told();
    draw();
  });
  controls.append(label);
}

if (scan.questions.length > 1) {
  const select = document.createElement("select");
  scan.questions.forEach((each, place) => select.append(new Option(each.text, place)));
  addControl(select, () => "question", place => { question = place; });
}
scan.axes.forEach((axis, i) => {
  if (i < 2) return;
  const slider = Object.assign(document.createElement("input"), {type: "range", min: 0, max: sizes[i] - 1, step: 1});
  slider.value = 0;
  addControl(slider, () => `${axis.label}: ${shown(axis.values[places[i]])}`, place => { places[i] = place; });
});
draw();
let width = plot.clientWidth;
window.addEventListener("resize", () => {
  if (plot.clientWidth !== width) draw();
  width = plot.clientWidth;
});
