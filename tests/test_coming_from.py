"""The first lines of other tools, on the pages for their users: run if the tool is installed, else checked otherwise.

Python of others is compiled; Antimony, PRISM's language and BNGL have readers here. What msm and lifelines compute is
computed here by their formulas. Nobody runs the blocks in Julia and R.
"""

import contextlib
import importlib.util
import io
import math
import re
import shutil
import subprocess
import warnings

import numpy as np
import pandas as pd
import pytest
from pages import ROOT, blocks
from scipy.linalg import expm

from kinetics import Chain, Network, solve
from kinetics.formats import read
from kinetics.markov import ask, read_prism

FOLDER = ROOT / "docs" / "coming_from"
FIRST = {block.title: block.text for page in sorted(FOLDER.glob("*.md")) for block in blocks(page) if block.title}
EXACT, SD = 5.932, 1.45  # copies of AB after 60 s; the page says so of ours


def test_every_tool_has_its_lines_and_its_row():
    tools = {page.stem for page in FOLDER.glob("*.md")} - {"index"}
    assert {name.split(".")[0] for name in FIRST if name.startswith("from_")} == {f"from_{tool}" for tool in tools}
    rows = re.findall(r"^\| .*\((\w+)\.md\)", (FOLDER / "index.md").read_text("utf-8"), flags=re.MULTILINE)
    assert sorted(rows) == sorted(tools)
    assert {"gillespy2", "tellurium", "copasi", "prism", "catalyst", "msm", "lifelines"} <= tools


@pytest.mark.parametrize(
    ("tool", "package", "last"),
    [
        ("gillespy2", "gillespy2", EXACT),
        ("tellurium", "tellurium", EXACT),
        ("copasi", "basico", EXACT),
        ("lifelines", "lifelines", 4 / 56.5),
    ],
)
def test_python_of_others(tool, package, last, tmp_path, monkeypatch):
    code = compile(FIRST[f"from_{tool}.py"], f"from_{tool}.py", "exec")
    if importlib.util.find_spec(package) is None:
        pytest.skip(f"{package} is not installed; its lines compile")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "patients.csv").write_text(FIRST["patients.csv"], encoding="utf-8")
    said = io.StringIO()
    with contextlib.redirect_stdout(said), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # their own
        exec(code, {})
    numbers = [float(word.strip("[],")) for word in said.getvalue().split() if word.strip("[],")]
    assert abs(numbers[-1] - last) < (6 * SD if last == EXACT else 1e-6)  # AB, or the hazard, stands last


def test_like_pairs_in_gillespy2():
    gillespy2 = pytest.importorskip("gillespy2")
    a, d, k = gillespy2.Species("A", 40), gillespy2.Species("D", 0), gillespy2.Parameter("k", expression=0.01)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # their own
        theirs = gillespy2.Reaction(name="pair", reactants={a: 2}, products={d: 1}, rate=k).propensity_function
    text = "2 A -> D, 0.01\nA = 40"
    for ours, times in ((Network.from_text(text), 2), (Network.from_text(f"{text}\ncombinations: ordered"), 1)):
        value = eval(theirs, {"k": 0.01, "A": 40, "vol": 1.0})
        assert value == pytest.approx(times * ours.propensities([40, 0])[0])


def test_antimony_in_tellurium(tmp_path):
    """The model of the page, read by our own reader, has the mean of the page."""
    (model,) = re.findall(r'"""(.*?)"""', FIRST["from_tellurium.py"], re.DOTALL)
    pytest.importorskip("antimony")
    (tmp_path / "pair.ant").write_text(model, encoding="utf-8")
    assert solve(read(tmp_path / "pair.ant"), "transient", times=[60]).mean()[0, 2] == pytest.approx(EXACT, abs=5e-4)
    (tmp_path / "wrong.ant").write_text(model.replace("->", "-"), encoding="utf-8")
    with pytest.raises(ValueError, match=r"wrong\.ant"):
        read(tmp_path / "wrong.ant")


def test_laws_of_like_pairs_stay_as_they_are_in_antimony(tmp_path):
    """As the page says: k A A is the propensity, but a reaction without its reactants is blocked."""
    pytest.importorskip("antimony")
    (tmp_path / "like.ant").write_text("r: 2 A -> D; k*A*A\nk = 0.01\nA = 40; D = 0\n", encoding="utf-8")
    network = read(tmp_path / "like.ant").network
    assert network.propensities([40, 0])[0] == pytest.approx(16.0)
    assert network.propensities([1, 0])[0] == 0


