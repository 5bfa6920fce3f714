"""Derivatives of a chain's answers: closed forms, differences of the answers themselves, names, input and pictures."""

from dataclasses import replace

import numpy as np
import pytest
from known_systems import decay, line, network, switch
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

from kinetics.markov import Chain, Sensitivity
from kinetics.markov.questions import parse

QUESTIONS = (
    "P=? [ F<=100 quadmer >= 1 ]",
    "P=? [ G<=50 dimer <= 3 ]",
    "P=? [ trimer == 0 U<=200 quadmer >= 1 ]",
    "P=? [ trimer == 0 U quadmer >= 1 ]",
    'R{"quadmer"}=? [ I=300 ]',
    'R{"dimer"}=? [ C<=300 ]',
    'R{"monomer"}=? [ F quadmer >= 2 ]',
    'R{"trimer"}=? [ S ]',
    "S=? [ quadmer >= 2 ]",
)


def bimolecular():
    """Binding, release and a leak of the complex."""
    reactions = {
        "bind": ((1, 1, 0, 0), (0, 0, 1, 0)),
        "release": ((0, 0, 1, 0), (1, 1, 0, 0)),
        "leak": ((0, 0, 1, 0), (1, 0, 0, 1)),
        "back": ((0, 0, 0, 1), (0, 1, 0, 0)),
    }
    return network(("A", "B", "AB", "C"), reactions, [0.03, 1.5, 0.2, 0.01])


def difference(model, initial, question, channel, step=2e-3):
    """d answer / d ln k by central differences, twice extrapolated (Richardson): right to step**6."""

    def answer(x):
        rates = np.array(model.known_rates, dtype=float)
        rates[channel] *= np.exp(x)
        return parse(question).value(Chain.of(model.with_rates(rates), initial)).value

    one, two, four = ((answer(k * step) - answer(-k * step)) / (2 * k * step) for k in (1, 2, 4))
    once, again = (4 * one - two) / 3, (4 * two - four) / 3
    return (16 * once - again) / 15


def assert_differences(model, initial, question):
    found = parse(question).derivatives(Sensitivity(Chain.of(model, initial)))
    expected = [difference(model, initial, question, r) for r in range(len(model.channels))]
    # a difference over 4e-3 of what is known to some 1e-14 of the answer
    atol = 1e-11 * abs(found.answer.value)
    assert_allclose(found.value, expected, rtol=1e-6, atol=atol, err_msg=question)
    assert found.answer.value == pytest.approx(parse(question).value(Chain.of(model, initial)).value, rel=1e-12)
    # the control: the derivatives of two channels exchanged
    assert np.abs(found.value - np.roll(expected, 1)).max() > 1e-3 * np.abs(expected).max()


@pytest.mark.parametrize("question", QUESTIONS)
def test_differences_on_the_line_of_four(question):
    assert_differences(line(), {"monomer": 10}, question)


@pytest.mark.parametrize(
    "question", ["P=? [ F<=2 C >= 2 ]", 'R{"AB"}=? [ I=3 ]', 'R{"AB"}=? [ F C >= 3 ]', "S=? [ C > 2 ]"]
)
def test_differences_of_binding(question):
    assert_differences(bimolecular(), {"A": 4, "B": 6}, question)


def test_decay():
    """Mean n exp(-k t): d / d ln k = -k t n exp(-k t). Extinction by t and its mean time: sums of 1 / (k i)."""
    k, n, t = 0.7, 5, 1.3
    asked = Sensitivity(Chain.of(decay(k), {"X": n}))
    at = asked.reward("X", at=t)
    true = -k * t * n * np.exp(-k * t)
    assert at.low[0] <= true <= at.high[0]
    assert at.elasticity[0] == pytest.approx(-k * t, rel=1e-12)
    assert at.by_constant[0] == pytest.approx(true / k, rel=1e-12)
    low, high = at.elasticity_bounds
    assert low[0] <= -k * t <= high[0]
    assert high[0] - low[0] < 1e-10
    extinct = asked.until("X == 0", by=t)
    gone = 1 - np.exp(-k * t)
    assert extinct.value[0] == pytest.approx(n * gone ** (n - 1) * k * t * np.exp(-k * t), rel=1e-12)
    assert asked.passage("X == 0").elasticity[0] == pytest.approx(-1.0, rel=1e-12)
    spent = asked.reward("X", up_to=t)
    assert spent.value[0] == pytest.approx(n * (t * np.exp(-k * t) - gone / k), rel=1e-11)


