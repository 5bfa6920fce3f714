"""What the likelihood of panel data costs, and what a fit of it with profile intervals costs.

    python -m tests.benchmarks.bench_panels [--only NAME] [--fits]

CPU seconds, compilation included in the first line only. The likelihood is a value with proven bounds, the derivatives
are those by all free parameters, once the states are known. `prey` is a path of prey and predators, of a network that
can reach infinitely many states; its fit takes minutes, so fits come only if asked for, but for the sheet.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np

from calibration import fit_model
from kinetics import Model, Network
from kinetics.markov.panels import PanelData, PanelLikelihood, PanelRun
from kinetics.support.tables import text_table

PLACES = [parent / "shared" / "outside" for parent in Path(__file__).parents[2:]]
OUTSIDE = next((place for place in PLACES if place.is_dir()), PLACES[0])  # data of others
EYAM = np.array(
    [(0, 254, 7), (0.5, 235, 14), (1, 201, 22), (1.5, 153, 29), (2, 121, 20), (2.5, 110, 8), (3, 97, 8), (4, 83, 0)]
)
HEARTS = {"12": 0.128, "14": 0.042, "21": 0.225, "23": 0.343, "24": 0.04, "32": 0.131, "34": 0.306}
CHAIN = {"12": 0.4, "21": 0.2, "23": 0.3, "32": 0.1, "34": 0.5, "43": 0.2}
PEOPLE, LOOKS = 1000, 10  # of the sheet: 10,000 intervals, of as many different lengths


def eyam() -> tuple[Model, PanelData]:
    """The plague at Eyam (Raggett 1982)."""
    model = Model.of(Network.from_text("infect: S + I -> 2 I, beta\nremove: I -> R, alpha", beta=0.02, alpha=3.0))
    run = PanelRun(np.append(EYAM[0, 1:], 0).astype(int), EYAM[1:, 0], EYAM[1:, 1:])
    return model, PanelData({"S": {"S": 1}, "I": {"I": 1}}, [run])


def staged(rates: dict[str, float]) -> tuple[Network, dict[str, dict[str, float]], list[int]]:
    """A chain of four stages, its columns, and where each stage is among the species."""
    network = Network.from_text("\n".join(f"q{ij}: S{ij[0]} -> S{ij[1]}, {rate}" for ij, rate in rates.items()))
    names = [f"S{i}" for i in (1, 2, 3, 4)]
    return network, {name: {name: 1.0} for name in names}, [network.index(name) for name in names]


def cav() -> tuple[Model, PanelData]:
    """R's msm, data set cav: 614 people, whose death is seen when it happens."""
    network, columns, place = staged(HEARTS)
    rows, runs = np.genfromtxt(OUTSIDE / "cav_panel.csv", delimiter=",", skip_header=1), []
    for person in np.unique(rows[:, 0]):
        years, stage = rows[rows[:, 0] == person, 1], rows[rows[:, 0] == person, 2].astype(int) - 1
        if years.size > 1:
            fired = np.where(stage[1:] == 3, 0, -1)
            start = np.eye(4, dtype=int)[stage[0]][np.argsort(place)]
            runs.append(PanelRun(start, years[1:], np.eye(4)[stage[1:]], years[0], fired=fired))
    return Model.of(network), PanelData(columns, runs, events=[("q14", "q24", "q34")])


def prey() -> tuple[Model, PanelData]:
    """Wilkinson's path of prey and predators (R package smfsb): 15 intervals."""
    network = Network.from_text("birth: X -> 2 X, 1\npredation: X + Y -> 2 Y, 0.005\ndeath: Y -> 0, 0.6")
    path = np.genfromtxt(OUTSIDE / "lotka_volterra_wilkinson.csv", delimiter=",", skip_header=1)
    run = PanelRun(path[0, 1:].astype(int), path[1:, 0], path[1:, 1:])
    return Model.of(network), PanelData({"X": {"X": 1}, "Y": {"Y": 1}}, [run])


def sheet() -> tuple[Model, PanelData]:
    """Of a thousand people, each seen ten times: stages drawn at random among neighbours."""
    network, columns, place = staged(CHAIN)
    rng, runs = np.random.default_rng(0), []
    for _ in range(PEOPLE):
        stages = np.clip(np.cumsum(rng.integers(-1, 2, LOOKS + 1)) + 1, 0, 3)
        times = np.cumsum(rng.exponential(1.0, LOOKS) + 0.1)
        runs.append(PanelRun(np.eye(4, dtype=int)[stages[0]][np.argsort(place)], times, np.eye(4)[stages[1:]]))
    return Model.of(network), PanelData(columns, runs)


CASES: dict[str, Callable[[], tuple[Model, PanelData]]] = {"eyam": eyam, "cav": cav, "sheet": sheet, "prey": prey}


@click.command()
@click.option("--only", type=click.Choice(list(CASES)), multiple=True)
@click.option("--fits", is_flag=True, help="also fit the path of prey and predators")
def main(only: tuple[str, ...], fits: bool) -> None:
    """Print the table."""
    rows = []
    for name in only or CASES:
        model, data = CASES[name]()
        free = list(model.network.parameters) or list(model.network.channels)
        asked = PanelLikelihood(model, data)
        value_seconds, answer = timed(asked.value)
        first_seconds, _ = timed(lambda asked=asked, free=free: asked.scored({}, free))
        seconds, _ = timed(lambda asked=asked, free=free: asked.scored({}, free))
        row = [name, str(data.looks), f"{answer.value:.6f}", f"{answer.error:.0e} {answer.kind}"]
        row += [f"{value_seconds:.2f}", f"{first_seconds:.2f}", f"{seconds:.3f}"]
        if name != "prey" or fits:
            fit_seconds, found = timed(lambda asked=asked, free=free: fit_model(asked, free, starts=1))
            row += [str(found.fit.evaluations), f"{fit_seconds:.1f}"]
        rows.append((*row, "", "")[:9])
    titles = ("data", "looks", "log-likelihood", "error", "value (s)", "first slopes", "slopes", "values", "fit (s)")
    click.echo(text_table(titles, rows))


def timed(work: Callable[[], Any]) -> tuple[float, Any]:
    """CPU time, s, and what came out."""
    began = time.process_time()
    found = work()
    return time.process_time() - began, found


if __name__ == "__main__":
    main()
