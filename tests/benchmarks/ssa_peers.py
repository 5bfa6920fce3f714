"""Other packages' exact samplers, to be timed in the same run as ours where they are installed.

    pip install 'wellmixed[peers]'

Each peer is a function of a network and its initial state that gives back `run(end, n_times, n_runs, seed)`, which
returns the final counts (n_runs, S). Mass action of at most two reactants, `distinct` combinations.
"""

from __future__ import annotations

import importlib.util
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from kinetics.network import Network

Run = Callable[[float, int, int, int], np.ndarray]


def sides(network: Network) -> list[tuple[list[int], list[int], float]]:
    """Species on both sides of each channel, with their copies, and its rate."""
    before, change = network.reactant_terms, network.change_terms
    rates = network.known_rates * network.ways
    reactions = []
    for r in range(len(network.channels)):
        left = dict(zip(*(part.tolist() for part in before.row(r)), strict=True))
        right = dict(left)
        for s, n in zip(*(part.tolist() for part in change.row(r)), strict=True):
            right[s] = right.get(s, 0) + n
        spelled = [[s for s, n in side.items() for _ in range(n)] for side in (left, right)]
        reactions.append((spelled[0], spelled[1], float(rates[r])))
    return reactions


def bngsim(network: Network, initial: np.ndarray) -> Run:
    """The BioNetGen engine; it counts like pairs as n (n - 1)."""
    import bngsim as package

    parameters, reactions = [], []
    for r, (left, right, rate) in enumerate(sides(network), 1):
        halved = rate / 2 if len(left) == 2 and left[0] == left[1] else rate
        texts = [",".join(str(s + 1) for s in side) or "0" for side in (left, right)]
        parameters.append(f"{r} k{r} {halved!r}")
        reactions.append(f"{r} {texts[0]} {texts[1]} k{r}")
    species = [f"{i + 1} s{i}() {n}" for i, n in enumerate(initial)]
    lines = ["begin parameters", *parameters, "end parameters", "begin species", *species, "end species"]
    lines += ["begin reactions", *reactions]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "model.net"
        file.write_text("\n".join([*lines, "end reactions"]) + "\n", encoding="utf-8")
        model = package.Model.from_net(str(file))
    simulator = package.Simulator(model, method="ssa")

    def run(end: float, n_times: int, n_runs: int, seed: int) -> np.ndarray:
        finals = []
        for i in range(n_runs):
            model.reset()
            made = simulator.run(t_span=(0.0, end), n_points=n_times, seed=1 + seed * n_runs + i)
            finals.append(np.asarray(made.species)[-1])
        return np.array(finals)

    return run


def bioscrape(network: Network, initial: np.ndarray) -> Run:
    """Its documented way to simulate, without a data frame for each run."""
    from bioscrape.simulator import py_simulate_model

    model, order, seed_with = _bioscrape_model(network, initial)

    def run(end: float, n_times: int, n_runs: int, seed: int) -> np.ndarray:
        seed_with(seed + 1)
        times = np.linspace(0.0, end, n_times)
        made = [py_simulate_model(times, Model=model, stochastic=True, return_dataframe=False) for _ in range(n_runs)]
        return np.array([result.py_get_result()[-1][order] for result in made])

    return run


def bioscrape_inside(network: Network, initial: np.ndarray) -> Run:
    """Its compiled simulator by itself."""
    from bioscrape.simulator import ModelCSimInterface, SSASimulator

    model, order, seed_with = _bioscrape_model(network, initial)

    def run(end: float, n_times: int, n_runs: int, seed: int) -> np.ndarray:
        seed_with(seed + 1)
        times = np.linspace(0.0, end, n_times)
        finals = []
        for _ in range(n_runs):
            interface = ModelCSimInterface(model)
            interface.py_set_initial_time(0.0)
            finals.append(SSASimulator().py_simulate(interface, times).py_get_result()[-1][order])
        return np.array(finals)

    return run


def _bioscrape_model(network: Network, initial: np.ndarray) -> tuple[Any, list[int], Callable[[int], None]]:
    from bioscrape.random import py_seed_random
    from bioscrape.types import Model

    names = [f"s{i}" for i in range(len(initial))]
    reactions = []
    for left, right, rate in sides(network):
        halved = rate / 2 if len(left) == 2 and left[0] == left[1] else rate
        reactions.append(([names[s] for s in left], [names[s] for s in right], "massaction", {"k": halved}))
    model = Model(species=names, reactions=reactions, initial_condition_dict=dict(zip(names, initial, strict=True)))
    return model, [model.get_species_index(name) for name in names], py_seed_random


def rebop(network: Network, initial: np.ndarray) -> Run:
    """Its Python face; every run returns a data set with labels."""
    import rebop as package

    names = [f"s{i}" for i in range(len(initial))]
    model = package.Gillespie()
    for left, right, rate in sides(network):
        halved = rate / 2 if len(left) == 2 and left[0] == left[1] else rate
        model.add_reaction(halved, [names[s] for s in left], [names[s] for s in right])
    start = {name: int(n) for name, n in zip(names, initial, strict=True) if n}

    def run(end: float, n_times: int, n_runs: int, seed: int) -> np.ndarray:
        finals = []
        for i in range(n_runs):
            made = model.run(start, tmax=end, nb_steps=n_times - 1, rng=seed * n_runs + i)
            finals.append([int(made[name][-1]) if name in made else 0 for name in names])
        return np.array(finals)

    return run


def installed() -> dict[str, Callable[[Network, np.ndarray], Run]]:
    """The peers that can be imported here."""
    peers = {"bngsim": bngsim, "bioscrape": bioscrape, "bioscrape inside": bioscrape_inside, "rebop": rebop}
    return {name: make for name, make in peers.items() if importlib.util.find_spec(name.split()[0]) is not None}
