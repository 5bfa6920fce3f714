"""The page of the pyramid's run says what the run holds."""

import re

import numpy as np
import pytest
from derived_books import derived
from scipy.stats import chi2

from mechsim.runs.store import RunStore
from tests.results.studies import ROOT

FOLDER = ROOT / "results" / "pyramid45"
STAGES = ((1, 4), (5, 12), (13, 24), (25, 26), (27, 42), (43, 44))


@pytest.fixture(scope="module")
def steps():
    """Of each docking: cubes before it, wait (tu), N h."""
    ((manifest, arrays),) = RunStore(FOLDER / "runs").contents()
    derivation = derived("pyramid45")
    names = derivation.network.channels
    events = dict(zip(names, derivation.events, strict=True))
    ways = {}
    for event, classes in derivation.events.items():
        for reactant in set(event.before) - {0}:
            ways[reactant] = ways.get(reactant, 0) + sum(classes.values())
    free, rows = 100, []
    sizes = [len(structure) for structure in derivation.structures.values()]
    for channel, wait in zip(arrays["channels"], np.diff(arrays["times"], prepend=0.0), strict=True):
        (grown,) = set(events[manifest["facts"]["channels"][channel]].before) - {0}
        rows.append((sizes[grown], wait, ways[grown] * free))
        free -= 1
    return np.array(rows)


def test_the_table_of_stages(steps):
    page = (FOLDER / "README.md").read_text(encoding="utf-8")
    shown = [line.split("|")[2:6] for line in page.splitlines() if re.match(r"\| \d", line)]
    for (low, high), cells in zip(STAGES, shown, strict=True):
        those = steps[(steps[:, 0] >= low) & (steps[:, 0] <= high)]
        n, exposure = len(those), those[:, 1] @ those[:, 2]
        limits = chi2.ppf(0.025, 2 * n) / 2, chi2.ppf(0.975, 2 * n + 2) / 2
        rate, low_rate, high_rate = (f"{x / exposure:.1e}".replace("e-0", "e-") for x in (n, *limits))
        assert [cell.strip() for cell in cells] == [
            str(n), f"{those[:, 1].sum():,.0f}", f"{those[:, 2].mean():,.0f}", f"{rate} ({low_rate} to {high_rate})"
        ]  # fmt: skip
    ends = np.cumsum(steps[:, 1])[[23, 25, 41, 43]]
    page = " ".join(page.split())
    assert all(f"{time:,.0f} tu" in page for time in ends)
    assert all(f"{time + 7:,.0f} tu" not in page for time in ends)  # the control
