import numpy as np
import pytest
from known_systems import bare_line, decay, line, switch
from matplotlib.figure import Figure
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import gamma

from kinetics import Direct, Model, Transient, first_passage, predict, simulate, solve
from kinetics.predicting import Job, over_draws, predict_job, predict_passage
from kinetics.predicting.observables import Observables
from kinetics.predicting.prediction import evidence_notes
from kinetics.rates import ChannelRate, Convention, Rates
from kinetics.sampling import run_source, statistics
from kinetics.sampling.run_source import RunSource

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
    made = predict(Model(bare_line(), START), Rates.load("table3"), TIMES, runs=50, seed=1)
    assert made.low is None
    assert made.high is None
    assert made.notes == ("no interval: these rates come without evidence (events and exposure)",)
    assert list(made.to_dataframe().columns) == ["time", "species", "mean", "sd", "standard_error"]


def test_progress_is_reported_or_not_with_the_same_result():
    lines = []
    one, two = (
        predict(Model(bare_line(), START), measured(50), TIMES, runs=20, seed=1, draws=3, progress=progress)
        for progress in (None, lines.append)
    )
    assert lines[-1] == "300 of 300 runs, under 3 of 3 draws of the rates"
    assert_array_equal(one.mean, two.mean)
    assert_array_equal(one.low, two.low)


def test_mean_and_sd_are_those_of_the_method():
    rates = Rates.load("table3")
    sampled = predict(Model(bare_line(), START), rates, TIMES, Direct(), runs=200, seed=4)
    ensemble = simulate(line(), Direct(), START, TIMES, runs=200, seed=4)
    assert_array_equal(sampled.mean, ensemble.mean())
    assert_allclose(sampled.standard_error, ensemble.sd() / np.sqrt(200), rtol=1e-14)
    assert (sampled.method, sampled.error) == ("ssa", 0.0)
    exact = predict(Model(bare_line(), START), rates, TIMES, Transient())
    assert_array_equal(exact.sd, solve(line(), Transient(), START, TIMES).sd())
    assert exact.method == "transient"
    assert 0 < exact.error < 1e-11
    assert not exact.standard_error.any()
    assert np.all(abs(sampled.mean - exact.mean) < 4.9 * sampled.standard_error + 1e-12)


def test_interval_of_a_decay_in_closed_form():
    # Mean 1000 exp(-k) with k from Gamma(100.5, 100): the quantiles follow from those of k.
    rates = Rates(
        convention=Convention(combinations="distinct"),
        channels={"decay": ChannelRate(rate=1.0, ways=1, events=100, exposure=100.0)},
    )
    made = predict(Model(decay(), [1000]), rates, [1.0], seed=2, draws=1000)
    k = np.random.default_rng(1).gamma(100.5, 0.01, size=200_000)
    low, high = 1000 * np.exp(-np.quantile(k, [0.975, 0.025]))
    # The quantile of 1000 draws has a standard error of about 0.065 of the interval's half-width per side.
    half = (high - low) / 2
    assert_allclose([made.low[0, 0], made.high[0, 0]], [low, high], atol=4.9 * 0.065 * half)


def test_a_decay_has_the_posterior_prediction_in_closed_form():
    """Mean and variance of 100 exp(-k) with binomial runs, k from Gamma(3.5, 3)."""
    rates = Rates(
        convention=Convention(combinations="distinct"),
        channels={"decay": ChannelRate(rate=1.0, ways=1, events=3, exposure=3.0)},
    )
    made = predict(Model(decay(), [100]), rates, [1.0], seed=2, draws=1000)
    first, second = (100**n * (3 / (3 + n)) ** 3.5 for n in (1, 2))
    between, within = second - first**2, first - second / 100
    assert_allclose(made.standard_error[0, 0], np.sqrt((between + within / 100) / 1000), rtol=0.15)
    assert abs(made.mean[0, 0] - first) < 4.9 * made.standard_error[0, 0]
    assert_allclose(made.sd[0, 0], np.sqrt(between + within), rtol=0.15)
    assert made.runs == 100_000
    # control: the posterior mean of the rate predicts something else
    assert abs(100 * np.exp(-3.5 / 3) - first) > 4.9 * made.standard_error[0, 0]
    solved = predict(Model(decay(), [100]), rates, [1.0], Transient(), seed=2, draws=100)
    assert_allclose(solved.mean[0, 0], 100 * np.exp(-3.5 / 3), rtol=1e-9)
    assert "mean, sd and band are those at the posterior mean of each rate constant" in solved.notes


