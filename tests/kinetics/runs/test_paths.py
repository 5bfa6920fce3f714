import numpy as np
import pytest
from known_systems import line
from matplotlib.figure import Figure
from numpy.testing import assert_array_equal

from kinetics.runs import RESTART, Ensemble, JumpPath, paths

JOIN, GROW = 0, 1  # channels 1+1->2 and 1+2->3


def a_path():
    return JumpPath(line(), [4, 0, 0, 0], [1.0, 2.0, 2.0, 3.0], [JOIN, GROW, RESTART, JOIN], 5.0)


def test_states_with_a_restart():
    expected = [[4, 0, 0, 0], [2, 1, 0, 0], [1, 0, 1, 0], [4, 0, 0, 0], [2, 1, 0, 0]]
    assert_array_equal(a_path().states, expected)


def test_states_by_replaying_events_one_by_one():
    rng = np.random.default_rng(1)
    net = line()
    state, channels, expected = np.array([12, 0, 0, 0]), [], [[12, 0, 0, 0]]
    for _ in range(300):
        able = [r for r in range(8) if (state >= net.reactants[r]).all()]
        channel = int(rng.choice([*able, RESTART]))
        state = np.array([12, 0, 0, 0]) if channel == RESTART else state + net.stoichiometry[channel]
        channels.append(channel)
        expected.append(state)
    path = JumpPath(net, [12, 0, 0, 0], np.arange(300.0), channels, 300.0)
    assert_array_equal(path.states, expected)


def test_counts_at_times():
    expected = [[4, 0, 0, 0], [2, 1, 0, 0], [4, 0, 0, 0], [4, 0, 0, 0], [2, 1, 0, 0]]
    assert_array_equal(a_path().at([0.0, 1.0, 2.0, 2.5, 5.0]), expected)
    with pytest.raises(ValueError, match=r"observed until 5; 5\.1 was requested"):
        a_path().at([5.1])


def test_first_time():
    path = a_path()
    assert path.first_time("monomer") == 0.0
    assert path.first_time("trimer") == 2.0
    assert np.isnan(path.first_time("quadmer"))
    assert np.isnan(path.first_time("dimer", copies=2))


def test_a_run_without_events():
    path = JumpPath(line(), [4, 0, 0, 0], [], [], 7.0)
    assert_array_equal(path.at([0, 7]), [[4, 0, 0, 0], [4, 0, 0, 0]])
    assert list(path.to_dataframe()["event"]) == ["start", "end"]


def test_table():
    table = a_path().to_dataframe()
    assert list(table["event"]) == ["start", "1+1->2", "1+2->3", "restart", "1+1->2", "end"]
    assert list(table["time"]) == [0, 1, 2, 2, 3, 5]
    assert list(table["dimer"]) == [0, 1, 0, 0, 1, 1]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"times": [2.0, 1.0, 3.0, 4.0]}, "times must rise; 1 comes after 2"),
        ({"times": [1.0, 2.0]}, r"channels has shape \(4,\); expected \(2\)"),
        ({"times": [-1.0, 2.0, 2.0, 3.0]}, "expected at least 0"),
        ({"times": [1.0, 2.0, 2.0, np.nan]}, "times holds nan"),
        ({"channels": [0, 1, -1, 8]}, "channels holds 8; the network has only 8"),
        ({"channels": [0, 1, -2, 0]}, "channels holds -2"),
        ({"channels": [0, 2, -1, 0]}, r"event 1 \(1\+3->4 at 2\) needs 1 of 'trimer'; there are 0"),
        ({"initial": [1, 0, 0, 0]}, r"event 0 \(1\+1->2 at 1\) needs 2 of 'monomer'; there are 1"),
        ({"end": 2.5}, "an event at 3 comes after the end, 2.5"),
        ({"end": np.inf}, "end holds inf"),
        ({"open_channels": np.arange(8) > 0}, r"channel '1\+1->2' fired but is not open"),
        ({"open_channels": [1, 1, 0, 0, 0, 0, 0, 0]}, "8 truth values"),
    ],
)
def test_bad_paths(change, message):
    good = a_path()
    parts = {name: getattr(good, name) for name in ("network", "initial", "times", "channels", "end")}
    with pytest.raises(ValueError, match=message):
        JumpPath(**(parts | change))