def test_a_switch():
    """A <-> B: the share of B is a / (a + b) (1 - exp(-(a + b) t)), for every copy on its own."""
    a, b, t, n = 0.8, 0.3, 0.9, 7
    found = Sensitivity(Chain.of(switch(a, b), {"A": n})).reward("B", at=t)
    both, gone = a + b, np.exp(-(a + b) * t)
    by_a = n * (b / both**2 * (1 - gone) + a / both * t * gone)
    by_b = n * (-a / both**2 * (1 - gone) + a / both * t * gone)
    assert_allclose(found.by_constant, [by_a, by_b], rtol=1e-12)
    rest = Sensitivity(Chain.of(switch(a, b), {"A": n})).reward("B", stationary=True)
    assert_allclose(rest.elasticity, [b / both, -b / both], rtol=1e-11)


def test_a_rate_law_has_a_factor_before_it():
    """X -> nothing at vmax X / (K + X) with one copy: an exponential wait of rate vmax / (K + 1)."""
    model = replace(decay(1.0), laws={"decay": "2.0 * X / (3.0 + X)"})
    found = Sensitivity(Chain.of(model, {"X": 1})).until("X == 0", by=1.5)
    assert found.value[0] == pytest.approx(0.75 * np.exp(-0.75), rel=1e-12)
    assert found.is_bound  # by what interval arithmetic knows of the law
    assert found.low[0] <= 0.75 * np.exp(-0.75) <= found.high[0]


def test_chains_from_elsewhere_name_their_parameters():
    rates = np.array([[0.0, 2.0, 1.0], [0.5, 0.0, 3.0], [0.0, 0.0, 0.0]])
    chain = Chain(rates, 0)
    with pytest.raises(ValueError, match="comes from no network"):
        Sensitivity(chain)
    with pytest.raises(ValueError, match="no parameters"):
        Sensitivity(chain, {})
    with pytest.raises(ValueError, match=r"parameter 'k' has shape \(2, 2\)"):
        Sensitivity(chain, {"k": np.ones((2, 2))})
    found = Sensitivity(chain, {"all": rates > 0, "half": 0.5 * (rates > 0)}).passage(np.arange(3) == 2)
    assert_allclose(found.elasticity, [-1.0, -0.5], rtol=1e-12)
    assert np.isnan(found.by_constant).all()


def test_where_no_rate_matters():
    asked = Sensitivity(Chain.of(decay(), {"X": 3}))
    for found in (asked.until("X == 3"), asked.until("X == 0"), asked.until("X == 4"), asked.reward("X", at=0.0)):
        assert not found.value.any()
        assert not found.high.any()
    never = asked.until("X == 4")
    assert np.isnan(never.elasticity).all()
    with pytest.raises(ValueError, match="no finite mean"):
        Sensitivity(Chain.of(decay(), {"X": 3})).passage("X == 4")
    with pytest.raises(ValueError, match="give one of at"):
        asked.reward("X")
    still = Sensitivity(Chain(np.zeros((2, 2)), 0), {"k": np.ones((2, 2))}).until(np.array([False, True]))
    assert still.is_bound
    assert not still.value.any()


def test_an_answer_shows_itself():
    found = Sensitivity(Chain.of(line(), {"monomer": 10})).until("quadmer >= 1", by=100)
    assert str(found).splitlines()[0].split() == ["parameter", "elasticity", "+-", "d", "/", "d", "ln"]
    assert len(found.to_dict()["elasticity"]) == 8
    ax = Figure().add_subplot()
    assert found.plot(ax) is ax
    assert len(ax.patches) == 8
