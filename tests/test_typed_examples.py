"""Users' own files pass mypy in strict mode: the Python of README and docs, and a script with dicts."""

import doctest
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = ["README.md", *sorted(str(path.relative_to(ROOT)) for path in (ROOT / "docs").glob("*.md"))]
# What `mypy --strict` asks for, as far as a file can ask for it.
STRICTLY = (
    "allow-redefinition, disallow-any-generics, disallow-subclassing-any, disallow-untyped-calls, "
    "disallow-untyped-defs, disallow-incomplete-defs, check-untyped-defs, disallow-untyped-decorators, "
    "warn-unused-ignores, warn-return-any, no-implicit-reexport, strict-equality, extra-checks"
)
SCRIPT = """
from kinetics import Direct, Model, Network, Transient
from kinetics import first_passage, predict, sample_path, scan, simulate, solve, stationary

network = Network.from_text("A + B <-> AB, k, 0.1", k=1e-2)
start: dict[str, int] = {"A": 20, "B": 10}
values: dict[str, list[float]] = {"k": [1e-2, 1e-1]}
mean: float = float(simulate(network, "ssa", start, [1.0, 2.0], runs=10)["AB"].mean())
solve(network, Transient(), start, [1, 2]).to_xarray()
simulate(network, Direct(), network.initial, [1.0])[0:1].to_dataframe()
first_passage(network, start, "AB").quantile(0.5)
predict(Model.of(network, start), None, [1.0]).plot()
stationary(network, start).mean()
sample_path(network, start, 1.0).to_parquet("path.parquet")
scan(Model.of(network, start), values, ["E[AB] @ 1"]).numbers("value")
"""
WRONG = SCRIPT + 'simulate(network, "ssa", start, [1.0], runs="many")\nmean = network\n'


def examples(page):
    """The statements of a page's examples."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return "".join(each.source for each in doctest.DocTestParser().get_examples(text))


def strictly(folder, sources):
    """What mypy has to say of files, name -> source.

    Each asks for its own strictness, so that our modules have the settings of `make lint`, and come from its cache.
    """
    for name, source in sources.items():
        (folder / name).write_text(f"# mypy: {STRICTLY}\n{source}", encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--no-error-summary", "--hide-error-context"]
    files = [folder / name for name in sources]
    done = subprocess.run([*command, *files], cwd=ROOT, capture_output=True, text=True, check=False)
    assert not done.stderr, done.stderr
    return [line.rpartition("/")[2] for line in done.stdout.splitlines()]


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    """All of it in one go: mypy reads our packages once."""
    pages = {f"{Path(page).stem.lower()}_page.py": examples(page) for page in PAGES if examples(page)}
    assert len(pages) >= 4
    folder = tmp_path_factory.mktemp("typed")
    return strictly(folder, {**pages, "script.py": SCRIPT, "wrong.py": WRONG})


def test_examples_pass(said):
    assert [line for line in said if not line.startswith("wrong.py")] == []


def test_mistakes_are_seen(said):
    """The control."""
    wrong = [line for line in said if re.match(r"wrong.py:.* error: ", line)]
    assert sorted(line.rsplit("[", 1)[1].rstrip("]") for line in wrong) == ["assignment", "call-overload"]
