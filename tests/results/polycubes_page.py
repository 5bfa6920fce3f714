"""The page of the table of shapes: table, contact sheets, figure and the blocks of README.md, from the rows."""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from statistics import median

import pandas as pd

from kinetics.assembly.drawing.drawing import INK
from kinetics.support.output import write_together
from kinetics.support.plots import COLOURS
from tests.results.polycubes_rows import BREAK, CPU_LIMIT, CUBES, DURATION, EFFORTS, JOIN, MAX_STATES, RUNS, Row
from tests.results.polycubes_shapes import ALL_UP_TO, SAMPLE, SEED, SIZES, Shape, canonical, chosen, polycubes
from tests.results.polycubes_sheets import NO_BOOK, NOT_DECIDED, colour_of, sheet, svg
from tests.results.studies import bullets, listed, only, paragraph, table

BLOCK = re.compile(r"(<!-- polycubes: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
SHEETS = {"shapes_1_to_5": (1, 2, 3, 4, 5), "shapes_6": (6,), "shapes_7": (7,), "shapes_8": (8,)}
FIGURE = "cubes.svg"
UNSHOWN = ("places", "book", "code", "reason")  # what the CSV file leaves to rows.jsonl
AIM = 10.0  # CPU s that a median shape may take

Rows = Sequence[Row]


def with_book(rows: Iterable[Row]) -> list[Row]:
    """Those for which there is a book."""
    return [row for row in rows if row.letters is not None]


def by_size(rows: Rows) -> dict[int, list[Row]]:
    """Rows of each number of cubes."""
    return {size: [row for row in rows if row.cubes == size] for size in sorted({row.cubes for row in rows})}


def mirrored(places: Shape) -> Shape:
    """The mirror image, in canonical form."""
    return canonical(tuple((-x, y, z) for x, y, z in places))


# The blocks of the page


def verdict(rows: Rows) -> str:
    """What the table comes to."""
    there = [row for row in rows if row.cubes > 1]
    books = with_book(there)
    proven = [row for row in books if row.is_fewest]
    outcomes = Counter(row.outcome for row in there)
    cpu = [row.cpu for row in there]
    none = [row for row in there if row.outcome == "infeasible"]
    exact = sum(row.method == "transient" for row in books)
    best, worst = (pick(books, key=lambda row: row.yield_ or 0.0) for pick in (max, min))
    letters = Counter(row.letters for row in books)
    said = listed([f"{number} with {count}" for count, number in sorted(letters.items())])
    there_are = (
        f"**{len(books)} of {len(there)} shapes of two cubes and more have a book**, {outcomes['infeasible']} are "
        f"proven to have none of the kind searched, with any senses{f' ({_sizes(none)} cubes)' if none else ''}, "
        f"and {outcomes['undecided'] + outcomes['ended']} were not decided within the allowed steps or time."
    )
    few = (
        f"**Few letters suffice**, the free cube's included: {said}. In {len(proven)} of the {len(books)} books "
        f"they are proven the fewest of the kind that the compiler searches, for these senses and orientations; for "
        f"the others it is not decided whether fewer suffice."
    )
    costs = (
        f"**What it costs**: CPU time of {median(cpu):.2g} s for the median shape "
        f"({'within' if median(cpu) <= AIM else 'more than'} the {AIM:g} s aimed at), {max(cpu):.3g} s for the "
        f"slowest, {sum(cpu) / 60:.1f} minutes for all."
    )
    amounts = (
        f"**Yields** of the books, targets at {DURATION:,.0f} tu over those possible, go from {worst.yield_:.2g} "
        f"(of {worst.cubes} cubes) to {best.yield_:.2g} (of {best.cubes}), median "
        f"{median([row.yield_ or 0.0 for row in books]):.2g}; {exact} are exact, the others sampled."
    )
    return bullets([there_are, few, costs, amounts, _mirrors(rows)])


def _sizes(rows: Rows) -> str:
    return listed([f"{n} of {size}" for size, n in sorted(Counter(row.cubes for row in rows).items())])


def _mirrors(rows: Rows) -> str:
    """Whether a shape and its mirror image come to the same."""
    found = {row.places: row for row in rows}
    pairs = [
        (row, found[other])
        for row in rows
        if (other := mirrored(row.places)) > row.places and other in found and row.cubes > 1
    ]
    same = sum((a.outcome, a.letters, a.senses) == (b.outcome, b.letters, b.senses) for a, b in pairs)
    return (
        f"**Mirror images**: {len(pairs)} pairs are in the table, each shape compiled separately; in {same} both "
        f"shapes have the same outcome, letters and senses."
    )


def sizes(rows: Rows) -> str:
    """A line a number of cubes."""
    head = ["cubes", "shapes", "here", "book", "fewest proven", "none", "not decided"]
    head += ["letters, median (most)", "yield, median", "CPU s, median", "CPU s, most"]
    lines = []
    for size, those in by_size(rows).items():
        books, outcomes = with_book(those), Counter(row.outcome for row in those)
        letters = [row.letters or 0 for row in books]
        lines.append(
            [
                f"{size}", f"{len(polycubes(size)):,}", f"{len(those)}", f"{len(books)}",
                f"{sum(bool(row.is_fewest) for row in books)}", f"{outcomes['infeasible']}",
                f"{outcomes['undecided'] + outcomes['ended']}",
                f"{median(letters):g} ({max(letters)})" if books else "–",
                f"{median([row.yield_ or 0.0 for row in books]):.2f}" if books else "–",
                f"{median([row.cpu for row in those]):.1f}", f"{max(row.cpu for row in those):.1f}",
            ]
        )  # fmt: skip
    return table(head, lines)


def senses(rows: Rows) -> str:
    """What the cubes of the books sense, and how many of these senses are proven the weakest of the ladder."""
    grouped = by_size([row for row in rows if row.cubes > 1])
    kinds = Counter(row.senses for row in with_book(rows))
    lines = []
    for kind, number in kinds.most_common():
        counts = [sum(row.senses == kind for row in those) for those in grouped.values()]
        proven = sum(row.senses == kind and not row.undecided_senses for row in rows)
        lines.append([kind, *(str(count) if count else "" for count in counts), str(number), str(proven)])
    return table(["senses", *(f"of {size}" for size in grouped), "all", "weaker ruled out"], lines)


def undecided(rows: Rows) -> str:
    """Why there is no book, counted."""
    kinds = Counter((row.outcome, row.cubes, why(row)) for row in rows if row.outcome not in {"book", "single"})
    if not kinds:
        return "None: every shape has its book."
    names = {"infeasible": "none", "undecided": "not decided", "ended": "not decided"}
    lines = [[names[outcome], str(size), reason, str(n)] for (outcome, size, reason), n in sorted(kinds.items())]
    return table(["book", "cubes", "why", "shapes"], lines)


def why(row: Row) -> str:
    """The reason in few words."""
    if row.outcome == "ended":
        return row.reason
    if row.outcome == "infeasible":
        if "it takes more than" in row.reason:
            return (
                "it takes more letters than were allowed, or cubes cannot distinguish what must join from what must not"
            )
        return "some meeting that must not join looks to the cubes like one that must, with any senses"
    if "not decided within" in row.reason:
        return f"{CPU_LIMIT:g} CPU s were used up"
    return "some senses were not decided in the steps allowed, and the others do not suffice"


def made(rows: Rows) -> str:
    """With what it was made."""
    seeds = {row.seed for row in rows if row.seed is not None} or {SEED}
    drawn = f"Samples: {SAMPLE} shapes of each size above {ALL_UP_TO}, seed {only(seeds)}. "
    kinds = {effort: [size for size in EFFORTS if EFFORTS[size] == effort] for effort in EFFORTS.values()}
    efforts = listed([f"{effort:g} for {listed(sizes)} cubes" for effort, sizes in kinds.items()])
    missing = len(chosen(SIZES, only(seeds))) - len(rows)
    versions = {size: Counter(row.code for row in those) for size, those in by_size(rows).items()}
    mixed = [f"{size} cubes ({', '.join(map(str, sorted(n.values())))})" for size, n in versions.items() if len(n) > 1]
    return paragraph(
        (f"**{missing} shapes of the table have no row yet.** " if missing else "")
        + (
            f"Several versions of the code made the rows of {listed(mixed)}; `--resume` makes the older ones anew. "
            if mixed
            else ""
        )
        + drawn
        + f"Share of the steps that `compile` takes by default: {efforts}; CPU time of a compilation: at most "
        f"{CPU_LIMIT:g} s. Yields: {CUBES} free cubes at time 0 in a tank of 2 x 2 x 3, "
        f"every pair of faces that may join does so at {JOIN:.0e} a tu and every bond breaks at "
        f"{BREAK:.0e} (`wellmixed rules rank BOOK --join {JOIN:.0e} --break {BREAK:.0e}`); up to {MAX_STATES:,} states "
        f"are solved exactly, else it is the mean of {RUNS:,} SSA runs with its 95 % interval. Of {CUBES} cubes, 7 can "
        f"make {CUBES // 7} targets and 8 make {CUBES // 8}; the rest is not counted as possible."
    )


BLOCKS: dict[str, Callable[[Rows], str]] = {
    "verdict": verdict,
    "sizes": sizes,
    "senses": senses,
    "undecided": undecided,
    "made": made,
}


# The files


def figure(rows: Rows) -> str:
    """Letters and CPU time against cubes, as SVG."""
    import matplotlib as mpl
    import numpy as np
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(7.2, 3.4), layout="constrained")
    left, right = drawn.subplots(1, 2)
    grouped = {size: those for size, those in by_size(rows).items() if size > 1}
    places = np.arange(len(grouped))
    names = {
        number: f"{number} letter{'' if number == 1 else 's'}" for row in with_book(rows) if (number := row.letters)
    }
    below = np.zeros(len(grouped))

    def stack(label: str, fill: str, hatch: str, counted: Callable[[Row], bool]) -> None:
        shares = np.array([sum(map(counted, those)) / len(those) for those in grouped.values()])
        if shares.any():
            left.bar(places, shares, 0.8, below, color=fill, edgecolor=INK, linewidth=0.6, hatch=hatch, label=label)
        below[:] += shares

    for n in sorted(names):
        stack(names[n], colour_of(n), "", lambda row, n=n: row.letters == n and bool(row.is_fewest))
        stack(f"≤{names[n]}", colour_of(n), "////", lambda row, n=n: row.letters == n and not row.is_fewest)
    stack("no book", NO_BOOK, "", lambda row: row.outcome == "infeasible")
    stack("not decided", NOT_DECIDED, "", lambda row: row.outcome in {"undecided", "ended"})
    left.set_ylabel("share of the shapes")
    left.set_ylim(0, 1)
    left.legend(fontsize=7, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4)
    rng = np.random.default_rng(0)
    for place, those in zip(places, grouped.values(), strict=True):
        cpu = np.array([row.cpu for row in those])
        right.semilogy(place + rng.uniform(-0.28, 0.28, cpu.size), cpu, ".", color=COLOURS[4], markersize=3)
        right.plot([place - 0.38, place + 0.38], [np.median(cpu)] * 2, "-", color=COLOURS[7], linewidth=2)
    right.axhline(AIM, color=COLOURS[5], linestyle="--", linewidth=1)
    right.annotate(f"{AIM:g} s", (places[0] - 0.4, AIM), (0, 2), textcoords="offset points", fontsize=7)
    right.set_ylabel("CPU time of a shape (s)")
    for ax in (left, right):
        ax.set_xticks(places, list(map(str, grouped)))
        ax.set_xlabel("cubes")
    with mpl.rc_context({"svg.hashsalt": "polycubes"}):
        text = io.StringIO()
        drawn.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()


