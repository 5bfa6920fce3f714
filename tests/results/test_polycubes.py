"""The table of shapes: its polycubes, its rows, and the page that is made of them."""

import multiprocessing
import os
import re
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from kinetics.assembly import RuleBook, Structure
from tests.results import polycubes_table as command
from tests.results.polycubes_page import FIGURE, SHEETS, figure, files, mirrored
from tests.results.polycubes_rows import Row, made
from tests.results.polycubes_shapes import KNOWN, SAMPLE, SEED, SIZES, canonical, chosen, polycubes, sampled
from tests.results.polycubes_sheets import caption, sheet
from tests.results.polycubes_table import FOLDER, main, stored

FIXED = (1, 3, 15, 86, 534, 3481, 23502)  # A001931: orientations counted apart
TWO_SIDED = (1, 1, 2, 7, 23, 112, 607)  # A038119: mirror images alike


@pytest.fixture(scope="module")
def rows():
    found = stored(FOLDER)
    return [found[key] for key in sorted(found)]


def orientations(shape):
    n = len(shape)
    return 24 // Structure(shape, (0,) * n, ("x",) * n).symmetry_number("one")


# Polycubes


def test_there_are_as_many_as_known():
    assert tuple(len(polycubes(size)) for size in range(1, 9)) == KNOWN


def test_other_counts_agree():
    """By orientations, and with mirror images alike."""
    assert tuple(sum(map(orientations, polycubes(size))) for size in range(1, 8)) == FIXED
    both = [{min(shape, mirrored(shape)) for shape in polycubes(size)} for size in range(1, 8)]
    assert tuple(map(len, both)) == TWO_SIDED
    assert KNOWN[:7] != TWO_SIDED


def test_a_shape_is_known_in_any_position():
    rng = np.random.default_rng(3)
    for shape in rng.permutation(np.array(polycubes(6)))[:20]:
        turned = Structure(tuple(map(tuple, shape.tolist())), (0,) * 6, ("x",) * 6).turned(int(rng.integers(24)))
        moved = tuple((x + 5, y - 2, z) for x, y, z in turned.positions)
        assert canonical(moved[::-1]) == canonical(tuple(map(tuple, shape.tolist())))
    assert canonical(((0, 0, 0), (1, 0, 0), (2, 0, 0))) != canonical(((0, 0, 0), (1, 0, 0), (1, 1, 0)))


def test_a_sample_comes_out_again():
    assert sampled(7, 5, 1) == sampled(7, 5, 1) != sampled(7, 5, 2)
    assert sampled(4, 100, 1) == tuple(range(8))
    assert len(set(sampled(8, SAMPLE, SEED))) == SAMPLE


def misfit(draws, number, taken):
    """p of numbers of draws of each of so many shapes, of which each draw takes `taken`, if all are as likely."""
    share, times = taken / number, len(draws)
    counts = np.zeros(number)
    for draw in draws:
        counts[list(draw)] += 1
    spread = times * share * (1 - share) * number / (number - 1)
    return chi2.sf(((counts - times * share) ** 2).sum() / spread, number - 1)


def test_shapes_are_as_likely_as_each_other():
    number = len(polycubes(5))
    assert misfit([sampled(5, 10, seed) for seed in range(3000)], number, 10) > 1e-6
    weights = np.array([orientations(shape) for shape in polycubes(5)], dtype=float)
    rng = np.random.default_rng(1)  # the control: by orientations, symmetrical shapes are rare
    skewed = [rng.choice(number, 10, replace=False, p=weights / weights.sum()) for _ in range(3000)]
    assert misfit(skewed, number, 10) < 1e-6


# Rows


def test_the_rows_are_those_of_the_table(rows):
    assert {row.key for row in rows} <= set(chosen(SIZES, SEED))
    assert all(row.places == polycubes(row.cubes)[row.number] for row in rows)
    assert all(row.seed == (None if row.cubes <= command.ALL_UP_TO else SEED) for row in rows)


def test_the_books_are_those_of_the_shapes(rows, tmp_path):
    for row in rows:
        if not row.book:
            assert row.reason
            continue
        path = tmp_path / f"{row.cubes}-{row.number}.toml"
        path.write_text(row.book, encoding="utf-8")
        book = RuleBook.load(path)
        assert canonical(book.target.positions) == row.places
        assert (len(book.letters), len(book.all_rules)) == (row.letters, row.rules)
        assert row.is_fewest == (not row.undecided_letters)
        assert row.low <= row.yield_ <= row.high


def unclocked(row):
    """A row without what no other computer repeats."""
    return replace(row, compile_cpu=0.0, yield_cpu=0.0, code="")


def test_cheap_rows_come_out_again(rows):
    cheap = [row for row in rows if row.cubes > 3 and row.book and row.compile_cpu < 1.5]
    drawn = [cheap[n] for n in np.random.default_rng(4).choice(len(cheap), 3, replace=False)]
    for row in drawn:
        again = made(*row.key, row.seed)
        assert unclocked(again) == unclocked(row)
        assert unclocked(replace(again, letters=row.letters + 1)) != unclocked(row)
        assert Row.read(again.line()) == again


# Page


