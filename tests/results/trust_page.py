"""The table of docs/trust.md, from what its commands have kept: `python -m tests.results.trust_page` writes it anew.

Each figure stands beside the command that makes it. Where the code of a room has changed since its mutants were
judged, the block says so.
"""

from __future__ import annotations

import json
import re
from typing import Any

from tests.helpers.fraction_campaign import STORED as FRACTIONS
from tests.helpers.fuzz_campaign import CANARIES, generators
from tests.helpers.fuzz_campaign import STORED as FUZZED
from tests.mutation.__main__ import ROOT, code_of, rooms, stored
from tests.mutation.known import STORED as KNOWN

PAGE = ROOT / "docs/trust.md"
FAULTS = ROOT / "results/faults.json"
HELD_OUT = ROOT / "results/line4/validation.json"
BLOCK = re.compile(r"(<!-- TRUST -->\n).*?(<!-- end -->)", re.DOTALL)


def told(path: Any) -> Any:
    """What a command has kept."""
    return json.loads(path.read_text("utf-8"))


def faults() -> str:
    """Tries and losses of the fault campaigns, and what became of the controls."""
    campaigns, controls = (list(part.values()) for part in told(FAULTS).values())
    made, possible = (sum(one[key] for one in campaigns) for key in ("tries", "possible"))
    losses, caught = sum(len(one["losses"]) for one in campaigns), sum(one["caught"] for one in controls)
    return (
        "a study struck by kills, failing disks, power failures, rivals, clocks and lost clusters: "
        f"{made} of {possible} possible tries made, {losses} runs or files lost; {caught} of {len(controls)} "
        f"deliberately faulty stores caught"
    )


def fuzzed() -> str:
    """Random inputs and those that did harm; hostile files and those that could."""
    found, hostile = told(FUZZED), told(CANARIES)
    kinds = ", ".join(sorted({name.split()[0] for name in found["counts"]}))
    older = "" if found["generators"] == generators() else ", made by an older generator"
    return (
        f"{found['inputs']:,} random inputs ({kinds}) read or refused in 10 s and 300 MB, all but "
        f"{len(found['failures'])}; {len(found['mended'])} more that once did harm do none now{older}. "
        f"{hostile['inputs']:,} hostile .bngl and .ant files, of which {len(hostile['failures'])} could create, change "
        f"or read a file; {hostile['run']:,} were run by BioNetGen or Antimony"
    )


def mutated() -> str:
    """The score of each room."""
    scores, spared = [], 0
    for room in rooms().values():
        score = stored(room.name)
        if score is None:
            continue
        older = "" if score.code == code_of(room) else " (code changed since)"
        scores.append(f"{room.name} {score.of('killed')} of {len(score.verdicts) - score.of('accepted')}{older}")
        spared += score.of("accepted")
    return (
        "random small changes of the code that a test detects, after tests were added for those that were missed at "
        f"first: {', '.join(scores)}; {spared} more change no answer, each with its reason in "
        "`tests/mutation/rooms.toml`"
    )


def known() -> str:
    """The mutants that once lived."""
    fates = list(told(KNOWN).values())
    return f"{fates.count('killed')} of {len(fates)} changes that tests once missed are detected"


def proven() -> str:
    """Limits against exact fractions."""
    found = told(FRACTIONS)
    return (
        f"{found['proven']:,} bounds reported as proven, for {found['chains']:,} random chains, against exact "
        f"fractions: {found['outside']} wrong, the widest {found['widest']:.0e} of its value; "
        f"{found['doubles_outside']:,} answers "
        "by LU in doubles lie outside"
    )


def held_out() -> str:
    """The verdict on the line of four."""
    found = told(HELD_OUT)
    kept = sum(rule["is_kept"] is True for rule in found["rules"])
    rows = {row["group"]: row for row in found["events"] if row["size"] == "all sizes"}
    joins, breaks = (rows[group]["seen"] / rows[group]["expected"] for group in ("joins", "breaks"))
    return (
        "held-out assemblies of the line of four, 40 to 240 cubes, four tanks, two engines, against rates that "
        f"never saw them: joins {joins:.2f} and breaks {breaks:.2f} of those expected; {kept} of the plan's "
        f"{len(found['rules'])} rules are kept; `docs/line_of_four.md` says which not, and why"
    )


def block() -> str:
    """The lines of the table."""
    rows = {
        "make faults": faults(),
        "make fuzz": fuzzed(),
        "make mutation": mutated(),
        "python -m tests.mutation.known": known(),
        "python -m tests.helpers.fraction_campaign": proven(),
        "python -m tests.results.study_pages": held_out(),
    }
    lines = [f"| `{command}` | {what} |" for command, what in rows.items()]
    return "\n".join(["| command | result |", "|---|---|", *lines, ""])


def written(text: str) -> str:
    """A page with the block as it is now. ValueError: it has no place for it."""
    if len(BLOCK.findall(text)) != 1:
        raise ValueError("expected one block from <!-- TRUST --> to <!-- end -->")
    return BLOCK.sub(lambda found: found[1] + block() + found[2], text)


if __name__ == "__main__":
    PAGE.write_text(written(PAGE.read_text("utf-8")), encoding="utf-8")