def csv(rows: Rows) -> str:
    """All rows without places, books and long reasons."""
    named = pd.DataFrame(rows).assign(why=[why(row) if row.reason else "" for row in rows]).drop(columns=[*UNSHOWN])
    for name in ("undecided_senses", "undecided_letters"):
        named[name] = ["; ".join(map(str, each)) for each in named[name]]
    for name in ("letters", "rules", "joins", "breaks", "size"):
        named[name] = named[name].astype("Int64")
    return named.rename(columns={"yield_": "yield"}).to_csv(index=False)


def filled(page: str, rows: Rows) -> str:
    """The page with its blocks as the rows have them."""
    return BLOCK.sub(lambda found: f"{found[1]}{BLOCKS[found[2]](rows)}\n{found[3]}", page)


def files(folder: Path, rows: Rows) -> dict[str, str]:
    """Name -> content of all files that the rows make; the page's words between its blocks stay."""
    made = {"README.md": filled((folder / "README.md").read_text(encoding="utf-8"), rows), "shapes.csv": csv(rows)}
    for name, those in SHEETS.items():
        shown = [row for row in rows if row.cubes in those]
        if shown:
            made[f"{name}.svg"] = svg(sheet(shown))
    return made | {FIGURE: figure(rows)}


def write_page(folder: Path, rows: Rows) -> None:
    """Write all of them."""
    write_together({folder / name: content for name, content in files(folder, rows).items()})