def test_the_page_says_what_the_rows_hold(rows):
    there = {path.name: path.read_text(encoding="utf-8") for path in FOLDER.iterdir() if path.name != "rows.jsonl"}
    made_files = files(FOLDER, rows)
    assert set(made_files) == set(there)
    assert {name for name, text in made_files.items() if text != there[name]} <= {FIGURE}
    assert lines_of(made_files[FIGURE]) == lines_of(there[FIGURE])


def lines_of(text):
    return re.findall(r'<path d="[^"]*" clip-path', text)


def test_a_changed_row_is_seen(rows):
    """The control."""
    number = next(n for n, row in enumerate(rows) if row.cubes == 4 and row.book)
    more = replace(rows[number], letters=rows[number].letters + 2, compile_cpu=777.0)
    changed = files(FOLDER, [*rows[:number], more, *rows[number + 1 :]])
    told = {name for name, text in changed.items() if text != (FOLDER / name).read_text(encoding="utf-8")}
    assert told >= {"README.md", "shapes.csv", "shapes_1_to_5.svg"}
    assert lines_of(figure(rows)) != lines_of(changed[FIGURE])


def boxes(drawing):
    """Of each shape's picture and each caption: left, bottom, right, top."""
    points = {}
    for shape in drawing.shapes:
        if shape.tag[0] == "face" and shape.tag[-1] != "key":
            points.setdefault(shape.tag[-1], []).append(shape.points)
    stacked = {key: np.vstack(each) for key, each in points.items()}
    pictures = {key: (*all_.min(axis=0), *all_.max(axis=0)) for key, all_ in stacked.items()}
    return pictures, [words.box for words in drawing.words]


def overlaps(all_boxes):
    found = np.array(all_boxes)
    apart = (found[:, None, 2] <= found[None, :, 0] + 1e-9) | (found[:, None, 3] <= found[None, :, 1] + 1e-9)
    return int((~(apart | apart.T)).sum()) - len(found)


@pytest.mark.parametrize("name", SHEETS)
def test_every_shape_is_drawn_and_none_over_another(rows, name):
    those = [row for row in rows if row.cubes in SHEETS[name]]
    if not those:
        pytest.skip("no row of these sizes yet")
    drawing = sheet(those)
    pictures, words = boxes(drawing)
    assert set(pictures) == {row.key for row in those}
    assert Counter(word.text for word in drawing.words[: len(those)]) == Counter(map(caption, those))
    assert overlaps([*pictures.values(), *words]) == 0
    moved = [*pictures.values(), words[0], next(iter(pictures.values()))]  # the control
    assert overlaps(moved) > 0


# The command


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "README.md").write_text("<!-- polycubes: sizes -->\n<!-- end -->\n", encoding="utf-8")
    return tmp_path


def test_the_command_makes_rows_and_page_and_resumes(folder, monkeypatch, capsys):
    assert main(["--sizes", "2,3", "--folder", str(folder), "--workers", "2"]) == 0
    assert [unclocked(row) for row in stored(folder).values()] == [
        unclocked(made(*key)) for key in ((2, 0), (3, 0), (3, 1))
    ]
    assert "| 3 | 2 | 2 |" in (folder / "README.md").read_text(encoding="utf-8")
    said = capsys.readouterr().out
    assert said.startswith("3 shapes by 2 workers: about 0 CPU minutes")
    assert "have no row yet" in said
    asked = []

    def counted(wanted, seed, workers):
        asked.extend(wanted)
        yield from ()

    monkeypatch.setattr(command, "made_rows", counted)
    assert main(["--sizes", "1,2,3", "--folder", str(folder), "--resume"]) == 0
    assert asked == [(1, 0)]
    monkeypatch.setattr(command, "code", lambda _: "other")
    assert main(["--sizes", "2,3", "--folder", str(folder), "--resume"]) == 0
    assert sorted(asked[1:]) == [(2, 0), (3, 0), (3, 1)]


def test_what_was_made_before_ctrl_c_is_kept(folder, monkeypatch, capsys):
    def interrupted(wanted, seed, workers):
        yield made(2, 0)
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "made_rows", interrupted)
    assert main(["--sizes", "2,3", "--folder", str(folder)]) == 130
    assert set(stored(folder)) == {(2, 0)}
    assert "stopped after 1 of 3 shapes" in capsys.readouterr().out


def test_a_process_that_is_ended_leaves_a_row_that_says_so():
    context = multiprocessing.get_context("forkserver")
    receiving, sending = context.Pipe(duplex=False)
    process = context.Process(target=os._exit, args=(9,))
    process.start()
    sending.close()
    row = command._received(receiving, process, Row(2, 0, polycubes(2)[0], "ended"))
    assert (row.outcome, row.reason) == ("ended", "its process was ended (exit code 9)")
    assert caption(row) == "?"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--sizes", "x"], "expected numbers such as 4,5,6"),
        (["--sizes", "4,9"], "9 cubes; the table is of 1 to 8"),
        (["--workers", "0"], "at least 1 is needed"),
        (["--folder", "nowhere"], "there is no such folder"),
    ],
)
def test_bad_options(arguments, said, capsys):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    assert said in capsys.readouterr().err
