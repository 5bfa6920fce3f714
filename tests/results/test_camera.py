"""The page of results/camera says what its tables hold, and the tables what runs and likelihood give."""

import re

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import expm

from calibration.estimating.likelihood_fit import FALL, fit_parameters
from calibration.estimating.model_fit import fit_model
from kinetics.markov.panels import PanelData, PanelLikelihood, PanelRun
from kinetics.markov.transient.states import reachable
from kinetics.network import Model, Network
from kinetics.sampling import sample_path
from tests.results import camera_simulated
from tests.results.camera import LEAST_P, PAGE, coverage, enough, pooled_error, simulated, stored, written
from tests.results.camera_simulated import SETS, fit_events
from tests.results.camera_study import CURVE, EVERY, ROOT, curve_rows, kept, network, stored_runs, watched
from tests.results.frame_likelihood import FrameLikelihood, frames_of
from tests.results.studies import listed

PAIR = Network.from_text("A + B <-> AB, 0.02, 0.1")


def panels(found, every, pairs):
    columns = {name: {name: 1.0} for name in found.species}
    return PanelData(columns, [PanelRun(before, [every], [after]) for before, after in pairs])


# The page


def test_the_page_says_what_the_tables_hold():
    text = PAGE.read_text("utf-8")
    assert written(text) == text
    changed = re.sub(r"(?<=\d\.)\d", lambda digit: str((int(digit[0]) + 1) % 10), text)  # control
    assert written(changed) != changed
    with pytest.raises(ValueError, match="has not one block"):
        written("")


def test_the_numbers_outside_its_tables_are_those_of_the_runs():
    text = re.sub(r"<!-- camera: \w+ -->.*?<!-- end -->", "", PAGE.read_text("utf-8"), flags=re.DOTALL)
    facts = stored("facts.json")
    assert {fact["states"] for fact in facts.values()} == {1906}
    assert len(stored_runs()) == 150
    assert {round(path.end) for path in stored_runs()} == {500}
    for words in ("the 1,906 states of 60 cubes", "the 150 calibration runs", "of 500 tu each", "end at 400"):
        assert words in " ".join(text.split())
    assert [facts[str(every)]["window"] for every in EVERY] == [500, 500, 500, 400]


def test_what_the_page_concludes():
    """No bias: no p below 0.01 among eight, and coverage within 0.93 to 0.97 but for what counting allows.

    Frames of 1 tu do not see what is undone at once, which a Markov chain would hardly do: without it they agree.
    """
    facts = stored("facts.json")
    assert min(fact["p"] if every != "1" else fact["p_net"] for every, fact in facts.items()) > LEAST_P
    breaks = (
        stored("estimates.csv").query("every == 1 and channel.str.contains('.*->.*[+]', regex=True)")["events"].sum()
    )
    assert 0 < facts["1"]["undone"] < 0.05 * breaks
    for every in EVERY:
        assert pooled_error(every)[1] > 0.01
        share, error = coverage(every)
        assert 0.93 - 3 * error < share < 0.97 + 3 * error
    table = stored("estimates.csv")
    for every, fact in stored("facts.json").items():
        open_ended = table[(table["every"] == int(every)) & (table["low"] == 0.0)]["channel"]
        assert fact["notes"] == [f"the data do not bound {name} from below" for name in open_ended]
    assert set(stored("simulated.csv")["set"]) == set(range(1, SETS + 1))
    assert np.isfinite(simulated().drop(columns="channel").to_numpy(dtype=float)).all()


def test_the_documentation_says_the_same():
    text = " ".join((ROOT / "docs" / "your_data.md").read_text("utf-8").split())
    curve = stored("information.csv")
    overall = curve[curve["channel"] == "all"].set_index("every")["kept"]
    shares = [f"{100 * overall[every]:.0f} %" for every in EVERY]
    time, events = enough("all")
    assert f"Frames keep {listed(shares)} of the information on its eight rates" in text
    assert f"A frame every {time:.0f} tu, on average {events:.1f} events from frame to frame, keeps 90 %" in text


def test_less_is_kept_the_longer_the_time():
    curve = stored("information.csv").pivot(index="every", columns="channel", values="kept")
    assert list(curve.index) == list(CURVE)
    assert (curve.diff().iloc[1:].drop(index=250) < 0).all(axis=None)  # frames to 400 tu and to 500 are of other times
    assert ((curve > 0) & (curve < 1)).all(axis=None)


# The tables


def test_estimates_by_events_are_those_of_the_stored_runs():
    table = stored("estimates.csv")
    for every in (1, 200):
        found, here = fit_events(watched(every)), table[table["every"] == every]
        for name, column in (("value", "by_events"), ("low", "events_low"), ("high", "events_high")):
            np.testing.assert_allclose(getattr(found, name), here[column], rtol=1e-6)


