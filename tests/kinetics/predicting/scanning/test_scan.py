"""Scans against closed forms, samples against exact answers, and the same numbers however they are made."""

import json

import numpy as np
import pytest
from scipy.stats import binom

from kinetics import Model, Network, Rates, scan
from kinetics.assembly import RuleBook, derive
from kinetics.formats import read
from kinetics.predicting.scanning import answering
from kinetics.support.answer import CONFIDENCE

DECAY = "decay: A -> 0, k\nA = 10"
BINDING = "time unit: s\nA + B <-> AB, k, 0.1\nA = 12\nB = 8\nobservable: bound = 2 * AB"
QUESTIONS = (
    "E[AB] @ 10",
    "E[A] @ 3",
    "P=? [ F<=10 AB >= 4 ]",
    "P=? [ G<=2 A > 9 ]",
    "P=? [ A > 5 U<=5 AB = 4 ]",
    'R{"AB"}=? [ C<=7 ]',
)


def decay():
    return Network.from_text(DECAY, k=1.0)


def binding():
    return Network.from_text("\n".join(BINDING.splitlines()[:-1]), k=1e-2)


def test_decay_is_binomial_at_every_point():
    rates, copies = np.array([0.1, 0.5, 2.0]), np.array([3, 10])
    found = scan(decay(), {"k": rates, "A": copies}, ["E[A] @ 2", "P=? [ F<=2 A = 0 ]"])
    alive = np.exp(-2.0 * rates)[:, None]
    np.testing.assert_allclose(found.numbers("value")[..., 0], alive * copies, rtol=1e-12)
    np.testing.assert_allclose(found.numbers("value")[..., 1], (1 - alive) ** copies, rtol=1e-10)
    assert (found.words("kind") == "proven").all()
    for q, truth in enumerate((alive * copies, (1 - alive) ** copies)):
        low, high = found.numbers("low")[..., q], found.numbers("high")[..., q]
        assert ((low <= truth * (1 + 1e-14)) & (truth * (1 - 1e-14) <= high)).all()
        assert (high - low < 1e-9 * truth).all()
    assert found.words("why")[..., 0].tolist() == [["4 states", "11 states"]] * 3


def test_names_are_parameters_species_channels_and_cubes():
    network = Network.from_reactions({"decay": ({"A": 1}, {})}, [1.0])
    found = scan(Model.of(network, {"A": 4}), {"decay": [0.5, 1.0]}, "E[A] @ 1")
    np.testing.assert_allclose(found.numbers("value").ravel(), 4 * np.exp([-0.5, -1.0]), rtol=1e-12)
    line = derive(RuleBook.load("line4")).network
    applied = Rates.load("table3").apply(line)
    book = scan(applied, {"cubes": [4, 8]}, "E[monomer] @ 0")
    assert book.numbers("value").ravel().tolist() == [4.0, 8.0]
    by_species = scan(applied, {"monomer": [4, 8]}, "E[monomer] @ 50")
    by_cubes = scan(applied, {"cubes": [4, 8]}, "E[monomer] @ 50")
    np.testing.assert_array_equal(by_species.numbers("value"), by_cubes.numbers("value"))


def test_counts_at_the_start_follow_parameters_and_are_overruled():
    network = Network.from_text("A -> 0, k\nA = 2 * n\nn = 3", k=1.0)
    assert scan(network, {"n": [3, 5]}, "E[A] @ 0").numbers("value").ravel().tolist() == [6.0, 10.0]
    both = scan(network, {"n": [3, 5], "A": [1, 2]}, "E[A] @ 0")
    assert both.numbers("value")[..., 0].tolist() == [[1.0, 2.0]] * 2


def coverage(sampled, exact):
    """How many of the intervals (points, Q) hold the exact values, and how many there are."""
    low, high = (sampled.numbers(what) for what in ("low", "high"))
    told = np.isfinite(low)
    return int(((low <= exact) & (exact <= high))[told].sum()), int(told.sum())


