"""Looks that begin alike: one pass forwards for all of them, and one backwards for the gradient of their sum.

Where a look tells the whole state the chain starts anew, so that a run is cut there, and its parts are independent.
Frames of a camera, and snapshots, are many looks from few beginnings. With a the probabilities at a beginning, E the
transition matrix and D the diagonal of what was seen, the log-likelihood of n such looks is the sum of c log(a E D 1)
over all different ones, seen c times each; its gradient is that of a E f, with f the sum of c D 1 / (a E D 1) held.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from kinetics.markov.derivatives import adjoint_at
from kinetics.markov.panels.carrying import FORGOTTEN
from kinetics.markov.panels.data import PanelData, PanelRun
from kinetics.markov.panels.moving_windows import EXPLORED
from kinetics.markov.panels.panel_step import PanelStep, too_unlikely, unreachable
from kinetics.markov.panels.slopes import Slopes
from kinetics.markov.passage.backward import LOST, uniformised
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.search import TooManyStatesError
from kinetics.markov.transient.states import StateSpace
from kinetics.markov.transient.transitions import Transitions
from kinetics.network import Network
from kinetics.support.arrays import Ints
from kinetics.support.packages import sparse

MOST_NUMBERS = 4_000_000  # probabilities of what was seen, for one beginning


@dataclass(eq=False)
class Fan:
    """Parts of runs that begin alike, and go on alike but for what one look shows; all different ones.

    runs : the first of those that are alike, each; copies : how many these are
    """

    runs: list[PanelRun] = field(default_factory=list)
    copies: list[int] = field(default_factory=list)


class Cut(NamedTuple):
    """All parts of the runs.

    of_runs : of each run, the fan of each part and the place in it
    """

    fans: list[Fan]
    of_runs: list[list[tuple[int, int]]]

    @classmethod
    def of(cls, network: Network, data: PanelData) -> Cut:
        """The parts of panel data, cut wherever a look tells the whole state."""
        fans: list[Fan] = []
        of_runs: list[list[tuple[int, int]]] = []
        places: dict[tuple[Any, ...], tuple[int, dict[bytes, int]]] = {}
        for run in data.runs:
            known, states = data.told_states(network, run)
            begins = [0, *(np.flatnonzero(known[:-1]) + 1).tolist()]
            parts = []
            for first, last in zip(begins, [*begins[1:], run.times.size], strict=True):
                initial, chances = (states[first - 1 : first], np.ones(1)) if first else (run.initial, run.chances)
                alone, seen = last - first == 1 and run.fired[first] < 0, run.seen[first:last].tobytes()  # type: ignore[index]
                alike = () if alone else (run.fired[first:last].tobytes(), seen)  # type: ignore[index]
                key = initial.tobytes(), chances.tobytes(), run.lengths[first:last].tobytes(), *alike
                fan, members = places.setdefault(key, (len(fans), {}))
                if fan == len(fans):
                    fans.append(Fan())
                member = members.setdefault(seen, len(members))
                if member == len(fans[fan].runs):
                    fans[fan].runs.append(run.part(first, last, initial, chances))
                    fans[fan].copies.append(0)
                fans[fan].copies[member] += 1
                parts.append((fan, member))
            of_runs.append(parts)
        return cls(fans, of_runs)


@dataclass(frozen=True, eq=False)
class FanStep:
    """The chain from the beginning of a fan to its looks, after any of which all states are possible.

    possible : (L, N) sparse; 1 where what was seen at a look is not impossible, whatever the parameters of observations
    """

    fan: Fan
    step: PanelStep
    possible: Any

    @classmethod
    def of(cls, network: Network, data: PanelData, fan: Fan, known: dict[bytes, PanelStep]) -> FanStep | None:
        """None for parts of several looks, for one alone, and where too many states are reached.

        known : steps by their states; those over the same states share their arrays

        ValueError: a look that cannot be
        """
        first = fan.runs[0]
        if len(fan.runs) == 1 or first.times.size > 1:
            return None
        blank = replace(first, seen=np.full((1, len(data.columns)), np.nan))
        try:
            step = PanelStep.of(network, data, blank, 0, first.initial, EXPLORED)
        except TooManyStatesError:
            return None
        goal = np.zeros(len(step.states), dtype=bool)
        goal[_possible(network, data, fan, step.states).indices] = True
        kept = step.chain(network).leading_to(np.append(goal, [False, False]))[:-2]
        kept[step.begins] = True
        step = step.with_ends(kept).within(kept, len(kept))
        step = replace(known.setdefault(step.states[np.lexsort(step.states.T)].tobytes(), step), length=step.length)
        begins = StateSpace(network, step.states, np.zeros(len(step.states), dtype=bool)).index_of(first.initial)
        possible = _possible(network, data, fan, step.states)
        return None if possible.nnz > MOST_NUMBERS else cls(fan, replace(step, begins=begins), possible)

    def chances(self, data: PanelData, network: Network, slope_of: int = -1) -> Any:
        """Probabilities, or densities, (L, N), sparse, of what was seen at each look in each state.

        slope_of : the column by whose parameter they are derived, times that parameter
        """
        found = self.possible.copy()
        looks = np.repeat(np.arange(found.shape[0]), np.diff(found.indptr))
        seen = np.array([run.seen[0] for run in self.fan.runs])
        counted = self.step.states @ data.weights(network).T
        for column, observation in enumerate(data.observations.values()):
            if observation.parameter is None:
                continue
            for number in np.unique(seen[~np.isnan(seen[:, column]), column]).tolist():
                mine = np.flatnonzero(seen[looks, column] == number)
                here = counted[found.indices[mine], column]
                if column == slope_of:
                    found.data[mine] *= observation.parameter * observation.slopes(here, number)
                else:
                    found.data[mine] *= observation.weights(here, number)
            if column == slope_of:
                found.data[np.isnan(seen[looks, column])] = 0.0
        return found


class FanPass:
    """The probabilities of all looks of a fan at the rates of a network.

    chain : of its step, which fans over the same states share

    ValueError: a look that cannot be, or whose probability is too small for a number
    """

    def __init__(self, at: FanStep, chain: Transitions, network: Network, data: PanelData, slopes: Slopes) -> None:
        fan, step = at.fan, at.step
        self.start, length = step.start(fan.runs[0].chances), step.length
        (there,), relative = uniformised(chain, self.start, [length], is_backwards=False, left_out=FORGOTTEN)
        chances, copies = at.chances(data, network), np.array(fan.copies, dtype=np.float64)
        seen = chances @ there[:-2]
        if not (seen > 0.0).all():
            look = int((~(seen > 0.0)).argmax())
            if not chances[[look]].data.any():
                raise unreachable(network, data, fan.runs[look], 0, fan.runs[look].initial)
            raise too_unlikely(fan.runs[look], 0)
        self.log_likelihood = float(copies @ np.log(seen))
        rounded = relative + ROUNDOFF * (step.states.shape[0] + chain.roundings + len(data.columns) + 8.0)
        self.error = float(copies.sum()) * rounded + (FORGOTTEN + LOST * (1 + there.size)) * float(
            (copies / seen).sum()
        )
        self.is_certified = chain.is_certified and all(each.is_certified for each in data.observations.values())
        self.gradient = np.zeros(slopes.size)
        if slopes.size:
            values = np.append((copies / seen) @ chances, [0.0, 0.0])
            scale = float(values.max())
            _, _, by_entry = adjoint_at(chain, self.start, values / scale, length)
            self.gradient += slopes.of_rates(step.states, step.rows, step.channels) @ by_entry * scale
        for p, column in slopes.columns.items():
            self.gradient[p] += float((copies / seen) @ (at.chances(data, network, column) @ there[:-2]))


def _possible(network: Network, data: PanelData, fan: Fan, states: Ints) -> Any:
    """Sparse (L, N): 1 where no column without a parameter says that what was seen cannot be.

    ValueError: a look that cannot be in any of the states
    """
    counted, starts, places = states @ data.weights(network).T, [0], []
    for run in fan.runs:
        left = np.arange(len(states))
        for column, (observation, seen) in enumerate(zip(data.observations.values(), run.seen[0], strict=True)):
            if observation.parameter is None and not np.isnan(seen):
                left = left[observation.weights(counted[left, column], float(seen)) > 0.0]
        if not left.size:
            raise unreachable(network, data, run, 0, run.initial)
        places.append(left)
        starts.append(starts[-1] + left.size)
    indices = np.concatenate(places)
    return sparse.csr_array((np.ones(indices.size), indices, starts), shape=(len(fan.runs), len(states)))
