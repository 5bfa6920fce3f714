"""The likelihood of panel data against an independent filter and closed forms; its bounds."""

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm
from scipy.stats import binom, poisson

from kinetics import Model, Network, reachable
from kinetics.markov.panels import PanelData, PanelLikelihood, PanelRun, few_states, log_likelihood
from kinetics.markov.panels.fans import Cut
from kinetics.markov.panels.observations import Detected, Gaussian, Rounded
from kinetics.markov.panels.panel_step import amplified
from kinetics.support.answer import Answer
from tests.helpers.random_chains import DIGITS, exact_generator

CYCLE = """ab: A -> B, k * 1
bc: B -> C, q
ca: C -> A, 2 * k
bond: A + B <-> D, 0.05, 0.4
"""


def by_expm(network, data, states):
    """An independent forward filter over these states (N, S), by scipy's matrix exponential."""
    states = np.asarray(states)
    places = {tuple(row): i for i, row in enumerate(states)}
    propensities, n = network.propensities(states), len(states)
    rates = np.zeros((len(network.channels), n, n))
    for i, row in enumerate(states):
        for r, change in enumerate(network.stoichiometry):
            j = places.get(tuple(row + change))
            if propensities[i, r] > 0 and j != i:
                rates[r, i, j] += propensities[i, r]
    generator, exits = rates.sum(axis=0), rates.sum(axis=(0, 2))
    for name in {name for names in data.events for name in names}:  # which are recorded whenever they fire
        generator -= rates[network.channels.index(name)]
    np.fill_diagonal(generator, -exits)
    counted, total = states @ data.weights(network).T, 0.0
    for run in data.runs:
        now, before = np.zeros(n), run.start
        now[[places[tuple(row)] for row in run.initial.tolist()]] = run.chances
        for look, time in enumerate(run.times):
            now = now @ expm(generator * (time - before))
            if run.fired[look] >= 0:
                now = now @ rates[[network.channels.index(c) for c in data.events[run.fired[look]]]].sum(axis=0)
            for c, observation in enumerate(data.observations.values()):
                if not np.isnan(run.seen[look, c]):
                    now = now * observation.weights(counted[:, c], run.seen[look, c])
            total += np.log(now.sum())
            now, before = now / now.sum(), time
    return total


def hidden_data(seed, observations=None, with_events=False):
    """Runs of `CYCLE` with two columns, one of which counts two species, and holes."""
    rng = np.random.default_rng(seed)
    runs = []
    for _ in range(5):
        times = np.cumsum(rng.exponential(0.7, rng.integers(1, 5)) + 0.05)
        seen = np.column_stack([rng.integers(0, 3, times.size), rng.integers(2, 5, times.size)]).astype(float)
        seen[rng.random(seen.shape) < 0.4] = np.nan
        fired = np.where(rng.random(times.size) < 0.4, 0, -1) if with_events else None
        runs.append(PanelRun([3, 1, 0, 1], times, seen, start=0.02, fired=fired))
    columns = {"C": {"C": 1}, "ab": {"A": 1, "B": 1, "D": 2}}
    if observations is None:
        observations = {"C": Detected(0.8), "ab": Rounded(2.0)}
    return PanelData(columns, runs, observations, [("ca", "bond")] if with_events else [])


def cycle(k=0.7, q=1.3):
    return Model.of(Network.from_text(CYCLE, k=k, q=q))


def reached(model, initial):
    return reachable(model.network, initial).states


@pytest.fixture(params=["few", "many"])
def road(request, monkeypatch):
    """Both ways to go over the states."""
    if request.param == "many":
        monkeypatch.setattr(few_states, "MOST_STATES", 1)
    return request.param


