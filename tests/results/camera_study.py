"""What a camera costs: the line of four calibrated from its stored runs, by events and from frames.

    python -m tests.results.camera_study

fits the frames that results/camera lacks, in some ten minutes of CPU time, and counts the information that frames of
other intervals keep.

The runs are the calibration runs of results/line4 at 60 cubes: the others are of other densities, where rates
differ, and held-out runs are not used. Breaks are of first order, so that counts of all species are all there is.
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from calibration import net_path
from calibration.estimating.exposure import count, pooled
from calibration.estimating.likelihood_fit import ParameterFit, fit_parameters
from kinetics.commands.models import network_of_book
from kinetics.markov.panels import PanelData, PanelLikelihood, PanelRun
from kinetics.network import Model, Network
from kinetics.rates import Rates
from kinetics.runs import JumpPath
from kinetics.support.arrays import Floats, Ints
from kinetics.support.config import read_toml
from kinetics.support.output import write_whole
from mechsim.runs.store import RunStore
from tests.results.camera_simulated import fit_events
from tests.results.frame_likelihood import FrameLikelihood, frames_of

ROOT = Path(__file__).parents[2]
FOLDER, STUDY = ROOT / "results" / "camera", ROOT / "results" / "line4"
CUBES = 60
EVERY = (1, 10, 50, 200)  # tu, of the fits
AT_ONCE = 2.0  # tu; a Markov chain rarely undoes a break by the same two parts so soon
CURVE = (1, 2, 5, 10, 20, 50, 100, 200, 250, 500)  # tu, of the information alone
RESAMPLED, SEED = 2000, 1  # bootstrap of whole runs


def network() -> Network:
    """The line of four at the rates of the paper, from which every search begins."""
    book = network_of_book("line4")[0]
    return book.with_rates(Rates.load("table3").apply(book).known_rates)


@cache
def runs_and_bonds() -> list[tuple[JumpPath, Ints]]:
    """The calibration runs of 60 cubes, by key, and the two cubes that met or parted at each event."""
    seed, book = read_toml(STUDY / "plan.toml")["calibration"]["seed"], network()
    found = []
    for manifest, arrays in RunStore.found(STUDY / "runs").contents():
        cubes = arrays["initial"] @ np.arange(1, 5)
        if manifest["inputs"]["seed"] == seed and manifest["outcome"] == "completed" and cubes == CUBES:
            path = JumpPath(book, arrays["initial"], arrays["times"], arrays["channels"], manifest["facts"]["end"])
            found.append((path, arrays["bonds"]))
    return found


def stored_runs() -> tuple[JumpPath, ...]:
    """The calibration runs of 60 cubes, by key."""
    return tuple(path for path, _ in runs_and_bonds())


def net_runs() -> tuple[JumpPath, ...]:
    """These runs without the breaks that the same two parts undid at once, and without the joins that did it."""
    return tuple(net_path(path, bonds, AT_ONCE) for path, bonds in runs_and_bonds())


def watched(every: float, runs: Sequence[JumpPath] | None = None) -> list[JumpPath]:
    """The runs up to their last frame: after it, events are seen and frames see nothing."""
    found = []
    for path in stored_runs() if runs is None else runs:
        last = every * int(path.end / every)
        kept = path.times <= last
        found.append(replace(path, times=path.times[kept], channels=path.channels[kept], end=last))
    return found


def fit_frames(every: float) -> tuple[FrameLikelihood, ParameterFit, float]:
    """Rate constants from frames, and the CPU time of the fit, s."""
    began = time.process_time()
    asked = FrameLikelihood(network(), every, frames_of(stored_runs(), every)[0])
    found = fit_parameters(asked.scored, network().channels, network().known_rates, starts=1)
    return asked, found, time.process_time() - began


def information(every: float, rates: Floats) -> tuple[Floats, Floats]:
    """What frames (R, P, P), and events (R, P), are expected to say in each run, given the counts in each frame."""
    pairs, owners = frames_of(stored_runs(), every)
    asked = FrameLikelihood(network(), every, pairs)
    found = asked.information(rates)
    cuts = np.flatnonzero(np.diff(owners, prepend=-1))
    return np.add.reduceat(found.frames[asked.begin_of], cuts), np.add.reduceat(found.events[asked.begin_of], cuts)


def kept(frames: Floats, events: Floats) -> Floats:
    """Share (..., P + 1) of the events' information that frames keep: of each rate, the others being unknown too, and
    of all, as the geometric mean over the axes of the confidence ellipsoid."""
    own = 1.0 / np.diagonal(np.linalg.inv(frames), axis1=-2, axis2=-1) / events
    size = np.linalg.slogdet(frames)[1] - np.log(events).sum(axis=-1)
    return np.concatenate([own, np.exp(size / events.shape[-1])[..., None]], axis=-1)


def curve_rows(every: float, rates: Floats) -> list[dict[str, Any]]:
    """The information kept at one interval, with 95 % intervals by a bootstrap of runs within each kind of start."""
    frames, events = information(every, rates)
    kinds = np.unique([path.initial for path in stored_runs()], axis=0, return_inverse=True)[1].reshape(-1)
    rng = np.random.default_rng(SEED)
    drawn = np.concatenate(
        [rng.choice(np.flatnonzero(kinds == kind), (RESAMPLED, (kinds == kind).sum())) for kind in np.unique(kinds)], 1
    )
    copies = np.apply_along_axis(np.bincount, 1, drawn, minlength=len(events))
    again = kept(np.tensordot(copies, frames, 1), copies @ events)
    low, high = np.quantile(again, [0.025, 0.975], axis=0)
    value = kept(frames.sum(axis=0), events.sum(axis=0))
    looks = len(frames_of(stored_runs(), every)[0])
    return [
        {"every": every, "channel": name, "kept": value[p], "low": low[p], "high": high[p],
         "events_per_frame": events.sum() / looks}
        for p, name in enumerate([*network().channels, "all"])
    ]  # fmt: skip


def fitted(every: float, rates: Floats) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Rows of estimates, a channel each, and the facts of one interval."""
    seen = fit_events(watched(every))
    asked, found, seconds = fit_frames(every)
    frames, events = (each.sum(axis=0) for each in information(every, rates))
    # An estimate from all events differs from one that uses a part of what they say by an independent error.
    spread = np.linalg.inv(frames) - np.diag(1.0 / events)
    off = np.log(found.value / seen.value)
    net = np.log(found.value / fit_events(watched(every, net_runs())).value)
    chi_square, chi_square_net = (float(each @ np.linalg.solve(spread, each)) for each in (off, net))
    undone = sum(path.times.size - net.times.size for path, net in zip(stored_runs(), net_runs(), strict=True)) // 2
    numbers = pooled(count(path) for path in watched(every)).events
    rows = [
        {"every": every, "channel": name, "events": int(numbers[p]),
         "by_events": seen.value[p], "events_low": seen.low[p], "events_high": seen.high[p],
         "rate": found.value[p], "low": found.low[p], "high": found.high[p],
         "expected_sd": np.sqrt(spread[p, p]), "z": off[p] / np.sqrt(spread[p, p])}
        for p, name in enumerate(found.names)
    ]  # fmt: skip
    facts = {
        "window": every * int(stored_runs()[0].end / every), "frames": int(asked.copies.sum()),
        "pairs": asked.copies.size, "begins": len(asked.begins), "states": asked.states,
        "log_likelihood": found.log_likelihood, "evaluations": found.evaluations, "cpu_seconds": seconds,
        "chi_square": chi_square, "freedom": len(off), "p": float(stats.chi2.sf(chi_square, len(off))),
        "undone": undone, "p_net": float(stats.chi2.sf(chi_square_net, len(off))),
        "notes": list(found.notes),
    }  # fmt: skip
    return rows, facts


