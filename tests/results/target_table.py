"""The table of targets in docs/rules.md: each target compiled, its book certified, and the table written anew.

    python -m tests.results.target_table

compiles the quick targets (QUICK) and takes the others from results/rules/targets.json; with `--all`, or names of
targets, behind it, it compiles these too and stores what it finds, one after another.
"""

from __future__ import annotations

import json
import re
import sys
import time
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from kinetics.assembly import derive
from kinetics.assembly.checking.certificate import certified
from kinetics.assembly.compiler import InfeasibleError, Target, UndecidedError, compile_book
from kinetics.assembly.compiler.compiling import LADDER
from kinetics.assembly.rules.conditions import Senses
from tests.results.studies import ROOT, table

PAGE, STORE = ROOT / "docs" / "rules.md", ROOT / "results" / "rules" / "targets.json"
BLOCK = re.compile(r"(<!-- targets -->\n).*?(<!-- end -->)", re.DOTALL)
TITLES = ("target", "letters (free one included)", "senses", "joins / breaks", "rules", "claims that hold")
TARGETS = {
    "l3": "L of 3",
    "line4": "line of 4",
    "line5": "line of 5",
    "t5": "T of 5",
    "corner": "corner of 4",
    "screw": "screw of 4",
    "plate2x2": "plate 2×2",
    "cube2": "cube 2×2×2",
    "h7": "H of 7",
    "ring8": "ring of 8",
    "cube3": "cube 3×3×3",
    "cube4": "cube 4×4×4",
    "pyramid45": "pyramid of 45",
}
QUICK = ("l3", "line4", "corner", "plate2x2")
NOTES = {
    "line4": "the paper uses 4",
    "t5": "the paper uses 4",
    "cube4": "with these senses, which were requested",
    "pyramid45": "our own book by hand: 7",
}
SENSES = {"cube4": Senses(faces="six", roll=True)}  # asked for, where weaker ones take long to decide
TIME_LIMIT = 3600.0  # s
EFFORTS = {"cube2": 0.1, "ring8": 0.1}  # what is taken of the compiler's usual steps, where these take long


def compiled(name: str) -> dict[str, Any]:
    """What the table says of a target, and the CPU time, s, that it takes to find out."""
    start = time.process_time()
    target = Target.load(name)
    asked = replace(target, senses=SENSES.get(name, target.senses))
    try:
        made = compile_book(asked, time_limit=TIME_LIMIT, effort=EFFORTS.get(name, 1.0))
    except (InfeasibleError, UndecidedError) as error:
        *_, ruled, remedy = str(error).splitlines()
        return {
            "outcome": "infeasible" if isinstance(error, InfeasibleError) else "not decided",
            "senses_ruled_out": ruled.count(";") + 1 if ruled.startswith("infeasible with") else 0,
            "remedy": remedy,
            "compiling": round(time.process_time() - start, 1),
        }
    is_seeded = made.certificate is None
    found = {
        "letters": made.letters,
        "is_fewest": made.minimal,
        "senses": made.capability,
        "joins": None if is_seeded else len(made.joins),
        "breaks": None if is_seeded else sum(len(event.before) == 1 for event in derive(made.book).events),
        "rules": len(made.book.all_rules),
        "compiling": round(time.process_time() - start, 1),
        "claims": None,
        "certifying": None,
    }
    if made.certificate is not None:
        start = time.process_time()
        claims = certified(made.book, json.loads(json.dumps(made.certificate.as_json())))
        found["claims"] = [sum(claim.holds is True for claim in claims), len(claims)]
        found["certifying"] = round(time.process_time() - start, 1)
    return found


def stored() -> dict[str, dict[str, Any]]:
    """What was found last."""
    return json.loads(STORE.read_text(encoding="utf-8")) if STORE.exists() else {}


def timeless(found: dict[str, Any]) -> dict[str, Any]:
    """Without what depends on the machine."""
    return {key: value for key, value in found.items() if key not in {"compiling", "certifying"}}


def filled(page: str, found: dict[str, dict[str, Any]]) -> str:
    """The page with its table; what was not compiled yet says so."""
    rows = [
        _row(name, found[name]) if name in found else (TARGETS[name], "not compiled yet", "", "", "", "")
        for name in TARGETS
    ]
    return BLOCK.sub(lambda match: f"{match[1]}{table(TITLES, rows)}\n{match[2]}", page)


def _row(name: str, found: dict[str, Any]) -> tuple[str, ...]:
    if "outcome" in found:
        steps = f" with {EFFORTS[name]:g} of the usual steps" if name in EFFORTS else ""
        ruled = f"{found['senses_ruled_out']} of {len(LADDER)} combinations of senses are proven insufficient"
        return TARGETS[name], f"{found['outcome']}{steps}; {found['remedy']}", ruled, "", "", ""
    notes = [*([] if found["is_fewest"] else ["not shown to be the fewest"]), *([NOTES[name]] if name in NOTES else [])]
    channels, claims = "grown from a seed", "no certificate"
    if found["joins"] is not None:
        channels, claims = f"{found['joins']} / {found['breaks']}", "{} of {}".format(*found["claims"])
    letters = f"{found['letters']} ({'; '.join(notes)})" if notes else str(found["letters"])
    return TARGETS[name], letters, found["senses"], channels, str(found["rules"]), claims


def main(names: Iterable[str]) -> None:
    """Compile some targets, store what is found as it is found, and write the table."""
    found = stored()
    for name in names:
        found[name] = compiled(name)
        STORE.write_text(json.dumps(found, indent=1, sort_keys=True) + "\n", encoding="utf-8")
        print(name, found[name], flush=True)  # noqa: T201  a command
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), found), encoding="utf-8")


if __name__ == "__main__":
    main(TARGETS if "--all" in sys.argv else [*QUICK, *(name for name in sys.argv[1:] if name not in QUICK)])
