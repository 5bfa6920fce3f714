"""The page results/camera/README.md and its figure, from the stored tables: `python -m tests.results.camera`.

`tests.results.camera_study` and `tests.results.camera_simulated` make the tables.
"""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from kinetics.support.plots import COLOURS, save_figure
from tests.results.camera_simulated import EVERY, TRUE, network
from tests.results.camera_study import AT_ONCE, FOLDER
from tests.results.studies import bullets, listed, table

PAGE, FIGURE = FOLDER / "README.md", FOLDER / "information.svg"
BLOCKS = re.compile(r"(<!-- camera: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
ENOUGH = 0.9  # of the information
LEAST_P = 0.01
MARKERS = "osD^vP*X"


def stored(name: str) -> Any:
    """A table or the facts of the study."""
    path = FOLDER / name
    return pd.read_csv(path) if path.suffix == ".csv" else json.loads(path.read_text("utf-8"))


def enough(channel: str) -> tuple[float, float]:
    """The interval, tu, at which frames keep 90 % of the information, and the events in it: read off the curve between
    its points, by the logarithm of the interval."""
    curve = stored("information.csv")
    here = curve[curve["channel"] == channel].sort_values("every")
    place = int(np.argmax(here["kept"].to_numpy() < ENOUGH))
    (above, below), (first, second) = (here[name].to_numpy()[place - 1 : place + 1] for name in ("kept", "every"))
    share = (above - ENOUGH) / (above - below)
    time = float(np.exp(np.log(first) + share * np.log(second / first)))
    return time, time * float(here["events_per_frame"].iloc[place - 1] / first)


def widths() -> pd.DataFrame:
    """Estimates with `ratio`, the width of the frames' interval over that of the events', both of the logarithm."""
    found = stored("estimates.csv")
    ratio = np.log(found["high"] / found["low"]) / np.log(found["events_high"] / found["events_low"])
    return found.assign(ratio=ratio)


def simulated() -> pd.DataFrame:
    """One row an interval (0: events) and channel of the simulated data sets: mean relative error of the rate, its
    standard error, mean error of the logarithm, standard deviation of that over sets, and how many intervals cover."""
    rows = stored("simulated.csv")
    true = rows["channel"].map(dict(zip(network().channels, TRUE, strict=True)))
    off, covers = rows["rate"] / true - 1.0, rows["low"].le(true) & rows["high"].ge(true)
    groups = rows.assign(off=off, log=np.log1p(off), covers=covers).groupby(["every", "channel"], sort=False)
    return groups.agg(
        sets=("off", "size"), off=("off", "mean"), error=("off", "sem"), log=("log", "mean"), log_error=("log", "sem"),
        sd=("log", "std"), covers=("covers", "sum"),
    ).reset_index()  # fmt: skip


def pooled_error(every: float) -> tuple[float, float]:
    """Hotelling's T-squared of the mean relative errors of all channels over the data sets, and its p."""
    rows = stored("simulated.csv")
    wide = rows[rows["every"] == every].pivot(index="set", columns="channel", values="rate")[list(network().channels)]
    off = wide.to_numpy() / TRUE - 1.0
    n, p = off.shape
    square = n * float(off.mean(axis=0) @ np.linalg.solve(np.cov(off.T), off.mean(axis=0)))
    return square, float(stats.f.sf(square * (n - p) / (p * (n - 1)), p, n - p))


def coverage(every: float) -> tuple[float, float]:
    """Share of the 95 % intervals of all channels that hold the true rate, and its standard error over data sets."""
    rows = stored("simulated.csv")
    rows = rows[rows["every"] == every]
    true = rows["channel"].map(dict(zip(network().channels, TRUE, strict=True)))
    shares = (rows["low"].le(true) & rows["high"].ge(true)).groupby(rows["set"]).mean()
    return float(shares.mean()), float(shares.sem())


def verdict() -> str:
    """What the study shows, by its numbers."""
    curve, facts, seen = stored("information.csv"), stored("facts.json"), widths()
    time, events = enough("all")
    each = {name: enough(name)[0] for name in network().channels}
    worst, best = min(each, key=each.__getitem__), max(each, key=each.__getitem__)
    overall = curve[curve["channel"] == "all"].set_index("every")["kept"]
    information = listed([f"{overall[every]:.0%}" for every in EVERY])
    bounded = seen[np.isfinite(seen["ratio"])]
    widest = listed([f"{bounded[bounded['every'] == every]['ratio'].max():.2f}" for every in EVERY])
    unbounded = seen[seen["low"] == 0.0]
    open_ended = "".join(
        f" Every {every} tu, {len(rows)} of the rates might be 0: the few events of {listed(list(rows['channel']))} "
        "may all be explained by others."
        for every, rows in unbounded.groupby("every")
    )
    agree = [every for every in EVERY if facts[str(every)]["p"] > LEAST_P]
    nested = listed([f"{facts[str(every)]['p']:.2g}" for every in agree])
    means = listed([f"{pooled_error(every)[1]:.2g}" for every in EVERY])
    covered = listed([f"{coverage(every)[0]:.1%}" for every in EVERY])
    minutes = {every: facts[str(every)]["cpu_seconds"] / 60 for every in EVERY}
    longest = max(minutes, key=minutes.__getitem__)
    decision = (
        f"**A frame every {time:.0f} tu keeps {ENOUGH:.0%} of what events say about all rates together**, with "
        f"{events:.1f} events between two frames on average. Single rates need a frame every {each[worst]:.0f} tu "
        f"({worst.replace('->', '→')}) to {each[best]:.0f} tu ({best.replace('->', '→')})."
    )
    lost = (
        f"**What is lost.** Frames every {listed(EVERY)} tu keep {information} of the information; the bounded "
        f"interval that grows most is {widest} times as wide as by events.{open_ended}".replace("->", "→")
    )
    bias = (
        f"**No bias of frames is seen.** In {stored('simulated.csv')['set'].nunique()} simulated data sets the mean "
        f"errors of all rates are compatible with 0 (p = {means}), and 95 % intervals hold the true rate in {covered} "
        f"of cases. In the runs, estimates from frames every {listed(agree)} tu differ from those by events as nested "
        f"estimates should (p = {nested})." + "".join(_rebound(every) for every in EVERY if every not in agree)
    )
    cost = (
        f"**It costs {min(minutes.values()):.1f} to {max(minutes.values()):.1f} min of CPU time** for eight rates with "
        f"intervals, most every {longest} tu, against milliseconds by events. Short intervals have more frames, long "
        f"ones more steps between two frames."
    )
    return bullets([decision, lost, bias, cost])


def _rebound(every: int) -> str:
    """Why estimates from frames every so many tu differ from those by events."""
    fact, breaks = stored("facts.json")[str(every)], stored("estimates.csv")
    is_break = (breaks["every"] == every) & ~breaks["channel"].str.split("->").str[0].str.contains("+", regex=False)
    return (
        f" Every {every} tu they do not (p = {fact['p']:.1g}): of {breaks[is_break]['events'].sum()} breaks, the same "
        f"two parts undid {fact['undone']} within {AT_ONCE:g} tu, which hardly happens in a Markov chain. Events count "
        f"these as breaks and joins, and frames do not see them; without them, p = {fact['p_net']:.2g}."
    )


def intervals() -> str:
    """A row an interval."""
    curve, facts, seen, package = stored("information.csv"), stored("facts.json"), widths(), stored("package.json")
    rows = []
    for every in EVERY:
        fact, ratio = facts[str(every)], seen[seen["every"] == every]["ratio"]
        minutes = fact["evaluations"] * package[str(every)]["cpu_seconds"] / 60
        (row,) = curve[(curve["every"] == every) & (curve["channel"] == "all")].to_dict("records")
        rows.append(
            [
                f"{every}", f"{fact['frames']:,}", f"{row['events_per_frame']:.2f}",
                f"{row['kept']:.3f} [{row['low']:.3f}, {row['high']:.3f}]", f"{ratio.median():.2f}",
                _ratio(ratio.max()), f"{fact['chi_square']:.1f} of {fact['freedom']}", f"{fact['p']:.2g}",
                f"{fact['cpu_seconds']:.0f}", f"{fact['evaluations']}", f"{minutes:.0f}",
            ]
        )  # fmt: skip
    titles = [
        "frame every (tu)", "frames", "events per frame", "information kept [95 %]", "width ratio, median", "largest",
        "shift: χ²", "p", "CPU time (s)", "evaluations", "by `calibrate --counts`, forecast (min)",
    ]  # fmt: skip
    return table(titles, rows)


def _ratio(value: float) -> str:
    return f"{value:.2f}" if np.isfinite(value) else "no lower end"


def rates() -> str:
    """A row a channel: by events, then by frames, with the shift in its expected standard deviations."""
    rows = []
    for name, here in widths().groupby("channel", sort=False):
        first = here.iloc[0]
        cells = [f"{1e5 * first.by_events:.2f} [{1e5 * first.events_low:.2f}, {1e5 * first.events_high:.2f}]"]
        cells += [
            f"{1e5 * row.rate:.2f} [{1e5 * row.low:.2f}, {1e5 * row.high:.2f}]; {_ratio(row.ratio)}; {row.z:+.1f}"
            for row in here.itertuples()
        ]
        rows.append([str(name).replace("->", "→"), f"{first.events}", *cells])
    return table(["channel", "events", "by events", *(f"every {every} tu" for every in EVERY)], rows)


def checks() -> str:
    """A row an interval of the simulated data sets."""
    rows = []
    for every, here in simulated().groupby("every"):
        share, error = coverage(float(str(every)))
        least, most = here["covers"].min() / here["sets"].max(), here["covers"].max() / here["sets"].max()
        square, p = pooled_error(float(str(every)))
        far = here.loc[(here["off"] / here["error"]).abs().idxmax()]
        log = here.loc[(here["log"] / here["sd"]).abs().idxmax()]
        rows.append(
            [
                f"frames every {every} tu" if every else "events",
                f"{far['channel']}: {100 * far['off']:+.1f} ± {100 * far['error']:.1f} %",
                f"{square:.1f} of {len(here)}", f"{p:.2g}",
                f"{log['channel']}: {log['log']:+.3f} of {log['sd']:.3f}",
                f"{share:.3f} ± {error:.3f}", f"{least:.3f} to {most:.3f}",
            ]
        )  # fmt: skip
    titles = [
        "from", "mean error of a rate, farthest from 0 in standard errors", "Hotelling's T²", "p",
        "largest mean error of a logarithm, and its scatter", "coverage", "by channel",
    ]  # fmt: skip
    return table(titles, rows)


def draw(figure: Any) -> None:
    """Information kept against the time between frames; above, the mean number of events between two."""
    curve = stored("information.csv")
    ax = figure.add_subplot()
    for k, (name, here) in enumerate(curve.groupby("channel", sort=False)):
        is_all = name == "all"
        spread = [here["kept"] - here["low"], here["high"] - here["kept"]]
        ax.errorbar(
            here["every"], here["kept"], yerr=spread, color="black" if is_all else COLOURS[k % 7],
            marker=None if is_all else MARKERS[k], markersize=4, linewidth=2.4 if is_all else 1.0,
            linestyle="-" if is_all or "+" in str(name).split("->")[0] else "--", elinewidth=0.8, capsize=1.5,
            label="all rates" if is_all else str(name).replace("->", "→"), zorder=3 if is_all else 2,
        )  # fmt: skip
    time, _ = enough("all")
    ax.axhline(ENOUGH, color="0.6", linewidth=0.8, zorder=1)
    ax.plot([time, time], [0.0, ENOUGH], color="0.6", linewidth=0.8, zorder=1)
    ax.annotate(f"{time:.0f} tu", (time, 0.0), (3, 4), textcoords="offset points", color="0.35", fontsize=9)
    ax.set_xscale("log")
    ax.set_xlim(0.9, 560)
    ax.set_ylim(0.0, 1.02)
    ax.set_xlabel("time between frames (tu)")
    ax.set_ylabel("Fisher information kept (frames / events)")
    ax.set_xticks([1, 10, 50, 200, 500], ["1", "10", "50", "200", "500"])
    ax.legend(frameon=False, fontsize=8, loc="lower left", ncols=1)
    here = curve[curve["channel"] == "all"]
    rate = float((here["events_per_frame"] / here["every"]).mean())
    top = ax.secondary_xaxis("top", functions=(lambda x: x * rate, lambda x: x / rate))
    top.set_xticks([0.1, 1, 10], ["0.1", "1", "10"])
    top.set_xlabel("mean number of events between frames")


def written(text: str) -> str:
    """The page with its tables made anew; ValueError: it has not the blocks for them."""
    made = {"verdict": verdict(), "intervals": intervals(), "rates": rates(), "checks": checks()}
    if sorted(block[2] for block in BLOCKS.finditer(text)) != sorted(made):
        raise ValueError(f"{PAGE.name} has not one block <!-- camera: ... --> for each of {', '.join(made)}")
    return BLOCKS.sub(lambda block: block[1] + made[block[2]] + "\n" + block[3], text)


def main() -> None:
    """Draw and write."""
    save_figure(str(FIGURE), draw, (6.4, 4.8))
    PAGE.write_text(written(PAGE.read_text("utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