@pytest.mark.parametrize("with_events", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_it_is_that_of_an_independent_filter(road, seed, with_events):
    model, data = cycle(), hidden_data(seed, with_events=with_events)
    found = log_likelihood(model, data)
    assert found.value == pytest.approx(by_expm(model.network, data, reached(model, [3, 1, 0, 1])), abs=1e-10)
    assert found.kind == "estimate"  # binomial probabilities come without a bound
    assert 0 < found.error < 1e-9


@pytest.mark.parametrize("with_events", [False, True])
@pytest.mark.parametrize(
    "observations", [None, {"C": Gaussian(0.6), "ab": Gaussian(1.5)}, {"ab": Detected(0.5), "C": Gaussian(1.0)}]
)
def test_the_gradient_is_that_of_the_value(road, observations, with_events):
    data = hidden_data(7, observations, with_events)
    asked = PanelLikelihood(cycle(), data)
    point = {"k": 0.7, "q": 1.3, "bond": 0.05}
    point |= {name: each.parameter for name, each in data.observations.items() if each.parameter is not None}
    names = list(point)
    gradient = asked.scored(point, names).gradient
    for p, name in enumerate(names):
        up, down = (asked.value({**point, name: point[name] * np.exp(sign * 1e-5)}).value for sign in (1, -1))
        assert gradient[p] == pytest.approx((up - down) / 2e-5, abs=2e-6)
    assert (gradient != 0).all()


def test_both_roads_agree_to_the_last_digits(monkeypatch):
    data = hidden_data(3, with_events=True)
    few = PanelLikelihood(cycle(), data).scored({}, ["k", "q", "C"])
    monkeypatch.setattr(few_states, "MOST_STATES", 1)
    many = PanelLikelihood(cycle(), data).scored({}, ["k", "q", "C"])
    assert few.answer.value == pytest.approx(many.answer.value, rel=1e-13)
    np.testing.assert_allclose(few.gradient, many.gradient, rtol=1e-9)


def false_bounds(seeds):
    """Of random chains of three states and rates over two decades, seen twice, in a hundred digits: how many fail."""
    failed = 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        rates = np.where(rng.random((3, 3)) < 0.7, 10.0 ** rng.uniform(-1, 1, (3, 3)), 0.0)
        np.fill_diagonal(rates, 0.0)
        rates[0, 1] = 1.0
        text = "\n".join(f"{'ABC'[i]} -> {'ABC'[j]}, {float(rates[i, j])!r}" for i, j in np.argwhere(rates > 0))
        network = Network.from_text(text)
        order = ["ABC".index(name) for name in network.species]
        times = np.cumsum(rng.integers(1, 9, 2) / 4)
        first, last = (rng.integers(0, len(order), 2)).tolist()
        seen = np.full((2, len(order)), np.nan)
        seen[0, first], seen[1] = 0.0, np.eye(len(order))[last]  # first, only that it is not there
        run = PanelRun([int(place == 0) for place in order], times, seen)
        with mpmath.workdps(DIGITS):
            generator = exact_generator(rates)
            row = mpmath.matrix([[1, 0, 0]]) * mpmath.expm(generator * mpmath.mpf(times[0]))
            row[order[first]] = 0
            row = row * mpmath.expm(generator * mpmath.mpf(times[1] - times[0]))
            if row[order[last]] < mpmath.mpf("1e-30"):
                continue
            exact = mpmath.log(row[order[last]])
            found = log_likelihood(network, PanelData({s: {s: 1} for s in network.species}, [run]))
            assert found.kind == "proven"
            assert found.error < 1e-11
            failed += not mpmath.mpf(found.low) <= exact <= mpmath.mpf(found.high)
    return failed


@pytest.mark.parametrize("chains", [50, pytest.param(2000, marks=pytest.mark.validate)])
def test_no_bound_is_false(road, chains):
    assert false_bounds(range(chains)) == 0


def test_a_bound_that_is_too_narrow_would_be_seen(monkeypatch):
    narrow = Answer.__init__

    def narrower(self, value, low, high, *rest, **kept):
        narrow(self, value, value + 1e-4 * (low - value), value + 1e-4 * (high - value), *rest, **kept)

    monkeypatch.setattr(Answer, "__init__", narrower)
    assert false_bounds(range(50)) > 10


def test_all_that_may_be_seen_sums_to_one(road):
    network = Network.from_text("pair: 2 A <-> D, 0.3, 0.5\ngone: D -> 0, 0.2")
    total = 0.0
    for a in range(7):
        for d in range(4):
            run = PanelRun([6, 0], [1.3], [[a, d]])
            try:
                total += np.exp(log_likelihood(network, PanelData({"A": {"A": 1}, "D": {"D": 1}}, [run])).value)
            except ValueError as error:
                assert "cannot be reached" in str(error)  # noqa: PT017 - all others must be there
    assert total == pytest.approx(1.0, abs=1e-12)


def test_closed_forms(road):
    decay = Network.from_text("A -> B, 0.4")
    run = PanelRun([9, 0], [1.0, 2.5], [[6, np.nan], [np.nan, 5]])
    found = log_likelihood(decay, PanelData({"A": {"A": 1}, "B": {"B": 1}}, [run]))
    expected = binom.logpmf(6, 9, np.exp(-0.4)) + binom.logpmf(4, 6, np.exp(-0.6))
    assert found.value == pytest.approx(expected, abs=1e-12)
    # seen with probability p, survivors are binomial with p times theirs
    seen = PanelData({"A": {"A": 1}}, [PanelRun([9, 0], [1.0], [[2]])], {"A": Detected(0.7)})
    assert log_likelihood(decay, seen).value == pytest.approx(binom.logpmf(2, 9, 0.7 * np.exp(-0.4)), abs=1e-12)


def test_the_density_of_an_event_integrates_to_its_probability(road):
    """A -> B -> C, of which C is entered at a known time: hidden B before."""
    chain = Network.from_text("ab: A -> B, 1.5\nbc: B -> C, 0.6\nac: A -> C, 0.2")

    def density(time):
        run = PanelRun([1, 0, 0], [time], [[1.0]], fired=[0])
        return np.exp(log_likelihood(chain, PanelData({"C": {"C": 1}}, [run], events=[("bc", "ac")])).value)

    whole, _ = quad(density, 1e-9, 3.0, epsabs=1e-9)
    dead = log_likelihood(chain, PanelData({"C": {"C": 1}}, [PanelRun([1, 0, 0], [3.0], [[1]])]))
    assert whole == pytest.approx(np.exp(dead.value), abs=1e-7)


def test_what_never_grows_keeps_the_states_few():
    """Of an outbreak among 261, some hundreds of states between two looks and not all that can be reached."""
    model = Model.of(Network.from_text("infect: S + I -> 2 I, 0.02\nremove: I -> R, 3"))
    asked = PanelLikelihood(
        model, PanelData({"S": {"S": 1}, "I": {"I": 1}}, [PanelRun([254, 7, 0], [0.5], [[235, 14]])]), 400
    )
    assert asked.value().value < 0


def test_stiff_chains_of_few_states_are_squared():
    fast = Network.from_text("A <-> B, 1e7, 2e7\nB -> C, 3")
    run = PanelRun([1, 0, 0], [0.5, 1.0], [[0], [0]])
    found = log_likelihood(fast, PanelData({"C": {"C": 1}}, [run]))
    assert found.value == pytest.approx(-1.0, abs=1e-6)  # a third of the time in B
    assert found.is_bound
    assert found.error < 1e-4


def test_a_rate_that_was_zero_may_become_positive(road):
    network = Network.from_text("ab: A -> B, 1\nbc: B -> C, k", k=0.0)
    data = PanelData({"C": {"C": 1}}, [PanelRun([2, 0, 0], [1.0], [[0]])])
    asked = PanelLikelihood(Model.of(network), data)
    assert asked.value().value == pytest.approx(0.0, abs=1e-12)
    fresh = PanelLikelihood(Model.of(network).at({"k": 0.5}), data).value().value
    assert asked.value({"k": 0.5}).value == fresh < 0


def test_certain_detection_may_become_uncertain(road):
    decay = Model.of(Network.from_text("A -> B, 0.5"))
    runs = [PanelRun([9, 0], [1.0, 2.0], [[4], [3]]), PanelRun([9, 0], [1.0], [[5]]), PanelRun([9, 0], [1.0], [[6]])]

    def asked(p):
        return PanelLikelihood(decay, PanelData({"A": {"A": 1}}, runs, {"A": Detected(p)}))

    certain = asked(1.0)
    assert certain.value().value == pytest.approx(asked(1.0 - 1e-12).value().value, abs=1e-9)
    assert certain.value({"A": 0.7}).value == asked(0.7).value().value
    assert asked(0.7).value({"A": 1.0}).value == certain.value().value


def test_rate_laws_count_too(road):
    network = Network.from_text("make: 0 -> A, v / (1 + A / K)\nlose: A -> 0, 0.3", v=1.5, K=4.0)
    data = PanelData({"A": {"A": 1}}, [PanelRun([0], [1.0, 2.0], [[2], [3]])])
    endless = PanelLikelihood(Model.of(network), data).value()
    ended = Network.from_text("make: 0 -> A, v / (1 + A / K) * (A < 40)\nlose: A -> 0, 0.3", v=1.5, K=4.0)
    asked = PanelLikelihood(Model.of(ended), data)
    assert endless.value == pytest.approx(asked.value().value, abs=1e-11)
    gradient = asked.scored({"v": 1.5, "K": 4.0}, ["v", "K"]).gradient
    for p, (name, value) in enumerate({"v": 1.5, "K": 4.0}.items()):
        up, down = (asked.value({name: value * np.exp(s * 1e-5)}).value for s in (1, -1))
        assert gradient[p] == pytest.approx((up - down) / 2e-5, abs=1e-6)


def test_endless_networks_keep_likely_states(road):
    """Made at rate v and lost at rate g: Poisson, with mean v / g (1 - exp(-g t)), from none; its law is known."""
    network = Network.from_text("make: 0 -> A, v\nlose: A -> 0, g", v=8.0, g=0.5)
    runs = [PanelRun([0], [time], [[seen]]) for time, seen in ((0.5, 3), (2.0, 9), (2.0, 14))]
    asked = PanelLikelihood(Model.of(network), PanelData({"A": {"A": 1}}, runs))
    for v in (8.0, 30.0):  # the likely states of the first are not those of the second
        found = asked.value({"v": v})
        means = [v / 0.5 * (1 - np.exp(-0.5 * run.times[0])) for run in runs]
        law = sum(poisson.logpmf(run.seen[0, 0], mean) for run, mean in zip(runs, means, strict=True))
        assert found.low <= law + 1e-13
        assert law - 1e-13 <= found.high
        assert found.error < 1e-6
        assert found.kind == "proven"


def test_what_was_seen_may_leave_fewer_states_than_are_likely(road, monkeypatch):
    """Six kinds are made and never lost: one of each at the end leaves 64 states on the way; millions are likely."""
    monkeypatch.setattr("kinetics.markov.panels.moving_windows.EXPLORED", 100)
    network = Network.from_text("\n".join(f"make{k}: 0 -> A{k}, v" for k in range(6)), v=3.0)
    columns = {f"A{k}": {f"A{k}": 1} for k in range(6)}
    data = PanelData(columns, [PanelRun([0] * 6, [1.0], [[1] * 6])])
    found = PanelLikelihood(Model.of(network), data, max_states=1000).scored({"v": 3.0}, ["v"])
    law = 6 * poisson.logpmf(1, 3.0)
    assert found.answer.low <= law + 1e-12
    assert law - 1e-12 <= found.answer.high
    assert found.gradient == pytest.approx([6 * (1 - 3.0)], abs=1e-9)
    with pytest.raises(ValueError, match="over 99 states are reachable"):
        PanelLikelihood(Model.of(network), data, max_states=99).value()


def test_what_is_left_out_may_explain_all_later_looks():
    tiny, chances = np.array([1e-12, 1e-12, 1e-12]), np.array([0.1, 0.01, 0.5])
    hidden = amplified(tiny, chances, np.zeros(3, dtype=bool))
    assert hidden == pytest.approx(1e-12 * (1 / (0.1 * 0.01 * 0.5) + 1 / (0.01 * 0.5) + 1 / 0.5))
    known = amplified(tiny, chances, np.ones(3, dtype=bool))  # each look tells the state: no further than it
    assert known == pytest.approx(1e-12 * (1 / 0.1 + 1 / 0.01 + 1 / 0.5))
    between = amplified(tiny, chances, np.array([False, True, False]))
    assert between == pytest.approx(1e-12 * (1 / (0.1 * 0.01) + 1 / 0.01 + 1 / 0.5))
    assert amplified(np.full(400, 1e-60), np.full(400, 0.1), np.zeros(400, dtype=bool)) == np.inf


def test_runs_that_are_alike_count_each(road):
    """A hundred snapshots of four kinds at two times cost two passes."""
    network = Network.from_text("make: 0 -> A, 2\nlose: A -> 0, g", g=0.5)
    runs = [PanelRun([0], [time], [[seen]]) for time, seen in ((0.5, 1), (2.0, 3), (2.0, 2), (0.5, 0))]
    once, many = (PanelLikelihood(Model.of(network), PanelData({"A": {"A": 1}}, runs * n)) for n in (1, 25))
    one, all_of_them = (each.scored({"g": 0.5}, ["g"]) for each in (once, many))
    assert all_of_them.answer.value == pytest.approx(25 * one.answer.value, rel=1e-13)
    assert all_of_them.gradient == pytest.approx(25 * one.gradient, rel=1e-12)
    assert "100 looks at 100 runs" in all_of_them.answer.why
    fans = Cut.of(network, many.data).fans
    assert [fan.copies for fan in fans] == [[25, 25], [25, 25]]


def test_what_is_lost_before_a_hidden_state_is_within_the_bound():
    text = "make: 0 -> A, 8{end}\nlose: A -> 0, 0.5\nspot: A -> A + S, 0.3{stop}"
    data = PanelData({"S": {"S": 1}}, [PanelRun([0, 0], [0.5, 1.0], [[0], [1]])])
    endless = log_likelihood(Network.from_text(text.format(end="", stop="")), data)
    ended = log_likelihood(Network.from_text(text.format(end=" * (A < 60)", stop=" * A * (S < 9)")), data)
    assert endless.kind == ended.kind == "proven"
    assert 1e-12 < endless.error < 1e-8
    assert endless.low < ended.value < endless.high


def test_a_wrong_likelihood_would_be_seen():
    """The control: looks that are taken for independent of each other give another number."""
    decay = Network.from_text("A -> B, 0.4")
    both = log_likelihood(decay, PanelData({"A": {"A": 1}}, [PanelRun([9, 0], [1.0, 2.5], [[6], [4]])]))
    alone = [
        log_likelihood(decay, PanelData({"A": {"A": 1}}, [PanelRun([9, 0], [t], [[n]])]))
        for t, n in ((1.0, 6), (2.5, 4))
    ]
    assert abs(both.value - sum(each.value for each in alone)) > 0.1


@pytest.mark.parametrize(
    ("run", "said"),
    [
        (lambda: PanelRun([3, 0], [1.0, 1.0], [[2], [1]]), "time 1 does not come after 1; sort the rows"),
        (lambda: PanelRun([3, 0], [1.0], [[2], [1]]), "do not fit"),
        (lambda: PanelRun([3, 0], [np.nan], [[2]]), "does not come after"),
        (lambda: PanelRun([3, 0], [0.0], [[2]], fired=[0]), "does not come after"),
        (lambda: PanelRun([3, 0], [1.0], [[4]]), "time 1: A 4 cannot be reached from A 3"),
        (lambda: PanelRun([3, 0], [1.0, 2.0], [[1], [2]]), "time 2: A 2 cannot be reached from A 1, B 2"),
        (lambda: PanelRun([3, 0], [1.0], [[1]], where=["t.csv, line 2"]), None),
        (lambda: PanelRun([3, 0], [1.0], [[9]], where=["t.csv, line 2"]), "t.csv, line 2: A 9 cannot be reached"),
        (lambda: PanelRun([3, 0], [1.0], [[1.5]]), "time 1, column A: 1.5 is no count"),
        (lambda: PanelRun([3, 0], [1.0], [[-1]]), "time 1, column A: -1 is no count"),
    ],
)
def test_data_that_cannot_be_are_refused(road, run, said):
    network = Network.from_text("A -> B, 1")

    def asked():
        return log_likelihood(network, PanelData({"A": {"A": 1}}, [run()]))

    if said is None:
        assert asked().value < 0
        return
    with pytest.raises(ValueError, match=said):
        asked()


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (lambda run: PanelData({"A": {"A": 1}}, []), "no runs"),
        (lambda run: PanelData({"A": {"A": 1}}, [run], {"B": Detected(0.5)}), "no column 'B'"),
        (lambda run: PanelData({"A": {"A": 1}, "B": {"B": 1}}, [run]), "a run has 1 columns; expected 2"),
        (lambda run: PanelData({"Z": {"Z": 1}}, [run]), "Z"),
        (lambda run: PanelData({"A": {"A": 1}}, [run]).with_observed(A=0.5), "has no parameter"),
    ],
)
def test_data_that_do_not_fit_the_network_are_refused(data, said):
    with pytest.raises(ValueError, match=said):
        log_likelihood(Network.from_text("A -> B, 1"), data(PanelRun([3, 0], [1.0], [[1]])))


def test_rates_that_depend_on_the_time_are_refused():
    tides = Network.from_text("0 -> A, 5 * (1 + cos(t))")
    with pytest.raises(ValueError, match="time"):
        log_likelihood(tides, PanelData({"A": {"A": 1}}, [PanelRun([0], [1.0], [[1]])]))