def an_ensemble():
    counts = np.zeros((3, 2, 4), dtype=np.int64)
    counts[:, 0] = [4, 0, 0, 0]
    counts[:, 1] = [[4, 0, 0, 0], [2, 1, 0, 0], [0, 2, 0, 0]]
    return Ensemble(line(), [0.0, 9.0], counts)


def test_ensemble_statistics():
    ensemble = an_ensemble()
    assert_array_equal(ensemble.mean(), [[4, 0, 0, 0], [2, 1, 0, 0]])
    assert_array_equal(ensemble.sd(), [[0, 0, 0, 0], [2, 1, 0, 0]])
    assert_array_equal(ensemble.standard_error() * np.sqrt(3), ensemble.sd())
    assert_array_equal(ensemble.quantile(0.5)[1], [2, 1, 0, 0])
    assert_array_equal(ensemble.variance()[1], [4, 1, 0, 0])
    assert_array_equal(ensemble.covariance()[1, :2, :2], [[4, -2], [-2, 1]])
    assert np.isnan(Ensemble(line(), [0.0, 9.0], ensemble.counts[:1]).covariance()).all()
    third = pytest.approx(1 / 3)
    assert ensemble.marginal("dimer").tolist() == [[1, 0, 0], [third, third, third]]
    table = ensemble.to_dataframe()
    assert len(table) == 6
    assert list(table["dimer"][table["run"] == 2]) == [0, 2]
    with pytest.raises(ValueError, match="expected a probability"):
        ensemble.quantile(1.5)


@pytest.mark.parametrize(
    "counts", [np.zeros((3, 1, 4), dtype=int), np.zeros((3, 2, 4)), np.zeros((0, 2, 4), dtype=int)]
)
def test_bad_ensembles(counts):
    with pytest.raises(ValueError, match="counts"):
        Ensemble(line(), [0.0, 9.0], counts)


@pytest.mark.parametrize("record", [a_path(), an_ensemble()])
def test_plots_draw_every_species_with_units(record):
    ax = Figure().add_subplot()
    assert record.plot(ax) is ax
    assert ax.get_xlabel() == "time (tu)"
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels[: len(record.network.species)] == list(record.network.species)
    assert labels[len(record.network.species) :] in ([], ["mean", "middle 95 % of runs"])


def test_long_paths_of_many_species_do_without_the_table_of_states(monkeypatch):
    """Everything but the table itself is the same where the table would be too large."""
    rng = np.random.default_rng(2)
    net, state, channels = line(), np.array([12, 0, 0, 0]), []
    for _ in range(300):
        able = [r for r in range(8) if (state >= net.reactants[r]).all()]
        channels.append(int(rng.choice([*able, *able, *able, RESTART])))
        state = np.array([12, 0, 0, 0]) if channels[-1] == RESTART else state + net.stoichiometry[channels[-1]]
    events, asked = (net, [12, 0, 0, 0], np.arange(300.0), channels, 300.0), [0.0, 0.5, 7.0, 100.2, 300.0]
    small = JumpPath(*events)
    monkeypatch.setattr(paths, "MAX_STATES", 10)
    large = JumpPath(*events)
    assert_array_equal(large.at(asked), small.at(asked))
    for species, copies in (("monomer", 1), ("quadmer", 1), ("dimer", 3), ("quadmer", 4)):
        assert_array_equal(large.first_time(species, copies), small.first_time(species, copies))
    with pytest.raises(ValueError, match="300 events of 4 species make a table of over 10 counts; ask for"):
        _ = large.states
    with pytest.raises(ValueError, match=r"event 2 \(4->1\+3 at 3\) needs 1 of 'quadmer'; there are 0"):
        JumpPath(net, [12, 0, 0, 0], [1.0, 2.0, 3.0, 4.0], [0, RESTART, 6, 0], 5.0)
