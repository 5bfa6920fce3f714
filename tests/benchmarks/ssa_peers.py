"""Other packages' exact samplers, to be timed in the same run as ours where they are installed.

    pip install 'wellmixed[peers]'

Each peer is a function of a network and its initial state that gives back `run(end, n_times, n_runs, seed)`, which
returns the final counts (n_runs, S). Mass action of at most two reactants, `distinct` combinations. What a package
can make once, model, machine code, tables, is made before `run`.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from unittest import mock

import click
import numpy as np

from kinetics.network import Network

Run = Callable[[float, int, int, int], np.ndarray]


def sides(network: Network) -> list[tuple[list[int], list[int], float]]:
    """Species on both sides of each channel, with their copies, and its rate."""
    before, change = network.sparse_reactants, network.sparse_stoichiometry
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


def roadrunner(network: Network, initial: np.ndarray) -> Run:
    """Its Gillespie integrator on machine code made from SBML; laws are spelled out, it corrects no combinations."""
    from roadrunner import RoadRunner

    simulator = RoadRunner(_sbml(network, initial))
    simulator.setIntegrator("gillespie")
    simulator.getIntegrator().setValue("variable_step_size", False)
    simulator.timeCourseSelections = [f"s{i}" for i in range(len(initial))]

    def run(end: float, n_times: int, n_runs: int, seed: int) -> np.ndarray:
        simulator.getIntegrator().setValue("seed", seed + 1)
        finals = []
        for _ in range(n_runs):
            simulator.reset()
            finals.append(np.array(simulator.simulate(0.0, end, n_times)[-1]))
        return np.array(finals)

    return run


def _sbml(network: Network, initial: np.ndarray) -> str:
    """Level 3, written out here so that this peer asks for no other package."""
    species = "".join(
        f'<species id="s{i}" compartment="tank" initialAmount="{n}" hasOnlySubstanceUnits="true" '
        'boundaryCondition="false" constant="false"/>'
        for i, n in enumerate(initial)
    )

    def listed(side: list[int], kind: str) -> str:
        parts = (
            f'<speciesReference species="s{s}" stoichiometry="{side.count(s)}" constant="true"/>'
            for s in dict.fromkeys(side)
        )
        return f"<listOf{kind}>{''.join(parts)}</listOf{kind}>" if side else ""

    reactions = []
    for r, (left, right, rate) in enumerate(sides(network)):
        factors = [f"<ci>s{s}</ci>" for s in left]
        halved = rate / 2 if len(left) == 2 and left[0] == left[1] else rate
        if halved != rate:
            factors[1] = f"<apply><minus/>{factors[0]}<cn>1</cn></apply>"
        law = f"<apply><times/><cn>{halved!r}</cn>{''.join(factors)}</apply>" if left else f"<cn>{rate!r}</cn>"
        reactions.append(
            f'<reaction id="r{r}" reversible="false">{listed(left, "Reactants")}{listed(right, "Products")}'
            f'<kineticLaw><math xmlns="http://www.w3.org/1998/Math/MathML">{law}</math></kineticLaw></reaction>'
        )
    return (
        '<sbml xmlns="http://www.sbml.org/sbml/level3/version2/core" level="3" version="2"><model id="network">'
        '<listOfCompartments><compartment id="tank" size="1" constant="true"/></listOfCompartments>'
        f"<listOfSpecies>{species}</listOfSpecies><listOfReactions>{''.join(reactions)}</listOfReactions></model></sbml>"
    )


def basico(network: Network, initial: np.ndarray) -> Run:
    """COPASI's direct method; its own task is run again and again, without a data frame for each run."""
    import basico as package
    from COPASI import CCopasiTask, CTaskEnum

    document = package.new_model(quantity_unit="#", volume_unit="1")
    package.add_compartment("tank", 1.0, model=document)
    for i, n in enumerate(initial):
        package.add_species(f"s{i}", "tank", initial_concentration=float(n), model=document)
    for r, (left, right, rate) in enumerate(sides(network)):
        halved = rate / 2 if len(left) == 2 and left[0] == left[1] else rate
        scheme = " -> ".join(" + ".join(f"s{s}" for s in side) for side in (left, right))
        package.add_reaction(f"r{r}", scheme, model=document)
        package.set_reaction_parameters(f"(r{r}).k1", value=halved, model=document)
    task = document.getTask("Time-Course")
    task.setMethodType(CTaskEnum.Method_directMethod)
    task.getMethod().getParameter("Use Random Seed").setBoolValue(True)
    random_seed = task.getMethod().getParameter("Random Seed")
    problem = task.getProblem()
    problem.setAutomaticStepSize(False)

    def run(end: float, n_times: int, n_runs: int, seed: int) -> np.ndarray:
        problem.setDuration(end)
        problem.setStepNumber(n_times - 1)
        finals = []
        for i in range(n_runs):
            random_seed.setUIntValue(1 + seed * n_runs + i)
            if not (task.initializeRaw(CCopasiTask.OUTPUT_UI) and task.processRaw(True)):
                raise RuntimeError(f"COPASI did not run: {package.model_info.get_copasi_messages(0)}")
            made = task.getTimeSeries()
            final = {
                made.getTitle(j): made.getConcentrationData(n_times - 1, j) for j in range(1, made.getNumVariables())
            }
            finals.append([final[f"s{i}"] for i in range(len(initial))])
        return np.array(finals)

    return run