def test_bngl_of_others(tmp_path):
    sections = [line.split(maxsplit=1)[1] for line in FIRST["from_bionetgen.bngl"].splitlines() if "begin " in line]
    ends = [line.split(maxsplit=1)[1] for line in FIRST["from_bionetgen.bngl"].splitlines() if "end " in line]
    assert sorted(sections) == sorted(ends)
    if not shutil.which("bionetgen"):
        pytest.skip("bionetgen is not installed; the sections of its lines are whole")
    (tmp_path / "pair.bngl").write_text(FIRST["from_bionetgen.bngl"], encoding="utf-8")
    subprocess.run(["bionetgen", "run", "-i", "pair.bngl", "-o", "."], cwd=tmp_path, check=True)
    (tmp_path / "ours.net").write_text(FIRST["pair.net"], encoding="utf-8")
    made, shown = read(tmp_path / "pair.net").network, read(tmp_path / "ours.net").network
    assert made.species == shown.species
    assert (made.stoichiometry == shown.stoichiometry).all()


def test_prism_of_others(tmp_path):
    """Both models of the page give the same answers to all digits that it shows."""
    (tmp_path / "pair.sm").write_text(FIRST["from_prism.sm"], encoding="utf-8")
    (tmp_path / "pair.rxn").write_text(FIRST["pair.rxn"], encoding="utf-8")
    theirs, ours = read_prism(tmp_path / "pair.sm"), Chain.of(read(tmp_path / "pair.rxn"))
    for one, other in (
        ("P=? [ F<=60 ab>=8 ]", "P=? [ F<=60 AB >= 8 ]"),
        ("S=? [ ab>=8 ]", "S=? [ AB >= 8 ]"),
        ('R{"complexes"}=? [ I=60 ]', 'R{"AB"}=? [ I=60 ]'),
    ):
        assert ask(theirs, one).value == pytest.approx(ask(ours, other).value, rel=1e-11)
    stormpy = pytest.importorskip("stormpy", reason="Storm is not installed; our reader takes the file")
    model = stormpy.build_model(stormpy.parse_prism_program(str(tmp_path / "pair.sm"), prism_compatibility=True))
    assert model.nr_states == 11


def msm_log_likelihood(visits, q, death):
    """As in Jackson (2011), eq. 4 and 5: transition probabilities, and for exact deaths the density of entering."""
    total = 0.0
    for _, person in visits.groupby("subject"):
        for before, after in zip(person.itertuples(), person.iloc[1:].itertuples(), strict=False):
            row = expm(q * (after.years - before.years))[before.state - 1]
            others = [state for state in range(len(q)) if state != death]
            total += math.log(row[others] @ q[others, death] if after.state - 1 == death else row[after.state - 1])
    return total


def test_the_likelihood_of_msm():
    """The page's figures: -2 log-likelihood, and state occupation after five years, at the estimates."""
    visits = pd.read_csv(io.StringIO(FIRST["visits.csv"]))
    onset, recovery, death, other = 0.3720332293, 0.1483236914, 0.1971477768, 0.02
    q = np.array([[0, onset, other], [recovery, 0, death], [0, 0, 0]])
    np.fill_diagonal(q, -q.sum(axis=1))
    page = (FOLDER / "msm.md").read_text("utf-8")
    best = -2 * msm_log_likelihood(visits, q, 2)
    assert f"({best:.6f}, True)" in page
    assert f"[{', '.join(f'{p:.4f}' for p in expm(5 * q)[0])}]" in page
    for row, column in ((0, 1), (1, 0), (1, 2)):  # the control: any other value is worse
        for factor in (0.9, 1.1):
            moved = q.copy()
            moved[row, column] *= factor
            np.fill_diagonal(moved, 0)
            np.fill_diagonal(moved, -moved.sum(axis=1))
            assert -2 * msm_log_likelihood(visits, moved, 2) > best


def test_the_likelihood_of_lifelines():
    patients = pd.read_csv(io.StringIO(FIRST["patients.csv"]))
    died, days = int(patients["died"].sum()), float(patients["days"].sum())
    hazard = died / days
    page = (FOLDER / "lifelines.md").read_text("utf-8")
    assert f"({died * math.log(hazard) - died:.4f}, {hazard:.4f})" in page
    assert f"\n{math.log(2) / hazard:.2f}\n" in page
    events = pd.read_csv(io.StringIO(FIRST["events.csv"]))
    ends = events[events["channel"] == "end"]["time"].tolist()
    assert ends == patients["days"].tolist()
    assert (events["channel"] == "die").sum() == died
