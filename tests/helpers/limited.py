"""Reads files of others, each in a process of its own whose memory and processor time are limited.

python -m tests.helpers.limited FOLDER   prints one line of JSON a file of the folder: name, outcome, message
"""

import atexit
import contextlib
import functools
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np

MEMORY = 300 * 2**20  # beyond what the process has at its start
CONTROL_SECONDS = 1
SECONDS = 10  # of processor time: what needs 1 s here may need more on a busy machine; bombs need minutes or years
ROOT = Path(__file__).resolve().parents[2]


def outcomes(folder):
    """Name -> outcome and message of every file in a folder; the outcome is read, refused, or how the process died."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.helpers.limited", str(folder)],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    return {name: rest for name, *rest in map(json.loads, done.stdout.splitlines())}


def use(path):
    """Read a file and use what it holds."""
    if path.suffix in (".law", ".condition", ".query"):
        _use_text(path.suffix, path.read_text(encoding="utf-8"))
    elif path.suffix == ".control":  # what must not pass
        while True:
            _ = [0] * (2 * MEMORY // 8) if "memory" in path.name else 0
            if "error" in path.name:
                raise RecursionError
    elif path.suffix == ".run":
        _use_run(path)
    elif path.suffix == ".parquet":
        from calibration.observed.reading import read_observed

        read_observed(_pair(), path)
    else:
        from kinetics.formats import read
        from kinetics.markov.explicit_files import read_explicit

        if path.suffix == ".tra":
            read_explicit(path)
            return
        model = read(path)
        model.network.propensities(model.initial + 1, 1.0)
        _ = model.network.fingerprint, str(model.network)[:1000]


def _use_text(kind, text):
    from kinetics.markov.questions import parse
    from kinetics.network.laws import Expression
    from kinetics.network.laws.program import evaluate, steps_of
    from kinetics.network.predicates import StateNames

    if kind == ".query":
        parse(text)
        return
    if kind == ".condition":
        StateNames(3, ["A"], np.arange(3)[:, None], {}).holds(text)
        return
    law = Expression(text)
    evaluate(steps_of(law, dict.fromkeys(law.species, 0)), np.arange(6).reshape(6, 1), 1.0)


@functools.cache
def _pair():
    from kinetics.network import Network

    return Network.from_reactions({"join": ({"A": 2}, {"B": 1}), "break": ({"B": 1}, {"A": 2})}, [0.1, 0.2])


@functools.cache
def _store():
    from mechsim.runs.store import RunStore

    folder = tempfile.mkdtemp()
    atexit.register(shutil.rmtree, folder)
    return RunStore(folder)


def _use_run(path):
    """Its tables, as `wellmixed runs export` reads them, and its path. Its name is WHAT.KEY.run or KEY.run."""
    from mechsim.inspection.poses import record_at

    store = _store()
    copy = store.folder / f"{path.stem.rpartition('.')[2]}.run"
    copy.write_bytes(path.read_bytes())
    try:
        _ = record_at(str(copy), store.folder).path.states
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that it is damaged, and moved aside
            for table in store.to_frames():
                table.to_parquet(index=False)
        if not copy.exists():
            raise ValueError("damaged, and moved aside")
    finally:
        for each in store.folder.glob("*.run*"):
            each.unlink()


def _limited(path):
    """In a child: the outcome, written to a pipe; how it died where there is none."""
    out, into = os.pipe()
    child = os.fork()
    if not child:
        size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, size + MEMORY))
        seconds = CONTROL_SECONDS if path.suffix == ".control" else SECONDS
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        try:
            use(path)
            found = ["read", ""]
        except ValueError as error:
            found = ["refused", str(error)[:300]]
        except BaseException as error:  # noqa: BLE001 - whatever it is, it is reported
            found = [type(error).__name__, str(error)[:300]]
        os.write(into, json.dumps(found).encode())
        os._exit(0)
    os.close(into)
    with os.fdopen(out) as pipe:
        text = pipe.read()
    _, status, used = os.wait4(child, 0)
    found = json.loads(text) if text else [f"died of signal {os.waitstatus_to_exitcode(status)}", ""]
    return [*found, round(used.ru_utime + used.ru_stime, 3), used.ru_maxrss // 1024]


def load():
    """Import what reads, before the limits."""
    import scipy.sparse  # noqa: F401

    with contextlib.suppress(ImportError):
        import pyarrow.parquet  # noqa: F401

        import mechsim.inspection.poses  # noqa: F401
        from mechsim.runs.record import book_of

        book_of("line4")
        _store()  # whose folder goes with this process, not with those that it forks
    with contextlib.suppress(ImportError):
        import libsbml  # noqa: F401


def main():
    """Every file of the folder that is named."""
    load()  # once, and not in each child
    for path in sorted(Path(sys.argv[1]).iterdir()):
        sys.stdout.write(f"{json.dumps([path.name, *_limited(path)])}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
