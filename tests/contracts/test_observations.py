"""What every observation model keeps: probabilities that sum to 1, a support that holds them, and right slopes."""

import numpy as np
import pytest

from kinetics.markov.panels.observations import OBSERVATIONS, Censored, Detected, Exact, Gaussian, Rounded

MEMBERS = [
    Exact(),
    Detected(0.3),
    Detected(0.9),
    Detected(1.0),
    Rounded(0.0),
    Rounded(5.0),
    Censored(),
    Censored({3.5: (2, 6), 40.5: (40, np.inf)}),
    Gaussian(0.7),
    Gaussian(4.0),
]
COUNTS = np.arange(60.0)


def test_all_are_tried():
    assert {type(member) for member in MEMBERS} == set(OBSERVATIONS)


@pytest.mark.parametrize("member", MEMBERS, ids=repr)
def test_weights_are_a_law_of_what_is_seen(member):
    fine = np.arange(-40.0, 101.0, 0.05) if isinstance(member, Gaussian) else np.arange(0.0, 100.0)
    table = np.array([member.weights(COUNTS, float(seen)) for seen in fine])
    assert table.shape == (fine.size, COUNTS.size)
    assert (table >= 0).all()
    if isinstance(member, Rounded):
        whole = 2 * member.half + 1  # numbers to which a count may have been rounded, of those that are whole
        assert (table[:, 10:20].sum(axis=0) == whole).all()
    else:
        width = 0.05 if isinstance(member, Gaussian) else 1.0
        np.testing.assert_allclose(table.sum(axis=0) * width, 1.0, rtol=1e-9)


def test_a_number_may_stand_for_an_interval():
    some = Censored({3.5: (2, 6), 40.5: (40, np.inf)})
    assert (some.weights(COUNTS, 3.5) == ((COUNTS >= 2) & (COUNTS <= 6))).all()
    assert (some.weights(COUNTS, 40.5) == (COUNTS >= 40)).all()
    rng = np.random.default_rng(1)
    assert some.drawn(np.array([1.0, 2.0, 6.0, 7.0]), 3.5, rng).tolist() == [1.0, 3.5, 3.5, 7.0]
    assert some.drawn(np.array([1.0, 2.0]), np.nan, rng).tolist() == [1.0, 2.0]


@pytest.mark.parametrize("member", MEMBERS, ids=repr)
def test_the_support_holds_all_weights(member):
    for seen in (0.0, 3.0, 17.0):
        low, high = member.support(seen)
        outside = (low > COUNTS) | (high < COUNTS)
        assert not member.weights(COUNTS, seen)[outside].any()
        assert member.weights(COUNTS, seen)[~outside].any()


@pytest.mark.parametrize("member", [m for m in MEMBERS if m.parameter is not None and m.parameter != 1.0], ids=repr)
def test_slopes_are_those_of_the_weights(member):
    size, step = member.parameter, 1e-6
    for seen in (0.0, 3.0, 17.0):
        up, down = (member.with_parameter(size + sign * step).weights(COUNTS, seen) for sign in (1, -1))
        np.testing.assert_allclose(member.slopes(COUNTS, seen), (up - down) / (2 * step), rtol=1e-6, atol=1e-8)


def test_the_slope_at_certain_detection_is_one_sided():
    down = Detected(1.0 - 1e-7).weights(COUNTS, 5.0)
    np.testing.assert_allclose(
        Detected(1.0).slopes(COUNTS, 5.0), (Detected(1.0).weights(COUNTS, 5.0) - down) / 1e-7, atol=1e-4
    )


@pytest.mark.parametrize("member", [m for m in MEMBERS if m.parameter is None], ids=repr)
def test_what_has_no_parameter_says_so(member):
    for refused in (lambda: member.with_parameter(0.5), lambda: member.slopes(COUNTS, 1.0)):
        with pytest.raises(ValueError, match="has no parameter"):
            refused()


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda: Detected(0.0), "p = 0; expected a probability above 0"),
        (lambda: Detected(1.2), "at most 1"),
        (lambda: Detected(float("nan")), "p"),
        (lambda: Gaussian(0.0), "sd = 0"),
        (lambda: Rounded(-1.0), "half = -1"),
        (lambda: Exact().support(2.5), r"2.5 is no count; expected a whole number"),
        (lambda: Exact().support(-1.0), "-1 is no count"),
        (lambda: Detected(0.5).support(0.5), "0.5 is no number of copies seen"),
        (lambda: Rounded(5.0).support(-9.0), "holds no count"),
        (lambda: Censored({9.0: (1, 2)}), "9 stands for counts from 1 to 2; expected it to lie between"),
        (lambda: Censored({2.5: (1, 4)}).support(3.5), "3.5 is neither a count nor stands for an interval"),
    ],
)
def test_bad_numbers_are_refused(made, said):
    with pytest.raises(ValueError, match=said):
        made()
