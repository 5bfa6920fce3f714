"""A duration chosen from the rates: what happens is seen in it, whatever the scale of time, and it is said why."""

import re
from dataclasses import replace

import numpy as np
import pytest
from command_line import run_here
from numpy.testing import assert_allclose

from kinetics import Model, Network, predict
from kinetics.network.laws import Event
from kinetics.predicting import mean_field
from kinetics.predicting.duration import chosen_duration, rounded

PAIR = "bind: A + B <-> AB, 0.01, 0.1\nA = 20\nB = 10\n"
CYCLE = "X -> 2 X, 1\nX + Y -> 2 Y, 0.005\nY -> 0, 0.6"


def chosen(text, **counts):
    return chosen_duration(Model(Network.from_text(text), counts or None), 2000.0)


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1.0, 1e3, 1e12])
def test_a_decay_is_seen_until_it_is_over_at_any_scale(scale):
    found = chosen(f"A -> B, {scale!r}", A=100)
    assert found.value == pytest.approx(5 / scale)
    settled = float(found.why.removeprefix("rate equations settle by "))
    assert np.log(100) <= settled * scale < 1.2 * np.log(100)


@pytest.mark.parametrize(
    ("text", "counts", "value", "why"),
    [
        (PAIR, {}, 20, "settle by"),
        ("0 -> A, 5\nA -> 0, 0.01", {}, 500, "settle by"),  # from nothing to 500 is no growth without bound
        ("0 -> A, 5", {}, 20, "grow without bound, to 100 copies at 20"),
        ("A -> 2 A, 1", {"A": 10}, 2, "grow without bound, to 100 copies at 2.3"),
        ("2 A -> 3 A, 1", {"A": 10}, 0.1, "grow without bound, to 100 copies at 0.18"),
        (CYCLE, {"X": 100, "Y": 100}, 100, "cycle with a period of about 8.4"),
        ("A <-> B, 1, 1", {"A": 50, "B": 50}, 5, "at rest; the slowest relaxation takes 0.5"),
        ("A <-> B, 1, 1\nB -> C, 1e-5", {"A": 100}, 1000, "a run has 1e+05 events by then; rate equations settle"),
        ("A <-> B, 1, 1\nB -> C, 1e-9", {"A": 100}, 1000, "a run has 1e+05 events by then"),
        ("A -> B, 1", {"A": 10**6}, 5, "settle by"),  # 1e6 events are those of the copies themselves
        ("A -> B, 0", {"A": 10}, 2000, "default, as nothing can happen at the start"),
        ("A -> B, 1", {}, 2000, "default, as nothing can happen at the start"),
        ("0 -> A, 1 + sin(t)", {}, 2000, "default, as a law depends on the time"),
        ("A -> B, floor(A / 2)", {"A": 9}, 2000, "default, as the law of channel 'r1', .* jumps"),
        ("A -> B, 2.5 + 0 * A", {"A": 10}, 2000, "default, as rate equations take 'A' below 0"),
        ("A -> B, 1e300", {"A": 10}, 2000, "default, as rate equations cannot be followed"),
    ],
)
def test_what_happens_sets_it(text, counts, value, why):
    found = chosen(text, **counts)
    assert found.value == pytest.approx(value)
    assert re.search(why.replace("+", "[+]"), found.why), found.why


def test_what_is_not_followed_to_its_end_is_no_cycle():
    """Noise of the integration about rest is none; here evaluations end before a long chain is filled."""
    chain = "\n".join(f"S{i} <-> S{i + 1}, 1.5, 1" for i in range(290))
    found = chosen(chain, S0=1000)
    assert "cycle" not in found.why
    assert found.value >= 20.0
    many = "\n".join(f"S{i} -> S{i + 1}, 1" for i in range(300))
    assert chosen(many, S0=10).why == "default, as over 300 species are too many for rate equations"


def test_events_leave_the_default():
    network = replace(Network.from_text("A -> 0, 1"), events=(Event("dose", "t >= 2", {"A": "A + 5"}),))
    found = chosen_duration(Model(network, {"A": 5}), 2000.0)
    assert found.value == 2000.0
    assert "event 'dose' sets counts" in found.why


def test_rate_equations_have_settled_by_then(monkeypatch):
    """For networks drawn at random; at a fiftieth of the time they have not, which is the control."""
    monkeypatch.setattr(mean_field, "FEW_STATES", 1)  # else each is solved exactly too, for up to two seconds
    rng = np.random.default_rng(5)
    early = []
    for _ in range(20):
        k = 10 ** rng.uniform(-3, 3, size=5)
        text = f"A <-> B, {k[0]}, {k[1]}\nB <-> C, {k[2]}, {k[3]}\n2 C -> C, {k[4]}"
        model = Model(Network.from_text(text), {"A": 12})
        end, why = chosen_duration(model, 2000.0)
        if not why.startswith("rate equations settle"):
            assert "events by then" in why
            continue
        mean = predict(model, times=[0.0, end / 50, end, 2 * end], method="mean-field").mean
        span = np.ptp(mean, axis=0).max()
        assert np.abs(mean[2] - mean[3]).max() <= 0.02 * span
        early.append(np.abs(mean[1] - mean[3]).max() / span)
    assert len(early) >= 6
    assert np.median(early) > 0.05


def test_the_command_says_it_and_keeps_to_what_is_given(tmp_path):
    (tmp_path / "pair.rxn").write_text(PAIR + "time unit: s\n", encoding="utf-8")
    told = run_here("predict", "pair.rxn", "--runs", 20, "--json", cwd=tmp_path).json
    assert told["duration"]["value"] == told["times"][-1] == 20.0
    assert told["duration"]["why"].startswith("rate equations settle by 15.")
    assert told["duration"]["why"].endswith(" s")
    out = run_here("predict", "pair.rxn", "--runs", 20, cwd=tmp_path).out
    assert "duration 20 s chosen, as none was given: rate equations settle by 15." in out
    for given in (["--duration", 7], ["--times", 7]):
        told = run_here("predict", "pair.rxn", "--runs", 20, *given, "--json", cwd=tmp_path).json
        assert (told["duration"], told["times"][-1]) == (None, 7.0)
    faster = run_here("predict", "pair.rxn", "--runs", 20, "--initial", "A=2000,B=1000", "--json", cwd=tmp_path).json
    assert faster["times"][-1] < 5.0


def test_a_rule_book_keeps_2000_tu(tmp_path):
    book = ("predict", "line4", "--rates", "table3", "--cubes", 4, "--runs", 5)
    told = run_here(*book, "--json", cwd=tmp_path).json
    assert (told["duration"], told["times"][-1]) == (None, 2000.0)


def test_rounded_to_1_2_or_5():
    assert [rounded(x, True) for x in (1.0, 1.1, 2.1, 5.1, 0.03)] == [1.0, 2.0, 5.0, 10.0, 0.05]
    assert [rounded(x, False) for x in (1.0, 1.9, 4.9, 9.9, 0.03)] == [1.0, 1.0, 2.0, 5.0, 0.02]
    assert_allclose(rounded(3e-200, True), 5e-200)
