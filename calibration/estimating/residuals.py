"""Randomised quantile residuals: does each look lie where the model, given all looks before, expects it?

The place of what was seen in its predicted distribution, with ties broken at random, is uniform from 0 to 1 if the
model holds, and independent of all places before (Rosenblatt 1952, doi:10.1214/aoms/1177729394; Dunn & Smyth 1996,
doi:10.1080/10618600.1996.10474708). The distribution is that of simulated runs, which start from the states that the
looks before allow: at the true parameters a rank among them is uniform, however few they are.

Where the times of some events are exact, runs are ordered by the time of their first such event, then those that had
none by the count of the column; the place in that order needs nothing of when a run would have been looked at.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from kinetics.markov.panels import (
    EventData,
    EventLikelihood,
    JointLikelihood,
    Likelihood,
    PanelData,
    PanelLikelihood,
    PanelRun,
)
from kinetics.network import Network
from kinetics.runs import RESTART
from kinetics.sampling import Auto, simulate
from kinetics.sampling.methods import path_method
from kinetics.support.arrays import Floats, Ints, whole_number
from kinetics.support.cli.progress import stage
from kinetics.support.packages import special, stats
from kinetics.support.shown import on_axes

REPLICATES, MOST, FEWEST = 200, 40_000, 20  # of each look, and of all looks together; of each look at least
LEVEL = 0.05
FEW = 5  # residuals, below which a column is not tested


class ResidualTest(NamedTuple):
    """The tests of the residuals of one column.

    n : residuals
    p_uniform, p_middle, p_spread, p_order : that they are uniform (Kolmogorov & Smirnov), and of their normal scores
        that the mean is 0, the variance 1, and neighbours in a run not correlated
    """

    column: str
    n: int
    p_uniform: float
    p_middle: float
    p_spread: float
    p_order: float

    @property
    def least(self) -> tuple[str, float]:
        """The test with the smallest p, and that p."""
        named = {"uniform": self.p_uniform, "mean": self.p_middle, "spread": self.p_spread, "order": self.p_order}
        name = min((each for each in named if not np.isnan(named[each])), key=named.__getitem__)
        return name, named[name]


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals (n,) with their column, run and time.

    columns : names; which (n,) of them each belongs to
    run, time : (n,) number of the run and time of the look
    value : (n,) between 0 and 1

    >>> import numpy as np
    >>> from calibration import Residuals
    >>> n = np.arange(40)
    >>> even = Residuals(("A",), 0 * n, n, 1.0 * n, (n + 0.5) / 40)
    >>> even.of("A")[:2].tolist(), even.tests()[0].p_uniform
    ([0.0125, 0.0375], 1.0)
    """

    columns: tuple[str, ...]
    which: Ints
    run: Ints
    time: Floats
    value: Floats

    def of(self, column: str) -> Floats:
        """The residuals of a column, in the order of runs and times."""
        return np.asarray(self.value[self.which == self.columns.index(column)])

    def tests(self) -> list[ResidualTest]:
        """One for each column of at least 5 residuals."""
        found = []
        for place, column in enumerate(self.columns):
            mine = self.which == place
            n = int(mine.sum())
            if n < FEW:
                continue
            values, scores = self.value[mine], special.ndtri(self.value[mine])
            runs, cumulated = self.run[mine], float((scores**2).sum())
            together = runs[1:] == runs[:-1]
            before, after = scores[:-1][together], scores[1:][together]
            lower = float(stats.chi2.cdf(cumulated, n))
            found.append(
                ResidualTest(
                    column,
                    n,
                    float(stats.kstest(values, "uniform").pvalue),
                    float(2.0 * stats.norm.sf(abs(scores.sum()) / np.sqrt(n))),
                    2.0 * min(lower, 1.0 - lower),
                    float(stats.pearsonr(before, after).pvalue) if before.size >= FEW else np.nan,
                )
            )
        return found

    @property
    def p(self) -> float:
        """The smallest p of all tests, times their number (Holm); nan if there are too few looks for any."""
        found = [p for test in self.tests() for p in test[2:] if not np.isnan(p)]
        return min(1.0, min(found) * len(found)) if found else np.nan

    @property
    def verdict(self) -> str:
        """A sentence."""
        if np.isnan(self.p):
            return f"Too few looks ({self.value.size} residuals) to test the model."
        column, (name, p) = min(((test.column, test.least) for test in self.tests()), key=lambda each: each[1][1])
        words = {"uniform": "their distribution", "mean": "their mean", "spread": "their spread", "order": "neighbours"}
        if self.p < LEVEL:
            return (
                f"The model does not describe these data: residuals of {column}, {words[name]}, p = {p:.2g}; of all "
                f"tests together p = {self.p:.2g}."
            )
        return f"The data are what the model expects: of all tests of the residuals together p = {self.p:.2g}."

    def rows(self) -> list[dict[str, Any]]:
        """One row a residual."""
        return [
            {"column": self.columns[w], "run": int(r), "time": float(t), "residual": float(u)}
            for w, r, t, u in zip(self.which, self.run, self.time, self.value, strict=True)
        ]

    @on_axes
    def plot(self, ax: Any) -> Any:
        """Residuals of each column in order of size, against what is expected of them."""
        from kinetics.support import plots

        for place, column in enumerate(self.columns):
            values = np.sort(self.value[self.which == place])
            if values.size:
                ax.plot((np.arange(values.size) + 0.5) / values.size, values, label=column, **plots.line(place))
        ax.plot([0, 1], [0, 1], color="0.6", lw=0.8, zorder=0)
        ax.set(xlabel="expected residual", ylabel="residual", xlim=(0, 1), ylim=(0, 1))
        ax.legend(fontsize="small")
        return ax


