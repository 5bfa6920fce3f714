"""The look of reports: on a screen, on a phone, and on paper.

On a screen a table that is too wide scrolls by itself, and never the page. Paper cannot scroll: there folds are open,
cells are broken into lines, and no picture, row or title is torn from what belongs to it.
"""

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff; max-width: 75rem;
       margin: 1rem auto; padding: 0 1rem; }
h1, h2 { line-height: 1.2; margin: 1rem 0 0.5rem; } h2 { font-size: 1.1rem; }
h1, p, summary, figcaption { overflow-wrap: anywhere; }
p { max-width: 62rem; margin: 0.5rem 0; }
figure { margin: 1rem 0; } img { max-width: 100%; height: auto; }
figcaption { color: #444; font-size: 0.9rem; margin: 0.3rem 0; width: 0; min-width: min(100%, 62rem); }
/* on the first screen figures stand side by side where they have room */
body > figure { display: inline-block; vertical-align: top; margin: 0.5rem 1.5rem 0.5rem 0; max-width: 100%; }
body > figure > img { width: 30rem; }
/* a table that is wider than the page scrolls by itself, under a bar that always shows */
.table { overflow-x: auto; max-width: 100%; }
.table::-webkit-scrollbar { height: 0.7rem; background: #eee; } .table::-webkit-scrollbar-thumb { background: #888; }
table { border-collapse: collapse; font-size: 0.85rem; line-height: 1.3; font-variant-numeric: tabular-nums; }
th, td { padding: 0.12rem 0.6rem; border-bottom: 1px solid #e4e4e4; text-align: right; white-space: nowrap; }
th { border-bottom: 2px solid #888; vertical-align: bottom; white-space: normal; }
th:first-child, td:first-child { text-align: left; }
details { border-top: 1px solid #ddd; padding: 0.5rem 0; } details > details { margin-left: 1rem; }
summary { cursor: pointer; font-weight: 600; }
td span { white-space: nowrap; } /* numbers, which else break behind the minus of an exponent */
td.words { text-align: left; white-space: normal; min-width: 14rem; }
table.facts td { text-align: left; white-space: normal; overflow-wrap: anywhere; }
@media (max-width: 40rem) {
  body { padding: 0 0.7rem; }
  h1 { font-size: 1.5rem; }
  body > figure { margin-right: 0; }
  table { font-size: 0.66rem; }
  th, td { padding: 0.12rem 0.2rem; }
  td:not(:first-child) { white-space: normal; }
  details > details { margin-left: 0.3rem; }
}
@page { margin: 1.5cm; }
@media print {
  body { font-size: 10pt; max-width: none; margin: 0; padding: 0; }
  details::details-content { content-visibility: visible; block-size: auto; }
  details > details { margin-left: 0; }
  .table { overflow: visible; }
  table { font-size: 7.5pt; }
  th, td { padding: 0.1rem 0.25rem; white-space: normal; }
  td:first-child:not(.words) { white-space: nowrap; }
  table.wide { font-size: 6pt; }
  table.wide th { overflow-wrap: anywhere; }
  td.words { min-width: 5rem; }
  td.words { overflow-wrap: anywhere; }
  thead { display: table-header-group; }
  tr, img, figure:has(> img) { break-inside: avoid; }
  h1, h2, summary, figcaption, thead { break-after: avoid; }
  p { orphans: 3; widows: 3; }
}
"""
