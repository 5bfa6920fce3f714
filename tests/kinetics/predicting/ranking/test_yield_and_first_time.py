"""Figures of a book: against closed forms and other solvers, sampled against exact, at horizons of any scale."""

from math import exp

import numpy as np
import pytest
from ranked_books import DIMER, LINE4, T5, T5_BAR, TABLE3, Asked, question
from scipy.integrate import quad
from scipy.stats import norm

from kinetics import Model, Network, Transient, first_passage, sample_path, solve
from kinetics.assembly import RuleBook, Semantics, Senses, Structure
from kinetics.assembly.rules.conditions import Combination
from kinetics.predicting.ranking import rank
from kinetics.predicting.ranking import yield_and_first_time as figures_of
from kinetics.predicting.ranking.yield_and_first_time import yield_and_first_time
from kinetics.rates import ClassRates

FALSE_ALARM = 1e-6


@pytest.mark.parametrize("horizon", [0.01, 1.0, 40.0])
def test_two_cubes_follow_the_closed_form(horizon):
    """One dimer: it comes at rate 4 k, goes at rate q."""
    k, q = 0.3, 0.5
    result = yield_and_first_time(*question(DIMER, ClassRates.uniform(k, q), 2, horizon), 2, 0)
    rate = 4 * k
    mean = (1 - exp(-rate * horizon)) / rate
    square = 2 * (1 - exp(-rate * horizon) * (1 + rate * horizon)) / rate**2
    reached = 1 - exp(-rate * horizon)
    amount = rate / (rate + q) * (1 - exp(-(rate + q) * horizon))
    for figure, value, sd in (
        (result.first, mean, result.first_sd / (square - mean**2) ** 0.5),
        (result.reached, reached, 1.0),
        (result.yield_, amount, result.yield_sd / (amount * (1 - amount)) ** 0.5),
    ):
        assert figure.value == pytest.approx(value, rel=1e-10)
        assert sd == pytest.approx(1.0, rel=1e-5)
        assert figure.low <= value <= figure.high
        assert (figure.kind, figure.why) == ("proven", "2 states")


@pytest.mark.parametrize(("book", "cubes", "horizon"), [(LINE4, 12, 300.0), (T5, 10, 2000.0), (T5_BAR, 10, 50.0)])
def test_exact_figures_agree_with_the_other_solvers(book, cubes, horizon):
    """The restricted mean is the integral of the survival function, however likely the target is."""
    asked = question(book, ClassRates.uniform(3e-4, 1e-4), cubes, horizon)
    result = yield_and_first_time(*asked, 2, 0)
    law = first_passage(asked.model, None, asked.target)
    mean = quad(law.survival, 0, horizon, epsabs=1e-9)[0]
    square = quad(lambda t: 2 * t * law.survival(t), 0, horizon, epsabs=1e-7)[0]
    assert result.first.value == pytest.approx(mean, rel=1e-9)
    assert result.first_sd == pytest.approx((square - mean**2) ** 0.5, rel=1e-6)
    assert result.reached.value == pytest.approx(float(law.cdf(horizon)), rel=1e-10)
    end, place = solve(asked.model, Transient(), times=[horizon]), asked.model.network.index(asked.target)
    assert result.yield_.value == pytest.approx(end.mean()[0, place] / asked.possible, rel=1e-10)
    assert result.yield_sd == pytest.approx(end.sd()[0, place] / asked.possible, rel=1e-8)


def test_sampled_figures_agree_with_exact_ones():
    """And do not where a rate is wrong by a fifth."""
    asked = question(LINE4, ClassRates.uniform(2e-3, 1e-3), 12, 60.0)
    wrong = question(LINE4, ClassRates.uniform(2.4e-3, 1e-3), 12, 60.0)
    runs = 4000
    sampled = yield_and_first_time(*asked, runs, 7, max_states=0)
    allowed = norm.isf(FALSE_ALARM / 6)

    def distances(exact):
        chance = exact.reached.value
        sds = {"first": exact.first_sd, "reached": (chance * (1 - chance)) ** 0.5, "yield_": exact.yield_sd}
        gaps = [abs(getattr(sampled, name).value - getattr(exact, name).value) for name in sds]
        return np.array(gaps) / (np.array(list(sds.values())) / runs**0.5)

    assert {sampled.first.kind, sampled.yield_.kind} == {"95 % confidence"}
    assert sampled.yield_.why == f"{runs} runs"
    assert (distances(yield_and_first_time(*asked, 2, 0)) < allowed).all()
    assert (distances(yield_and_first_time(*wrong, 2, 0)) > allowed).any()


