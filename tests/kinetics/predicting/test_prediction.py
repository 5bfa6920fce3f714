import numpy as np
import pytest
from known_systems import bare_line, decay, line
from matplotlib.figure import Figure
from numpy.testing import assert_allclose, assert_array_equal

from kinetics import Direct, Transient, first_passage, predict, simulate, solve
from kinetics.predicting.observables import Observables
from kinetics.predicting.prediction import evidence_notes, predict_passage
from kinetics.rates import ChannelRate, Convention, Rates
from kinetics.runs import statistics
from kinetics.sampling import streamed

TIMES = [50.0, 400.0]
START = [30, 0, 0, 0]


def measured(events, rate=None):
    """Table III as if it had been measured by so many events in every channel."""
    table = Rates.load("table3")
    channels = {
        name: ChannelRate(rate=given.rate, ways=given.ways, events=events, exposure=events / given.rate)
        for name, given in table.channels.items()
    }
    return Rates(convention=table.convention, channels=channels)


def test_without_evidence_there_is_no_interval_and_the_reader_is_told():
    made = predict(bare_line(), Rates.load("table3"), START, TIMES, runs=50, seed=1)
    assert made.low is None
    assert made.high is None
    assert made.notes == ("no interval: these rates come without evidence (events and exposure)",)
    assert list(made.to_dataframe().columns) == ["time", "species", "mean", "sd", "standard_error"]


def test_progress_is_reported_or_not_with_the_same_result():
    lines = []
    one, two = (
        predict(bare_line(), measured(50), START, TIMES, runs=20, seed=1, draws=3, progress=progress)
        for progress in (None, lines.append)
    )
    assert lines[-1] == "3 of 3 draws of the rates"
    assert_array_equal(one.mean, two.mean)
    assert_array_equal(one.low, two.low)


def test_mean_and_sd_are_those_of_the_method():
    rates = Rates.load("table3")
    sampled = predict(bare_line(), rates, START, TIMES, Direct(), runs=200, seed=4)
    ensemble = simulate(line(), Direct(), START, TIMES, runs=200, seed=4)
    assert_array_equal(sampled.mean, ensemble.mean())
    assert_allclose(sampled.standard_error, ensemble.sd() / np.sqrt(200), rtol=1e-14)
    assert (sampled.method, sampled.error) == ("ssa", 0.0)
    exact = predict(bare_line(), rates, START, TIMES, Transient())
    assert_array_equal(exact.sd, solve(line(), Transient(), START, TIMES).sd())
    assert exact.method == "exact"
    assert 0 < exact.error < 1e-11
    assert not exact.standard_error.any()
    assert np.all(abs(sampled.mean - exact.mean) < 4.9 * sampled.standard_error + 1e-12)


def test_interval_of_a_decay_in_closed_form():
    # Mean 1000 exp(-k) with k from Gamma(100.5, 100): the quantiles follow from those of k.
    rates = Rates(
        convention=Convention(combinations="distinct"),
        channels={"decay": ChannelRate(rate=1.0, ways=1, events=100, exposure=100.0)},
    )
    made = predict(decay(), rates, [1000], [1.0], seed=2, draws=1000)
    k = np.random.default_rng(1).gamma(100.5, 0.01, size=200_000)
    low, high = 1000 * np.exp(-np.quantile(k, [0.975, 0.025]))
    # The quantile of 1000 draws has a standard error of about 0.065 of the interval's half-width per side.
    half = (high - low) / 2
    assert_allclose([made.low[0, 0], made.high[0, 0]], [low, high], atol=4.9 * 0.065 * half)


def test_interval_does_not_widen_with_monte_carlo_noise():
    # With a million events the rates are known, and what is left among the draws is only sampling noise.
    made = predict(bare_line(), measured(1_000_000), START, TIMES, seed=3)
    noise = made.sd / np.sqrt(100)
    assert np.all(made.high - made.low < noise * 4 * 0.6)
    loose = predict(bare_line(), measured(10), START, TIMES, seed=3)
    assert np.all(loose.high - loose.low > 3 * (made.high - made.low))
    assert np.all(loose.low < loose.mean)
    assert np.all(loose.mean < loose.high)


def test_the_same_seed_gives_the_same_prediction():
    one, other = (predict(bare_line(), measured(20), START, TIMES, seed=5, draws=20, threads=n) for n in (1, 2))
    assert_array_equal(one.mean, other.mean)
    assert_array_equal(one.low, other.low)
    assert np.any(predict(bare_line(), measured(20), START, TIMES, seed=6, draws=20).low != one.low)


