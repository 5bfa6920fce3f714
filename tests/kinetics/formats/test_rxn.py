"""Files of reactions: parameters, counts and observables come back by name, and the commands take other values."""

import re

import pytest
from click.testing import CliRunner
from matplotlib.figure import Figure
from numpy.testing import assert_allclose, assert_array_equal

from kinetics import Direct, simulate
from kinetics.formats import read, write
from wellmixed import main

TEXT = """time unit: s
A + B <-> AB, k1, k2
AB -> AB + P, v * AB / (K + AB)
k1 = 1e-2
k2 = 10 * k1
v = 2
K = 5
A = 4 * K
B = 7
observable: total = A + 2 * AB
"""


def model_at(folder, text=TEXT):
    path = folder / "model.rxn"
    path.write_text(text, encoding="utf-8")
    return read(path)


def test_parameters_come_back_by_name(tmp_path):
    """What is written has the formulas, so that other values of the parameters mean the same in both."""
    model = model_at(tmp_path)
    write(model, tmp_path / "again.rxn")
    again = read(tmp_path / "again.rxn")
    assert again.network.parameters == model.network.parameters
    assert again.network.time_unit == "s"
    assert_array_equal(model.initial, [20, 7, 0, 0])
    for values in ({}, {"k1": 3.0, "K": 2.0}):
        one, other = (each.with_parameters(**values) for each in (model, again))
        assert_array_equal(one.initial, other.initial)
        assert_array_equal(one.network.propensities([3, 4, 5, 6]), other.network.propensities([3, 4, 5, 6]))
    assert one.network.propensities([3, 4, 5, 6]).tolist() == [36.0, 150.0, 10 / 7]
    assert one.initial.tolist() == [8, 7, 0, 0]
    assert one.observables == {"total": {"A": 1.0, "AB": 2.0}}


def test_amounts_take_a_scale_with_their_parameters(tmp_path):
    """The rate equations at ten copies to a unit, also with another value of each parameter."""
    text = TEXT.replace("B = 7", "B = 0.25 * K")
    with pytest.raises(ValueError, match=r"'B' starts from 1\.25"):
        model_at(tmp_path, text)
    chosen = {"k1": 0.3, "K": 6.0}
    unit = read(tmp_path / "model.rxn", 1e6).with_parameters(**chosen)
    large = read(tmp_path / "model.rxn", 4e6).with_parameters(**chosen)
    assert_array_equal(unit.initial, [24e6, 1.5e6, 0, 0])
    assert_array_equal(large.initial, 4 * unit.initial)
    state = unit.initial.copy()
    state[2] = 10**6
    assert_allclose(large.network.propensities(4 * state), 4 * unit.network.propensities(state), rtol=1e-12)


def test_what_is_not_read_names_file_line_and_word(tmp_path):
    for text, why in (
        (TEXT + "observable: square = A * A\n", "'square' is A . A; expected a sum of counts"),
        ("A -> B", "line 1, "),
    ):
        with pytest.raises(ValueError, match=why) as told:
            model_at(tmp_path, text)
        assert "model.rxn" in str(told.value)


def run(*words):
    return CliRunner().invoke(main, [str(word) for word in words])


def test_commands_take_other_values(tmp_path):
    """Predictions, passage times and answers are those of the text with the other number in it."""
    model_at(tmp_path, TEXT.replace("AB -> AB + P, v * AB / (K + AB)\n", "").replace("v = 2\n", ""))
    file, other = tmp_path / "model.rxn", tmp_path / "other.rxn"
    other.write_text(file.read_text().replace("1e-2", "0.05"))
    questions = {
        "predict": ["--times", 3, "--method", "exact"],
        "passage": ["--species", "AB", "--copies", 3],
        "ask": ["P=? [ F<=0.5 AB >= 3 ]"],
    }
    for command, words in questions.items():
        found, expected, unlike = (
            re.findall(r"[0-9.]+(?:e-?[0-9]+)?", re.sub(r".*(CPU|chosen).*", "", run(command, *each, *words).output))
            for each in ([file, "--set", "k1=0.05"], [other], [file])
        )
        assert found == expected != unlike, command
        assert len(found) > 1
    for words, why in (
        ([file, "--set", "k3=1"], "unknown parameter 'k3' (did you mean k2 or k1?)"),
        ([file, "--set", "k1"], "--set k1; expected a name and a number"),
        (["line4", "--rates", "table3", "--cubes", 6, "--set", "k1=1"], "is a rule book, whose rates"),
        (["model.cps"], "model.cps ends in .cps, which is not read; a network file ends in .net"),
    ):
        told = run("predict", *words)
        assert told.exit_code == 2
        assert why in " ".join(told.output.split()), told.output


def test_the_unit_of_time_is_the_models_own(tmp_path):
    """Tables, axes and words say it; nothing is said where the file states none."""
    text = TEXT.replace("AB -> AB + P, v * AB / (K + AB)\n", "").replace("v = 2\n", "")
    for unit in ("s", ""):
        model = model_at(tmp_path, text if unit else text.removeprefix("time unit: s\n"))
        file, shown = tmp_path / "model.rxn", f" ({unit})" if unit else ""
        assert f"k{f' (1/{unit})' if unit else ''}\n" in run("rules", "derive", file).output
        times = ["--times", 1, "--method", "exact"]
        assert run("predict", file, *times).output.startswith(f"time{shown} ")
        assert run("predict", file, *times, "--show", "total").output.startswith(f"time{shown} ")
        passage = run("passage", file, "--species", "AB", "--copies", 3).output
        assert f"quantiles{shown}: " in passage
        assert re.search(rf"mean [0-9.e-]+{' s' if unit else ''}, sd", passage)
        ax = Figure().add_subplot()
        simulate(model.network, Direct(), model.initial, [0.0, 1.0], runs=3, seed=1).plot(ax)
        assert ax.get_xlabel() == f"time{shown}"
