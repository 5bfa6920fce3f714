import signal
from fractions import Fraction

import numpy as np
import pytest
from known_systems import bare_line, decay, line, network
from matplotlib.figure import Figure
from numpy.testing import assert_allclose, assert_array_equal

from kinetics import Auto, Direct, Lockstep, simulate, simulate_statistics
from kinetics.sampling import run_source, statistics
from kinetics.sampling.run_source import RunSource
from kinetics.sampling.statistics import MOST_BINS, Tally, kept_pairs
from kinetics.support import memory

TIMES = [0.0, 20.0, 300.0]
START = [30, 0, 0, 0]
ARRAYS = ("low", "high", "shift", "origin", "histogram", "sums", "products")


def assert_identical(one, other):
    assert one.runs == other.runs
    for name in ARRAYS:
        assert_array_equal(getattr(one, name), getattr(other, name), strict=True)


@pytest.fixture
def small_blocks(monkeypatch):
    monkeypatch.setattr(run_source, "BLOCK_BYTES", 37 * 8 * 4 * len(TIMES))  # 37 runs


def streamed_equals_full(method, runs=500, **options):
    """Whether the statistics of the runs in blocks are those of the runs kept in full."""
    full = simulate(line(), Direct(), START, TIMES, runs=runs, seed=3)
    part = simulate_statistics(line(), method, START, TIMES, runs=runs, seed=3, **options)
    exact = [np.array_equal(part.mean(), full.mean())]
    exact += [np.array_equal(part.quantile(q), full.quantile(q)) for q in (0, 0.025, 0.3, 0.5, 0.975, 1)]
    exact += [np.array_equal(part.marginal(name), full.marginal(name)) for name in line().species]
    return all(exact) and np.allclose(part.covariance(), full.covariance(), rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize("method", [Direct(), Lockstep(), Auto()], ids=lambda m: m.name)
def test_streamed_statistics_are_those_of_the_same_runs_in_full(method, small_blocks):
    assert streamed_equals_full(method)
    assert streamed_equals_full(method, runs=37)
    assert streamed_equals_full(method, runs=2, threads=1)


def test_blocks_that_repeat_their_runs_are_seen(small_blocks):
    class Repeating(Direct):
        """The control: every block makes the same runs."""

        def source(self, *arguments):
            return RepeatingSource(**vars(super().source(*arguments)))

    class RepeatingSource(RunSource):
        def counts(self, grid, runs, first_run=0, threads=None, watch=None):
            return super().counts(grid, runs, 0, threads, watch)

    assert not streamed_equals_full(Repeating())


def test_neither_blocks_nor_threads_matter(monkeypatch):
    def made(block, threads):
        monkeypatch.setattr(run_source, "BLOCK_BYTES", block * 8 * 4 * len(TIMES))
        return simulate_statistics(line(), Lockstep(), START, TIMES, runs=300, seed=1, threads=threads)

    first = made(300, 1)
    for block, threads in ((16, 1), (101, 2), (299, 2)):
        assert_identical(first, made(block, threads))
    other = simulate_statistics(line(), Lockstep(), START, TIMES, runs=300, seed=2)
    assert np.any(first.sums != other.sums)


def test_moments_are_rounded_once():
    counts = simulate(line(), Direct(), START, TIMES, runs=123, seed=5).counts
    made = gathered(counts)
    for t in range(3):
        for a in range(4):
            x = counts[:, t, a].tolist()
            assert made.mean()[t, a] == float(Fraction(sum(x), 123))
            for b in range(4):
                y = counts[:, t, b].tolist()
                square = Fraction(sum(i * j for i, j in zip(x, y, strict=True))) - Fraction(sum(x) * sum(y), 123)
                assert made.covariance()[t, a, b] == float(square / 122)
    assert_array_equal(made.variance(), made.covariance()[:, range(4), range(4)])


def wide_counts(rng, runs):
    """Three times, four species: narrow, wide, far from zero and narrow, and all that an int64 can hold."""
    columns = [
        rng.poisson(20, (runs, 3)),
        rng.integers(0, 60_000, (runs, 3)),
        10**9 + rng.poisson(10**3, (runs, 3)),
        rng.integers(0, 2**63 - 1, (runs, 3)),
    ]
    return np.stack(columns, axis=2).astype(np.int64)


def gathered(*parts):
    tally = Tally(line(), TIMES, kept_pairs(4))
    for part in parts:
        tally.add(part)
    return tally.statistics(sum(map(len, parts)))


@pytest.mark.parametrize("seed", range(3))
def test_order_of_blocks_and_merges_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    counts = wide_counts(rng, 400)
    whole = gathered(counts)
    for _ in range(4):
        cuts = np.sort(rng.choice(np.arange(1, 400), 5, replace=False))
        parts = np.split(rng.permutation(counts), cuts)
        assert_identical(whole, gathered(*parts))
        left, right = gathered(*parts[:2]), gathered(*parts[2:])
        assert_identical(whole, left.merged(right))
        assert_identical(whole, right.merged(left))


def test_quantiles_are_exact_where_the_range_is_small_and_within_their_error_elsewhere():
    counts = wide_counts(np.random.default_rng(7), 2000)
    made = gathered(counts)
    error = made.quantile_error()
    assert not error[:, [0, 2]].any()
    # Bins are as narrow as the range allows.
    spread = (made.high - made.low).astype(float)
    assert np.all(error[:, [1, 3]] <= spread[:, [1, 3]] / (MOST_BINS - 1))
    assert np.all(error[:, [1, 3]] > 0)
    missed = 0
    for q in (0, 0.01, 0.25, 0.5, 0.9, 0.999, 1):
        truth = np.sort(counts, axis=0)[max(0, int(np.ceil(q * 2000)) - 1)].astype(float)
        off = np.abs(made.quantile(q) - truth)
        assert np.all(off <= error * (1 + 1e-12))
        missed += np.count_nonzero(off > error / 4)
    assert missed > 0  # the control: a quarter of the error would be claimed too much


def test_sums_beyond_64_bits_are_exact():
    counts = wide_counts(np.random.default_rng(8), 50)
    made = gathered(counts[:20], counts[20:])
    exact = counts.astype(object)
    assert_array_equal(made.sums, exact.sum(axis=0))
    first, second = made.pairs
    assert_array_equal(made.products, (exact[:, :, first] * exact[:, :, second]).sum(axis=0))
    assert made.products.max() > 2**120


def test_ranges_that_need_several_passes_are_exact():
    counts = np.random.default_rng(9).integers(0, 2**30, (100, 3, 4))  # four squares and 2**62 is reached
    assert_array_equal(gathered(counts).products, gathered(*np.split(counts, 50)).products)
    exact = counts.astype(object)
    first, second = kept_pairs(4)
    assert_array_equal(gathered(counts).products, (exact[:, :, first] * exact[:, :, second]).sum(axis=0))


def test_interrupted_runs_leave_the_statistics_of_those_that_were_made(small_blocks, monkeypatch):
    counts, at = RunSource.counts, 74

    def interrupted(source, grid, runs, first_run=0, threads=None, watch=None):
        if first_run == at:
            raise KeyboardInterrupt
        return counts(source, grid, runs, first_run, threads, watch)

    monkeypatch.setattr(RunSource, "counts", interrupted)
    told = []
    made = simulate_statistics(line(), Direct(), START, TIMES, runs=400, seed=3, progress=told.append)
    assert (made.runs, made.asked, made.is_complete, told) == (74, 400, False, [37, 74])
    at = -1
    assert_identical(made, simulate_statistics(line(), Direct(), START, TIMES, runs=74, seed=3))
    at = 0
    with pytest.raises(KeyboardInterrupt):
        simulate_statistics(line(), Direct(), START, TIMES, runs=400)


def test_ctrl_c_never_cuts_a_block_in_two(small_blocks, monkeypatch):
    widen = Tally._widen

    def interrupted(tally):
        if tally.runs == 37:
            signal.raise_signal(signal.SIGINT)
        widen(tally)

    monkeypatch.setattr(Tally, "_widen", interrupted)
    made = simulate_statistics(line(), Direct(), START, TIMES, runs=400, seed=3)
    assert made.runs == 74
    assert made.histogram.sum() == 74 * 12
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_marginal_with_intervals():
    made = simulate_statistics(decay(), Direct(), [3], [0.0, 1.0], runs=400, seed=2)
    at = made.marginal_at("X", 1.0)
    assert_array_equal(at.first, [0, 1, 2, 3])
    assert_array_equal(at.share, made.marginal("X")[1])
    assert at.width == 1
    p = np.exp(-1.0)
    exact = np.array([(1 - p) ** 3, 3 * p * (1 - p) ** 2, 3 * p**2 * (1 - p), p**3])
    sure = made.marginal_at("X", 1.0, level=1 - 1e-6)
    assert np.all((sure.low < exact) & (exact < sure.high))
    assert np.all((sure.low < at.low) & (at.low < at.share) & (at.share < at.high) & (at.high < sure.high))
    start = made.marginal_at("X", 0.0)
    # All of n runs: the lower limit is (1 - level / 2) ** (1 / n), in closed form.
    assert_allclose([start.low[-1], start.high[-1]], [0.025 ** (1 / 400), 1.0], rtol=1e-12)
    ax = Figure().add_subplot()
    assert at.plot(ax) is ax
    assert ax.get_xlabel().endswith("X at 1")


def test_plot_and_table():
    made = simulate_statistics(line(), Direct(), START, TIMES, runs=50)
    ax = Figure().add_subplot()
    assert made.plot(ax) is ax
    assert sum(len(line.get_xdata()) > 0 for line in ax.get_lines()) == 4
    table = made.to_dataframe()
    assert len(table) == 12
    assert_array_equal(table["mean"], made.mean().ravel())


def test_a_single_run_has_no_spread():
    made = simulate_statistics(line(), Direct(), START, TIMES, runs=1)
    assert np.isnan(made.sd()).all()
    assert np.isnan(made.covariance()).all()
    assert_array_equal(made.mean(), made.quantile(0.5))


def test_pairs_of_many_species_are_kept_only_where_asked_for():
    n = statistics.MOST_COVARIED + 1
    here = np.eye(n, dtype=int)
    ring = network([f"s{i}" for i in range(n)], {f"r{i}": (here[i], here[i - 1]) for i in range(n)}, [1.0] * n)
    start = [5] * n
    bare = simulate_statistics(ring, Direct(), start, [1.0], runs=20)
    with pytest.raises(ValueError, match="covariances=True"):
        bare.covariance()
    asked = simulate_statistics(ring, Direct(), start, [1.0], runs=20, covariances=True)
    full = simulate(ring, Direct(), start, [1.0], runs=20)
    assert_allclose(asked.covariance(), full.covariance(), atol=1e-12)
    assert_array_equal(asked.variance(), bare.variance())
    with pytest.raises(ValueError, match="in both or in neither"):
        asked.merged(bare)


def test_histograms_take_bounded_memory():
    assert statistics.bins_for(101, 4) == MOST_BINS
    assert 8 * 101 * 1000 * statistics.bins_for(101, 1000) <= statistics.HISTOGRAM_BYTES
    assert statistics.bins_for(10**6, 10) == statistics.FEWEST_BINS


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"runs": 0}, "runs = 0"),
        ({"runs": 2.5}, "runs = 2.5"),
        ({"times": []}, "times is empty"),
        ({"times": [2.0, 1.0]}, "times must rise"),
        ({"initial": [1, 0]}, "state has shape"),
        ({"seed": -1}, "seed = -1"),
        ({"model": bare_line()}, "no rate constants"),
    ],
)
def test_bad_questions(change, message):
    good = {"model": line(), "method": Direct(), "initial": START, "times": TIMES, "runs": 10}
    with pytest.raises(ValueError, match=message):
        simulate_statistics(**(good | change))


