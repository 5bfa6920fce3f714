"""Results have one face: what a prediction shows of them needs no test of their kind."""

import ast
import inspect

import numpy as np
import pytest

import kinetics.commands.predict
import kinetics.predicting.page
import kinetics.predicting.pictures
from kinetics import Model, Network, predict
from kinetics.predicting.counts_over_time import CountsOverTime

MODEL = Model(Network.from_text("A + B <-> AB, 0.01, 0.1"), {"A": 20, "B": 10})
MEMBERS = [name for name in vars(CountsOverTime) if not name.startswith("_")]


@pytest.fixture(scope="module", params=["ssa", "transient", "fsp", "mean-field", "1%"])
def made(request):
    return predict(MODEL, times=[0.0, 5.0], method=request.param)


def test_each_result_has_every_member_with_arrays_of_one_shape(made):
    for name in MEMBERS:
        assert hasattr(made.result, name)
    assert len(MEMBERS) == 17
    for table in (made.mean, made.sd, made.standard_error, *made.result.columns(made.standard_error).values()):
        assert table.shape == (2, 3)
    bands, field = made.result.bands(), made.result.approximate()
    assert bands.middle.shape == bands.low.shape == bands.high.shape == (2, 3)
    assert (bands.low <= bands.middle + 1e-9).all()
    assert (field is None) == (made.approximation is None) == (made.method != "mean-field")
    assert (made.runs is None) == (not made.standard_error.any())
    assert made.result.meaning in made.headline
    assert np.isnan(made.error) == (made.approximation is not None)


@pytest.mark.parametrize("module", [kinetics.commands.predict, kinetics.predicting.page, kinetics.predicting.pictures])
def test_nothing_that_shows_a_prediction_asks_which_result_it_has(module):
    calls = [node for node in ast.walk(ast.parse(inspect.getsource(module))) if isinstance(node, ast.Call)]
    assert "isinstance" not in {ast.unparse(call.func) for call in calls}
