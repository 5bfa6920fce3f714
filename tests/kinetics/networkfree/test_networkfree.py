"""Growth without a network: the distributions of the derived network where both run, closed forms, larger books."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from command_line import run_here
from derived_books import derived
from known_systems import FALSE_ALARM, assert_follows_cdf, assert_follows_table

from kinetics import Direct, Network, Transient, first_passage, simulate, solve
from kinetics.assembly import RuleBook, Senses, Structure, derive
from kinetics.assembly.rules.conditions import Combination, Dissociation, Internal
from kinetics.networkfree import Growth, Growths, grow
from kinetics.networkfree import tank as networkfree_tank
from kinetics.networkfree.growth import aligned
from kinetics.networkfree.simulate import free_cubes
from kinetics.networkfree.tank import bridges
from kinetics.rates import ClassRates

LINE4, T5, PYRAMID = (RuleBook.load(name) for name in ("line4", "t5", "pyramid45"))
STICKY = RuleBook("sticky", ("a",), "a", Senses(faces="one"), combine=(Combination(rule="stick", becomes="a"),))
SEQUENTIAL = replace(LINE4, semantics=LINE4.semantics.replace(update="sequential"))
# Side faces that meet at parallel axes make other letters than those that meet crossed: the twist decides.
TWIST = RuleBook(
    "twist",
    ("a", "p", "c"),
    "a",
    Senses(faces="two", roll=True),
    combine=tuple(
        Combination(rule=roll, letter="a", face="f2", partner="a", partner_face="f2", roll=roll, becomes=becomes)
        for roll, becomes in (("parallel", "p"), ("crossed", "c"))
    ),
    dissociate=(Dissociation(rule="alone", neighbours=[], becomes="a"),),
)


def varied(rate_class):
    """Rates that differ by event, sizes, faces and the number touched."""
    return alike(rate_class) * (1.0 if rate_class.touched == 1 else 0.3)


def alike(rate_class):
    """The same without regard to the number touched."""
    scale = 1.0 + 0.5 * rate_class.sizes[0] + 0.25 * rate_class.sizes[1] + 0.75 * rate_class.faces.count("f2")
    return scale * (0.004 if rate_class.event == "join" else 0.03)


def network_of(book, rate, cubes) -> tuple:
    """Derivation and network of all that so many cubes can make; a channel's rate is the mean over its ways."""
    derivation = derive(book, max_cubes=cubes, partial=True)
    constants = [sum(n * rate(c) for c, n in ways.items()) / sum(ways.values()) for ways in derivation.events.values()]
    return derivation, derivation.network.with_rates(constants)


def with_like_pairs_twice(network: Network) -> Network:
    """The mistake of counting A + B and B + A for like structures."""
    return network.with_rates(network.rate_constants * np.where(network.reactants.max(axis=1) == 2, 2.0, 1.0))


def with_twists_alike(network: Network) -> Network:
    """The mistake of giving each product the same weight, however many twists make it: here 3/4 and 1/4."""
    skewed = network.rate_constants.copy()
    first, second = np.flatnonzero(network.reactants.sum(axis=1) == 2)[:2]
    skewed[[first, second]] *= (1.5, 0.5)
    return network.with_rates(skewed)


def cells(growths, derivation, space, time):
    """How many runs are in each state of the network at a time."""
    names = derivation.network.species
    table = np.zeros(len(space), dtype=int)
    for run in growths.runs:
        held = {names[derivation.species_of(s)]: copies for s, copies in run.at(time).items()}
        table[int(space.index_of(derivation.network.state(held)))] += 1
    return table


