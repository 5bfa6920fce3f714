"""Mutants: the mistakes of samplers that a verification must see, made to runs that are right.

Most rearrange the runs, so that their power is measured on the very runs that were verified.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from kinetics.network import Network
from kinetics.runs import JumpPath
from kinetics.sampling import SamplingMethod
from kinetics.trust.verification.sampler_runs import CountSampler, SamplerRuns

ALIKE = 8  # runs that are sorted among themselves


@dataclass(frozen=True)
class Mutant:
    """Name of a mistake, and the runs of a correct sampler with that mistake; None if it changes nothing.

    >>> from kinetics.trust.verification import MUTANTS
    >>> [mutant.name for mutant in MUTANTS[:2]]
    ['every run twice', 'the second half of the runs as the first']
    """

    name: str
    applied: Callable[[SamplerRuns], SamplerRuns | None]


def _every_run_twice(sample: SamplerRuns) -> SamplerRuns:
    return _picked(sample, lambda n: np.arange(n) // 2)


def _second_half_as_first(sample: SamplerRuns) -> SamplerRuns:
    return _picked(sample, lambda n: np.arange(n) % (n - n // 2))


def _picked(sample: SamplerRuns, pick: Callable[[int], NDArray[np.intp]]) -> SamplerRuns:
    counts, fine, next_fine = (part[pick(len(part))] for part in (sample.counts, sample.fine, sample.next_fine))
    paths, next_paths = (tuple(part[i] for i in pick(len(part))) for part in (sample.paths, sample.next_paths))
    return replace(sample, counts=counts, fine=fine, next_fine=next_fine, paths=paths, next_paths=next_paths)


def _first_time_from_another_run(sample: SamplerRuns) -> SamplerRuns | None:
    if sample.counts.shape[1] < 2:
        return None
    counts, fine = sample.counts.copy(), sample.fine.copy()
    for part in (counts, fine):
        part[:, 0] = np.roll(part[:, 0], 1, axis=0)
    return replace(sample, counts=counts, fine=fine, paths=())


def _next_run_alike(sample: SamplerRuns) -> SamplerRuns:
    """Runs sorted in small groups: the same runs, but neighbours are alike."""
    n, last = sample.runs - sample.runs % ALIKE, sample.counts[:, -1]
    spread = last.std(axis=0)
    order = np.arange(sample.runs)
    groups = order[:n].reshape(-1, ALIKE)
    ranks = np.argsort(last[groups][:, :, int(spread.argmax())], axis=1, kind="stable")
    order[:n] = np.take_along_axis(groups, ranks, axis=1).ravel()
    return replace(sample, counts=sample.counts[order], paths=())


def _next_seed_shifted(sample: SamplerRuns) -> SamplerRuns:
    fine = np.concatenate([sample.fine[1:], sample.next_fine[-1:]])
    paths = (*sample.paths[1:], *sample.next_paths[-1:])
    return replace(sample, next_fine=fine, next_paths=paths)


MUTANTS: tuple[Mutant, ...] = (
    Mutant("every run twice", _every_run_twice),
    Mutant("the second half of the runs as the first", _second_half_as_first),
    Mutant("the first time from another run", _first_time_from_another_run),
    Mutant("neighbouring runs alike", _next_run_alike),
    Mutant("run i of the next seed is run i + 1", _next_seed_shifted),
)


def rate_mutant(network: Network, method: CountSampler, seed: int, channel: str, off: float) -> Mutant:
    """The rate constant of one channel too high by the relative error `off`; its runs are made anew.

    >>> from kinetics import Direct, Network
    >>> from kinetics.trust.verification import rate_mutant
    >>> rate_mutant(Network.from_text("decay: A -> 0, 1"), Direct(), seed=1, channel="decay", off=0.01).name
    'the rate of decay 1 % too high'
    """

    def applied(sample: SamplerRuns) -> SamplerRuns:
        constants = network.known_rates.copy()
        constants[network.channels.index(channel)] *= 1.0 + off
        start, times = sample.reference.start, sample.reference.solution.times
        wrong = network.with_rates(constants)
        grids = (times, sample.runs), (sample.reference.fine_times, len(sample.fine))
        counts, fine = (method.simulate(wrong, start, grid, runs=n, seed=seed).counts for grid, n in grids)
        paths: tuple[JumpPath, ...] = ()
        if sample.paths and isinstance(method, SamplingMethod):
            made = method.sample_paths(wrong, start, float(times[-1]), seed)
            paths = tuple(replace(path, network=network) for path in islice(made, len(sample.paths)))
        return replace(sample, counts=counts, fine=fine, paths=paths)

    return Mutant(f"the rate of {channel} {100 * off:.3g} % too high", applied)
