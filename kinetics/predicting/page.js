// Draws predicted counts over time: a panel for each species, or one panel for at most two, and a legend whose boxes
// show and hide a kind of curve in all panels.
"use strict";

const [legend, panels] = ["legend", "panels"].map(id => document.getElementById(id));
const hidden = new Set(); // kinds of curves
const isOne = data.times.length === 1; // time: points with error bars in the place of curves
// kind of curve -> whether there are any, and how it looks
const KINDS = {
  mean: {isThere: data.bandTimes !== null, look: {width: 2}},
  band: {isThere: data.bandTimes !== null, look: {width: 12}},
  interval: {isThere: data.species.some(each => each.from !== null), look: {width: 1, dash: "dash"}},
  field: {isThere: data.species.some(each => each.field !== null), look: {width: 2.5, dash: "dot"}},
  run: {isThere: data.species.some(each => each.runs.length > 0), look: {width: 0.7}},
};

const when = time => `t = ${shown(time)}${data.unit && ` ${data.unit}`}`;
const clear = colour => `${colour}33`; // a fifth of it

/** What the pointer shows of a mean. */
function textOf(each, t) {
  const told = [`${each.name} at ${when(data.bandTimes[t])}`];
  const sd = each.sd === null || each.sd[t] === null ? "" : ` ± ${shown(each.sd[t])}`;
  told.push(`${data.labels.mean} ${shown(number(each.mean[t]))}${sd}`);
  told.push(`${data.labels.band}: ${shown(number(each.low[t]))} to ${shown(number(each.high[t]))}`);
  if (each.from !== null) {
    told.push(`${data.labels.interval}: ${shown(number(each.from[t]))} to ${shown(number(each.to[t]))}`);
  }
  return told.map(line => lines(line, 44)).join("<br>");
}

/** A trace of one kind of curve; `meta` is the kind. */
function curve(kind, each, x, y, more) {
  const line = {color: each.colour, ...KINDS[kind].look}, symbol = {interval: "line-ew-open", field: "x"}[kind];
  return {
    type: "scatter", mode: isOne ? "markers" : "lines", x, y, meta: kind, line, name: entities(each.name),
    marker: {color: each.colour, size: 8, symbol: symbol || "circle"},
    hoverinfo: "skip", showlegend: false, visible: !hidden.has(kind), ...more,
  };
}

/** Both ends of a band; the second fills the space between them. */
function bandOf(each) {
  const shape = data.isWhole ? "hvh" : "linear", x = data.bandTimes;
  const ends = {mode: "lines", line: {width: 0, color: each.colour, shape}, fillcolor: clear(each.colour)};
  return [curve("band", each, x, each.low, ends), curve("band", each, x, each.high, {...ends, fill: "tonexty"})];
}

/** The middle 95 % at one time, as a bar at the mean. */
function barOf(each) {
  const error_y = {
    type: "data", symmetric: false, color: each.colour, thickness: 6, width: 0,
    array: [each.high[0] - each.mean[0]], arrayminus: [each.mean[0] - each.low[0]],
  };
  const marker = {size: 0.1, color: each.colour};
  return [curve("band", each, data.bandTimes, each.mean, {marker, opacity: 0.3, error_y})];
}

function tracesOf(each, isNamed) {
  const found = [];
  if (KINDS.band.isThere) found.push(...(isOne ? barOf(each) : bandOf(each)));
  for (const [x, y] of each.runs) {
    const line = {...KINDS.run.look, color: each.colour, shape: "hv"};
    found.push(curve("run", each, x, y, {mode: "lines", opacity: 0.7, line}));
  }
  if (KINDS.mean.isThere) {
    const text = data.bandTimes.map((_, t) => textOf(each, t));
    found.push(curve("mean", each, data.bandTimes, each.mean, {text, hoverinfo: "text", showlegend: isNamed}));
  }
  if (each.from !== null) {
    for (const limit of [each.from, each.to]) found.push(curve("interval", each, data.times, limit, {}));
  }
  if (each.field !== null) {
    const text = data.times.map((time, t) => {
      return lines(`${each.name} at ${when(time)}: ${data.labels.field} ${shown(number(each.field[t]))}`, 44);
    });
    const isOnly = !KINDS.mean.isThere;
    found.push(curve("field", each, data.times, each.field, {text, hoverinfo: "text", showlegend: isNamed && isOnly}));
  }
  return found;
}

function drawPanel(plot, places) {
  const room = Math.max(20, Math.floor(plot.clientWidth / 9)), isAlone = data.panels.length === 1;
  const species = places.map(place => data.species[place]);
  const axis = title => ({
    title: {text: entities(title), font: {size: 13}, standoff: 8}, automargin: true, zeroline: false,
    gridcolor: "#e4e4e4", exponentformat: "power",
  });
  const title = isAlone ? {} : {title: {text: lines(species[0].name, room), font: {size: 14}, y: 0.97, yanchor: "top"}};
  const rows = isAlone ? 1 : lines(species[0].name, room).split("<br>").length;
  const layout = {
    ...title, margin: {l: 45, r: 12, t: isAlone ? 20 : 12 + 18 * rows, b: 40}, height: isAlone ? 440 : 250 + 18 * rows,
    hovermode: "x", hoverlabel: {align: "left"}, plot_bgcolor: "#fff", xaxis: axis(data.time), yaxis: axis(data.count),
    legend: {
      orientation: "h", x: 0, y: 1.02, yanchor: "bottom", traceorder: "normal", itemclick: false, itemdoubleclick: false,
    },
  };
  const displayModeBar = isAlone && plot.clientWidth > 600;
  const modeBarButtons = [["toImage", "zoom2d", "pan2d", "resetScale2d"]];
  const traces = species.flatMap(each => tracesOf(each, species.length > 1));
  Plotly.newPlot(plot, traces, layout, {responsive: true, displaylogo: false, displayModeBar, modeBarButtons});
}

/** The look of a kind of curve, as a picture of its own. */
function sample(look) {
  const [svg, path] = ["svg", "path"].map(name => document.createElementNS("http://www.w3.org/2000/svg", name));
  const size = {width: 28, height: 14, "aria-hidden": true};
  for (const [name, value] of Object.entries(size)) svg.setAttribute(name, value);
  const dashes = {dash: "6 4", dot: "2 4"}[look.dash] || "none";
  const given = {d: "M0 7H28", stroke: "#666", "stroke-width": look.width, "stroke-dasharray": dashes};
  for (const [name, value] of Object.entries(given)) path.setAttribute(name, value);
  if (look.width > 10) path.setAttribute("stroke-opacity", 0.3);
  svg.append(path);
  return svg;
}

function addToLegend(kind) {
  const label = document.createElement("label"), box = document.createElement("input");
  Object.assign(box, {type: "checkbox", checked: true});
  box.addEventListener("change", () => {
    if (box.checked) hidden.delete(kind);
    else hidden.add(kind);
    for (const plot of panels.children) {
      const those = plot.data.flatMap((trace, i) => (trace.meta === kind ? [i] : []));
      if (those.length) Plotly.restyle(plot, {visible: box.checked}, those);
    }
  });
  label.append(box, sample(KINDS[kind].look), data.labels[kind]);
  legend.append(label);
}

Object.keys(KINDS).filter(kind => KINDS[kind].isThere).forEach(addToLegend);
// All panels are there before the first is drawn: each takes the width that it will have.
panels.append(...data.panels.map(() => document.createElement("div")));
data.panels.forEach((places, i) => drawPanel(panels.children[i], places));
