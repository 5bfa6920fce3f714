"""Chains on which elimination and sparse factors would take too long are refused before either is begun."""

import pytest

from kinetics import first_passage
from kinetics.markov.passage import elimination
from kinetics.markov.passage.elimination import TooLargeError
from tests.helpers.known_systems import switch


def test_what_would_fill_up_is_refused(monkeypatch):
    known = first_passage(switch(1.0, 2.0), [30, 0], "B", 20)
    monkeypatch.setattr(elimination, "MAX_WORK", 0.0)
    factored = first_passage(switch(1.0, 2.0), [30, 0], "B", 20)  # the control: factors do it
    assert factored.mean == pytest.approx(known.mean, rel=1e-12)
    monkeypatch.setattr(elimination, "MAX_FACTORED", 0.0)
    with pytest.raises(TooLargeError, match="too many to eliminate") as caught:
        first_passage(switch(1.0, 2.0), [30, 0], "B", 20)
    assert caught.value.work >= 20.0
