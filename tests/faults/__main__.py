"""The fault campaigns: `python -m tests.faults` makes all tries of each, as far as the time goes, and the controls.

Prints a line a campaign (tries made and possible, losses) and a line a control; the exit code is 1 where something was
lost, where a control was not caught, or where a campaign has not made a try.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import shutil
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from tests.faults import cluster, disks, outputs, shared
from tests.faults.disks import Plan, Try
from tests.faults.known_studies import Mutant, unchanged
from tests.faults.mutants import MUTANTS

CAMPAIGNS: dict[str, Plan] = {
    "kills": disks.kills,
    "failures": disks.failures,
    "power": disks.power_failures,
    "hangs": disks.hangs,
    "door": outputs.door,
    "drivers": shared.drivers,
    "hung runs": shared.hung_runs,
    "clocks": shared.clocks,
    "versions": shared.versions,
    "command": outputs.command,
    "dask": cluster.dask,
}
SHORT = {"kills": 12, "failures": 12, "power": 29, "hangs": 1, "door": 40, "drivers": 3, "hung runs": 1, "clocks": 4}
SHORT |= {"versions": 6}  # the others have tests of their own among the default ones


def run(plan: Plan, scratch: Path, *, until: float, most: int, mutant: Mutant = unchanged, seed: int = 1) -> dict:
    """Tries of one campaign, in an order drawn by `seed`: at most so many, none begun after `until`; a control ends at
    the first loss.
    """
    began, cpu = time.monotonic(), _cpu()
    planned = scratch / "plan"
    planned.mkdir(parents=True)
    tries = plan(planned, mutant)
    kinds: Counter[str] = Counter()
    made, losses = 0, []
    for one in in_turn(tries, seed)[:most]:
        if made and time.monotonic() > until:
            break
        place = scratch / "try"
        place.mkdir()
        losses += [f"{one.label}: {loss}" for loss in one.losses(place)]
        shutil.rmtree(place)
        made += 1
        kinds[one.kind] += 1
        if losses and mutant is not unchanged:
            break
    shutil.rmtree(scratch)
    spent = {"seconds": round(time.monotonic() - began, 1), "cpu_seconds": round(_cpu() - cpu, 1)}
    return {"tries": made, "possible": len(tries), "kinds": dict(kinds), "losses": losses} | spent


def in_turn(tries: list[Try], seed: int) -> list[Try]:
    """In an order by chance, in which the first of each kind come first, then the second ones."""
    ranks: Counter[str] = Counter()
    ranked = []
    for one in random.Random(seed).sample(tries, len(tries)):
        ranked.append((ranks[one.kind], one))
        ranks[one.kind] += 1
    return [one for _, one in sorted(ranked, key=lambda pair: pair[0])]


def _cpu() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def main() -> int:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description="Strike at studies in every way, and see that nothing is lost.")
    parser.add_argument("--seconds", type=float, default=780.0, help="Begin no try after this time.")
    parser.add_argument("--short", action="store_true", help="Make few tries of each campaign, and no slow campaign.")
    parser.add_argument("--only", choices=CAMPAIGNS, help="Make this campaign alone, without controls.")
    parser.add_argument(
        "--json",
        type=Path,
        metavar="FILE",
        help="Also write what came of it to this file; with --only, beside what is there.",
    )
    asked = parser.parse_args()
    end = time.monotonic() + asked.seconds
    names = [asked.only] if asked.only else list(SHORT if asked.short else CAMPAIGNS)
    controls = {} if asked.only else MUTANTS
    told: dict[str, dict[str, Any]] = {"campaigns": {}, "controls": {}}
    with tempfile.TemporaryDirectory() as folder:
        for control, (name, mutant) in controls.items():  # first: they are few, and end at the first loss
            done = run(CAMPAIGNS[name], Path(folder, "control"), until=end, most=1000, mutant=mutant)
            told["controls"][control] = done | {"campaign": name, "caught": bool(done["losses"])}
            say(f"control: {control}", done, "caught" if done["losses"] else "NOT CAUGHT")
        for position, name in enumerate(names):
            share = (end - time.monotonic()) / (len(names) - position)  # what is left over goes to the next ones
            most = SHORT[name] if asked.short else 1 << 30
            done = run(CAMPAIGNS[name], Path(folder, "campaign"), until=time.monotonic() + share, most=most)
            told["campaigns"][name] = done
            say(name, done, f"{len(done['losses'])} losses")
            for loss in done["losses"]:
                sys.stdout.write(f"    {loss}\n")
    if asked.json:
        if asked.only and asked.json.exists():  # the others stay as they are
            kept = json.loads(asked.json.read_text())
            told = {"campaigns": kept["campaigns"] | told["campaigns"], "controls": kept["controls"]}
        asked.json.write_text(json.dumps(told, indent=1) + "\n")
    lost = any(done["losses"] or not done["tries"] for done in told["campaigns"].values())
    return int(lost or not all(done["caught"] for done in told["controls"].values()))


def say(name: str, done: dict, verdict: str) -> None:
    """A line of the table."""
    spent = f"{done['seconds']:6.1f} s, CPU {done['cpu_seconds']:5.1f} s"
    sys.stdout.write(f"{name:55s} {done['tries']:4d} of {done['possible']:4d} tries, {verdict:12s} {spent}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