@pytest.mark.parametrize(
    ("book", "cubes", "times", "runs", "mistake"),
    [
        pytest.param(LINE4, 8, (4.0, 40.0), 1000, with_like_pairs_twice, marks=pytest.mark.validate),
        pytest.param(T5, 8, (5.0, 60.0), 1000, with_like_pairs_twice, marks=pytest.mark.validate),
        (TWIST, 6, (4.0, 40.0), 1500, with_twists_alike),
        (STICKY, 5, (0.5, 5.0), 1200, with_like_pairs_twice),  # loops hold; twelve squares, plates and lines
        (SEQUENTIAL, 5, (5.0, 30.0), 1200, with_like_pairs_twice),
    ],
    ids=lambda value: getattr(value, "name", None),
)
def test_agrees_with_the_master_equation_of_the_derived_network(book, cubes, times, runs, mistake):
    """The whole distribution of what the tank holds, at two times."""
    derivation, network = network_of(book, varied, cubes)
    start = derivation.species_of(book.monomer())
    initial = np.bincount([start] * cubes, minlength=len(network.species))
    exact = solve(network, Transient(), initial, times)
    wrong = solve(mistake(network), Transient(), initial, times)
    growths = grow(book, varied, cubes, times[-1], runs, seed=3)
    for row, time in enumerate(times):
        table = cells(growths, derivation, exact.space, time)
        assert_follows_table(table, exact.probabilities[row], FALSE_ALARM / 10)
    assert np.array_equal(wrong.space.states, exact.space.states)
    early = cells(growths, derivation, exact.space, times[0])
    with pytest.raises(AssertionError):
        assert_follows_table(early, wrong.probabilities[0], FALSE_ALARM / 10)


def test_places_that_touch_several_cubes_are_filled_at_a_rate_of_their_own():
    """Squares of four sticky cubes close at .3 of the rate of open places; the control fills them as these."""
    cubes, times = 5, (1.0, 5.0)
    derivation, network = network_of(STICKY, varied, cubes)
    assert {c.touched for c in derivation.rate_classes if c.event == "join"} == {1, 2}
    initial = np.bincount([0] * cubes, minlength=len(network.species))
    exact, wrong = (
        solve(known, Transient(), initial, times) for known in (network, network_of(STICKY, alike, cubes)[1])
    )
    growths = grow(STICKY, varied, cubes, times[-1], 2000, seed=8)
    table = cells(growths, derivation, exact.space, times[-1])
    assert_follows_table(table, exact.probabilities[-1], FALSE_ALARM)
    with pytest.raises(AssertionError):
        assert_follows_table(table, wrong.probabilities[-1], FALSE_ALARM)


def test_a_join_without_a_rate_is_refused_when_it_happens():
    """Rates of open places alone: the first place that touches more is an error that names its class."""
    known = ClassRates(classes={"join touching 1": {"rate": 4e-3}, "break": {"rate": 0.0}})
    assert grow(STICKY, known, 2, 50.0, runs=3).runs
    with pytest.raises(ValueError, match=r"no rate for class 'join .* touching [2-9]'; add it"):
        grow(STICKY, known, 12, 50.0, runs=3)


@pytest.mark.validate
def test_agrees_with_the_direct_method_in_a_larger_tank():
    """60 cubes of line4: the means of the two samples differ by chance alone; joins a fifth too fast are seen."""
    times = [1.0, 60.0]
    _, network = network_of(LINE4, varied, 4)
    ours = grow(LINE4, varied, 60, times[-1], runs=150, seed=5).by_size(times)[:, :, 1:5]
    theirs = simulate(network, Direct(), [60, 0, 0, 0], times, runs=5000, seed=5)

    def gaps(other):
        spread = np.sqrt(ours.var(axis=0, ddof=1) / len(ours) + other.standard_error() ** 2)
        return np.abs(ours.mean(axis=0) - other.mean()) / spread

    assert gaps(theirs).max() < 5.7  # 8 comparisons at 1e-6 in all
    joins = network.reactants.sum(axis=1) == 2
    faster = network.with_rates(network.rate_constants * np.where(joins, 1.2, 1.0))
    assert gaps(simulate(faster, Direct(), [60, 0, 0, 0], times, runs=5000, seed=5)).max() > 5.7


def only_dimers(join, break_):
    """Rates under which single cubes pair up, and nothing else happens."""

    def rate(rate_class):
        if rate_class.event == "break":
            return break_
        return join if rate_class.sizes == (1, 1) else 0.0

    return rate


