"""Few tries of every quick campaign, and all controls; `make faults` makes the rest.

In a process of its own: it forks, and stands in the way of its disk.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

from tests.faults.layer import LITTLE
from tests.faults.power import NAMES_ALONE, NEITHER, TORN, Disk

ROOT = Path(__file__).parents[2]


def test_nothing_is_lost_and_every_control_is_caught(tmp_path):
    told = tmp_path / "told.json"
    done = subprocess.run(
        [sys.executable, "-m", "tests.faults", "--short", "--json", told],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    campaigns, controls = json.loads(told.read_text()).values()
    assert all(one["tries"] and not one["losses"] for one in campaigns.values())
    assert all(one["caught"] for one in controls.values())
    classes = {"open", "write", "truncate", "fsync", "rename", "unlink", "mkdir"}
    assert set(campaigns["kills"]["kinds"]) == classes
    assert {kind.partition(",")[0] for kind in campaigns["failures"]["kinds"]} == classes


def test_what_a_power_failure_leaves(tmp_path):
    """A file of which the first half is synced, then its name, then all of it under another name."""
    disk = Disk(tmp_path)
    old, new, content = str(tmp_path / "old"), str(tmp_path / "new"), bytes(LITTLE)

    def left():
        return {case: {name: len(data) for name, data in tree.items()} for case, tree in disk.states().items()}

    for event in (["create", old], ["content", old, content[: LITTLE // 2].hex()], ["sync", old]):
        disk.apply(event)
    assert left() == {NAMES_ALONE: {"old": LITTLE // 2}, TORN: {"old": LITTLE // 2}, NEITHER: {}}
    disk.apply(["sync", str(tmp_path)])
    disk.apply(["content", old, content.hex()])
    disk.apply(["rename", old, new])
    assert left() == {NAMES_ALONE: {"new": LITTLE // 2}, TORN: {"new": LITTLE // 2}, NEITHER: {"old": LITTLE // 2}}
    disk.apply(["sync", new])
    disk.apply(["sync", str(tmp_path)])
    assert left() == {case: {"new": LITTLE} for case in (NAMES_ALONE, TORN, NEITHER)}
