"""The page results/line_and_t/README.md, its figure and its table of the chain.

python -m tests.results.line_and_t_runs      # the mechanics: runs.csv
python -m tests.results.line_and_t           # chain.csv, in a minute; then figure and page
"""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import numpy as np
import pandas as pd

from kinetics import Model, first_passage, simulate
from kinetics.commands.models import network_of_book
from kinetics.network import Network
from kinetics.rates import Rates
from kinetics.support.arrays import Floats
from kinetics.support.intervals import binomial_limits
from kinetics.support.output import write_whole
from kinetics.support.plots import COLOURS, save_figure
from mechsim.runs.record import book_of
from tests.results.line_and_t_runs import CANDIDATES, FOLDER
from tests.results.studies import bullets, listed, table

PAGE, FIGURE, CHAIN, RUNS = (FOLDER / name for name in ("README.md", "first_t.svg", "chain.csv", "runs.csv"))
BLOCKS = re.compile(r"(<!-- line and T: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
PAPER = {60: 102.82, 80: 77.97}  # tu, medians of 50 runs (the paper's section V-B)
PAPER_RUNS = 50
FACTORS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
SIMULATED, SEED = 20_000, 5
RESAMPLED = 4_000  # medians of 50
JOINS = {(1, 1): "1+1->2", (1, 2): "1+2->3", (1, 3): "1+3->4", (2, 2): "2+2->4", (2, 3): "2+2->4", (1, 4): "1+3->4"}
BREAKS = {2: "2->1+1", 3: "3->1+2", 4: "4->1+3"}


@cache
def t_network(factor: float) -> Network:
    """The T with Table III: rates of a way of docking by the sizes of the parts, the last docking times a factor.

    Table III counts the ways of the line's joins as one common 2 (`table3`), where the geometry has 4. A T does not
    break: the paper reports none, and its first copy is all that is asked for.
    """
    known, line = Rates.load("table3").channels, network_of_book("line4")[0]
    by_way = {
        name: channel.rate * channel.ways / line.ways[line.channel_places[name]] for name, channel in known.items()
    }
    derivation = book_of("t5")[1]
    network, found = derivation.network, []
    for row in range(len(network.channels)):
        kinds, copies = network.sparse_reactants.row(row)
        sizes = sorted(len(derivation.structures[network.species[s]]) for s in np.repeat(kinds, copies))
        if len(sizes) == 1:
            found.append(known[BREAKS[sizes[0]]].rate if sizes[0] in BREAKS else 0.0)
        else:
            found.append(by_way[JOINS[sizes[0], sizes[1]]] * (factor if sizes == [1, 4] else 1.0))
    return network.with_rates(np.array(found))


def first_t(cubes: int, factor: float, runs: int = SIMULATED) -> Floats:
    """Times (runs,), tu, to the first T; inf for none by 10,000 tu."""
    model = Model(t_network(factor), {"monomer": cubes})
    found = simulate(model, "ssa", None, [10_000.0], runs=runs, seed=SEED, until="pentamer >= 1")
    return np.where(np.isnan(found.times), np.inf, found.times)


def chain_rows() -> list[dict[str, float]]:
    """Medians by cubes and factor, with 95 % intervals of the median, and of the median of 50 runs."""
    rows, rng = [], np.random.default_rng(SEED)
    for cubes in PAPER:
        for factor in FACTORS:
            times = np.sort(first_t(cubes, factor))
            half = 0.98 * np.sqrt(times.size)  # binomial, of the rank
            low, high = times[int(times.size / 2 - half)], times[int(times.size / 2 + half)]
            few = np.median(rng.choice(times, (RESAMPLED, PAPER_RUNS)), axis=1)
            few_low, few_high = np.quantile(few, [0.025, 0.975])
            rows.append(
                {"cubes": cubes, "factor": factor, "median": float(np.median(times)), "low": low, "high": high,
                 "few_low": few_low, "few_high": few_high}
            )  # fmt: skip
    return rows


def first_line() -> tuple[float, float]:
    """Mean and median, tu, of the time to the first line of four of 60 cubes, by the same table."""
    book = network_of_book("line4")[0]
    found = first_passage(Rates.load("table3").apply(book), {"monomer": 60}, "quadmer")
    return found.mean, float(found.quantile(0.5))


def needed(cubes: int, column: str = "median") -> float:
    """The factor at which a column of chain.csv is the paper's median, between the factors by logarithms."""
    here = pd.read_csv(CHAIN).query("cubes == @cubes").sort_values("factor", ascending=False)
    return float(np.exp(np.interp(np.log(PAPER[cubes]), np.log(here[column]), np.log(here["factor"]))))


def ratios() -> pd.DataFrame:
    """Of each candidate k(1+1) and k(1+L), 1e-5 per way and pair and tu, and their ratio with its exact 95 % interval:
    given all joins, those of the last kind are binomial."""
    found = pd.read_csv(RUNS)
    per_event = (found["first_exposure"] / found["last_exposure"]).to_numpy()
    limits = [binomial_limits(row.last_events, row.last_events + row.first_events) for row in found.itertuples()]
    low, high = np.array(limits, dtype=float).T
    return found.assign(
        first=1e5 * found["first_events"] / found["first_exposure"],
        last=1e5 * found["last_events"] / found["last_exposure"],
        ratio=found["last_events"] / found["first_events"] * per_event,
        low=low / (1.0 - low) * per_event,
        high=high / (1.0 - high) * per_event,
    )


def candidates() -> str:
    """A row a candidate."""
    rows = [
        [
            CANDIDATES[row.candidate].title, f"{row.first_events}", f"{row.last_events}", f"{row.first:.2f}",
            f"{row.last:.2f}", f"{row.ratio:.2f}", f"{row.low:.2f} to {row.high:.2f}",
        ]
        for row in ratios().itertuples()
    ]  # fmt: skip
    titles = ["changed", "1+1", "1+L", "k(1+1), 1e-5/tu", "k(1+L)", "k(1+L) / k(1+1)", "95 %"]
    return table(titles, rows)


def medians() -> str:
    """A row a factor."""
    chain, rows = pd.read_csv(CHAIN), []
    for factor in FACTORS:
        cells = [f"{factor:g}"]
        for cubes in PAPER:
            (row,) = chain[(chain["cubes"] == cubes) & (chain["factor"] == factor)].itertuples()
            cells += [f"{row.median:.0f} ({row.low:.0f} to {row.high:.0f})", f"{row.few_low:.0f} to {row.few_high:.0f}"]
        rows.append(cells)
    titles = ["factor on 1+L"]
    for cubes in PAPER:
        titles += [f"median first T, {cubes} cubes (tu)", "95 % of medians of 50 runs"]
    return table(titles, rows)


def verdict() -> str:
    """What the tables show."""
    chain, found = pd.read_csv(CHAIN), ratios()
    mean, median = first_line()
    plain = {c: float(chain.query("cubes == @c and factor == 1")["median"].iloc[0]) for c in PAPER}
    limits = {c: (needed(c, "few_low"), needed(c, "few_high")) for c in PAPER}
    both = max(low for low, _ in limits.values()), min(high for _, high in limits.values())
    largest = found.loc[found["ratio"].idxmax()]
    reach = found[found["high"] >= both[0]]
    base = found.iloc[0]
    contradiction = (
        f"**The contradiction.** With Table III the first line of 60 cubes takes {mean:.1f} tu on average (median "
        f"{median:.1f}; the paper's Gillespie runs: 93.84). With the same rates per way of docking the median first T "
        f"takes {plain[60]:.0f} tu at 60 cubes and {plain[80]:.0f} at 80. The paper says "
        f"{PAPER[60]} and {PAPER[80]}."
    )
    mended = (
        f"**What would mend it.** If only the last docking, 1+L, were {needed(60):.1f} times as fast, the median would "
        f"be the paper's at 60 cubes; at 80 cubes {needed(80):.1f} times. Medians of {PAPER_RUNS} runs scatter: "
        f"factors from {limits[60][0]:.1f} to {limits[60][1]:.1f} agree with the paper at 60 cubes, from "
        f"{limits[80][0]:.1f} to {limits[80][1]:.1f} at 80, from {both[0]:.1f} to {both[1]:.1f} with both."
    )
    given = (
        f"**What mechanics gives.** The last docking has {base.ratio:.2f} times the rate of 1+1 (95 %: {base.low:.2f} "
        f"to {base.high:.2f}). Of {len(found) - 1} changes the largest ratio is {largest.ratio:.2f} "
        f"({largest.low:.2f} to {largest.high:.2f}): {_plain(largest.candidate)}."
    )
    said = [contradiction, mended, given]
    if reach.empty:
        said.append(
            f"**No change reaches {both[0]:.1f}.** None of them is the reason, alone; a faster pace of all joins would "
            f"bring the line forward, too, by the same factor."
        )
    else:
        names = [_plain(name) for name in reach["candidate"]]
        said.append(f"**Within its interval {both[0]:.1f} is reached by** {listed(names)}.")
    return bullets(said)


def _plain(name: str) -> str:
    return CANDIDATES[name].title


def draw(figure: Any) -> None:
    """Above, the median first T by the chain against the factor; below, the factors that mechanics gives."""
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[1.0, 1.1])
    chain = pd.read_csv(CHAIN)
    for k, cubes in enumerate(PAPER):
        here = chain[chain["cubes"] == cubes]
        top.plot(here["factor"], here["median"], color=COLOURS[k], marker="os"[k], ms=4, label=f"{cubes} cubes")
        top.fill_between(here["factor"], here["few_low"], here["few_high"], color=COLOURS[k], alpha=0.2, lw=0)
        top.axhline(PAPER[cubes], color=COLOURS[k], ls="--", lw=1.0)
        top.annotate("paper", (0.58, PAPER[cubes]), (0, 2), textcoords="offset points", color=COLOURS[k], fontsize=8)
    top.set_yscale("log")
    top.set_yticks([60, 80, 100, 150, 200, 300], ["60", "80", "100", "150", "200", "300"])
    top.minorticks_off()
    top.set_ylabel("median first T (tu)")
    top.legend(frameon=False, fontsize=8)
    found = ratios().iloc[::-1].reset_index(drop=True)
    spread = [found["ratio"] - found["low"], found["high"] - found["ratio"]]
    bottom.errorbar(found["ratio"], found.index, xerr=spread, fmt="o", color="black", ms=3.5, lw=1.0, capsize=2)
    bottom.set_yticks(list(found.index), [_plain(name) for name in found["candidate"]], fontsize=8)
    low = max(needed(c, "few_low") for c in PAPER)
    high = min(needed(c, "few_high") for c in PAPER)
    for ax in (top, bottom):
        ax.axvspan(low, high, color="0.9", zorder=0)
    bottom.set_xscale("log")
    bottom.set_xticks([0.5, 1, 2, 4, 8], ["0.5", "1", "2", "4", "8"])
    bottom.minorticks_off()
    bottom.set_xlabel("k(1+L) / k(1+1), per way of docking")


def written(text: str) -> str:
    """The page with its blocks made anew; ValueError: it has not the blocks for them."""
    made = {"verdict": verdict(), "medians": medians(), "candidates": candidates()}
    if sorted(block[2] for block in BLOCKS.finditer(text)) != sorted(made):
        raise ValueError(f"{PAGE.name} has not one block <!-- line and T: ... --> for each of {', '.join(made)}")
    return BLOCKS.sub(lambda block: block[1] + made[block[2]] + "\n" + block[3], text)


def main() -> None:
    """Simulate what is missing, draw and write."""
    if not CHAIN.exists():
        write_whole(CHAIN, pd.DataFrame(chain_rows()).to_csv(index=False, float_format="%.6g"))
    save_figure(str(FIGURE), draw, (6.4, 6.4))
    PAGE.write_text(written(PAGE.read_text("utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