def test_first_pair_and_last_pair_of_irreversible_dimers():
    """From n cubes the first join comes at rate 4 k n (n - 1) / 2, the last of 4 cubes' two at 4 k (6 + 1)."""
    k, n = 1e-3, 20
    growths = grow(LINE4, only_dimers(k, 0.0), n, 1e6, runs=2000, seed=1)
    dimer = derive(LINE4).structures["dimer"]
    first = growths.first_times(dimer)
    rate = 4 * k * n * (n - 1) / 2
    assert_follows_cdf(first, lambda t: 1 - np.exp(-rate * t))
    with pytest.raises(AssertionError):  # a pair counted twice
        assert_follows_cdf(first, lambda t: 1 - np.exp(-2 * rate * t))
    last = np.array([run.times[-1] - run.times[-2] for run in growths.runs])
    assert_follows_cdf(last, lambda t: 1 - np.exp(-4 * k * t))
    assert all(run.times.size == n // 2 for run in growths.runs)
    assert (growths.count(dimer, [1e6]) == n // 2).all()


@pytest.mark.validate
def test_equilibrium_of_dimers():
    """Detailed balance: p(d + 1) / p(d) = 4 k (n - 2 d) (n - 2 d - 1) / (2 kb (d + 1))."""
    k, kb, n = 2e-3, 0.1, 12
    weights = [1.0]
    for d in range(n // 2):
        weights.append(weights[-1] * 4 * k * math.comb(n - 2 * d, 2) / (kb * (d + 1)))
    stationary = np.array(weights) / sum(weights)
    growths = grow(LINE4, only_dimers(k, kb), n, 80.0, runs=1200, seed=2)
    dimers = growths.count(derive(LINE4).structures["dimer"], [80.0])[:, 0]
    observed = np.bincount(dimers, minlength=stationary.size)
    assert_follows_table(observed, stationary)
    shifted = stationary * 2.0 ** np.arange(stationary.size)  # a like pair counted twice
    with pytest.raises(AssertionError):
        assert_follows_table(observed, shifted / shifted.sum())


@pytest.mark.parametrize("cubes", [60, 200])
def test_books_beyond_enumeration(cubes):
    """Identical sticky cubes: the polycubes of 60 cubes are beyond counting, and bonds in loops do not break."""
    growths = grow(STICKY, ClassRates.uniform(1e-3, 3e-2), cubes, 10.0, runs=2, seed=4)
    times = np.linspace(0.0, 10.0, 21)
    assert (growths.by_size(times) @ np.arange(growths.most + 1) == cubes).all()
    assert (growths.largest([10.0]) > cubes // 2).all()
    for run in growths.runs:
        for structure, copies in run.at(10.0).items():
            assert copies == 1 or len(structure) < 5
            assert structure == structure.canonical("one")
            Structure(structure.positions, structure.rotations, structure.letters)  # connected, no overlap


def test_pyramid_grows_from_its_seed():
    """45 cubes from a seed in 200 free cubes at 7e-5 a pair of faces: the exact distribution, mean 557.7 tu, SD 118.

    Rules by which neither side waited for the other took 528.8 tu.
    """
    derivation = derived("pyramid45")
    network = derivation.network.with_rates([7e-5] * len(derivation.events))
    names = {s: network.species[derivation.species_of(s)] for s in (PYRAMID.monomer(), PYRAMID.seed(), PYRAMID.target)}
    passage = first_passage(network, {names[PYRAMID.monomer()]: 200, names[PYRAMID.seed()]: 1}, names[PYRAMID.target])
    growths = grow(PYRAMID, ClassRates.uniform(7e-5), 200, 1200.0, runs=12, seed=6)
    first = growths.first_times(PYRAMID.target)
    assert_follows_cdf(first, passage.cdf)
    assert abs(first.mean() - passage.mean) < 4.9 * passage.sd / math.sqrt(len(first))
    with pytest.raises(AssertionError):
        assert_follows_cdf(first, lambda t: passage.cdf(2 * t))
    for run in growths.runs:
        assert run.at(1200.0) == {PYRAMID.monomer(): 156, PYRAMID.target.canonical("two"): 1}
        assert (run.after[:, 1] == -1).all()  # nothing breaks


def test_one_seed_gives_one_result(monkeypatch):
    """Also for other numbers of runs and other ends, and however much is remembered."""

    def record(run):
        return run.structures, run.times.tolist(), run.before.tolist(), run.after.tolist()

    growths = grow(STICKY, varied, 30, 1.0, runs=3, seed=8)
    assert record(grow(STICKY, varied, 30, 1.0, runs=1, seed=8).runs[0]) == record(growths.runs[0])
    longer = grow(STICKY, varied, 30, 2.0, runs=3, seed=8).runs[2]
    n = growths.runs[2].times.size
    assert longer.times[:n].tolist() == growths.runs[2].times.tolist()
    assert longer.times[n] > 1.0
    assert record(growths.runs[0]) != record(growths.runs[1])
    assert record(grow(STICKY, varied, 30, 1.0, runs=1, seed=9).runs[0]) != record(growths.runs[0])
    monkeypatch.setattr(networkfree_tank, "MAX_REMEMBERED", 3)
    assert [record(run) for run in grow(STICKY, varied, 30, 1.0, runs=3, seed=8).runs] == [
        record(r) for r in growths.runs
    ]


def test_starts_from_any_structures():
    derivation = derive(LINE4)
    quadmer, free = derivation.structures["quadmer"], LINE4.monomer()
    growths = grow(LINE4, only_dimers(0.0, 1e-2), {quadmer: 5, free: 0}, 1e5, seed=1)
    (run,) = growths.runs
    assert run.structures[0] == quadmer
    assert run.at(0.0) == {quadmer: 5}
    assert run.at(1e5) == {free: 20}
    assert run.times.size == 15  # three bonds each
    assert run.first_time(quadmer) == 0.0
    assert run.count(LINE4.target, [0.0, 1e5]).tolist() == [5, 0]


def test_nothing_to_do():
    (run,) = grow(LINE4, ClassRates.uniform(0.0), 10, 100.0).runs
    assert run.times.size == run.draws == 0
    assert run.by_size([0.0, 100.0])[:, 1].tolist() == [10, 10]
    assert math.isnan(run.first_time(LINE4.target))
    assert run.count(LINE4.target, [50.0]).tolist() == [0]
    assert grow(LINE4, ClassRates.uniform(1.0), 1, 100.0).runs[0].times.size == 0


def test_bonds_that_hold_a_loop_or_not():
    """A square with a tail: only the tail's bond holds two parts together. Every bond of a line does."""
    letters, rotations = ("a",) * 5, (0,) * 5
    square = Structure(((0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)), rotations, letters)
    assert bridges(square) == [((3, 4), (4, 1))]
    line = Structure(tuple((0, 0, z) for z in range(5)), rotations, letters)
    assert sorted(bridges(line)) == [((z, z + 1), (z + 1, 4 - z)) for z in range(4)]
    grown = grow(STICKY, ClassRates.uniform(1e-2), 40, 20.0, seed=1).runs[0]
    for structure in grown.at(20.0):
        slow = {bond: sides for bond in structure.bonds if (sides := structure.sides(*bond)) is not None}
        found = {tuple(sorted(bond)): sizes for bond, sizes in bridges(structure)}
        assert found.keys() == slow.keys()
        assert all(sorted(found[bond]) == sorted(map(len, sides)) for bond, sides in slow.items())


def test_series_and_frames():
    growths = grow(T5, ClassRates.uniform(1e-2), 40, 100.0, runs=3, seed=2)
    times = np.linspace(0.0, 100.0, 6)
    series = growths.series(times)
    assert list(series) == ["1 cube", "2 cubes", *(f"{n} cubes" for n in (3, 4, 5)), "target", "largest"]
    assert np.array_equal(series["target"], series["5 cubes"])
    table = growths.to_dataframe(times)
    assert table.shape == (18, 9)
    assert (table["time"].to_numpy().reshape(3, 6) == times).all()
    final = growths.final()
    assert sum(len(s) * copies for s, copies in final.items()) == pytest.approx(40)
    sticky = grow(STICKY, ClassRates.uniform(1e-2), 40, 10.0, seed=2)
    assert list(sticky.series([10.0]))[:3] == ["1 cube", "2 to 3 cubes", "4 to 7 cubes"]
    many = grow(STICKY, ClassRates.uniform(1e-3), 150, 100.0, seed=2)
    assert [low for low, _ in many.classes()] == [1, 4, 16, 64]  # doubling would take more than there are colours
    assert many.classes()[-1] == (64, many.largest([100.0])[0, 0])
    run = growths.runs[0]
    rows = run.to_dataframe()
    assert list(rows.columns) == ["time", "before", "after"]
    assert len(rows) == run.times.size
    assert rows["after"][0] == "b(0,0,0) b(0,0,1)"
    pyramid = grow(PYRAMID, ClassRates.uniform(2e-4), 100, 1000.0, seed=1).runs[0]
    moments = pyramid.milestones(8)
    assert (moments[0], moments[-1], moments.size) == (0.0, pyramid.times[-1], 8)
    frames = pyramid.frames(moments)
    assert len(frames[-1]) == 45
    for small, large in pairwise(frames):
        assert set(small.positions) < set(large.positions)  # what stays keeps its place


def test_alignment_takes_back_any_turn():
    target = T5.target
    turned = target.canonical("two")
    assert set(aligned(turned, target, "two").positions) == set(target.positions)


def test_plots_are_labelled():
    from matplotlib.figure import Figure

    for book, n, label in ((T5, 30, "count"), (PYRAMID, 100, "number of cubes")):
        ax = Figure().add_subplot()
        growths = grow(book, ClassRates.uniform(1e-3), n, 50.0, runs=3)
        assert growths.plot(ax, [0.0, 25.0, 50.0]) is ax
        assert ax.get_ylabel() == label
        assert "target" not in ax.get_legend_handles_labels()[1]  # it is all there is of its size
        assert ax.get_xlabel() == "time (tu)"


def test_ctrl_c_keeps_finished_runs():
    def stop(after):
        def progress(finished, time):
            assert time > 0
            if finished == after:
                raise KeyboardInterrupt

        return progress

    rates = ClassRates.uniform(1e-2, 1e-2)
    growths = grow(LINE4, rates, 60, 2000.0, runs=5, seed=1, progress=stop(2))
    assert growths.interrupted
    whole = grow(LINE4, rates, 60, 2000.0, runs=2, seed=1)
    assert not whole.interrupted
    assert [run.times.tolist() for run in growths.runs] == [run.times.tolist() for run in whole.runs]
    with pytest.raises(KeyboardInterrupt):
        grow(LINE4, rates, 60, 2000.0, runs=5, seed=1, progress=stop(0))


BLINKING = replace(
    LINE4,
    combine=(Combination(rule="stick", letter="a", face="f1", partner="a", partner_face="f1", becomes="b"),),
    internal=tuple(Internal(rule=x + y, letter=x, neighbours=x, becomes=y) for x, y in ("bc", "cb")),
)
UNIFORM = ClassRates.uniform(1e-3, 1e-3)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"initial": 0}, "cubes = 0; expected a whole number of at least 1"),
        ({"initial": 1.5}, "cubes = 1.5; expected a whole number"),
        ({"initial": {}}, "initial holds no structure at all"),
        ({"initial": {LINE4.monomer(): -1}}, "copies of a"),
        ({"initial": {Structure(((0, 0, 0),), (0,), ("z",)): 1}}, "book 'line4' has no letter 'z', but a, b, c, d"),
        ({"end": -1.0}, "times holds -1"),
        ({"end": float("inf")}, "expected finite numbers"),
        ({"runs": 0}, "runs = 0"),
        ({"seed": -1}, "seed = -1"),
        ({"rates": {"join": 1.0}}, "expected ClassRates, or a function of a rate class"),
        (
            {"rates": lambda _: -1.0},
            r"class `join 1 f1 \+ 1 f1 touching 1` is -1.0; expected a number >= 0",
        ),
        ({"rates": lambda _: float("nan")}, "is nan; expected a number >= 0"),
        ({"rates": lambda _: None}, "is None; expected a number >= 0"),
        ({"rates": lambda _: 1e308}, "goes beyond 1e308; the rate constants are too large"),
        ({"rates": ClassRates(classes={"break": {"rate": 1.0}})}, r"no rate for class 'join 1 f1 \+ 1 f1 touching 1'"),
        ({"rates": UNIFORM.replace(faces="six")}, "book 'line4' has 'two', whose face types"),
        (
            {"rates": ClassRates(convention={"combinations": "ordered"}, classes={"join": {"rate": 1.0}})},
            "count pairs as 'ordered'",
        ),
        ({"book": PYRAMID, "initial": {PYRAMID.monomer(): 9}}, "grows from a seed, so add book.seed"),
        ({"book": BLINKING}, "internal rules never come to rest"),
    ],
)
def test_bad_input(changes, says):
    with pytest.raises(ValueError, match=says):
        grow(**({"book": LINE4, "rates": UNIFORM, "initial": 10, "end": 100.0} | changes))