def test_samples_agree_with_exact_answers_and_another_rate_does_not():
    over = {"k": np.geomspace(3e-3, 3e-2, 8), "A": [8, 12]}
    sampled = scan(binding(), over, QUESTIONS, max_states=0, runs=300, seed=4)
    assert (sampled.words("kind") == CONFIDENCE).all()
    assert all(why.startswith("300 runs") for why in sampled.words("why").ravel())
    exact = scan(binding(), over, QUESTIONS).numbers("value")
    inside, of = coverage(sampled, exact)
    assert of > 80
    # answers of one point come from the same runs; even so, of so many points few are off
    least = binom.ppf(1e-6, of // len(QUESTIONS), 0.95) / (of // len(QUESTIONS))
    assert inside / of > least
    other = scan(Network.from_text(BINDING.rsplit("\n", 1)[0].replace("0.1", "0.3"), k=1e-2), over, QUESTIONS)
    wrong, _ = coverage(sampled, other.numbers("value"))
    assert wrong / of < least  # the control: another rate of breaking is seen


def test_labels_of_every_chain_are_asked_alike_both_ways():
    """A chain of three steps: its end is the one deadlock; at the start only while nothing has happened."""
    network = Network.from_text("A -> B, k\nB -> C, 1\nC -> C + D, 0\nA = 1", k=1.0)
    asked = ["P=? [ F<=2 deadlock ]", "P=? [ G<=1 init ]", "P=? [ init U<=1 B = 1 ]"]
    exact = scan(network, {"k": [1.0, 3.0]}, asked)
    sampled = scan(network, {"k": [1.0, 3.0]}, asked, max_states=0, runs=2000, seed=2)
    np.testing.assert_allclose(exact.numbers("value")[:, 1], np.exp([-1.0, -3.0]), rtol=1e-9)
    assert ((sampled.numbers("value") > 0) & (sampled.numbers("value") < 1)).all()
    assert abs(sampled.numbers("value") - exact.numbers("value")).max() < 5.3 * 0.5 / np.sqrt(2000)
    named = Network.from_text("init -> deadlock, k\ninit = 1", k=1.0)  # of species with these names, their counts
    both = [scan(named, {"k": [1.0]}, "P=? [ F<=1 deadlock >= 1 ]", max_states=n, runs=500) for n in (9, 0)]
    assert abs(both[0].numbers("value") - both[1].numbers("value")).max() < 5.3 * 0.5 / np.sqrt(500)


def test_observables_are_asked_alike_both_ways(tmp_path):
    file = tmp_path / "model.rxn"
    file.write_text(BINDING + "\nk = 1e-2\n", encoding="utf-8")
    questions = ["E[bound] @ 4", 'R{"bound"}=? [ I=4 ]', "E[AB] @ 4"]
    exact = scan(read(file), {"k": [1e-2]}, questions).numbers("value").ravel()
    assert exact[0] == exact[1] == pytest.approx(2 * exact[2], rel=1e-12)
    sampled = scan(read(file), {"k": [1e-2]}, questions, max_states=0, runs=50).numbers("value").ravel()
    assert sampled[0] == sampled[1] == 2 * sampled[2]


def test_the_limit_of_states_is_the_switch():
    found = scan(binding(), {"B": [3, 8]}, "E[AB] @ 1", max_states=5, runs=20)
    assert found.words("kind").ravel().tolist() == ["proven", CONFIDENCE]
    exact, sampled = found.words("why").ravel()
    assert exact == "4 states"
    assert sampled.startswith("20 runs, standard error ")


def test_a_chain_without_end_has_limits_within_a_part_and_is_sampled_else():
    births = Network.from_text("0 -> X, b\nX -> 0, 1", b=2.0)
    part = scan(births, {"b": [1.0, 2.0]}, "P=? [ F<=1 X >= 3 ]", truncate=30)
    assert (part.words("kind") == "proven").all()
    sampled = scan(births, {"b": [1.0, 2.0]}, "P=? [ F<=1 X >= 3 ]", max_states=500, runs=400)
    assert (sampled.words("kind") == CONFIDENCE).all()
    assert coverage(sampled, part.numbers("value"))[0] == 2


def test_rates_that_depend_on_time_are_sampled():
    found = scan(Network.from_text("A -> 0, k * A * t\nA = 50", k=1.0), {"k": [0.1, 1.0]}, "E[A] @ 2", runs=300)
    assert (found.words("kind") == CONFIDENCE).all()
    truth = 50 * np.exp(-np.array([0.1, 1.0]) * 2.0)
    errors = [float(why.split()[-1]) for why in found.words("why").ravel()]
    assert (np.abs(found.numbers("value").ravel() - truth) < 5 * np.array(errors)).all()


def test_runs_that_are_all_alike_give_a_mean_no_interval():
    found = scan(decay(), {"k": [1e-9]}, ["E[A] @ 1", "P=? [ F<=1 A < 10 ]"], max_states=0, runs=20)
    mean, chance = found.rows
    assert (mean["value"], np.isnan(mean["low"]), np.isnan(mean["high"])) == (10.0, True, True)
    assert (chance["value"], chance["low"]) == (0.0, 0.0)
    assert chance["high"] == pytest.approx(1 - 0.025 ** (1 / 20))


def test_the_same_numbers_in_any_grid_order_and_number_of_workers():
    over = {"k": [1e-2, 3e-2, 1e-1], "A": [9, 12]}
    once = scan(binding(), over, QUESTIONS[:3], max_states=0, runs=30, seed=1)
    turned, told = {"A": [12, 9], "k": [1e-1, 3e-2, 1e-2]}, []
    given = {"max_states": 0, "runs": 30, "seed": 1, "workers": 2, "progress": told.append}
    backwards = scan(binding(), turned, QUESTIONS[:3], **given)
    assert any("by 2 workers in 1/2 of that" in text for text in told)
    for what in ("value", "low", "high"):
        np.testing.assert_array_equal(once.numbers(what), backwards.numbers(what)[::-1, ::-1].swapaxes(0, 1))
    other = scan(binding(), over, QUESTIONS[:3], max_states=0, runs=30, seed=2)
    assert (once.numbers("value") != other.numbers("value")).any()  # the control


def test_points_are_independent():
    """Not the same stream at each: with one, the decays at k and A would be those at other k, scaled."""
    found = scan(decay(), {"k": np.linspace(1.0, 1.0001, 20)}, "E[A] @ 1", max_states=0, runs=50)
    assert len(set(found.numbers("value").ravel())) > 5


def test_what_is_done_is_not_done_again(tmp_path, monkeypatch):
    over = {"k": [1e-2, 3e-2], "A": [9, 12]}
    once = scan(binding(), over, QUESTIONS[:2], max_states=0, runs=30, folder=tmp_path)
    made = []
    real = answering.answers_at
    monkeypatch.setattr(
        "kinetics.predicting.scanning.grid.answers_at", lambda *given: made.append(given[2]) or real(*given)
    )
    again = scan(binding(), over, QUESTIONS[:2], max_states=0, runs=30, folder=tmp_path)
    assert made == []
    assert again.answers == once.answers or again.rows == pytest.approx(once.rows, nan_ok=True)
    wider = scan(binding(), {**over, "A": [9, 10, 12]}, QUESTIONS[:2], max_states=0, runs=30, folder=tmp_path)
    assert [point["A"] for point in made] == [10, 10]
    np.testing.assert_array_equal(wider.numbers("value")[:, [0, 2]], once.numbers("value"))
    made.clear()
    scan(binding(), over, QUESTIONS[:2], max_states=0, runs=30, seed=1, folder=tmp_path)
    scan(Network.from_text("A + B <-> AB, k, 0.2\nA = 1\nB = 8", k=1.0), over, QUESTIONS[:2], runs=30, folder=tmp_path)
    assert len(made) == 8  # the control: another seed, another network


def test_interrupted_scans_keep_what_is_done(tmp_path):
    over = {"k": [1e-2, 2e-2, 3e-2, 4e-2]}

    def stop(text):
        if text.startswith("2 of"):
            raise KeyboardInterrupt

    part = scan(binding(), over, "E[AB] @ 1", folder=tmp_path, progress=stop)
    assert not part.is_complete
    assert len(part.rows) == 2
    assert np.isnan(part.numbers("value")[2:]).all()
    assert "2 of 4 points" in part.headline
    told = []
    whole = scan(binding(), over, "E[AB] @ 1", folder=tmp_path, progress=told.append)
    assert told == ["3 of 4 points", "4 of 4 points"]
    assert whole.is_complete
    with pytest.raises(KeyboardInterrupt):  # where there is nothing to give back
        scan(binding(), over, "E[AB] @ 2", progress=lambda _: None, folder=_Stopping(tmp_path))


class _Stopping:
    """A folder whose first use is interrupted."""

    def __init__(self, path):
        self.path = path

    def __fspath__(self):
        raise KeyboardInterrupt


def test_the_cost_is_told():
    told = []
    scan(decay(), {"k": np.linspace(0.1, 1, 12)}, "E[A] @ 1", progress=told.append)
    (cost,) = (text for text in told if "took" in text)
    assert told.index(cost) == 3
    assert cost.startswith("12 points, 9 still to be answered; those tried took ")
    assert "workers" not in cost
    scan(decay(), {"k": [1.0, 2.0]}, "E[A] @ 1", progress=told.append)
    assert told[-2:] == ["1 of 2 points", "2 of 2 points"]  # nothing is left to forecast


@pytest.mark.parametrize(
    ("over", "ask", "given", "said"),
    [
        ({}, "E[A] @ 1", {}, "no name to scan over"),
        ({"q": [1]}, "E[A] @ 1", {}, "'q' is no parameter, species or channel of the model; there are k, A$"),
        ({"kk": [1]}, "E[A] @ 1", {}, "did you mean k"),
        ({"cubes": [1]}, "E[A] @ 1", {}, "'cubes' is no parameter"),
        ({"value": [1]}, "E[A] @ 1", {}, "'value' is a column of the table"),
        ({"decay": [1]}, "E[A] @ 1", {}, "the rate constant of channel 'decay' is k; scan what it reads: k"),
        ({"k": []}, "E[A] @ 1", {}, "'k' takes no value"),
        ({"k": [-1.0]}, "E[A] @ 1", {}, "expected at least 0"),
        ({"A": [1.5]}, "E[A] @ 1", {}, "must be whole numbers"),
        ({"A": [-1]}, "E[A] @ 1", {}, "expected at least 0"),
        ({"k": [1]}, [], {}, "no question; give one"),
        ({"k": [1]}, "E[A]", {}, "cannot read the question"),
        ({"k": [1]}, ["E[A] @ 1", "E[A] @ 1"], {}, "is asked twice"),
        ({"k": [1]}, "E[B] @ 1", {}, "^unknown reward 'B'"),
        ({"k": [1]}, "E[B] @ 1", {"max_states": 0}, "^unknown reward 'B'"),
        ({"k": [1]}, "P=? [ F<=1 B > 0 ]", {"max_states": 0}, "^condition 'B > 0': unknown name 'B'"),
        ({"k": [1]}, "S=? [ B > 0 ]", {}, "^condition 'B > 0': unknown name 'B'"),
        ({"k": [1]}, 'R{"time"}=? [ F B > 0 ]', {}, "^condition 'B > 0': unknown name 'B'"),
        ({"k": [1]}, "P=? [ F A = 0 ]", {"truncate": "B < 3"}, "^condition 'B < 3': unknown name 'B'"),
        ({"k": [1]}, "P=? [ F A = 0 ]", {"max_states": 0}, "cannot be sampled: it has no time bound"),
        ({"k": [1]}, "S=? [ A = 0 ]", {"max_states": 0}, "cannot be sampled"),
        ({"k": [1]}, "E[A] @ 1", {"runs": 1}, "runs = 1; expected"),
        ({"k": [1]}, "E[A] @ 1", {"workers": 0}, "workers = 0"),
        ({"k": [1]}, "E[A] @ 1", {"max_states": -1}, "max_states = -1"),
    ],
)
def test_wrong_use_says_what_was_expected(over, ask, given, said):
    with pytest.raises(ValueError, match=said):
        scan(decay(), over, ask, **given)


@pytest.mark.parametrize(("law", "cure"), [("v * A", "scan what it reads: v"), ("2 * A", "write it with a parameter")])
def test_a_law_is_no_rate_constant(law, cure):
    network = Network.from_text(f"decay: A -> 0, {law}\nA = 3" + "\nv = 2" * ("v" in law))
    with pytest.raises(ValueError, match=f"the propensity of channel 'decay' is .*; {cure}"):
        scan(network, {"decay": [1.0]}, "E[A] @ 1")


def test_a_question_without_an_answer_at_a_point_says_so_and_the_others_go_on(tmp_path):
    asked = ['R{"time"}=? [ F A = 0 ]', "E[A] @ 0"]
    found = scan(decay(), {"k": [1.0, 0.0, 2.0]}, asked, folder=tmp_path)
    assert found.words("kind").tolist() == [["proven", "proven"], ["none", "proven"], ["proven", "proven"]]
    assert found.unanswered == 1
    assert found.is_complete
    assert np.isnan(found.numbers("value")[1, 0])
    assert "no finite mean" in found.rows[2]["why"]
    assert "1 without an answer" in found.headline
    assert str(found).count("none: the target is reached with probability 0 only") == 1
    again = scan(decay(), {"k": [1.0, 0.0, 2.0]}, asked, folder=tmp_path)
    assert again.to_dataframe().equals(found.to_dataframe())  # seconds too: it was kept
    found.plot()
    found.to_xarray()
    # nothing is sampled for ever, where too many states can be reached
    mixed = scan(decay(), {"A": [3, 30]}, ["P=? [ F A = 0 ]", "E[A] @ 1"], max_states=10, runs=20)
    assert mixed.words("kind").tolist() == [["proven", "proven"], ["none", CONFIDENCE]]
    assert "has no time bound" in mixed.rows[2]["why"]


def test_rewards_are_the_same_ones_exact_and_sampled(tmp_path):
    """One that is negative has no answer (it had a wrong one, called proven), and the time is one."""
    file = tmp_path / "model.rxn"
    file.write_text("A -> B, k\nk = 1\nA = 3\nobservable: gain = A - B\nobservable: half = A + 0.5 * B\n", "utf-8")
    asked = ["E[gain] @ 2", 'R{"gain"}=? [ C<=2 ]', 'R{"time"}=? [ C<=2 ]', "E[time] @ 2", "R=? [ I=2 ]", "E[half] @ 2"]
    exact = scan(read(file), {"k": [1.0]}, asked)
    sampled = scan(read(file), {"k": [1.0]}, asked, max_states=0, runs=200)
    for one, other in zip(exact.rows, sampled.rows, strict=True):
        assert (one["kind"] == "none") == (other["kind"] == "none")
        assert one["kind"] != "none" or one["why"] == other["why"]
    assert [row["kind"] for row in sampled.rows] == ["none"] * 2 + [CONFIDENCE] * 4
    assert "expected at least 0: ask for gains and losses as two rewards" in exact.rows[0]["why"]
    assert sampled.numbers("value")[0, 2:4].tolist() == pytest.approx([2.0, 1.0])
    assert exact.numbers("value")[0, 2:4].tolist() == pytest.approx([2.0, 1.0])
    assert exact.numbers("value")[0, 4] == exact.numbers("value")[0, 5]


def test_models_that_are_none():
    for none in ({"A": 1}, "nothing.rxn"):
        with pytest.raises(TypeError, match="expected a Network or a Model"):
            scan(none, {"k": [1]}, "E[A] @ 1")
    twice = Network.from_reactions({"A": ({"A": 1}, {})}, [1.0])
    with pytest.raises(ValueError, match="'A' is a species and a channel"):
        scan(twice, {"A": [1]}, "E[A] @ 1")


def test_the_tables():
    found = scan(binding(), {"k": [1e-2, 2e-2], "A": [9, 12]}, QUESTIONS[:2], max_states=9, runs=20)
    frame = found.to_dataframe()
    assert list(frame.columns[:6]) == ["k", "A", "question", "value", "low", "high"]
    assert len(frame) == 8
    cube = found.to_xarray()
    assert dict(cube.sizes) == {"k": 2, "A": 2, "question": 2}
    row = frame.iloc[5]
    assert float(cube["value"].sel(k=row["k"], A=row["A"], question=row["question"])) == row["value"]
    assert cube["A"].attrs["long_name"] == "A at time 0 (count)"
    json.dumps(found.rows)
    assert len(str(found).splitlines()) == 1 + 1 + 8 + 2
    assert "times in s" in str(found).splitlines()
    assert repr(found).startswith("<Scan: 4 points of k (2) x A (2), 2 questions: 8 proven; ")
    assert found._repr_html_().count("<tr>") == 9


def test_parquet_holds_the_table(tmp_path):
    import pandas as pd

    found = scan(decay(), {"k": [1.0, 2.0]}, "E[A] @ 1")
    assert found.to_parquet(tmp_path / "a.parquet") == tmp_path / "a.parquet"
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "a.parquet"), found.to_dataframe())


def test_rewards_until_a_condition_and_conditions_of_products_are_sampled():
    """Beside the exact answers; a condition that never holds has none."""
    network = Network.from_text("A -> B, k\nk = 1\nA = 3")
    asked = [
        'R{"time"}=? [ F A = 0 ]',
        'R{"A"}=? [ F A = 0 ]',
        "P=? [ A * B <= 2 U<=1 B >= 2 ]",
        "P=? [ G<=1 A * B < 2 ]",
    ]
    exact = scan(network, {"k": [1.0]}, asked)
    found = scan(network, {"k": [1.0]}, asked, max_states=0, runs=2000, seed=3)
    assert found.words("kind").tolist() == [[CONFIDENCE] * 4]
    value, low, high = (found.numbers(each)[0] for each in ("value", "low", "high"))
    assert (abs(value - exact.numbers("value")[0]) < 2.5 * (high - low)).all()  # five standard errors
    never = scan(network, {"k": [1.0]}, 'R{"time"}=? [ F A = 1 & B = 1 ]', max_states=0, runs=2)
    assert "the mean is infinite" in never.rows[0]["why"]
