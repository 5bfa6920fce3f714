"""The figures of docs/trust.md are those that the commands have kept; and these hold what the project asks of them."""

import pytest

from tests.helpers.fraction_campaign import SEED, run
from tests.mutation.__main__ import FLOOR, rooms, stored
from tests.results.trust_page import CANARIES, FAULTS, FUZZED, PAGE, told, written


def test_the_block_is_what_is_kept():
    text = PAGE.read_text("utf-8")
    assert written(text) == text
    with pytest.raises(ValueError, match="expected one block"):
        written("")


def test_nothing_was_lost_and_every_control_was_caught():
    kept = told(FAULTS)
    assert len(kept["campaigns"]) == 11
    assert all(one["tries"] and not one["losses"] for one in kept["campaigns"].values())
    assert all(one["caught"] for one in kept["controls"].values())


def test_no_input_does_harm():
    kept = told(FUZZED)
    assert kept["failures"] == []
    assert sum(kept["counts"].values()) >= kept["inputs"] - len(kept["mended"])
    for kind in {name.split()[0] for name in kept["counts"]}:
        read, refused = (kept["counts"].get(f"{kind} {outcome}", 0) for outcome in ("read", "refused"))
        assert min(read, refused) > (read + refused) / 16
    hostile = told(CANARIES)
    assert hostile["failures"] == []
    assert sum(hostile["counts"].values()) == hostile["inputs"] >= 20_000


@pytest.mark.parametrize("room", rooms().values(), ids=lambda room: room.name)
def test_every_room_that_was_judged_is_above_the_floor(room):
    score = stored(room.name)
    if score is None:
        pytest.skip("not judged yet")
    assert score.share >= FLOOR
    assert len(score.verdicts) >= 10
    accepted = {f"{one.place} | {one.change}" for one in score.verdicts if one.fate == "accepted"}
    assert accepted <= room.accepted.keys()


def test_limits_hold_exact_fractions():
    """Twenty chains of the campaign; the control: answers by LU in doubles, which the limits do not all hold."""
    kept = run(20, SEED)
    assert kept["proven"] == kept["limits"] == 60
    assert kept["outside"] == 0
    assert kept["widest"] < 1e-12
    assert kept["doubles_outside"] > 0