def test_channels_without_evidence_are_named():
    rates = measured(20)
    channels = rates.channels | {"4->2+2": ChannelRate(rate=1e-5, ways=1)}
    mixed = rates.model_copy(update={"channels": channels})
    assert evidence_notes(mixed) == ("the interval leaves out 4->2+2: taken as known, because without evidence",)
    assert evidence_notes(rates) == ()


def test_order_of_channels_in_the_file_does_not_matter():
    rates = measured(1_000_000)
    turned = rates.model_copy(update={"channels": dict(reversed(rates.channels.items()))})
    (_, one), (_, other) = (predict_passage(bare_line(), r, START, "quadmer", draws=50) for r in (rates, turned))
    assert_allclose(one, other, rtol=5e-3)


def test_passage_with_its_interval():
    law, interval = predict_passage(bare_line(), measured(50), START, "quadmer", seed=1)
    assert law.mean == first_passage(line(), START, "quadmer").mean
    assert interval[0] < law.mean < interval[1]
    assert 0.1 < (interval[1] - interval[0]) / law.mean < 0.6
    _, none = predict_passage(bare_line(), Rates.load("table3"), START, "quadmer")
    assert none is None


def test_interrupted_runs_give_a_prediction_that_says_so(monkeypatch):
    monkeypatch.setattr(streamed, "BLOCK_BYTES", 50 * 8 * 4 * 2)
    simulate_runs = Direct.simulate

    def interrupted(method, *arguments, first_run=0, **options):
        if first_run >= 100:
            raise KeyboardInterrupt
        return simulate_runs(method, *arguments, first_run=first_run, **options)

    monkeypatch.setattr(Direct, "simulate", interrupted)
    made = predict(bare_line(), measured(50), START, TIMES, Direct(), runs=400, seed=1)
    assert (made.runs, made.low, made.is_complete) == (100, None, False)
    assert "interrupted: 100 of 400 runs were made, no interval" in made.notes


def test_interrupted_draws_give_the_interval_of_those_that_were_made():
    lines = []

    def interrupt(text):
        lines.append(text)
        if text.startswith("30 of"):
            raise KeyboardInterrupt

    made = predict(bare_line(), measured(50), START, TIMES, runs=100, seed=1, progress=interrupt)
    assert lines[0] == "100 of 100 runs"
    assert not made.is_complete
    assert "interrupted: 30 of 200 draws of the rates were made" in made.notes
    whole = predict(bare_line(), measured(50), START, TIMES, runs=100, seed=1)
    assert whole.is_complete
    assert_array_equal(made.mean, whole.mean)
    assert np.all((made.low < whole.high) & (whole.low < made.high))


def test_counts_of_a_wide_range_tell_how_well_their_band_is_known(monkeypatch):
    exact = predict(decay(), None, [1000], [0.7], runs=200)
    assert not any("copies" in note for note in exact.notes)
    monkeypatch.setattr(statistics, "MOST_BINS", 16)
    rounded = predict(decay(), None, [1000], [0.7], runs=200)
    assert "the middle 95 % of the runs is known to 4 copies" in rounded.notes
    assert_array_equal(rounded.sd, exact.sd)


def test_plot_and_table():
    made = predict(bare_line(), measured(50), START, TIMES, runs=50, draws=10)
    ax = Figure().add_subplot()
    assert made.plot(ax) is ax
    assert len(ax.get_lines()) == 4 + 2 * 4
    assert list(made.to_dataframe().columns)[-2:] == ["low", "high"]


def test_bad_input():
    with pytest.raises(ValueError, match="another network"):
        predict(decay(), Rates.load("table3"), [1], TIMES)
    with pytest.raises(ValueError, match="draws = 1"):
        predict(bare_line(), measured(50), START, TIMES, draws=1)


@pytest.mark.parametrize("change", [{"runs": 0}, {"runs": 2.5}, {"runs": True}, {"threads": 0}, {"first_run": -1}])
def test_sampled_observables_are_asked_for_with_whole_numbers(change):
    """As every sampling method."""
    sums = Observables.of(line(), {"first": {line().species[0]: 1}})
    sampling = sums.sampling(Direct(), line())
    ((name, value),) = change.items()
    with pytest.raises(ValueError, match=f"{name} = {value}; expected a whole number"):
        sampling.simulate(sums.network, START, TIMES, **change)
    with pytest.raises(ValueError, match="times is empty"):
        sampling.simulate(sums.network, START, [])
    assert sampling.simulate(sums.network, START, TIMES, runs=2).counts.shape == (2, 2, 1)