def test_bad_questions_of_the_result():
    made = simulate_statistics(line(), Direct(), START, TIMES, runs=10)
    with pytest.raises(ValueError, match="q = 2"):
        made.quantile(2)
    with pytest.raises(ValueError, match="expected one of the 3 times"):
        made.marginal_at("dimer", 7.0)
    with pytest.raises(ValueError, match="level = 1"):
        made.marginal_at("dimer", 20.0, level=1)
    with pytest.raises(ValueError, match="unknown species"):
        made.marginal("pentamer")
    with pytest.raises(ValueError, match="different networks"):
        made.merged(simulate_statistics(decay(), Direct(), [3], TIMES, runs=10))
    with pytest.raises(ValueError, match="different times"):
        made.merged(simulate_statistics(line(), Direct(), START, [1.0], runs=10))
    with pytest.raises(ValueError, match="marginal_at"):
        gathered(wide_counts(np.random.default_rng(1), 10)).marginal("dimer")
    with pytest.raises(ValueError, match="there are no statistics"):
        gathered()
    with pytest.raises(ValueError, match="read-only"):
        made.histogram[0] = 1


def test_full_counts_that_do_not_fit_are_refused_before_a_run_is_made(monkeypatch):
    monkeypatch.setattr(memory, "SMALL", 0)
    monkeypatch.setattr(memory, "available_bytes", lambda: 2.0**20)
    with pytest.raises(ValueError, match=r"would take 0.0\d* GB of memory.*simulate_statistics"):
        simulate(line(), Direct(), START, TIMES, runs=20_000)
    with pytest.raises(ValueError, match="statistics of 4 species at 200 times would take"):
        simulate_statistics(line(), Direct(), START, np.arange(200.0), runs=10)


def test_limits_of_a_group_of_processes_count(monkeypatch, tmp_path):
    monkeypatch.setattr(memory, "GROUPS", tmp_path)
    free = memory.available_bytes()
    (tmp_path / "memory.max").write_text("max\n")
    (tmp_path / "memory.current").write_text("1000\n")
    (tmp_path / "memory.stat").write_text("anon 900\ninactive_file 100\n")
    assert memory.available_bytes() > free / 2  # no limit
    (tmp_path / "memory.max").write_text("5000\n")
    assert memory.available_bytes() == 5000 - 1000 + 100
