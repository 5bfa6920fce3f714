"""Rankings: what is known of the shipped books, ties, order, rates with draws, bad input, the command."""

import json
from dataclasses import replace

import numpy as np
import pytest
from command_line import run_here
from known_systems import assert_follows_cdf
from ranked_books import DIMER, LINE4, NO_PAIRS, NO_TRIMERS, PAIRS, T5, T5_ALL, T5_BAR, TABLE3, question
from scipy.stats import gamma

from kinetics.assembly import RuleBook, check, derive
from kinetics.markov.transient import reachable
from kinetics.predicting.ranking import rank, ranking
from kinetics.predicting.ranking.ranked_book import pathway
from kinetics.rates import ClassRates
from kinetics.rates.class_entries import ClassRate


def figures(made):
    """Everything but what it cost."""
    return json.loads(
        json.dumps(made.as_dict()),
        object_hook=lambda found: {key: value for key, value in found.items() if key != "cpu_seconds"},
    )


# --- the books of the pathways ---


@pytest.mark.parametrize(
    ("book", "joins"),
    [
        (LINE4, ("1+1", "1+2", "1+3", "2+2")),
        (PAIRS, ("1+1", "2+2")),
        (NO_TRIMERS, ("1+1", "1+3", "2+2")),
        (NO_PAIRS, ("1+1", "1+2", "1+3")),
        (T5_BAR, ("1+1", "1+2", "2+3")),
        (T5, ("1+1", "1+2 x2", "1+3 x3", "2+2", "1+4 x2", "2+3")),
        (T5_ALL, ("1+1 x2", "1+2 x5", "1+3 x4", "2+2", "1+4 x2", "2+3")),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_books_of_a_pathway_are_correct(book, joins):
    assert check(book, slow_waves=False).is_correct
    made = derive(book)
    assert len(made.structures) == {4: 4, 5: 9}[len(book.target)]
    assert pathway(made, ClassRates.uniform(1.0, 1.0)) == joins


def test_a_pathway_leaves_out_what_needs_a_break():
    """Without breaks there are neither bars to stand on nor halves to mend."""
    assert pathway(derive(T5), ClassRates.uniform(1.0)) == ("1+1", "2+2", "1+4")
    assert pathway(derive(NO_TRIMERS), ClassRates.uniform(1.0)) == ("1+1", "2+2")


# --- what was found before, by another program (exact, and SSA where ± is large) ---


def test_pairs_beat_the_papers_line():
    made = rank([LINE4, PAIRS, NO_TRIMERS, NO_PAIRS], TABLE3)
    assert [c.name for c in made.books] == ["line4_no12", "line4_pairs", "line4", "line4_no22"]
    assert made.places == (1, 2, 3, 4)
    found = {c.name: (c.result.first.value, 15 * c.result.yield_.value) for c in made.books}
    assert found["line4"] == (pytest.approx(47.7, abs=0.05), pytest.approx(9.39, abs=0.005))
    assert found["line4_pairs"] == (pytest.approx(60.3, abs=0.05), pytest.approx(12.83, abs=0.005))
    assert found["line4_no12"] == (pytest.approx(60.3, abs=0.05), pytest.approx(12.94, abs=0.005))
    # Its mean of 63.3 holds the 0.03 % of runs that find no target by 2000 tu.
    assert found["line4_no22"] == (pytest.approx(62.93, abs=0.05), pytest.approx(6.37, abs=0.005))
    by_first = rank([LINE4, PAIRS, NO_TRIMERS, NO_PAIRS], TABLE3, by="first")
    assert by_first.places == (1, 2, 2, 4)  # neither the second nor the third joins a trimer before its first line
    assert by_first.ties_of("line4_no12") == ("line4_pairs",)


def test_bar_and_dimer_beat_the_papers_t_and_all_joins_ruin_it():
    made = rank([T5, T5_ALL, T5_BAR], ClassRates.uniform(7e-5), runs=400, seed=3)
    assert [c.name for c in made.books] == ["t5_bar", "t5", "t5_all"]
    assert made.places == (1, 2, 3)
    found = {c.name: (c.result.first.value, 12 * c.result.yield_.value) for c in made.books}
    assert found["t5"] == (pytest.approx(99.7, abs=1.5), pytest.approx(7.0, abs=0.05))
    assert found["t5_bar"] == (pytest.approx(72.7, abs=1.0), pytest.approx(9.5, abs=0.05))
    worst = made.books[-1].result.yield_
    assert worst.method == "ssa"
    assert worst.high * 12 < 0.4


# --- order and ties ---


def test_the_order_of_the_books_does_not_matter():
    books = [LINE4, PAIRS, NO_TRIMERS]
    made = rank(books, TABLE3, cubes=12, runs=50, seed=5, max_states=0)
    assert figures(rank(books[::-1], TABLE3, cubes=12, runs=50, seed=5, max_states=0)) == figures(made)
    alone = rank([PAIRS], TABLE3, cubes=12, runs=50, seed=5, max_states=0).books[0]
    again = next(c for c in made.books if c.name == PAIRS.name)
    assert alone.result.first.value == again.result.first.value
    other = rank([PAIRS], TABLE3, cubes=12, runs=50, seed=6, max_states=0).books[0]
    assert other.result.first.value != again.result.first.value


def test_differences_within_the_intervals_are_ties():
    """Yields of 0.863 and 0.856: told apart by exact figures, not by 50 runs."""
    exact, sampled = (rank([NO_TRIMERS, PAIRS], TABLE3, runs=50, max_states=n) for n in (100_000, 0))
    assert exact.places == (1, 2)
    assert sampled.places == (1, 1)
    assert sampled.ties_of("line4_no12") == ("line4_pairs",)
    assert "1=" in str(sampled)


def test_a_place_is_shared_with_its_leader_only():
    """0.50, 0.45, 0.40, each ± 0.04: the third ties with the second, but not with the first."""
    one = rank([DIMER], ClassRates.uniform(1.0), cubes=2, horizon=1.0).books[0]

    def like(name, value):
        figure = replace(one.result.yield_, value=value, low=value - 0.04, high=value + 0.04)
        return replace(one, name=name, result=replace(one.result, yield_=figure))

    candidates = tuple(like(name, value) for name, value in (("x", 0.50), ("y", 0.45), ("z", 0.40)))
    made = ranking.Ranking(candidates, "yield", 2, 1, 1.0, 100, 0, 0, 0)
    assert made.places == (1, 1, 3)
    assert [made.ties_of(name) for name in "xyz"] == [("y",), ("x", "z"), ("y",)]
    assert "z cannot be distinguished from y either" in made.table()
    with pytest.raises(ValueError, match="unknown book 'w'; ranked are x, y, z"):
        made.ties_of("w")


# --- rates that are not known exactly ---


def test_draws_follow_the_posterior_of_the_rates():
    """Two cubes that wait for ever: the mean is 1 / (4 k), and k has 20 events behind it."""
    rates = ClassRates(classes={"join": ClassRate(rate=2.0, events=20, exposure=10.0), "break": ClassRate(rate=0.0)})
    made = rank([DIMER], rates, cubes=2, horizon=8.0, draws=400, seed=2)
    drawn = 1 / (4 * made.books[0].drawn[:, 1])
    assert_follows_cdf(drawn, gamma(20.5, scale=0.1).cdf)
    with pytest.raises(AssertionError):
        assert_follows_cdf(drawn, gamma(20.5, scale=0.08).cdf)
    low, high = made.books[0].from_rates("first")
    assert low < 1 / 8 < high
    assert made.notes == ("the rates' intervals exclude break: taken as exact, because without evidence",)


def test_shared_draws_tell_books_apart_that_their_intervals_do_not():
    """A poorly known rate moves both books up and down together."""
    entry = ClassRate(rate=7e-5, events=4, exposure=4 / 7e-5)
    rates = ClassRates(classes={"join": entry, "break": ClassRate(rate=3e-5)})
    made = rank([PAIRS, NO_TRIMERS], rates, cubes=24, draws=60)
    (low, high), (other_low, other_high) = (c.from_rates("yield") for c in made.books)
    assert low < other_high  # the intervals overlap
    assert other_low < high
    assert made.places == (1, 2)
    assert "[" in made.table()


def test_draws_of_rates_without_evidence_are_not_made():
    made = rank([PAIRS], TABLE3, cubes=8, draws=50)
    assert made.draws == 0
    assert made.books[0].from_rates("yield") is None
    assert "taken as exact" in made.notes[0]


# --- around it ---


def test_ctrl_c_keeps_what_was_finished(monkeypatch):
    def interrupted(derivation, *rest):
        if derivation.book.name == PAIRS.name:
            raise KeyboardInterrupt
        return ranked_book(derivation, *rest)

    ranked_book = ranking.ranked_book
    monkeypatch.setattr(ranking, "ranked_book", interrupted)
    made = rank([LINE4, PAIRS], TABLE3, cubes=8)
    assert [c.name for c in made.books] == ["line4"]
    assert made.unfinished == ("line4_pairs",)
    assert "interrupted before line4_pairs" in made.table()
    with pytest.raises(KeyboardInterrupt):
        rank([PAIRS, LINE4], TABLE3, cubes=8)


def test_plot_shows_each_book_with_its_interval():
    from matplotlib.figure import Figure

    made = rank([LINE4, PAIRS], TABLE3, cubes=12, runs=20, max_states=30)
    ax = Figure().add_subplot()
    assert made.plot(ax) is ax
    assert [text.get_text() for text in ax.get_legend().get_texts()] == [
        f"{c.name}: {', '.join(c.pathway)}" for c in made.books
    ]
    assert "(tu)" in ax.get_xlabel()


@pytest.mark.parametrize(
    ("books", "settings", "message"),
    [
        ([], {}, "no books"),
        ([LINE4, T5], {}, "make different targets"),
        ([LINE4, LINE4], {}, "two books are called 'line4'"),
        ([LINE4, replace(PAIRS, target=None)], {}, "has no target"),
        ([RuleBook.load("t5_as_printed")], {}, r"only correct books are ranked; .* \(target not reached\)"),
        ([RuleBook.load("line4_as_printed")], {}, "only correct books are ranked"),
        ([LINE4, replace(PAIRS, letters=("a", "b", "d", "s"), seed_letter="s")], {}, "from a seed"),
        ([LINE4], {"cubes": 3}, "3 cubes do not suffice for a target of 4"),
        ([LINE4], {"cubes": 0}, "cubes = 0"),
        ([LINE4], {"horizon": 0.0}, "horizon = 0; expected a positive"),
        ([LINE4], {"horizon": float("nan")}, "horizon = nan"),
        ([LINE4], {"by": "speed"}, "by = 'speed'; expected one of yield, first"),
        ([LINE4], {"runs": 1}, "runs = 1"),
        ([LINE4], {"draws": 1}, "draws = 1"),
        ([LINE4], {"seed": -1}, "seed = -1"),
        ([LINE4, T5_BAR], {}, "different targets"),
    ],
)
def test_bad_input(books, settings, message):
    with pytest.raises(ValueError, match=message):
        rank(books, TABLE3, **settings)


def test_a_class_without_a_rate_is_told_before_any_work():
    with pytest.raises(ValueError, match=r"no rate for class 'join 2 f1 \+ 2 f2 touching 1'"):
        rank([T5], TABLE3)


# --- the command ---


def test_the_command(tmp_path):
    table, picture = tmp_path / "ranked.csv", tmp_path / "ranked.png"
    done = run_here(
        *("rules", "rank", "line4", "line4_pairs", "--rates", "table3"),
        *("--json", "--csv", table, "--plot", picture),
        cwd=tmp_path,
    )
    found = done.json
    assert [(book["place"], book["book"]) for book in found["books"]] == [(1, "line4_pairs"), (2, "line4")]
    assert found["pathways"]["line4_pairs"] == ["1+1", "2+2"]
    assert found["rates"]["classes"]["join 1 f1 + 1 f1 touching 1"]["rate"] == pytest.approx(7.88e-5 / 2)
    assert found["books"][0]["yield"]["method"] == "transient"
    assert len(table.read_text().splitlines()) == 1 + 2 * 3
    assert picture.read_bytes()[:4] == b"\x89PNG"


TARGET = 'cubes = [[0, 0, 0], [0, 0, 1], [0, 0, 2], [0, 0, 3]]\ntops = ["z", "z", "z", "z"]\n'


def test_the_command_compiles_a_target(tmp_path):
    """Five choices of joins lead to lines of four; the best book can be used as it is."""
    (tmp_path / "line.toml").write_text(TARGET, encoding="utf-8")
    shared = ("--rates", "table3_geometric", "--time-limit", "inf", "--json")
    found = run_here("rules", "rank", "line.toml", *shared, "--best", "best.toml", cwd=tmp_path).json
    assert [(book["place"], ", ".join(found["pathways"][book["book"]])) for book in found["books"]] == [
        (1, "1+1, 1+3, 2+2"),
        (2, "1+1, 2+2"),
        (3, "1+1, 1+2, 1+3, 2+2"),
        (4, "1+1, 1+2, 1+3"),
        (5, "1+1, 1+2, 2+2"),
    ]
    assert found["notes"] == ["5 books compiled of target 'line': all choices of joins for which one was found"]
    again = run_here("rules", "rank", "best.toml", "line4", *shared, cwd=tmp_path).json
    assert again["books"][0]["book"] == "best"
    assert again["books"][0]["yield"]["value"] == found["books"][0]["yield"]["value"]


def test_the_command_takes_rates_by_class_and_uniform_ones(tmp_path):
    TABLE3.save(tmp_path / "rates.toml")
    shared = ("rules", "rank", "line4", "--cubes", "12", "--horizon", "100", "--json")
    by_class = run_here(*shared, "--rates", "rates.toml", cwd=tmp_path).json
    assert by_class["books"][0]["yield"]["value"] == pytest.approx(
        rank([LINE4], TABLE3, cubes=12, horizon=100.0).books[0].result.yield_.value
    )
    uniform = run_here(*shared, "--join", "1e-3", "--break", "1e-4", cwd=tmp_path).json
    assert uniform["rates"]["classes"] == {"join": {"rate": 1e-3}, "break": {"rate": 1e-4}}


def test_the_command_reports_probabilities_that_are_barely_above_zero(tmp_path):
    """Three joins in 1e-5 tu: (Q t)**3 / 6, about 1e-19, which a difference from 1 loses or even turns negative."""
    asked = question(LINE4, ClassRates.uniform(1e-3), 12, 1e-5)
    space = reachable(asked.model.network, asked.model.initial)
    has_target = space.states[:, asked.model.network.index(asked.target)] >= 1
    thrice = np.linalg.matrix_power(space.generator().toarray() * 1e-5, 3)
    leading = thrice[0, has_target].sum() / 6
    shared = ("rules", "rank", "line4", "--join", "0.001", "--cubes", "12", "--json", "--horizon")
    reached = run_here(*shared, "1e-5", cwd=tmp_path).json["books"][0]["reached"]
    assert reached["value"] == pytest.approx(leading, rel=1e-4, abs=0.0)
    sampled = run_here(*shared, "1e-300", "--max-states", "0", cwd=tmp_path).json["books"][0]
    assert (sampled["reached"]["value"], sampled["first"]["value"]) == (0.0, 1e-300)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("line4",), "give the rates by either"),
        (("line4", "--rates", "table3", "--join", "1"), "give the rates by either"),
        (("line4", "--rates", "table3", "--break", "1"), "--break goes with --join"),
        (("line4", "--join", "1", "--rates-book", "line4"), "--rates-book goes with --rates"),
        (("line4", "--join", "nan"), "uniform rates"),
        (("t5", "--rates", "table3"), "Say which book by --rates-book"),
        (("t5", "--rates", "table3", "--rates-book", "line4"), "no rate for class"),
        (("line5", "--join", "1"), "unknown rule book 'line5'"),
    ],
)
def test_mistakes_of_the_command(arguments, message):
    from click.testing import CliRunner

    from kinetics.commands.rank import rank as command

    done = CliRunner().invoke(command, list(arguments))
    assert isinstance(done.exception, ValueError)
    assert message in str(done.exception)