def test_a_clock_that_stands_still_is_told(monkeypatch):
    """A bond that breaks at once is an event; only many such in a row are a clock that stands still."""
    rates = (LINE4, lambda c: 1.0 if c.event == "join" else 1e17, 10, 100.0)
    assert grow(*rates).runs[0].times.size > 10
    monkeypatch.setattr("kinetics.networkfree.simulate.MOST_STILL", 1)
    with pytest.raises(ValueError, match="the clock could not advance"):
        grow(*rates)


def test_records_are_checked():
    (run,) = grow(LINE4, UNIFORM, 20, 200.0, seed=1).runs
    fields = {name: getattr(run, name) for name in Growth.__dataclass_fields__}
    mistakes = {
        "does not conserve cubes": {"after": np.full_like(run.after, -1)},
        "there are only": {"before": run.before + len(run.structures)},
        "comes after the end": {"end": run.times[-1] / 2},
        "of which there is none": {"initial": np.where(np.arange(len(run.initial)) == 0, 1, 0)},
        "initial has shape": {"initial": run.initial[1:]},
    }
    for says, change in mistakes.items():
        with pytest.raises(ValueError, match=says):
            Growth(**(fields | change))
    with pytest.raises(ValueError, match="was observed until 200; 300 was requested"):
        run.by_size([300.0])
    with pytest.raises(ValueError, match="no runs; expected"):
        Growths(())
    other = grow(LINE4, UNIFORM, 21, 200.0, seed=1)
    with pytest.raises(ValueError, match="expected runs of one tank"):
        Growths((run, *other.runs))
    assert free_cubes(PYRAMID, 3) == {PYRAMID.monomer(): 3, PYRAMID.seed(): 1}


