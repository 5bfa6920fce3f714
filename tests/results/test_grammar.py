"""The page on one letter a cube or one a face says what its files hold, and its counts come out again."""

import re

import numpy as np
import pandas as pd
import pytest

from tests.results.grammar_page import COSTS_FILE, FIGURE, PAGE, counted, figure, filled, fitted


def test_the_page_says_what_the_files_hold():
    page = PAGE.read_text(encoding="utf-8")
    assert filled(page) == page
    changed = re.sub(r"(?<=\d\.)\d", lambda digit: str((int(digit[0]) + 1) % 10), page)  # control: other decimals
    assert filled(changed) != changed


@pytest.mark.validate
def test_the_counts_come_out_again():
    """All growths, from their seeds."""
    pd.testing.assert_frame_equal(counted(), pd.read_csv(COSTS_FILE), check_dtype=False)


def test_the_figure_shows_them():
    def paths(text):
        return re.findall(r'<path d="[^"]*" clip-path', text)

    assert paths(figure()) == paths(FIGURE.read_text(encoding="utf-8"))


def test_exponents_of_known_power_laws():
    x = np.arange(2.0, 7.0)
    assert fitted(x, 3 * x**2) == pytest.approx((2, 0), abs=1e-12)
    slope, half = fitted(x, x * (x + 1) / 2)
    assert 1.7 < slope < 1.85
    assert 0 < half < 0.1
    assert fitted(x, np.zeros(5)) is None
    rng = np.random.default_rng(1)
    noisy = [fitted(x, x * np.exp(rng.normal(0, 0.1, 5))) for _ in range(2000)]
    inside = sum(abs(slope - 1) < half for slope, half in noisy)
    assert abs(inside - 1900) < 4.9 * np.sqrt(2000 * 0.95 * 0.05)
