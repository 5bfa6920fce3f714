"""The numbers of the studies' pages, from their stored files: blocks of docs/line_of_four.md,
docs/crowding.md, the paper and results/*/README.md.

    python -m tests.results.study_pages

writes them anew, each between a line `<!-- STUDY: NAME -->` and a line `<!-- end -->`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from functools import cache

from tests.results import calibrated_blocks, judged_blocks
from tests.results.studies import ROOT, STUDIES, Study

PAGES = (
    *(ROOT / "docs" / f"{name}.md" for name in ("line_of_four", "crowding")),
    ROOT / "paper" / "paper.md",
    *(folder / "README.md" for folder in STUDIES.values()),
)
BLOCK = re.compile(rf"(<!-- ({'|'.join(STUDIES)}): (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)

BLOCKS: dict[str, Callable[[Study], str]] = {
    "plan": calibrated_blocks.planned,
    "made": calibrated_blocks.made,
    "rates": calibrated_blocks.rate_table,
    "channels": calibrated_blocks.channel_table,
    "partners": calibrated_blocks.who_broke,
    "models": calibrated_blocks.model_table,
    "reason": calibrated_blocks.reason,
    "crowding": calibrated_blocks.crowding_chosen,
    "hits_by_tank": calibrated_blocks.hits_by_tank,
    "hits_of_three": calibrated_blocks.hits_of_three,
    "pairs": calibrated_blocks.pairs,
    "diagnostics": calibrated_blocks.diagnostics,
    "held": judged_blocks.made_so_far,
    "events": judged_blocks.event_table,
    "rules": judged_blocks.rules,
    "mass_action": judged_blocks.joins_by_mass_action,
    "verdict": judged_blocks.verdict,
    "missed": judged_blocks.missed,
    "parts": judged_blocks.parts,
    "sentence": judged_blocks.in_one_sentence,
    "several": judged_blocks.several,
    "summary": judged_blocks.summary_table,
    "paper": judged_blocks.beside_the_paper,
}


@cache
def study_of(name: str) -> Study:
    """One study for all blocks, so that its runs are read once."""
    return Study(name)


def filled(text: str) -> str:
    """A page with its blocks made anew."""
    return BLOCK.sub(lambda found: f"{found[1]}{BLOCKS[found[3]](study_of(found[2]))}\n{found[4]}", text)


def numbers(text: str) -> Counter[str]:
    """Numbers of a text outside its blocks, its code and its links."""
    bare = re.sub(r"```.*?```|`[^`]*`|\]\([^)]*\)", " ", BLOCK.sub(" ", text), flags=re.DOTALL)
    return Counter(re.findall(r"\d+(?:[.,]\d+)*(?:e-?\d+)?", bare))


if __name__ == "__main__":
    for page in PAGES:
        page.write_text(filled(page.read_text(encoding="utf-8")), encoding="utf-8")
