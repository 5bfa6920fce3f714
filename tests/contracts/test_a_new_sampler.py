"""Adding a sampling method is one file and one line: a scratch copy gains one and runs the contract on it."""

import shutil
from pathlib import Path

from scratch import add_line, run_contract, scratch_copy

from kinetics.kernels import streams
from kinetics.sampling.base import stream_key

FIRST_REACTION = '''
"""Gillespie's first-reaction method, in plain Python."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kinetics.kernels.outcomes import OVERFLOW, STALLED_CLOCK
from kinetics.sampling.base import SamplingMethod
from kinetics.sampling.mass_action import mass_action


@dataclass(frozen=True)
class FirstReaction(SamplingMethod):
    """Every channel draws its wait, and the shortest fires (Gillespie 1976, doi:10.1016/0021-9991(76)90041-3)."""

    name: ClassVar[str] = "firstreaction"

    def prepared(self, network):
        return FirstReactionSampler(network)


class FirstReactionSampler:
    def __init__(self, network):
        self.network, self.model = network, mass_action(network)

    def ensemble(self, initial, grid, key, first_run, out, watch):
        for i in range(len(out)):
            times, channels = self.path(initial, grid[-1], key, first_run + i, watch)
            steps = np.vstack([initial, self.network.stoichiometry[channels]])
            out[i] = np.cumsum(steps, axis=0)[np.searchsorted(times, grid, side="right")]

    def path(self, initial, end, key, run, watch):
        rng = np.random.default_rng([*key.tolist(), run])
        species, taken, needed = np.moveaxis(self.model.factors, 2, 0)
        state, t, still, times, channels = np.append(initial, 1), 0.0, 0, [], []
        look = watch.first_look
        while self.network.channels:
            copies = state[species]
            with np.errstate(divide="ignore", over="ignore"):
                rates = RATES * self.model.coefficients * ((copies - taken) * (copies >= needed)).prod(1, dtype=float)
                waits = rng.exponential(size=rates.size) / rates
            watch.hear()
            if len(times) == look:
                look = watch.look(run, look, t, state[:-1])
                if not look:
                    break
            if not rates.sum() < np.inf:
                watch.stop(run, OVERFLOW, t, state[:-1])
                break
            r = int(waits.argmin())
            still = still + 1 if t + waits[r] == t else 0
            if still == 1000:
                watch.stop(run, STALLED_CLOCK, t, state[:-1])
                break
            t += waits[r]
            if t > end:
                break
            after = state[:-1] + self.network.stoichiometry[r]
            if after.min() < 0:
                watch.stop(run, OVERFLOW, t, state[:-1])
                break
            state[:-1] = after
            times.append(t)
            channels.append(r)
        return np.array(times), np.array(channels, dtype=np.int64)
'''


def contract_with(folder, rates, cases):
    copy = scratch_copy(folder)
    # The kernels are the same, and so what they compile to.
    streams.start_stream(stream_key(0), 0, stream_key(0))  # there is one in the cache at least
    compiled = Path(streams.start_stream._cache.cache_path)
    shutil.copytree(compiled, copy / "kinetics" / "kernels" / "__pycache__" / compiled.name)
    room = copy / "kinetics" / "sampling"
    (room / "first_reaction.py").write_text(FIRST_REACTION.replace("RATES", rates).lstrip(), encoding="utf-8")
    add_line(room / "exact_methods.py", "import General", "from kinetics.sampling.first_reaction import FirstReaction")
    return run_contract(copy, "test_sampling.py", "-k", cases)


def test_a_sampler_is_one_file_and_one_line(tmp_path):
    code, said = contract_with(tmp_path, "1.0", "firstreaction and (decay or multinomial or bad_input)")
    assert code == 0, said
    assert "passed" in said


def test_a_sampler_with_rates_a_fifth_too_large_fails_the_contract(tmp_path):
    """A control that must fail."""
    code, said = contract_with(tmp_path, "1.2", "firstreaction and decay")
    assert code == 1, said
    assert "FAILED tests/contracts/test_sampling.py::test_a_decay_is_binomial[firstreaction]" in said