def test_sampled_runs_are_those_of_the_direct_method_and_their_first_times_too():
    asked = question(LINE4, ClassRates.uniform(2e-3, 1e-3), 12, 30.0)
    sampled = yield_and_first_time(*asked, 40, 3, max_states=0, first_run=5)
    paths = [sample_path(asked.model, None, asked.horizon, 3, 5 + run) for run in range(40)]
    times = [path.first_time(asked.target) for path in paths]
    assert 0 < np.isnan(times).sum() < 40
    assert sampled.first.value == pytest.approx(np.nan_to_num(times, nan=asked.horizon).mean(), rel=1e-15)
    assert sampled.reached.value == np.isfinite(times).mean()
    shares = [path.states[-1, asked.model.network.index(asked.target)] / asked.possible for path in paths]
    assert sampled.yield_.value == np.mean(shares)
    other = yield_and_first_time(*asked, 40, 4, max_states=0, first_run=5)
    assert other.first.value != sampled.first.value


DECAY = Network.from_reactions({"decay": ({"A": 1}, {"B": 1})}, [1.0])


def decay(network=DECAY, horizon=1.0, **initial):
    return Asked(Model.of(network, initial or {"A": 1}), "B", 1, horizon)


def test_horizons_of_any_scale_are_sampled_and_none_is_refused():
    """The same random numbers on another scale of time."""
    unit = yield_and_first_time(*decay(), 200, 0, max_states=0)
    quick = DECAY.with_rates([1e300])
    found = yield_and_first_time(*decay(quick, 1e-300), 200, 0, max_states=0)
    assert found.first.value == pytest.approx(1e-300 * unit.first.value, rel=1e-9, abs=0.0)
    assert found.reached.value == unit.reached.value
    for horizon in (0.0, -1.0, float("inf"), float("nan")):
        with pytest.raises(ValueError, match=r"horizon = .*; expected a positive number of tu"):
            yield_and_first_time(*decay(horizon=horizon), 200, 0)


def test_like_runs_have_no_spread_at_any_horizon():
    """2000 times 1e-12 sum to a little less than 2e-9, which is no spread."""
    found = yield_and_first_time(*decay(horizon=1e-12), 2000, 0, max_states=0)
    assert (found.first.value, found.first_sd, found.first.high) == (1e-12, 0.0, 1e-12)
    assert found.first.low == pytest.approx(1e-12 * 0.025 ** (1 / 2000), rel=1e-9, abs=0.0)


def test_a_target_that_is_there_from_the_beginning_takes_no_time():
    asked = question(DIMER, ClassRates.uniform(0.3, 0.5), 4, 1.0)
    asked = asked._replace(model=asked.model.with_counts({"monomer": 2, "dimer": 1}))
    for max_states in (100, 0):
        result = yield_and_first_time(*asked, 10, 0, max_states)
        assert result.first.value == 0.0
        assert result.reached.value == 1.0


def test_runs_without_a_target_count_with_the_horizon():
    result = yield_and_first_time(*question(LINE4, ClassRates.uniform(1e-9), 8, 10.0), 100, 0, max_states=0)
    assert (result.first.value, result.reached.value, result.yield_.value) == (10.0, 0.0, 0.0)
    share = 1 - 0.025**0.01  # a chance that would still leave 100 runs without a target in 2.5 % of all cases
    assert result.reached.low == result.yield_.low == 0.0
    assert result.reached.high == result.yield_.high == pytest.approx(share)
    assert (result.first.low, result.first.high) == (pytest.approx(10.0 * (1 - share)), 10.0)


def test_each_figure_is_exact_where_its_own_chain_is_small_enough():
    """On the way to the first target there are fewer states than in all."""
    asked = question(LINE4, TABLE3, 60, 2000.0)
    result = yield_and_first_time(*asked, 10, 0, max_states=1000)
    assert (result.first.kind, result.first.why) == ("proven", "621 states")
    assert result.yield_.method == "ssa"
    assert (
        yield_and_first_time(*asked, 10, 0, like=result).yield_.method == "ssa"
    )  # what was too large is not tried again


def test_too_much_work_is_sampled(monkeypatch):
    monkeypatch.setattr(figures_of, "MAX_SECONDS", 1e-9)
    assert yield_and_first_time(*question(LINE4, TABLE3, 12, 2000.0), 10, 0).yield_.method == "ssa"


def seeded(cubes):
    """A seed that takes one free cube."""
    pair = {"face": "f1", "partner_face": "f1"}
    rules = (
        Combination(rule="G1", letter="s", partner="a", neighbours=(), becomes="t", **pair),
        Combination(rule="G2", letter="a", partner="s", becomes="b", **pair),
    )
    target = Structure(((0, 0, 0), (0, 0, 1)), (0, 0), ("t", "b"))
    held = Semantics(bonds="hold")
    book = RuleBook("seeded", ("a", "s", "t", "b"), "a", Senses(faces="two"), target, "s", held, rules)
    return rank([book], ClassRates.uniform(0.01), cubes=cubes, horizon=30.0)


def test_a_seeded_book_makes_one_target():
    """Any of n cubes by 4 ways: rate 4 n k."""
    made = seeded(5)
    mean = (1 - exp(-0.2 * 30)) / 0.2
    assert made.possible == 1
    assert made.books[0].result.first.value == pytest.approx(mean)
    assert made.books[0].result.yield_.value == pytest.approx(1 - exp(-0.2 * 30))
