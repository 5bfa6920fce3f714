"""What the usual commands cost beside `import numpy`, and C kernels beside those by Numba: user CPU, medians.

    python -m tests.benchmarks.bench_start [--repeats 20]

The commands run as a new process each, turn about with the reference, so that a busy machine slows all alike. Kernels
are compiled beforehand; their first compilation is timed by itself, in an empty cache.
"""

from __future__ import annotations

import os
import resource
import shlex
import subprocess
import sys
import tempfile
import time
from itertools import islice
from pathlib import Path
from statistics import median
from unittest.mock import patch

import click
import numpy as np

from kinetics.assembly import RuleBook, derive
from kinetics.kernels.ensemble_work import ensemble_work, never
from kinetics.native import twins
from kinetics.native.lanes import Lanes
from kinetics.native.library import is_built
from kinetics.rates import Rates
from kinetics.sampling import Direct
from kinetics.sampling.base import stream_key
from kinetics.sampling.merging import Merging
from kinetics.support.output import scratch_folder
from kinetics.support.tables import text_table

REFERENCE = [sys.executable, "-c", "import numpy"]
LINE = "line4 --rates table3 --cubes 60"
COMMANDS = {
    "--help": 0.5,
    "rules derive line4": 2.0,
    f"predict {LINE} --method ssa --runs 1000": 2.0,
    f"predict {LINE} --method transient": 4.0,
    f"passage {LINE} --species quadmer": 4.0,
    "ask eleven.sm 'P=? [ F<=10 n=10 ]'": 3.0,
    "ask eleven.sm 'S=? [ n=10 ]'": 3.0,
    "ask pair.rxn 'P=? [ F<=10 AB>=5 ]'": 3.0,
    "ask pair.rxn 'P=? [ F<=10 AB>=5 ]' --sensitivity": 3.0,
    "ask pair.rxn 'S=? [ AB>=5 ]' --sensitivity": 3.0,
}
FILES = {
    "eleven.sm": """ctmc
module queue
  n : [0..10] init 0;
  [] n<10 -> 1 : (n'=n+1);
  [] n>0 -> 2 : (n'=n-1);
endmodule
""",
    "pair.rxn": "bind: A + B <-> AB, 0.1, 0.2\nA = 10\nB = 8\n",
}


# Bytecode is kept, as where a wheel is installed: without, all of our modules would be compiled at every start.
USUAL = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


def user_seconds(command: list[str], **more: str) -> float:
    """User CPU time of a new process."""
    with scratch_folder(FILES) as folder:
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        subprocess.run(command, check=True, capture_output=True, env=USUAL | more, cwd=folder)
        return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


def wellmixed(words: str) -> list[str]:
    return [sys.executable, "-c", "import wellmixed; wellmixed.main()", *shlex.split(words)]


def starts(repeats: int) -> None:
    for words in COMMANDS:
        user_seconds(wellmixed(words))  # bytecode is written once
    took: dict[str, list[float]] = {words: [] for words in COMMANDS}
    alone: list[float] = []  # numpy as it is imported, and without the threads of BLAS, which our commands do not start
    single: list[float] = []
    for _ in range(repeats):
        alone.append(user_seconds(REFERENCE))
        single.append(user_seconds(REFERENCE, OPENBLAS_NUM_THREADS="1"))
        for words, times in took.items():
            times.append(user_seconds(wellmixed(words)))
    with tempfile.TemporaryDirectory() as folder:
        first = user_seconds(wellmixed(f"predict {LINE}"), NUMBA_CACHE_DIR=folder)
        compiled = bool(list(Path(folder).rglob("*.nbc")))
    found = [(words, median(times), COMMANDS[words]) for words, times in took.items()]
    found.append((f"predict {LINE}, no kernel compiled", first, 2.0))
    rows = [
        [f"wellmixed {words}", f"{seconds / median(alone):.2f}", f"{most:g}", f"{seconds / median(single):.2f}"]
        for words, seconds, most in found
    ]
    click.echo(text_table(["command", "import numpy = 1", "at most", "numpy, one thread = 1"], rows))
    told = " and ".join(f"{1000 * median(each):.0f}" for each in (alone, single))
    click.echo(f"import numpy {told} ms of user CPU; kernels of Numba needed at first: {compiled}")


def events(repeats: int) -> None:
    """ns an event of the line of four at 60 cubes, by both twins."""
    network = Rates.load("table3").apply(derive(RuleBook.load("line4")).network)
    merging, start = Merging.of(network), np.array([60, 0, 0, 0])
    model, changes = merging.model(), network.stoichiometry[merging.representatives]
    grid, key = np.array([2000.0]), stream_key(0)
    limits, runs, until = np.array([1, 1, 0, 10**9]), 2000, (never(len(changes)), np.empty(0))
    kernels = {
        "direct": lambda out: twins.direct(model, changes, ensemble_work(4), start, grid, key, 0, out, until),
        "lockstep": lambda out: twins.lockstep(
            model, changes, Lanes(model, changes), start, grid, key, 0, out, np.zeros(runs, dtype=bool), until
        ),
    }
    paths = islice(Direct().sample_paths(network, start, 2000.0), 50)
    n_events = np.mean([path.times.size for path in paths])
    rows = []
    for name, twin in kernels.items():
        times: list[list[float]] = [[], []]
        for repeat in range(repeats + 1):
            for in_c, found in zip((True, False), times, strict=True):
                out = np.empty((runs, 1, 4), np.int64)
                began = time.process_time()
                with patch.object(twins, "is_built", return_value=in_c):
                    twin(out)(limits, 10**9)
                if repeat:  # the first may compile
                    found.append((time.process_time() - began) / (len(out) * n_events))
        rows.append([name, *(f"{1e9 * median(found):.1f}" for found in times)])
    click.echo(text_table(["ns an event", "in C", "by Numba"], rows))


@click.command()
@click.option("--repeats", type=click.IntRange(min=1), default=20, show_default=True)
def main(repeats: int) -> None:
    """Costs of starting, as ratios in the same run, and of an event in either kernel."""
    click.echo("C kernels: " + ("built" if is_built() else "not built"))
    starts(repeats)
    events(repeats)


if __name__ == "__main__":
    main()