@pytest.mark.parametrize("seed", range(6))
def test_no_estimate_leaves_its_interval_and_no_interval_what_is_possible(seed):
    """Over rates files with 0, 1, 3 or 1000 events a channel."""
    rng = np.random.default_rng(seed)
    table = Rates.load("table3")
    channels = {}
    for name, given in table.channels.items():
        exposure = 10 ** rng.uniform(2, 5)
        events = int(rng.choice([0, 0, 1, 3, 1000]))
        channels[name] = ChannelRate(rate=events / exposure, ways=given.ways, events=events, exposure=exposure)
    rates = Rates(convention=table.convention, channels=channels)
    most = 8 // np.array([1, 2, 3, 4])
    for method in (Direct(), Transient()):
        made = predict(Model(bare_line(), [8, 0, 0, 0]), rates, [1.0, 100.0], method, runs=10, seed=seed, draws=20)
        assert (made.low >= 0).all()
        assert (made.low <= made.mean).all()
        assert (made.mean <= made.high).all()
        assert (made.high <= most).all()
        assert (made.mean >= 0).all()
    first = predict_passage(bare_line(), rates, [8, 0, 0, 0], "quadmer", seed=seed, draws=20)
    assert 0 < first.mean.low <= first.mean.value <= first.mean.high < np.inf
    assert np.isfinite(first.passage.mean)


def test_the_point_rate_of_a_channel_without_events_lies_outside_of_the_interval():
    """The control: no copy ever at the point rate, while the interval is above 0."""
    rates = Rates(
        convention=Convention(combinations="distinct"),
        channels={"decay": ChannelRate(rate=0.0, ways=1, events=0, exposure=1.0)},
    )
    made = predict(Model(decay(), [100]), rates, [0.5], seed=1, draws=50)
    assert made.high[0, 0] < 100 == solve(rates.apply(decay()), Transient(), [100], [0.5]).mean()[0, 0]


def test_more_runs_are_more_draws_and_the_first_ones_stay():
    few, many = (predict(Model(bare_line(), START), measured(20), TIMES, runs=n, seed=5, draws=10) for n in (10, 4000))
    assert (few.runs, many.runs) == (1000, 4000)
    assert_array_equal(few.drawn.means, many.drawn.means)
    assert many.drawn.means.shape == (10, 2, 4)
    assert np.all(many.standard_error[1] < few.standard_error[1])


def test_counts_of_every_species_as_observables_are_the_same_runs():
    sums = Observables.of(bare_line(), {name: {name: 1} for name in bare_line().species})
    whole = predict(Model(bare_line(), START), measured(20), TIMES, seed=5, draws=4)
    summed = predict_job(Job(Model(bare_line(), START), TIMES, sums, seed=5), measured(20), draws=4)
    assert_array_equal(whole.mean, summed.mean)
    assert_array_equal(whole.high, summed.high)


def test_interval_does_not_widen_with_monte_carlo_noise():
    # With a million events the rates are known, and what is left among the draws is only sampling noise.
    made = predict(Model(bare_line(), START), measured(1_000_000), TIMES, seed=3)
    noise = made.sd / np.sqrt(100)
    assert np.all(made.high - made.low < noise * 4 * 0.6)
    loose = predict(Model(bare_line(), START), measured(10), TIMES, seed=3)
    assert np.all(loose.high - loose.low > 3 * (made.high - made.low))
    assert np.all(loose.low < loose.mean)
    assert np.all(loose.mean < loose.high)
    words = "an interval of zero width is narrower than 100 runs for each draw of the rates can resolve"
    assert words in made.notes
    assert words not in loose.notes


def test_the_same_seed_gives_the_same_prediction():
    one, other = (predict(Model(bare_line(), START), measured(20), TIMES, seed=5, draws=20, threads=n) for n in (1, 2))
    assert_array_equal(one.mean, other.mean)
    assert_array_equal(one.low, other.low)
    assert np.any(predict(Model(bare_line(), START), measured(20), TIMES, seed=6, draws=20).low != one.low)


def test_channels_without_evidence_are_named():
    rates = measured(20)
    channels = rates.channels | {"4->2+2": ChannelRate(rate=1e-5, ways=1)}
    mixed = rates.replace(channels=channels)
    assert evidence_notes(mixed) == ("the interval excludes 4->2+2: taken as exact, because without evidence",)
    assert evidence_notes(rates) == ()


def test_order_of_channels_in_the_file_does_not_matter():
    rates = measured(1_000_000)
    turned = rates.replace(channels=dict(reversed(rates.channels.items())))
    one, other = (predict_passage(bare_line(), r, START, "quadmer", draws=50) for r in (rates, turned))
    for end in ("low", "value", "high"):
        assert getattr(one.mean, end) == pytest.approx(getattr(other.mean, end), rel=5e-3)