def by_package(every: float, rates: Floats) -> dict[str, float]:
    """`PanelLikelihood` of all frames at these rates, as `calibrate --counts` maximises it: value, how many standard
    errors a Newton step would still go, and CPU time of value and gradient once the states are known, s."""
    network_at = network().with_rates(rates)
    columns, runs = {name: {name: 1.0} for name in network_at.species}, []
    for path in stored_runs():
        times = every * np.arange(1, int(path.end / every) + 1)
        runs.append(PanelRun(path.initial, times, path.at(times)))
    asked = PanelLikelihood(Model.of(network_at), PanelData(columns, runs))
    asked.scored({}, network_at.channels)  # finds the states
    began = time.process_time()
    found = asked.scored({}, network_at.channels)
    seconds = time.process_time() - began
    expected = information(every, rates)[0].sum(axis=0)
    off = float(np.sqrt(found.gradient @ np.linalg.solve(expected, found.gradient)))
    width = found.answer.high - found.answer.low
    return {"log_likelihood": found.answer.value, "bounds_apart": width, "still_off": off, "cpu_seconds": seconds}


def main() -> None:
    """Write what is missing: estimates.csv and facts.json, then information.csv and package.json."""
    FOLDER.mkdir(exist_ok=True)
    estimates, facts, curve = FOLDER / "estimates.csv", FOLDER / "facts.json", FOLDER / "information.csv"
    package = FOLDER / "package.json"
    rates = fit_events(list(stored_runs())).value
    said: dict[str, Any] = json.loads(facts.read_text("utf-8")) if facts.exists() else {}
    for every in EVERY:
        if str(every) not in said:
            rows, said[str(every)] = fitted(every, rates)
            known = [pd.read_csv(estimates)] if estimates.exists() else []
            table = pd.concat([*known, pd.DataFrame(rows)], ignore_index=True)
            write_whole(estimates, table.to_csv(index=False, float_format="%.8g"))
            write_whole(facts, json.dumps(said, indent=1) + "\n")
    if not curve.exists():
        table = pd.DataFrame([row for every in CURVE for row in curve_rows(every, rates)])
        write_whole(curve, table.to_csv(index=False, float_format="%.6g"))
    if not package.exists():
        table = pd.read_csv(estimates)
        checked = {every: by_package(every, table[table["every"] == every]["rate"].to_numpy()) for every in EVERY}
        write_whole(package, json.dumps(checked, indent=1) + "\n")


if __name__ == "__main__":
    main()
