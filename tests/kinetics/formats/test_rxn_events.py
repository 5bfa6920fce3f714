"""Files of reactions with events and constant species: written again, and by way of SBML and Antimony."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from kinetics import Model, simulate
from kinetics.formats import FORMATS, proving, read, write
from kinetics.formats.rxn import ReactionLines
from kinetics.network import Network
from kinetics.network.laws import Event
from tests.helpers.fuzzed_texts import ReactionTexts

TEXT = """time unit: min
A + S -> B, k
2 B -> A, 0.25
const S = 10
k = 0.01
A = 40
n = 5
at t = 2: A = A + 100
'a dose': at t = 0.5 * n, priority 2: A = floor(A / 2), B = B + n
when B > 30, delay 0.125, also at 0: A = min(A, 7), B = B - 10
species: when B % 7 < 3 and not (A > 40 or t < 1), from trigger, not persistent: A = (B > 3) + sqrt(abs(A - A)) + 4
observable: total = A + 2 * B
"""
TIMES = np.linspace(0, 4, 9)


def model_at(folder, text=TEXT):
    path = folder / "model.rxn"
    path.write_text(text.replace("\nspecies:", "\n'species':"), encoding="utf-8")
    return read(path)


def runs(model):
    return simulate(model.network, "general", model.initial, TIMES, runs=20, seed=7).counts


def test_a_written_file_is_the_same_model(tmp_path):
    """Also with other parameters; and what is written from it is the same text."""
    model = model_at(tmp_path)
    write(model, tmp_path / "again.rxn")
    again = read(tmp_path / "again.rxn")
    assert again.digest == model.digest
    assert again.network.events == model.network.events
    assert again.network.parameters == model.network.parameters == {"k": 0.01, "n": 5.0}
    assert_array_equal(runs(again), runs(model))
    one, other = (each.with_parameters(n=3.0) for each in (model, again))
    assert one.digest == other.digest != model.digest
    assert ReactionLines().text(again) == Path(tmp_path, "again.rxn").read_text(encoding="utf-8")


def test_sbml_and_antimony_keep_events_and_constants(tmp_path):
    """The same runs under the same seed, by both."""
    model = model_at(tmp_path)
    write(model, tmp_path / "model.xml")
    found = [read(tmp_path / "model.xml")]
    antimony = pytest.importorskip("antimony")
    assert antimony.loadSBMLFile(str(tmp_path / "model.xml")) >= 0
    text = antimony.getAntimonyString(antimony.getMainModuleName())
    (tmp_path / "model.ant").write_text(text, encoding="utf-8")
    found.append(read(tmp_path / "model.ant"))
    expected = runs(model)
    assert len(np.unique(expected)) > 20
    for again in found:
        assert again.network.species == model.network.species
        assert [event.name for event in again.network.events][:3] == ["event_1", "a_dose", "event_3"]
        assert_array_equal(again.initial, model.initial)
        state = [17, 10, 23]
        assert_allclose(again.network.propensities(state, 0.0), model.network.propensities(state, 0.0), rtol=1e-12)
        assert_array_equal(runs(again), expected)
        assert (runs(again)[:, :, 1] == 10).all()
    other = model_at(tmp_path, TEXT.replace("% 7", "% 8"))
    assert not np.array_equal(runs(other), expected)


FAULTS = {  # what a faulty writer would write: in .rxn and in SBML
    "time": ("at t = 2:", "at t = 3:", "<cn> 2 </cn>", "<cn> 3 </cn>"),
    "new count": ("A = A + 100", "A = A + 101", "<cn> 100 </cn>", "<cn> 101 </cn>"),
    "delay": ("delay 0.125", "delay 0.126", "<cn> 0.125 </cn>", "<cn> 0.126 </cn>"),
    "priority": (", priority 2.0", "", "", ""),
    "at 0": (", also at 0", "", 'initialValue="false"', 'initialValue="true"'),
    "trigger": (", from trigger", "", 'useValuesFromTriggerTime="true"', 'useValuesFromTriggerTime="false"'),
    "persistent": (", not persistent", "", 'persistent="false"', 'persistent="true"'),
    "target": ("A = A + 100", "B = A + 100", 'eventAssignment variable="A"', 'eventAssignment variable="B"'),
    "another": ("A = A + 100", "A = A + 100, S = 3", "", ""),
    "missing": ("at t = 2: A = A + 100\n", "", "", ""),
    "comparison": ("B > 30", "B >= 30", "", ""),
    "logic": ("not (A > 40 or t < 1)", "not (A > 40 and t < 1)", "<or/>", "<and/>"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_faulty_writer_of_events_is_caught(fault, tmp_path):
    model = model_at(tmp_path)
    old, new, *in_sbml = FAULTS[fault]
    for kind, before, after in (("rxn", old, new), ("sbml", *in_sbml)):
        if before:
            made = next(each for each in FORMATS if each.name == kind)
            right = made.text(model)
            begin = right.index("<listOfEvents" if kind == "sbml" else "at t = 2")
            assert before in right[begin:]
            wrong = right[:begin] + right[begin:].replace(before, after, 1)
            proving.check_written(made, model, right, tmp_path / "m")
            with pytest.raises(ValueError, match=r"m is not written, because .*(event|read back)"):
                proving.check_written(made, model, wrong, tmp_path / "m")


def test_events_take_a_scale(tmp_path):
    """A new count of half a unit is five copies at ten to a unit, and refused where a unit is a copy."""
    path = tmp_path / "half.rxn"
    path.write_text("A -> B, 0\nA = 1.5\nat t = 1: A = 0.5", encoding="utf-8")
    assert simulate(read(path, 10).network, "auto", None, [0.0, 1.0], runs=1, seed=1)["A"].tolist() == [[15, 5]]
    with pytest.raises(ValueError, match=r"half\.rxn, line 3, column 15, .*0\.5 copies of 'A'"):
        read(path)


def test_a_formula_that_sbml_would_repeat_without_bound_is_refused(tmp_path):
    formula = "A"
    for _ in range(11):
        formula = f"max({formula}, {formula} + 1)"
    model = Model(Network.from_reactions({"r": ({"A": 1}, {})}, [1.0], events=[Event("e", "t > 1", {"A": formula})]))
    with pytest.raises(ValueError, match="has over 10000 parts in SBML; write it with fewer"):
        write(model, tmp_path / "m.xml")


def test_random_texts_are_the_same_model_once_written(tmp_path):
    """Those of the fuzzer that are read: the digest has rates, laws, counts and events."""
    counts = Counter()
    for number in range(200):
        path = tmp_path / "input.rxn"
        path.write_bytes(ReactionTexts(5, number).files()[path.name])
        try:
            with np.errstate(all="ignore"):
                model = read(path)
        except ValueError:
            counts["refused"] += 1
            continue
        try:
            write(model, tmp_path / "again.rxn")
        except ValueError as error:
            assert "too long for one line of text" in str(error)  # noqa: PT017
            counts["too long"] += 1
            continue
        assert read(tmp_path / "again.rxn").digest == model.digest, number
        counts["same"] += 1
        counts["with events"] += bool(model.network.events)
    assert counts["with events"] > 30
    assert counts["too long"] < 10


UNITS = """time unit: min
volume = 2 fL
bind: A + B -> C, k1
2 A -> D, 1e6 /M/s
D -> 0, v * D / (K + D)
k1 = 1e6 /M/s
v = 3 nM/min
K = 5 nM
A = 50 nM
B = 2 * c
c = 10 nM
at t = 30 s: A = A + c
"""


def test_units_are_numbers_once_written_and_are_noted(tmp_path):
    """The written file is the same model, with the parameters in their units; only the units are not written."""
    model = model_at(tmp_path, UNITS)
    assert model.notes == (
        "volume 2 fL: 1 nM is 1.20443 copies",
        "50 nM is 60.2214 copies, rounded to 60",
        "2 * c is 24.0886 copies, rounded to 24",
    )
    write(model, tmp_path / "again.rxn")
    again = read(tmp_path / "again.rxn")
    assert again.digest == model.digest
    one, other = (each.with_parameters(k1=2e6, c=20.0, v=1.0) for each in (model, again))
    assert one.digest == other.digest != model.digest
    assert one.initial.tolist() == [60, 48, 0, 0]
    with pytest.raises(
        ValueError, match=r"model\.rxn, its volume says how many copies .*leave out the copies per unit"
    ):
        read(tmp_path / "model.rxn", 10)


def test_rates_with_units_by_sbml(tmp_path):
    model = model_at(
        tmp_path,
        UNITS.replace("D -> 0, v * D / (K + D)\n", "D -> 0, v\n")
        .replace("K = 5 nM\n", "")
        .replace("3 nM/min", "3 /min"),
    )
    write(model, tmp_path / "model.xml")
    again = read(tmp_path / "model.xml")
    assert_array_equal(again.initial, [60, 24, 0, 0])
    nv = 6.02214076e23 * 2e-15
    expected = [60e6 / nv * 60 * 24, 60e6 / nv * 60 * 59, 3 * 7]
    for each in (model, again):
        assert_allclose(each.network.propensities([60, 24, 0, 7], 0.0), expected, rtol=1e-12)
    assert_array_equal(runs(again), runs(model))
