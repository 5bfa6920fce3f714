"""The likelihood of complete frames a fixed time apart, all frames at once.

If a frame shows all species, the chain starts anew at each: a run is a set of independent pairs (counts, counts one
frame later), and equal pairs of all runs count as one. `PanelLikelihood` takes one look after the other, with the same
result (tests/results/test_camera.py compares them); here all frames that begin with the same counts share the work.

With P = 1 + Q / r the chain of one step of uniformisation and w Poisson weights of mean r T, a row of the transition
matrix over T is e' sum_n w_n P^n. Its derivative by a rate constant follows by the product rule, step by step.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from kinetics.markov.transient.poisson import poisson_tails, poisson_window
from kinetics.markov.transient.states import reachable
from kinetics.network import Network
from kinetics.runs import JumpPath
from kinetics.support.arrays import Floats, Ints

LEFT_OUT = 1e-16  # of the Poisson probability
FEW = 100  # states, up to which full matrices are quicker


class Information(NamedTuple):
    """What one frame is expected to say, from each of I counts that a frame begins with, at some rates of P channels.

    frames : (I, P, P) Fisher information by the logarithms of the rate constants, of the next frame
    events : (I, P) expected events until then, which is the Fisher information of the events themselves
    """

    frames: Floats
    events: Floats


class FrameLikelihood:
    """Pairs of counts seen `every` tu apart.

    network : without laws; its rate constants play no part
    pairs : (n, 2, S) counts of a frame and of the next; all in one closed class of at most some thousand states

    states : how many states the chain has
    begins : (I, S) all different counts with which a pair begins; `begin_of` (n,) the place of each pair's
    copies : (K,) how often each of the K different pairs was seen
    """

    def __init__(self, network: Network, every: float, pairs: Ints) -> None:
        unit = network.with_rates(np.ones(len(network.channels)))
        space = reachable(unit, pairs[0, 0])
        before, after = space.index_of(pairs[:, 0]), space.index_of(pairs[:, 1])
        if min(before.min(), after.min()) < 0:
            raise ValueError("a frame cannot be reached from the first one; take frames of one number of cubes")
        self.every, self.states = every, len(space)
        starts, self.begin_of = np.unique(before, return_inverse=True)
        self.begins, self._starts = space.states[starts], starts
        different, self.copies = np.unique(np.stack([self.begin_of, after], axis=1), axis=0, return_counts=True)
        self._place, self._after = different.T
        moves, n, channels = space.transitions(), self.states, len(network.channels)
        self._exits = np.zeros((channels, n))
        np.add.at(self._exits, (moves.channels, moves.rows), moves.rates)
        # P blocks (N, N): rates per unit of a constant, from column to row, less the exits on the diagonal.
        here = np.tile(np.arange(n), channels)
        rows = np.concatenate([moves.channels * n + moves.columns, np.repeat(np.arange(channels), n) * n + here])
        rates = np.concatenate([moves.rates, -self._exits.reshape(-1)])
        self._into = sparse.csr_array((rates, (rows, np.concatenate([moves.rows, here]))), shape=(channels * n, n))
        self._block = np.repeat(np.repeat(np.arange(channels), n), np.diff(self._into.indptr))
        self._sum = sparse.hstack([sparse.eye_array(n, format="csr")] * channels, format="csr")
        self._full = self._into.toarray().reshape(channels, n, n) if n <= FEW else None

    def _chain(self, rates: Floats) -> tuple[float, Any, Any, int, Floats]:
        """The rate r of uniformisation, P', its derivatives (P N, N) by the logarithms of the rate constants (P,), and
        the first and all weights of the number of steps."""
        jump_rate = float((rates @ self._exits).max())
        step: Any
        change: Any
        if self._full is not None:
            blocks = self._full * (rates / jump_rate)[:, None, None]
            step, change = np.eye(self.states) + blocks.sum(axis=0), blocks.reshape(-1, self.states)
        else:
            change = self._into.copy()
            change.data *= rates[self._block] / jump_rate
            step = sparse.csr_array(sparse.eye_array(self.states) + self._sum @ change)
        return jump_rate, step, change, *poisson_window(jump_rate * self.every, LEFT_OUT)

    def _start(self, part: slice) -> Floats:
        """A column (N,) for each beginning of a part, 1 at its state."""
        starts = self._starts[part]
        found = np.zeros((self.states, starts.size))
        found[starts, np.arange(starts.size)] = 1.0
        return found

    def _parts(self, size: int) -> Iterator[slice]:
        """Some beginnings at a time, so few that what belongs to them stays in the processor's cache."""
        for begin in range(0, self._starts.size, size):
            yield slice(begin, min(begin + size, self._starts.size))

    def scored(self, logs: Floats) -> tuple[float, Floats]:
        """Log-likelihood and its gradient (P,) by the logarithms of the rate constants.

        The gradient is w_n c' P^m dP P^(n-1-m) e, summed over m < n, with c the weights of what was seen: forwards from
        e, and backwards from c.
        """
        rates = np.exp(logs)
        _, step, change, first, weights = self._chain(rates)
        weights = np.append(np.zeros(first), weights)
        back = step.T if self.states <= FEW else sparse.csr_array(step.T)
        value, gradient = 0.0, np.zeros(rates.size)
        for part in self._parts(32):
            steps = [self._start(part)]
            for _ in weights[1:]:
                steps.append(step @ steps[-1])
            row = sum(w * each for w, each in zip(weights[first:], steps[first:], strict=True))
            mine = (self._place >= part.start) & (self._place < part.stop)
            after, place, copies = self._after[mine], self._place[mine] - part.start, self.copies[mine]
            seen = row[after, place]
            if not (seen > 0.0).all():
                raise ValueError("a frame has probability 0 at these rates")
            value += float(copies @ np.log(seen))
            wanted = np.zeros_like(row)
            wanted[after, place] = copies / seen
            ahead = np.zeros_like(row)
            for w, before in zip(weights[:0:-1], steps[-2::-1], strict=True):
                ahead = w * wanted + back @ ahead
                gradient += (change @ before).reshape(rates.size, -1) @ ahead.reshape(-1)
        return value, gradient

    def information(self, rates: Floats) -> Information:
        """What the next frame, and the events up to it, are expected to say at these rate constants (P,)."""
        jump_rate, step, change, first, weights = self._chain(rates)
        tails = poisson_tails(first, weights, 0.0)
        frames, events = [], []
        for part in self._parts(8):
            row = self._start(part)
            slopes = np.zeros((self.states, rates.size, row.shape[1]))
            rows, all_slopes, time_in = np.zeros_like(row), np.zeros_like(slopes), np.zeros_like(row)
            for n, tail in enumerate(tails):
                time_in += tail / jump_rate * row
                if n >= first:
                    rows += weights[n - first] * row
                    all_slopes += weights[n - first] * slopes
                slopes = (step @ slopes.reshape(self.states, -1)).reshape(slopes.shape)
                slopes += (change @ row).reshape(rates.size, *row.shape).transpose(1, 0, 2)
                row = step @ row
            share = all_slopes / np.sqrt(np.maximum(rows, 1e-300))[:, None]  # its squares are (dp)^2 / p
            frames.append(np.einsum("npi,nqi->ipq", share, share, optimize=True))
            events.append((time_in.T @ self._exits.T) * rates)
        return Information(np.concatenate(frames), np.concatenate(events))


def frames_of(paths: Iterable[JumpPath], every: float) -> tuple[Ints, Ints]:
    """Pairs (n, 2, S) of counts `every` tu apart, from time 0 of each path on, and the place (n,) of their path."""
    found, owners = [], []
    for r, path in enumerate(paths):
        seen = path.at(every * np.arange(int(path.end / every) + 1))
        found.append(np.stack([seen[:-1], seen[1:]], axis=1))
        owners.append(np.full(len(seen) - 1, r))
    return np.concatenate(found), np.concatenate(owners)