def gillespy2(network: Network, initial: np.ndarray) -> Run:
    """Its C++ solver, compiled once, all runs in one child process; where it finds no compiler, its NumPy solver."""
    import gillespy2 as package

    model = package.Model(name="network")
    species = [package.Species(name=f"s{i}", initial_value=int(n), mode="discrete") for i, n in enumerate(initial)]
    model.add_species(species)
    for r, (left, right, rate) in enumerate(sides(network)):
        halved = rate / 2 if len(left) == 2 and left[0] == left[1] else rate
        constant = package.Parameter(name=f"k{r}", expression=repr(halved))
        model.add_parameter(constant)
        before, after = ({f"s{s}": side.count(s) for s in side} for side in (left, right))
        model.add_reaction(package.Reaction(name=f"r{r}", reactants=before, products=after, rate=constant))
    # It builds with the interpreter behind a virtual environment, which does not see the environment's packages.
    with mock.patch.dict(os.environ, {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}):
        solver = model.get_best_solver_algo("SSA")(model)
    if isinstance(solver, package.NumPySSASolver):
        click.echo("  gillespy2 finds no C++ compiler: its NumPy solver", err=True)

    def run(end: float, n_times: int, n_runs: int, seed: int) -> np.ndarray:
        solver.model.timespan(np.linspace(0.0, end, n_times))
        made = solver.run(number_of_trajectories=n_runs, seed=seed + 1)
        return np.array([[path[one.name][-1] for one in species] for path in made])

    return run


def batss(network: Network, initial: np.ndarray) -> Run:
    """Its batches of a reaction network of any size; like pairs count as n (n - 1), and every run is built anew."""
    import batss as package

    species = package.species(" ".join(f"s{i}" for i in range(len(initial))))
    reactions = []
    for left, right, rate in sides(network):
        halved = rate / 2 if len(left) == 2 and left[0] == left[1] else rate
        before, after = (package.Expression([species[s] for s in side]) for side in (left, right))
        reactions.append((before >> after).k(halved))
    start = {species[i]: int(n) for i, n in enumerate(initial) if n}

    def run(end: float, n_times: int, n_runs: int, seed: int) -> np.ndarray:
        finals = []
        for i in range(n_runs):
            made = package.Simulation(start, reactions, seed=1 + seed * n_runs + i, volume=1.0)
            made.run(end, history_interval=end / (n_times - 1), stopping_interval=end, timer=False)
            finals.append([made.config_dict.get(one, 0) for one in species])
        return np.array(finals)

    return run


# name in tables: module, distribution, adapter
PEERS = {
    "batss": ("batss", "batss", batss),
    "bngsim": ("bngsim", "bngsim", bngsim),
    "bioscrape": ("bioscrape", "bioscrape", bioscrape),
    "bioscrape inside": ("bioscrape", "bioscrape", bioscrape_inside),
    "rebop": ("rebop", "rebop", rebop),
    "roadrunner": ("roadrunner", "libroadrunner", roadrunner),
    "COPASI": ("basico", "copasi-basico", basico),
    "gillespy2": ("gillespy2", "gillespy2", gillespy2),
}


def installed() -> dict[str, Callable[[Network, np.ndarray], Run]]:
    """The peers that can be imported here."""
    return {name: make for name, (module, _, make) in PEERS.items() if find_spec(module) is not None}


def versions() -> list[str]:
    """A line for each peer: the version that is here, or how to install it."""
    given = {}
    for module, distribution, _ in PEERS.values():
        found = find_spec(module) is not None
        given[distribution] = (
            f"{distribution} {version(distribution)}"
            if found
            else f"{distribution} left out: pip install {distribution}"
        )
    return list(given.values())
