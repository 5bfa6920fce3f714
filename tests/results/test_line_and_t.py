"""The page results/line_and_t says what its tables hold, and the tables what chain and mechanics give."""

import re

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from kinetics.commands.models import network_of_book
from kinetics.rates import Rates
from mechsim.runs.record import book_of
from tests.results.line_and_t import CHAIN, FACTORS, PAGE, PAPER, RUNS, first_t, needed, ratios, t_network, written
from tests.results.line_and_t_runs import CANDIDATES, COMPOSITION, DURATION, FIRST, LAST, measured, scene_of
from tests.results.line_and_t_runs import RUNS as RUNS_EACH


def test_the_page_says_what_the_tables_hold():
    text = PAGE.read_text("utf-8")
    assert written(text) == text
    changed = re.sub(r"(?<=\d\.)\d", lambda digit: str((int(digit[0]) + 1) % 10), text)  # control
    assert written(changed) != changed
    with pytest.raises(ValueError, match="has not one block"):
        written("")


def test_the_numbers_outside_its_tables_are_those_of_the_runs():
    text = " ".join(
        re.sub(r"<!-- line and T: \w+ -->.*?<!-- end -->", "", PAGE.read_text("utf-8"), flags=re.DOTALL).split()
    )
    assert f"{COMPOSITION['monomer']} free cubes and nine Ls of four" in text
    assert COMPOSITION["quadmer.a"] + COMPOSITION["quadmer.b"] == 9
    assert f"Every row has {RUNS_EACH} runs of {DURATION:g} tu" in text
    assert "20,000 simulated runs each" in text


def test_rates_per_way_are_those_of_table_three():
    """By hand: two ways of four for the line's joins; the last docking with the rate of 1+3 times the factor."""
    derivation, known = book_of("t5")[1], Rates.load("table3").channels
    network = t_network(3.0)
    rates = dict(zip(network.channels, network.known_rates.tolist(), strict=True))
    assert network_of_book("line4")[0].ways[:4].tolist() == [4.0] * 4
    assert rates[FIRST] == pytest.approx(known["1+1->2"].rate / 2)
    assert rates["1+dimer.b->trimer.c"] == pytest.approx(known["1+2->3"].rate / 2)
    assert rates["dimer.a+dimer.a->quadmer.b"] == pytest.approx(known["2+2->4"].rate / 2)
    for name in LAST:
        assert rates[name] == pytest.approx(3.0 * known["1+3->4"].rate / 2)
    assert rates["quadmer.b->dimer.a+dimer.a"] == known["4->1+3"].rate
    assert rates["5->1+quadmer.a"] == 0.0
    assert set(derivation.structures) == set(network.species)


@pytest.mark.parametrize("cubes", PAPER)
def test_medians_of_the_chain_are_found_again(cubes):
    """By fewer runs, to five standard errors; between two factors it would be seen."""
    table = pd.read_csv(CHAIN)
    for factor in (1.0, 4.0):
        (row,) = table[(table["cubes"] == cubes) & (table["factor"] == factor)].itertuples()
        times = np.sort(first_t(cubes, factor, 3000))
        low, high = times[int(1500 - 2.5 * 3000**0.5)], times[int(1500 + 2.5 * 3000**0.5)]
        assert low < row.median < high
        assert row.few_low < row.median < row.few_high
    assert list(table["factor"].unique()) == list(FACTORS)
    assert needed(cubes, "few_low") < needed(cubes) < needed(cubes, "few_high")


def test_ratios_are_those_of_counts():
    found = ratios().set_index("candidate")
    assert list(found.index) == list(CANDIDATES)
    raw = pd.read_csv(RUNS).set_index("candidate")
    exposure = 24 * 23 / 2 * 4, 24 * 9 * 2  # pairs times ways
    assert raw["first_exposure"].to_numpy() == pytest.approx(exposure[0] * RUNS_EACH * DURATION, rel=1e-3)
    assert raw["last_exposure"].to_numpy() == pytest.approx(exposure[1] * RUNS_EACH * DURATION, rel=1e-3)
    for row in found.itertuples():
        assert row.ratio == pytest.approx((row.last_events / exposure[1]) / (row.first_events / exposure[0]), rel=1e-3)
        n = row.first_events + row.last_events
        for end, above in ((row.low, True), (row.high, False)):
            share = end / (end + exposure[0] / exposure[1])
            tail = (
                stats.binom.sf(row.last_events - 1, n, share) if above else stats.binom.cdf(row.last_events, n, share)
            )
            assert tail == pytest.approx(0.025, rel=1e-2)


def test_a_candidate_changes_what_it_says():
    base = scene_of(CANDIDATES["as it is"])
    assert base.numerics.engine == "own"
    assert "breaking" not in {each.effect for each in base.effects}
    for candidate in list(CANDIDATES.values())[1:]:
        assert scene_of(candidate) != base
    found = measured(CANDIDATES["latch-100"], 1, runs=1, duration=20.0)
    assert found["first_exposure"] == pytest.approx(1104 * 20.0, rel=1e-3)
    assert found["first_events"] > 0