def test_command(tmp_path):
    common = ("rules", "grow", "t5", "--cubes", 40, "--join", 1e-3, "--runs", 3, "--seed", 5, "--times", 10, 100)
    found = run_here(*common, "--break", 1e-3, "--json", "--csv", "t.csv", "--plot", "t.png", cwd=tmp_path).json
    growths = grow(T5, ClassRates.uniform(1e-3, 1e-3), 40, 100.0, runs=3, seed=5)
    assert found["series"]["1 cube"]["mean"] == pytest.approx(growths.by_size([10.0, 100.0])[:, :, 1].mean(axis=0))
    assert found["target"]["reached"] == np.isfinite(growths.first_times(T5.target)).sum()
    assert found["times"] == [10.0, 100.0]
    assert (tmp_path / "t.csv").read_text().startswith("run,time,1 cube,")
    assert (tmp_path / "t.png").stat().st_size > 0
    table = run_here(*common, "--strip", "s.png", cwd=tmp_path)
    assert "time (tu)" in table.out
    assert "target reached in" in table.out
    assert table.err == ""
    assert (tmp_path / "s.png").stat().st_size > 0


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--cubes", 9), "either --rates FILE, or --join"),
        (("--cubes", 9, "--join", 1, "--rates", "x.toml"), "either --rates FILE, or --join"),
        (("--cubes", 9, "--join", -1), "at least 0"),
        (("--cubes", 9, "--rates", "missing.toml"), "missing.toml does not exist"),
        (("--cubes", 0, "--join", 1), "0 is not in the range"),
        (("--join", 1), "Missing option '--cubes'"),
        (("--cubes", 9, "--join", 1, "--duration", 0), "expected a positive number of tu"),
        (("--cubes", 9, "--join", 1, "--times", 5, 3), "times must rise"),
    ],
)
def test_command_refuses(tmp_path, arguments, says):
    done = run_here("rules", "grow", "line4", *arguments, cwd=tmp_path)
    assert done.code == 2
    assert says in " ".join(done.err.split())
    assert done.out == ""
