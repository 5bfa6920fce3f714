// Shared by interactive pages. Every text of a model is put into the page as text, and into Plotly with & < > as
// entities.
"use strict";

const data = JSON.parse(document.getElementById("data").textContent);
const number = value => (value === null ? NaN : Number(value)); // infinite ones come as text
const shown = value => (Number.isFinite(value) ? String(Number(value.toPrecision(6))) : value > 0 ? "infinite" : "-");
const entities = text => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");

/** A text in lines of at most so many characters, as Plotly wants it; longer words are cut. */
function lines(text, most) {
  const found = [""];
  for (const word of text.split(" ").flatMap(each => each.match(new RegExp(`[^]{1,${most}}`, "gu")) || [""])) {
    const longer = found.at(-1) ? `${found.at(-1)} ${word}` : word;
    if (longer.length <= most) found[found.length - 1] = longer;
    else found.push(word);
  }
  return found.map(entities).join("<br>");
}
