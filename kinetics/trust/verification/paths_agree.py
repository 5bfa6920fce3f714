"""Whether paths and counts describe the same runs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kinetics.trust.verification.base import SamplerCheck, SamplerFinding
from kinetics.trust.verification.sampler_runs import SamplerRuns


class PathsAgree(SamplerCheck):
    """Run number i has the same events however it is asked for, so its path passes through its counts. No chance."""

    name = "paths agree"
    sees = "counts that belong to other runs than the paths of the same seed and number"

    def findings(self, sample: SamplerRuns) -> Iterator[SamplerFinding]:
        """Yield findings of the seed at its times and at fine times, and of the next seed."""
        reference = sample.reference
        for what, paths, times, counts in (
            ("at the times", sample.paths, reference.solution.times, sample.counts),
            ("at fine times", sample.paths, reference.fine_times, sample.fine),
            ("of the next seed", sample.next_paths, reference.fine_times, sample.next_fine),
        ):
            both = list(zip(paths, counts, strict=False))
            apart = sum(not np.array_equal(path.at(times), run) for path, run in both)
            yield SamplerFinding(f"runs whose path and counts differ {what}", apart, 0.0, 0.0 if apart else 1.0)
