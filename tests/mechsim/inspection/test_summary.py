"""What is shown of runs: the target, and only species that occurred."""

import numpy as np
import pytest

from kinetics.assembly import RuleBook
from mechsim.inspection.pictures.tank import growth
from mechsim.inspection.summary import columns_of, plot_counts, row, table
from mechsim.runs.record import RunRecord, RunSpec, book_of
from mechsim.runs.species import single_cubes, species_of
from mechsim.scene import Scene


def record_of(scene, composition, channels, run=0, end=100.0):
    """A record without mechanics: these channels fire, one each tu."""
    network = book_of(scene.rules)[1].network
    arrays = {
        "initial": network.state(composition),
        "times": np.arange(1.0, len(channels) + 1),
        "channels": np.array(channels, np.int64),
    }
    facts = {"end": end, "channels": list(network.channels), "open_channels": [True] * len(network.channels)}
    spec = RunSpec(scene, composition, end, seed=1, run=run)
    return RunRecord(spec, "completed", arrays, facts, {"cpu_seconds": 1.5, "wall_seconds": 2.0})


def named(scene, *names):
    network = book_of(scene.rules)[1].network
    return [network.channels.index(name) for name in names]


@pytest.fixture(scope="module")
def t5():
    return Scene.load("t5")


@pytest.fixture(scope="module")
def pyramid():
    """Runs that grow by the first channel that can fire: to the end, and not nearly."""
    scene = Scene.load("pyramid45")
    derivation = book_of(scene.rules)[1]
    network, start = derivation.network, single_cubes(derivation, 101)
    state, channels = network.state(start), []
    while (able := (state >= network.reactants).all(axis=1)).any():
        channels.append(int(np.argmax(able)))
        state = state + network.stoichiometry[channels[-1]]
    return [record_of(scene, start, channels[:n], run) for run, n in enumerate((44, 20))]


def test_species_that_occurred_and_the_target(t5):
    records = [
        record_of(t5, {"monomer": 10}, named(t5, "1+1->dimer.a", "1+1->dimer.a", "dimer.a+dimer.a->quadmer.b")),
        record_of(t5, {"monomer": 10}, named(t5, "1+1->dimer.a", "dimer.a->1+1"), run=1),
    ]
    lines = [line.split() for line in table(records).splitlines()]
    assert lines[0] == [
        *("run", "monomer", "dimer.a", "quadmer.b", "pentamer", "largest", "first", "pentamer", "(tu)"),
        *("events", "CPU", "(s)", "outcome"),
    ]
    assert lines[1] == ["0", "6", "0", "1", "0", "4", "-", "3", "1.5", "completed"]
    assert lines[2] == ["1", "10", "0", "0", "0", "1", "-", "2", "1.5", "completed"]


def test_a_row_holds_no_zeros_and_the_target_is_the_books(t5):
    names = ("1+1->dimer.a", "1+1->dimer.a", "dimer.a+dimer.a->quadmer.b", "1+quadmer.b->5")
    told = row(record_of(t5, {"monomer": 10}, named(t5, *names)))
    assert told["events"] == {"1+1->dimer.a": 2, "dimer.a+dimer.a->quadmer.b": 1, "1+quadmer.b->5": 1}
    assert told["final"] == {"monomer": 5, "pentamer": 1}
    assert (told["target"], told["first_target"], told["largest"]) == (1, 4.0, 5)


def test_many_species_are_shown_by_size(pyramid):
    lines = table(pyramid).splitlines()
    assert lines[0].startswith(
        "run  1 cube  2 cubes  3-4 cubes  5-8 cubes  9-16 cubes  17-32 cubes  33-64 cubes  largest"
    )
    assert lines[1].split()[:11] == ["0", "56", "0", "0", "0", "0", "0", "1", "45", "1", "44.0"]
    assert lines[2].split()[:11] == ["1", "80", "0", "0", "0", "0", "1", "0", "21", "0", "-"]
    told = row(pyramid[0])
    assert told["final"] == {"monomer": 56, "45-mer": 1}
    assert len(told["events"]) == 44
    assert told["first_target"] == 44.0


def test_size_classes_hold_every_species_once(pyramid):
    network = pyramid[0].path.network
    columns = columns_of(network, [record.path for record in pyramid], "45-mer")
    np.testing.assert_array_equal(np.sum(list(columns.values()), axis=0), np.ones(len(network.species)))


def test_plots_what_the_table_shows(pyramid):
    from matplotlib.figure import Figure

    ax = plot_counts(Figure().add_subplot(), pyramid)
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels[0] == "1 cube"
    assert labels[-3:] == ["33-64 cubes", "mean", "middle 95 % of runs"]


def test_what_free_cubes_never_become_is_no_target(t5):
    derivation = book_of("t5")[1]
    assert species_of(derivation, derivation.book.target) == "pentamer"
    assert species_of(derivation, None) is None
    assert species_of(derivation, RuleBook.load("line4").target) is None


def test_single_cubes_hold_the_seed_where_there_is_one():
    assert single_cubes(book_of("line4")[1], 60) == {"monomer": 60}
    assert single_cubes(book_of("pyramid45")[1], 60) == {"monomer": 59, "seed": 1}
    assert single_cubes(book_of("pyramid45")[1], 1) == {"seed": 1}


def test_growth_shows_each_largest_structure_once_and_when_it_came(pyramid, t5):
    captions = [words.text for words in growth(pyramid[0], frames=4).words if "tu" in words.text]
    assert captions == ["1 cube, 0 tu", "16 cubes, 15 tu", "30 cubes, 29 tu", "45 cubes, 44 tu"]
    names = ("1+1->dimer.a", "dimer.a->1+1", "1+1->dimer.a", "1+1->dimer.a", "dimer.a+dimer.a->quadmer.b")
    grown = growth(record_of(t5, {"monomer": 10}, named(t5, *names)))
    captions = [words.text for words in grown.words if "tu" in words.text]
    assert captions == ["1 cube, 0 tu", "2 cubes, 1 tu", "4 cubes, 5 tu"]
    start = growth(record_of(t5, {"pentamer": 2}, []))
    assert [words.text for words in start.words if "tu" in words.text] == ["5 cubes, 0 tu"]


def test_a_growth_from_a_seed_begins_with_the_seed(pyramid):
    letters = [words.text for words in growth(pyramid[1], frames=2).words if "tu" not in words.text]
    assert letters[0] == "b"
