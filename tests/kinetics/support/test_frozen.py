"""Records that put their fields into a checked form stay as they were built."""

from dataclasses import FrozenInstanceError, fields

import numpy as np
import pytest

from calibration import Exposure
from kinetics import Chain, Ensemble, JumpPath, Model, Network, Tank
from kinetics.assembly import RuleBook, derive
from kinetics.network.laws import Event, Expression
from kinetics.networkfree.growth import Growth
from mechsim import RunSpec, Scene

DECAY = Network.from_text("decay: A -> 0, 1")
LINE, NONE = RuleBook.load("line4"), np.zeros((0, 2), int)
RECORDS = [
    DECAY,
    Model(DECAY, {"A": 2}),
    Tank((1, 2, 3)),
    Expression("k * A", {"k": 1.0}),
    Expression("k * A", {"k": 1.0}).with_numbers(),
    Event("dose", "t > 1", {"A": 5}),
    Chain([[0.0, 1.0], [2.0, 0.0]], initial=0),
    JumpPath(DECAY, {"A": 2}, times=[0.5], channels=[0], end=3.0),
    Ensemble(DECAY, [1.0], np.array([[[4]], [[2]]])),
    Exposure(DECAY, [1], [2.0]),
    Growth(LINE, (derive(LINE).structures["monomer"],), [3], [], NONE, NONE, end=1.0, draws=0),
    RunSpec(Scene.load("line4"), {"monomer": 4}, duration=1.0, seed=1, run=0),
]


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: type(record).__name__)
def test_a_checked_record_is_immutable(record):
    for each in fields(record):
        value = getattr(record, each.name)
        with pytest.raises(FrozenInstanceError):
            setattr(record, each.name, value)
        assert not isinstance(value, np.ndarray) or not value.flags.writeable
