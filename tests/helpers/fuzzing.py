"""Reads random inputs in processes of limited memory and processor time; whatever is neither read nor refused is told.

python -m tests.helpers.fuzzing SEED FIRST LAST [ReactionTexts]  a line of JSON an input: number, kind, outcome, message
"""

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import warnings
from collections import Counter
from pathlib import Path

from tests.helpers.fuzzed_inputs import Inputs
from tests.helpers.fuzzed_texts import ReactionTexts
from tests.helpers.limited import MEMORY, ROOT, load, use

SECONDS = 10  # of processor time for one input
IN_ONE_PROCESS = 1000  # inputs: what one leaves behind counts against the next


def campaign(seed, first, last, made="Inputs"):
    """Kind and outcome -> how many; and of each that failed its number, kind and message."""
    counts, failures = Counter(), []
    while first < last:
        end = min(first + IN_ONE_PROCESS, last)
        done = subprocess.run(
            [sys.executable, "-m", "tests.helpers.fuzzing", str(seed), str(first), str(end), made],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"},
            capture_output=True,
            check=False,
        )
        lines = [json.loads(line) for line in done.stdout.splitlines() if line.endswith(b"]")]
        for number, kind, outcome, message in lines:
            counts[kind, outcome] += 1
            if outcome not in ("read", "refused"):
                failures.append((number, kind, outcome, message))
        first = lines[-1][0] + 1 if lines else first
        if first < end:  # it died of the next one
            failures.append((first, "", f"exit {done.returncode}", done.stderr[-300:].decode(errors="replace")))
            first += 1
    return counts, failures


class Harmful(Inputs):
    """Inputs of which three must be told: the control."""

    def files(self):
        """Most are harmless."""
        bad = {3: "memory", 5: "time", 7: "error"}.get(self.number)
        return {f"{bad}.control": b""} if bad else {"input.law": b"A + 1"}


def _outcome(path):
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            use(path)
    except ValueError as error:
        return "refused", str(error)
    except BaseException as error:  # noqa: BLE001
        return type(error).__name__, str(error)
    return "read", ""


def main():
    """The inputs FIRST to LAST of a seed, each in the same process."""
    seed, first, last = map(int, sys.argv[1:4])
    made = {"Harmful": Harmful, "ReactionTexts": ReactionTexts}.get("".join(sys.argv[4:]), Inputs)
    load()
    size = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, size + MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    folder = Path(tempfile.mkdtemp())
    try:
        for number in range(first, last):
            paths = []
            for name, content in made(seed, number).files().items():
                paths.append(folder / name)
                paths[-1].write_bytes(content)
            seconds = 1 if made is Harmful else SECONDS
            signal.setitimer(signal.ITIMER_VIRTUAL, seconds)  # whose signal ends the process, wherever it is
            outcome, message = _outcome(paths[0])
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)
            for path in paths:
                path.unlink(missing_ok=True)
            sys.stdout.write(f"{json.dumps([number, paths[0].suffix, outcome, message[:300]])}\n")
            sys.stdout.flush()
    finally:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
