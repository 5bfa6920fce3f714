"""The first lines of other tools, on the page for their users: run where the tool is, else checked for their syntax.

There is no Julia among our tools, so that Catalyst's lines are only looked at by people.
"""

import contextlib
import importlib.util
import io
import re
import shutil
import subprocess
import warnings

import pytest
from pages import ROOT, blocks

from kinetics import Network
from kinetics.formats import read

THEIRS = {block.title: block.text for block in blocks(ROOT / "docs" / "coming_from.md") if block.title}
EXACT, SD = 5.932, 1.45  # copies of AB after 60 s; the page says so of ours


@pytest.mark.parametrize("tool", ["gillespy2", "tellurium"])
def test_python_of_others(tool):
    code = compile(THEIRS[f"from_{tool}.py"], f"from_{tool}.py", "exec")
    if importlib.util.find_spec(tool) is None:
        pytest.skip(f"{tool} is not installed; its lines compile")
    said = io.StringIO()
    with contextlib.redirect_stdout(said), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # their own
        exec(code, {})
    numbers = [float(word.strip("[],")) for word in said.getvalue().split() if word.strip("[],")]
    assert abs(numbers[-1] - EXACT) < 6 * SD  # AB stands last


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


def test_antimony_in_tellurium():
    (model,) = re.findall(r'"""(.*?)"""', THEIRS["from_tellurium.py"], re.DOTALL)
    antimony = pytest.importorskip("antimony")
    assert antimony.loadAntimonyString(model) >= 0, antimony.getLastError()
    assert antimony.loadAntimonyString(model.replace("->", "-")) == -1  # the control


def test_bngl_of_others(tmp_path):
    sections = [line.split(maxsplit=1)[1] for line in THEIRS["from_bionetgen.bngl"].splitlines() if "begin " in line]
    ends = [line.split(maxsplit=1)[1] for line in THEIRS["from_bionetgen.bngl"].splitlines() if "end " in line]
    assert sorted(sections) == sorted(ends)
    if not shutil.which("bionetgen"):
        pytest.skip("bionetgen is not installed; the sections of its lines are whole")
    (tmp_path / "pair.bngl").write_text(THEIRS["from_bionetgen.bngl"], encoding="utf-8")
    subprocess.run(["bionetgen", "run", "-i", "pair.bngl", "-o", "."], cwd=tmp_path, check=True)
    (tmp_path / "ours.net").write_text(THEIRS["pair.net"], encoding="utf-8")
    made, shown = read(tmp_path / "pair.net").network, read(tmp_path / "ours.net").network
    assert made.species == shown.species
    assert (made.stoichiometry == shown.stoichiometry).all()


def test_prism_of_others(tmp_path):
    text = THEIRS["from_prism.sm"]
    assert text.count("module pair") == text.count("endmodule") == 1
    stormpy = pytest.importorskip("stormpy", reason="neither PRISM nor Storm is installed; the module is closed")
    (tmp_path / "pair.sm").write_text(text, encoding="utf-8")
    model = stormpy.build_model(stormpy.parse_prism_program(str(tmp_path / "pair.sm"), prism_compatibility=True))
    assert model.nr_states == 11


def test_the_names_of_the_page_are_those_of_the_tests():
    assert {name for name in THEIRS if name.startswith("from_")} == {
        *("from_gillespy2.py", "from_tellurium.py", "from_bionetgen.bngl", "from_prism.sm", "from_catalyst.jl"),
    }
