"""The long run of the fuzzer: `python -m tests.helpers.fuzz_campaign` goes on in blocks until it has made all.

What came of them is kept in results/fuzzing.json after every block: by kind, those that failed, and those that failed
once and do no more; other generators of inputs begin anew. Hostile BNGL and Antimony files follow, and if BioNetGen and
Antimony are installed, they run what is made of these (results/canaries.json). The exit code is 1 where an input was
neither read nor refused, or a hostile file could create, change or read another.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import json
import os
import shutil
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from tests.helpers import canaries
from tests.helpers.canary_runs import ran
from tests.helpers.fuzzing import IN_ONE_PROCESS, campaign
from tests.helpers.limited import ROOT

STORED = ROOT / "results/fuzzing.json"
CANARIES = ROOT / "results/canaries.json"
SEED, LONG, HOSTILE = 1, 100_000, 20_000
GENERATORS = ("tests/helpers/fuzzed_inputs.py", "tests/helpers/fuzzed_archives.py")


def generators() -> str:
    """SHA-256 of what makes the inputs: with the seed, of the inputs."""
    return hashlib.sha256(b"".join((ROOT / name).read_bytes() for name in GENERATORS)).hexdigest()


def goes_on(path: Path, seed: int) -> dict:
    """What is known so far of the inputs of a seed."""
    if path.exists():
        told = json.loads(path.read_text("utf-8"))
        if (told["seed"], told["generators"]) == (seed, generators()):
            return told
    return {"seed": seed, "generators": generators(), "inputs": 0, "counts": {}, "failures": [], "mended": []}


def run(path: Path, seed: int, inputs: int) -> dict:
    """Try those that failed again, then go on until so many inputs were made."""
    told = goes_on(path, seed)
    still = [failure for number, *_ in told["failures"] for failure in campaign(seed, number, number + 1)[1]]
    told["mended"] += sorted({number for number, *_ in told["failures"]} - {number for number, *_ in still})
    told["failures"] = still
    path.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    while told["inputs"] < inputs:
        last = min(told["inputs"] + IN_ONE_PROCESS, inputs)
        began = time.monotonic()
        counts, failures = campaign(seed, told["inputs"], last)
        total = Counter(told["counts"]) + Counter({f"{kind} {outcome}": n for (kind, outcome), n in counts.items()})
        told |= {"inputs": last, "counts": dict(sorted(total.items()))}
        told["failures"] += failures
        path.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
        said = f"{last} inputs, {len(told['failures'])} failures; {time.monotonic() - began:.0f} s"
        sys.stdout.write("\n".join([said, *map(str, failures), ""]))
        sys.stdout.flush()
    return told


def hostile(path: Path, seed: int, inputs: int) -> dict:
    """Judge hostile files, and run the programs on what they are turned into."""
    has_bionetgen = "BNGPATH" in os.environ or importlib.util.find_spec("bionetgen")
    has_programs = shutil.which("perl") and has_bionetgen and importlib.util.find_spec("antimony")
    with tempfile.TemporaryDirectory() as folder:
        counts, failures, given = canaries.campaign(Path(folder), seed, 0, inputs)
        failures += ran(Path(folder), given) if has_programs else []
    found = {f"{kind} {outcome}": n for (kind, outcome), n in sorted(counts.items())}
    told = {
        "seed": seed,
        "inputs": inputs,
        "counts": found,
        "run": len(given) if has_programs else 0,
        "failures": failures,
    }
    path.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    sys.stdout.write(f"{inputs} hostile files, {told['run']} run; {len(failures)} failures\n")
    return told


def main() -> int:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description="Read random inputs of every grammar, within limits, block by block.")
    parser.add_argument("--inputs", type=int, default=LONG, help=f"Go on until so many were made ({LONG}).")
    parser.add_argument("--hostile", type=int, default=HOSTILE, help=f"How many hostile files ({HOSTILE}).")
    parser.add_argument("--seed", type=int, default=SEED, help="Draw them by this seed.")
    asked = parser.parse_args()
    found = [run(STORED, asked.seed, asked.inputs), hostile(CANARIES, asked.seed, asked.hostile)]
    return int(any(told["failures"] for told in found))


if __name__ == "__main__":
    sys.exit(main())
