"""Studies that `wellmixed new` began: the stored files are what the stored runs say."""

from collections import Counter

import pytest

from calibration.pipeline.calibration_study import run_calibration
from calibration.pipeline.study_runs import StudyRuns
from kinetics.runs import NO_BREAK
from mechsim.runs.store import RunStore
from tests.results.studies import STUDIES, Study

NEW = [name for name, folder in STUDIES.items() if (folder / "target.toml").is_file()]
MOST_BYTES = 3_000_000


@pytest.mark.parametrize("name", NEW)
def test_rates_are_those_of_the_calibration_runs(name):
    study, runs = Study(name), STUDIES[name] / "runs"
    specs = study.plan.specs(study.plan.calibration)
    if len(RunStore.found(runs).existing(specs)) < len(specs):
        pytest.skip("the stored runs were made with other versions of the engine or of numpy")
    calibrated = run_calibration(StudyRuns.planned(study.plan, "calibration"), runs, progress=False)
    assert study.rates.evidence["runs_digest"] == calibrated.evidence["runs_digest"]
    for row in calibrated.calibration.table():
        known = study.rates.channels[row["channel"]]
        assert (known.events, known.prior is None) == (row["events"], row["note"] == "")
        if "+" in row["channel"].split("->")[0] and known.prior is None:
            assert (known.rate, known.low, known.high) == (row["rate"], row["low"], row["high"])


@pytest.mark.parametrize("name", NEW)
def test_events_are_those_of_the_held_out_runs(name):
    """Counted here; those of the calibration runs, the control, are others."""
    study, counted = Study(name), {}
    for manifest, arrays in RunStore.found(STUDIES[name] / "runs").contents():
        breaks = int((arrays["partners"] != NO_BREAK).sum())
        found = counted.setdefault(manifest["inputs"]["seed"], Counter())
        found.update(joins=int((arrays["channels"] >= 0).sum()) - breaks, breaks=breaks)
    rows = study.events
    seen = rows[rows["size"] == "all sizes"].set_index("group")["seen"]
    assert {group: int(seen[group]) for group in ("joins", "breaks")} == dict(counted[study.plan.held_out.seed])
    assert dict(counted[study.plan.calibration.seed]) != dict(counted[study.plan.held_out.seed])


@pytest.mark.parametrize("name", NEW)
def test_a_study_is_stored_compactly(name):
    files = [path for path in STUDIES[name].rglob("*") if path.is_file() and path.suffix != ".html"]
    assert sum(path.stat().st_size for path in files) < MOST_BYTES
