"""Networks of the classes on which exact samplers are compared in print, made from their rules.

multistate : one molecule with independent sites of two states
receptor : ligand, receptor that dimerises and carries sites, and an adaptor that binds them; with three sites the
    size of the `egfr` network of Blinov et al. (2006), with four that of `fceri` (Faeder et al. 2003)

Each gives a model and a time until which to run.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations_with_replacement, product

import numpy as np

from kinetics.formats.base import Model
from kinetics.network import Network
from kinetics.network.network import Reaction

Sites = tuple[str, ...]
STATES = FREE, PHOSPHORYLATED, BOUND = "Y", "pY", "A"


def multistate(n_sites: int, copies: int = 1000) -> tuple[Model, float]:
    """2**n species, n * 2**n channels: every site of every state flips."""
    states = ["".join(bits) for bits in product("01", repeat=n_sites)]
    reactions: dict[str, Reaction] = {}
    rates = []
    for state in states:
        for i, bit in enumerate(state):
            flipped = f"{state[:i]}{'1' if bit == '0' else '0'}{state[i + 1 :]}"
            reactions[f"{state}>{flipped}"] = ({_molecule(state): 1}, {_molecule(flipped): 1})
            rates.append(1.0 + 0.1 * i if bit == "0" else 2.0)
    network = Network.from_reactions(reactions, rates, species=[_molecule(state) for state in states])
    initial = np.zeros(len(states), dtype=np.int64)
    initial[0] = copies
    return Model(network, initial, {"first_on": {_molecule(s): 1.0 for s in states if s[0] == "1"}}), 20.0


def _molecule(state: str) -> str:
    return f"M({','.join(f's{i}~{bit}' for i, bit in enumerate(state))})"


def receptor(n_sites: int, receptors: int = 2000) -> tuple[Model, float]:
    """Monomers with and without ligand, and dimers of those with; sites are phosphorylated in dimers and bind."""
    sites = list(product(STATES, repeat=n_sites))
    reactions: dict[str, Reaction] = {}
    rates: list[float] = []

    def add(before: list[str], after: list[str], rate: float) -> None:
        name = f"r{len(reactions) + 1}"
        reactions[name] = ({s: before.count(s) for s in before}, {s: after.count(s) for s in after})
        rates.append(rate)

    def turn(whole: str, turned: Mapping[str, str], site: str, in_dimer: bool, ways: int = 1) -> None:
        """What can happen at one site; `turned` names the molecule with that site in each other state."""
        if site == FREE and in_dimer:
            add([whole], [turned[PHOSPHORYLATED]], 0.5 * ways)
        elif site == PHOSPHORYLATED:
            add([whole], [turned[FREE]], 4.5 * ways)
            add([whole, "A(d)"], [turned[BOUND]], 1e-3 * ways)
        elif site == BOUND:
            add([whole], [turned[PHOSPHORYLATED], "A(d)"], 0.05 * ways)

    for state in sites:
        bare, bound = _monomer(state, "l"), _monomer(state, "l!+")
        add([bare, "L(r)"], [bound], 1e-4)
        add([bound], [bare, "L(r)"], 0.05)
        for ligand, i in product(("l", "l!+"), range(n_sites)):
            turned = {new: _monomer(_with(state, i, new), ligand) for new in STATES}
            turn(_monomer(state, ligand), turned, state[i], in_dimer=False)
    for one, other in combinations_with_replacement(sites, 2):
        dimer = _dimer(one, other)
        add([_monomer(one, "l!+"), _monomer(other, "l!+")], [dimer], 2e-3)
        add([dimer], [_monomer(one, "l!+"), _monomer(other, "l!+")], 0.1)
        for half, rest in {(one, other): None, (other, one): None}:  # once where they are alike: two ways then
            for i in range(n_sites):
                turned = {new: _dimer(_with(half, i, new), rest) for new in STATES}
                turn(dimer, turned, half[i], in_dimer=True, ways=1 + (one == other))
    names = list(dict.fromkeys(name for before, after in reactions.values() for name in (*before, *after)))
    network = Network.from_reactions(reactions, rates, species=names)
    start = {_monomer((FREE,) * n_sites, "l"): receptors, "L(r)": 2 * receptors, "A(d)": receptors}
    dimers = {name: 1.0 for name in names if name.count("R(") == 2}
    return Model(network, network.state(start), {"dimers": dimers}), 10.0


def _with(state: Sites, i: int, new: str) -> Sites:
    return (*state[:i], new, *state[i + 1 :])


def _spelled(state: Sites) -> str:
    return ",".join(f"y{i}~{site}" for i, site in enumerate(state))


def _monomer(state: Sites, ligand: str) -> str:
    return f"R({ligand},d,{_spelled(state)})"


def _dimer(one: Sites, other: Sites) -> str:
    """The same name whichever half comes first."""
    first, second = sorted((one, other))
    return f"R(l!+,d!1,{_spelled(first)}).R(l!+,d!1,{_spelled(second)})"
