"""Hits that runs have logged, and joins: how many there were in each run, and the exposure to them in a crowd."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calibration.estimating.exposure import sojourns
from kinetics.network import Crowding, Tank
from kinetics.rates.breaks import Expansion, break_model, is_break
from kinetics.rates.breaks.base import WALL, body_sizes
from kinetics.rates.crowding.base import SourceName
from kinetics.runs import BY_WALL, RESTART, JumpPath
from kinetics.support.arrays import Floats, Ints, divided


@dataclass(frozen=True, eq=False)
class RunHits:
    """One run and its log of hits.

    path : the run; it knows its tank
    struck, partner (H,) : species; a partner of BY_WALL is a wall
    load (H,) : on the most loaded bond of the struck structure
    shared (H,) bool : another body or wall touched it in the same step
    log_above, threshold : least load in the log, and that above which a bond breaks
    tank : name of the kind of tank, such as "120 cubes in 2 x 2 x 3"; engine : of the mechanics
    """

    path: JumpPath
    struck: Ints
    partner: Ints
    load: Floats
    shared: NDArray[np.bool_]
    log_above: float
    threshold: float
    tank: str
    engine: str

    @property
    def size(self) -> Tank:
        """The tank. ValueError: the run does not know it."""
        if self.path.tank is None:
            raise ValueError("a run without its tank; crowding depends on the volume: state the edges of the tank")
        return self.path.tank


@dataclass(frozen=True, eq=False)
class Source:
    """Events of one kind in some runs, and the exposure to them.

    name : "bodies" or "walls", hits by them on structures; or "joins"
    runs : the n runs, of one book
    expansion : the network with a channel for each break and partner, to which crowding gives factors
    rates : (G,) what has a rate constant: the struck species, or the join
    channels (G, P) : of the expansion, one a partner; P = 1 where partners are not distinguished
    sizes (P,) : of the partners, in cubes
    """

    name: SourceName
    runs: tuple[RunHits, ...]
    expansion: Expansion
    rates: tuple[str, ...]
    channels: Ints
    sizes: Floats
    _known: dict[tuple[object, ...], Floats] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, name: SourceName, runs: Sequence[RunHits]) -> Source:
        """Events of this kind in these runs."""
        base = runs[0].path.network
        found = Expansion.of(base, break_model("collision-wall"))
        if name == "joins":
            joins = np.flatnonzero(found.partner_of < 0)
            rates = tuple(found.network.channels[r] for r in joins)
            return cls(name, tuple(runs), found, rates, joins[:, None], np.ones(1))
        wanted = [p for p, partner in enumerate(found.model.partners(base)) if (partner == WALL) == (name == "walls")]
        table, breaks = base.sparse_reactants, np.flatnonzero(is_break(base))
        first = {int(table.row(r)[0][0]): r for r in breaks[::-1].tolist()}  # struck species -> its first break
        channels = [
            [np.flatnonzero((found.base_of == r) & (found.partner_of == p))[0] for p in wanted]
            for _, r in sorted(first.items())
        ]
        sizes = body_sizes(base).astype(float) if name == "bodies" else np.ones(1)
        return cls(name, tuple(runs), found, tuple(base.species[s] for s in sorted(first)), np.array(channels), sizes)

    @cached_property
    def kinds(self) -> tuple[list[tuple[str, str]], Ints]:
        """The kinds of tank, each with its engine, and the kind (n,) of each run."""
        each = [(run.tank, run.engine) for run in self.runs]
        names = list(dict.fromkeys(each))
        return names, np.array([names.index(kind) for kind in each])

    def events(self, above: float = 0.0, up_to: float = np.inf) -> Ints:
        """Events (n, G, P, 2) in each run, alone and shared; of hits those with a load above `above` and <= `up_to`."""
        found = np.zeros((len(self.runs), *self.channels.shape, 2), dtype=np.int64)
        place = {name: g for g, name in enumerate(self.rates)}
        for n, run in enumerate(self.runs):
            network = run.path.network
            if self.name == "joins":
                fired = run.path.channels[run.path.channels != RESTART]
                found[n, :, 0, 0] = np.bincount(fired, minlength=len(network.channels))[
                    [network.channel_places[name] for name in self.rates]
                ]
                continue
            by_wall = run.partner == BY_WALL
            mine = (run.load > above) & (run.load <= up_to) & (by_wall == (self.name == "walls"))
            row = np.array([place.get(name, -1) for name in network.species])[run.struck[mine]]
            partner = np.where(by_wall, 0, run.partner)[mine]
            np.add.at(found[n], (row, partner, run.shared[mine].astype(np.int64)), 1)
        return found

    def exposure(self, crowdings: Sequence[Crowding]) -> Floats:
        """Exposure (n, G, P) of each run to each event, for partners of weight 1.

        crowdings : factors on the channels of the expansion, for each run in its tank

        It is the integral of x y / V for hits by bodies and joins (x (x - 1) / V for hits by like bodies), of x A / V
        for hits by walls, times the factor of the crowd. The integrals of z^d / (1 - phi) behind a factor are computed
        once for all coefficients.
        """
        place = {crowding: k for k, crowding in enumerate(dict.fromkeys(crowdings))}
        terms = np.array([crowding.coefficients[self.channels] for crowding in place])
        factors = terms[[place[crowding] for crowding in crowdings]]
        return np.asarray(np.einsum("ngpd,ndgp->ngp", factors, self._integrals(crowdings, factors.shape[-1])))

    def around(self, crowdings: Sequence[Crowding]) -> Floats:
        """Mean (n, G, P) of z = s / (1 - phi) over the meetings of each run: surface of bodies in their free volume."""
        _, whole, crowded = np.moveaxis(self._integrals(crowdings, 3), 1, 0)
        return divided(crowded, whole)

    def _integrals(self, crowdings: Sequence[Crowding], terms: int) -> Floats:
        """Integrals (n, D, G, P) of the exposure's rate times 1, 1 / (1 - phi), z / (1 - phi), ...; they are kept."""
        key = (terms, *(c.weights.tobytes() + c.volumes.tobytes() for c in crowdings))
        if key not in self._known:
            self._known[key] = np.array([self._of_run(n, c, terms) for n, c in enumerate(crowdings)])
        return self._known[key]

    def _of_run(self, n: int, crowding: Crowding, terms: int) -> Floats:
        path, tank = self.runs[n].path, self.runs[n].size
        begin, end, _ = sojourns(path)
        network, base = self.expansion.network, self.expansion.base
        times = (network.ways / base.ways[self.expansion.base_of])[self.channels]  # of like bodies either is struck
        rate = network.combinations_of(path.states)[:, self.channels] * times / tank.volume
        if self.name == "walls":
            rate *= tank.surface
        free = 1.0 - path.states @ crowding.volumes
        powers = np.ones((terms, len(begin)))
        powers[1:] = ((path.states @ crowding.weights) / free) ** np.arange(terms - 1)[:, None] / free
        return np.asarray(np.einsum("dt,tgp->dgp", powers * (end - begin), rate))