def test_one_estimate_from_frames_is_found_again():
    """Every 200 tu, the quickest: no likelihood is larger nearby, and with the other rates held, that at the end of an
    interval is at most the profile's."""
    table = stored("estimates.csv")
    here = table[table["every"] == 200]
    asked = FrameLikelihood(network(), 200, frames_of(stored_runs(), 200)[0])
    logs = np.log(here["rate"].to_numpy())
    value, gradient = asked.scored(logs)
    fact = stored("facts.json")["200"]
    assert value == pytest.approx(fact["log_likelihood"], abs=1e-6)
    assert np.abs(gradient).max() < 1e-3
    assert (asked.copies.sum(), asked.copies.size) == (fact["frames"], fact["pairs"])
    for end in ("low", "high"):
        held = logs.copy()
        held[0] = np.log(here[end].iloc[0])
        assert asked.scored(held)[0] <= value - FALL + 1e-5


def test_the_information_of_one_interval_is_found_again():
    rates = fit_events(list(stored_runs())).value
    table = stored("information.csv")
    again = pd.DataFrame(curve_rows(500, rates))
    here = table[table["every"] == 500].reset_index(drop=True)
    pd.testing.assert_frame_equal(again, here, rtol=1e-4)


def test_a_simulated_data_set_is_found_again():
    table = stored("simulated.csv")
    here = table[(table["set"] == 7) & table["every"].isin((0, 50))]
    runs = camera_simulated.paths(7)
    asked = FrameLikelihood(runs[0].network, 50, frames_of(runs, 50)[0])
    again = fit_parameters(asked.scored, runs[0].network.channels, camera_simulated.TRUE, starts=1)
    for every, found in ((0, fit_events(runs)), (50, again)):
        for name, column in (("value", "rate"), ("low", "low"), ("high", "high")):
            np.testing.assert_allclose(getattr(found, name), here[here["every"] == every][column], rtol=1e-5)


# The likelihood of frames


def test_the_package_finds_no_larger_likelihood():
    """All frames, by the likelihood behind `calibrate --counts`."""
    facts = stored("facts.json")
    for every, found in stored("package.json").items():
        assert found["log_likelihood"] == pytest.approx(facts[every]["log_likelihood"], abs=1e-5)
        assert found["bounds_apart"] < 2e-6
        assert found["still_off"] < 1e-3


def test_value_and_gradient_are_those_of_the_package():
    """A sample of the stored frames, at rates off the estimates."""
    rates = fit_events(list(stored_runs())).value * 1.3
    for every in (1, 50):
        pairs = frames_of(stored_runs(), every)[0]
        chosen = pairs[np.random.default_rng(2).permutation(len(pairs))[:8]]
        value, gradient = FrameLikelihood(network(), every, chosen).scored(np.log(rates))
        model = Model.of(network().with_rates(rates))
        found = PanelLikelihood(model, panels(model.network, every, chosen)).scored({}, model.network.channels)
        assert value == pytest.approx(found.answer.value, rel=1e-12)
        np.testing.assert_allclose(gradient, found.gradient, rtol=1e-10, atol=1e-12)


def test_the_whole_fit_is_that_of_the_package():
    runs = [sample_path(PAIR, {"A": 6, "B": 4}, 40.0, seed=5, run=r) for r in range(4)]
    pairs = frames_of(runs, 4.0)[0]
    asked = FrameLikelihood(PAIR, 4.0, pairs)
    found = fit_parameters(asked.scored, PAIR.channels, PAIR.known_rates, starts=1)
    other = fit_model(PanelLikelihood(Model.of(PAIR), panels(PAIR, 4.0, pairs)), list(PAIR.channels), starts=1).fit
    for name in ("value", "low", "high"):
        np.testing.assert_allclose(getattr(found, name), getattr(other, name), rtol=1e-5)


def test_information_is_the_mean_square_of_the_score():
    """Of all frames that may follow one start, by the transition matrix as a whole."""
    rates = PAIR.known_rates
    asked = FrameLikelihood(PAIR, 4.0, np.array([[[6, 4, 0], [6, 4, 0]]]))
    found = asked.information(rates)
    space = reachable(PAIR, [6, 4, 0])

    def row(logs):
        generator = reachable(PAIR.with_rates(np.exp(logs)), [6, 4, 0]).generator().toarray()
        return expm(4.0 * generator)[0]

    at, step = np.log(rates), 1e-5
    slopes = np.array([(row(at + step * e) - row(at - step * e)) / (2 * step) for e in np.eye(2)])
    np.testing.assert_allclose(found.frames[0], (slopes / row(at)) @ slopes.T, rtol=1e-6)
    moments = np.linspace(0.0, 4.0, 2001)
    flow = np.array([expm(t * space.generator().toarray())[0] @ PAIR.propensities(space.states) for t in moments])
    np.testing.assert_allclose(found.events[0], np.trapezoid(flow, moments, axis=0), rtol=1e-5)
    assert (kept(found.frames, found.events) < 1.0).all()


def test_frames_beyond_reach_are_refused():
    with pytest.raises(ValueError, match="cannot be reached from the first one; take frames of one number of cubes"):
        FrameLikelihood(PAIR, 1.0, np.array([[[6, 4, 0], [6, 3, 0]]]))