def quantile_residuals(
    likelihood: Likelihood, point: Mapping[str, float] | None = None, *, replicates: int | None = None, seed: int = 0
) -> Residuals:
    """The residuals of data of any kind at values of the parameters.

    replicates : simulated runs for each look; None for 200, fewer where looks are many. A rank is uniform among any
        number of them
    Parameters that were fitted to the same data make residuals a little too good; tests then reject less often than
    they say.

    Cost: for counts one pass of the likelihood and `replicates` runs from look to look; for events one pass.

    >>> from calibration import quantile_residuals
    >>> from kinetics import Model, Network
    >>> from kinetics.markov.panels import PanelData, PanelLikelihood, PanelRun
    >>> decay = Model.of(Network.from_text("A -> B, 1"))
    >>> runs = [PanelRun([1000, 0], [1.0], [[n]]) for n in (368, 300)]
    >>> found = quantile_residuals(PanelLikelihood(decay, PanelData({"A": {"A": 1}}, runs)), seed=1)
    >>> bool(0.3 < found.value[0] < 0.7), bool(found.value[1] < 0.01)
    (True, True)
    """
    if replicates is not None:
        whole_number("replicates", replicates, 1)
    rng = np.random.default_rng(whole_number("seed", seed, 0))
    if isinstance(likelihood, JointLikelihood):
        columns: list[str] = []
        arrays: list[list[Any]] = [[], [], [], []]
        for name, part in likelihood.parts.items():
            here = likelihood.point_of(name, point or {})
            found = quantile_residuals(part, here, replicates=replicates, seed=int(rng.integers(2**63)))
            runs = len(set().union(*arrays[1])) if arrays[1] else 0
            for whole, each in zip(
                arrays, (found.which + len(columns), found.run + runs, found.time, found.value), strict=True
            ):
                whole.append(each)
            columns += [f"{each} [{name}]" for each in found.columns]
        return Residuals(tuple(columns), *(np.concatenate(each) for each in arrays))
    network = likelihood.network_at(point or {})
    if isinstance(likelihood, EventLikelihood):
        return _of_events(network, likelihood.data, rng)
    if not isinstance(likelihood, PanelLikelihood):
        raise TypeError(f"residuals of {type(likelihood).__name__} are not known")
    usual = min(REPLICATES, max(FEWEST, MOST // likelihood.data.looks))
    return _of_looks(network, likelihood, point or {}, usual if replicates is None else replicates, rng)


def _of_events(network: Network, data: EventData, rng: np.random.Generator) -> Residuals:
    """Of each event, its wait (the rise of the integrated total rate is exponential) and which channel fired.

    What the end of a run, or a restart, leaves of a wait goes on in the next one: waits that end within their own run
    are the short ones.
    """
    which, run, time, value = [], [], [], []
    since = 0.0
    for number, (path, causes) in enumerate(zip(data.paths, data.which or (), strict=True)):
        rates = network.propensities(path.states) * path.open_channels
        total = rates.sum(axis=1)
        for event, (channel, at) in enumerate(zip(path.channels.tolist(), path.times.tolist(), strict=True)):
            since += total[event] * (at - (path.times[event - 1] if event else 0.0))
            if channel == RESTART:
                continue
            members = (
                [channel] if causes[event] < 0 else [network.channel_places[n] for n in data.causes[causes[event]]]
            )
            below = float(rates[event, : min(members)].sum())
            u = (below + rng.random() * float(rates[event, members].sum())) / total[event]
            for place, each in enumerate((-np.expm1(-since), u)):
                which.append(place)
                run.append(number)
                time.append(at)
                value.append(each)
            since = 0.0
        since += total[-1] * (path.end - (path.times[-1] if path.times.size else 0.0))
    arrays = np.array(which, dtype=np.int64), np.array(run, dtype=np.int64), np.array(time), _open(np.array(value))
    return Residuals(("wait", "channel"), *arrays)


def _of_looks(
    network: Network, likelihood: PanelLikelihood, point: Mapping[str, float], replicates: int, rng: np.random.Generator
) -> Residuals:
    """Of each look and column, its rank among replicates from what was possible before."""
    data, weights = likelihood.data_at(point), likelihood.data.weights(network)
    observations = list(data.observations.values())
    known = {network.channel_places[name] for names in data.events for name in names}
    which, run_of, time_of, value, done = [], [], [], [], 0
    for looks, states, chances, length in _alike(data, likelihood.filtered(point)):
        times, counts = _replicates(network, states, chances, length, known, replicates * len(looks), rng)
        shuffled = rng.permutation(times.size).reshape(len(looks), replicates)
        for (number, look), mine in zip(looks, shuffled, strict=True):
            run, before = data.runs[number], times[mine]
            if run.fired is not None and run.fired[look] >= 0:  # a residual of every column, before those of survivors
                columns = list(range(len(observations)))
                found = [(before < np.inf).sum() + rng.random() for _ in columns]
            else:
                columns, found = _places(run, look, observations, before, counts[mine] @ weights.T, rng)
            for column, place in zip(columns, found, strict=True):
                which.append(column)
                run_of.append(number)
                time_of.append(run.times[look])
                value.append(place / (replicates + 1.0))
        done += len(looks)
        stage(f"residuals of {done} of {data.looks} looks", done / data.looks)
    order = np.lexsort((time_of, run_of))  # neighbours in a run stand next to each other
    of_columns, of_runs = np.array(which, dtype=np.int64)[order], np.array(run_of, dtype=np.int64)[order]
    return Residuals(tuple(data.columns), of_columns, of_runs, np.array(time_of)[order], _open(np.array(value)[order]))


def _alike(
    data: PanelData, filtered: list[list[tuple[Ints, Floats]]]
) -> list[tuple[list[tuple[int, int]], Ints, Floats, float]]:
    """Looks, as numbers of run and look, that come after the same time from the same possible states, with these."""
    found: dict[tuple[bytes, bytes, float], tuple[list[tuple[int, int]], Ints, Floats, float]] = {}
    for number, (run, before) in enumerate(zip(data.runs, filtered, strict=True)):
        for look, (states, chances) in enumerate(before):
            length = float(run.times[look] - (run.times[look - 1] if look else run.start))
            key = states.tobytes(), chances.tobytes(), length
            found.setdefault(key, ([], states, chances, length))[0].append((number, look))
    return list(found.values())


def _places(
    run: PanelRun, look: int, observations: list[Any], before: Floats, counted: Floats, rng: np.random.Generator
) -> tuple[list[int], list[float]]:
    """Columns of a look without an event, and their ranks among replicates: those with an event first."""
    columns, found = [], []
    survive = ~(before < np.inf)
    for column, observation in enumerate(observations):
        seen = float(run.seen[look, column])
        if np.isnan(seen):
            continue
        drawn = observation.drawn(counted[survive, column], seen, rng)
        less, ties = int((drawn < seen).sum()), int((drawn == seen).sum())
        columns.append(column)
        found.append(int((~survive).sum()) + less + rng.random() * (ties + 1.0))
    return columns, found


def _replicates(
    network: Network,
    states: Ints,
    chances: Floats,
    length: float,
    known: set[int],
    replicates: int,
    rng: np.random.Generator,
) -> tuple[Floats, Ints]:
    """Times (n,) of the first event of a channel in `known`, inf for none, and counts (n, S) after a length, tu."""
    numbers = rng.multinomial(replicates, chances / chances.sum())
    times, counts = np.full(replicates, np.inf), np.empty((replicates, states.shape[1]), dtype=np.int64)
    at = 0
    for state, n in zip(states[numbers > 0], numbers[numbers > 0].tolist(), strict=True):
        seed, here = int(rng.integers(2**63)), slice(at, at + n)
        if length == 0.0:
            counts[here] = state
        elif not known:
            counts[here] = simulate(network, Auto(), state, [length], n, seed, 1).counts[:, 0]
        else:
            paths = path_method(network).sample_paths(network, state, length, seed)
            for k, path in zip(range(at, at + n), paths, strict=False):
                first = path.times[np.isin(path.channels, list(known))]
                times[k], counts[k] = first.min(initial=np.inf), path.states[-1]
        at += n
    return times, counts


def _open(values: Floats) -> Floats:
    """Between 0 and 1, ends excluded."""
    return np.clip(values, 1e-12, 1.0 - 1e-12)