def test_passage_with_its_interval():
    made = predict_passage(bare_line(), measured(50), START, "quadmer", seed=1)
    at_mean = measured(50).expected(bare_line())
    assert made.passage.mean == first_passage(at_mean, START, "quadmer").mean
    assert made.mean.low < made.mean.value < made.mean.high
    assert 0.1 < (made.mean.high - made.mean.low) / made.mean.value < 0.6
    known = predict_passage(bare_line(), Rates.load("table3"), START, "quadmer")
    assert known.mean.kind == "proven"
    assert known.mean.value == known.passage.mean == first_passage(line(), START, "quadmer").mean


def test_a_mean_time_without_a_posterior_mean_has_its_median_in_closed_form():
    """A -> B once: 1 / k with k from Gamma(1/2, 10). The median of 400 draws has a standard error of 2.5 % of rank."""
    events = {"forward": 0, "backward": 5}
    channels = {n: ChannelRate(rate=seen / 10, ways=1, events=seen, exposure=10.0) for n, seen in events.items()}
    rates = Rates(convention=Convention(combinations="distinct"), channels=channels)
    made = predict_passage(switch(), rates, [1, 0], "B", draws=400)
    share = gamma(0.5, scale=0.1).sf(1 / made.mean.value)
    assert abs(share - 0.5) < 4.9 * 0.025
    assert 0 < made.mean.low < made.mean.value < made.mean.high < np.inf
    assert any("posterior median" in note for note in made.notes)
    # control: at the point rates it never comes
    assert first_passage(rates.apply(switch()), [1, 0], "B").mean == np.inf


def test_interrupted_runs_give_a_prediction_that_says_so(monkeypatch):
    monkeypatch.setattr(run_source, "BLOCK_BYTES", 50 * 8 * 4 * 2)
    counts = RunSource.counts

    def interrupted(source, grid, runs, first_run=0, threads=None, watch=None):
        if first_run >= 100:
            raise KeyboardInterrupt
        return counts(source, grid, runs, first_run, threads, watch)

    monkeypatch.setattr(RunSource, "counts", interrupted)
    made = predict(Model(bare_line(), START), Rates.load("table3"), TIMES, Direct(), runs=400, seed=1)
    assert (made.runs, made.low, made.is_complete) == (100, None, False)
    assert "interrupted: 100 of 400 runs were made" in made.notes


def test_interrupted_draws_give_the_prediction_of_those_that_were_made(monkeypatch):
    monkeypatch.setattr(over_draws, "BATCH_BYTES", 1)  # a draw at a time

    def interrupt(text):
        if "under 30 of" in text:
            raise KeyboardInterrupt

    made = predict(Model(bare_line(), START), measured(50), TIMES, seed=1, draws=60, progress=interrupt)
    assert (made.runs, made.is_complete, len(made.drawn.means)) == (3000, False, 30)
    assert "interrupted: 30 draws of the rates, 3000 runs were made" in made.notes
    whole = predict(Model(bare_line(), START), measured(50), TIMES, seed=1, draws=60)
    assert whole.is_complete
    assert_array_equal(made.drawn.means, whole.drawn.means[:30])
    assert np.all((made.low < whole.high) & (whole.low < made.high))


def test_counts_of_a_wide_range_tell_how_well_their_band_is_known(monkeypatch):
    exact = predict(Model(decay(), [1000]), None, [0.7], runs=200)
    assert not any("copies" in note for note in exact.notes)
    monkeypatch.setattr(statistics, "MOST_BINS", 16)
    rounded = predict(Model(decay(), [1000]), None, [0.7], runs=200)
    assert "the middle 95 % of the runs is known to 4 copies" in rounded.notes
    assert_array_equal(rounded.sd, exact.sd)


def test_plot_and_table():
    made = predict(Model(bare_line(), START), measured(50), TIMES, runs=50, draws=10)
    ax = Figure().add_subplot()
    assert made.plot(ax) is ax
    assert sum(len(line.get_xdata()) > 0 for line in ax.get_lines()) == 4 + 2 * 4
    assert list(made.to_dataframe().columns)[-2:] == ["low", "high"]


def test_bad_input():
    with pytest.raises(ValueError, match="another network"):
        predict(Model(decay(), [1]), Rates.load("table3"), TIMES)
    with pytest.raises(ValueError, match="draws = 1"):
        predict(Model(bare_line(), START), measured(50), TIMES, draws=1)


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
