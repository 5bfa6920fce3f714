"""State diagrams and networks: all there is is drawn, once, and legibly; counterexamples; `wellmixed rules draw`."""

import json
import xml.etree.ElementTree as ET
from collections import Counter
from dataclasses import replace
from itertools import combinations

import pytest
from click.testing import CliRunner
from matplotlib.figure import Figure

from kinetics.assembly import RuleBook, Semantics, check, derive
from kinetics.assembly.deriving.history import Change, laid_out
from kinetics.assembly.drawing.counterexamples import change_drawing, wrapped
from kinetics.assembly.drawing.diagrams import COMBINATION, DISSOCIATION, INTERNAL
from kinetics.assembly.drawing.drawing import width_of
from kinetics.assembly.drawing.network_diagram import DrawnChannel, grouped
from kinetics.assembly.rules.conditions import Combination, Dissociation, Internal
from kinetics.assembly.rules.words import rule_words
from wellmixed import main

LINE4, T5, PYRAMID = (RuleBook.load(name) for name in ("line4", "t5", "pyramid45"))
BOOKS = [LINE4, T5, PYRAMID, RuleBook.load("line4_as_printed")]


def overlapping(words):
    """Pairs of texts whose boxes have more than a hair in common."""
    found = []
    for first, second in combinations(words, 2):
        (a, b, c, d), (e, f, g, h) = first.box, second.box
        if min(c, g) - max(a, e) > 0.02 and min(d, h) - max(b, f) > 0.1:  # boxes are higher than their letters
            found.append((first.text, second.text))
    return found


def arrows(drawing):
    """(from, to, colour of the line) of every arrow of a state diagram."""
    return Counter((*s.tag[1:], s.line) for s in drawing.shapes if isinstance(s.tag, tuple) and s.tag[0] == "arrow")


@pytest.mark.parametrize("book", BOOKS, ids=lambda book: book.name)
def test_every_change_of_letter_has_one_arrow_of_its_kind(book):
    expected = set()
    kinds = ((COMBINATION, book.combine), (DISSOCIATION, book.dissociate), (INTERNAL, book.internal))
    for kind, rules in kinds:
        for rule in rules:
            letters = rule.letter or set(book.letters) - {rule.becomes}
            expected |= {(letter, rule.becomes, kind.colour) for letter in letters}
    drawn = arrows(book.drawing())
    assert set(drawn) == expected
    assert set(drawn.values()) == {1}


@pytest.mark.parametrize("book", BOOKS, ids=lambda book: book.name)
def test_a_state_diagram_is_legible(book):
    drawing = book.drawing()
    assert overlapping(drawing.words) == []
    texts = [words.text for words in drawing.words]
    assert set(book.letters) <= set(texts)
    for rule in book.all_rules:
        assert texts.count(rule_words(rule)) >= 1
        assert any(rule.rule in text for text in texts)


def test_kinds_of_rules_differ_in_style_and_in_colour():
    kinds = (COMBINATION, DISSOCIATION, INTERNAL)
    assert len({str(kind.style) for kind in kinds}) == len({kind.colour for kind in kinds}) == 3


def test_long_names_of_rules_are_numbered():
    texts = [words.text for words in PYRAMID.drawing().words]
    assert "9, 13, 14" in texts  # three rules at the seed's own loop
    assert "host beside corner" in texts
    assert "seed" in texts


def test_rules_in_short():
    combine = Combination(
        rule="x", letter=["a", "b"], face="f1", partner="c", partner_face="f2", neighbours=[], across=["", "d"],
        touched=["c", "d"], roll="parallel", becomes="e",
    )  # fmt: skip
    assert rule_words(combine) == "a/b.f1 + c.f2, roll parallel, none/d across, touching c d, alone → e"
    assert rule_words(Dissociation(rule="x", lost="b", neighbours=["d", "b"], becomes="a")) == "any − b, beside b d → a"
    assert rule_words(Internal(rule="x", letter="a", has="b", becomes="c")) == "a, beside at least b → c"


def test_a_book_of_one_letter_and_a_book_without_rules_are_drawn():
    grow = Combination(rule="grow", becomes="a")
    one = RuleBook("one", ("a",), "a", LINE4.senses, combine=(replace_letter(grow, "a"),))
    assert arrows(one.drawing()) == {("a", "a", COMBINATION.colour): 1}
    assert not arrows(replace(one, combine=()).drawing())


def channels(derivation):
    """The channels of a network as a drawing is given them."""
    return [DrawnChannel(*event, sum(ways.values())) for event, ways in derivation.events.items()]


def replace_letter(rule, letter):
    return rule.replace(letter=(letter,))


@pytest.mark.parametrize("book", [LINE4, T5], ids=lambda book: book.name)
def test_a_network_shows_every_species_and_channel(book):
    derivation = derive(book)
    drawing = derivation.drawing()
    assert overlapping(drawing.words) == []
    texts = Counter(words.text for words in drawing.words)
    assert all(texts[name] >= 1 for name in derivation.structures)
    _, reactions = grouped(derivation.structures, channels(derivation), lump=False)
    for kind, sign in (("join", "→"), ("break", "←")):
        shown = Counter(text for text in texts.elements() if text.startswith(sign) and text[2:].isdigit())
        assert shown == Counter(f"{sign} {r.ways[kind]:g}" for r in reactions if r.ways[kind])
    n_channels = sum(n > 0 for reaction in reactions for n in reaction.ways.values())
    assert n_channels == len(derivation.events)
    assert sum(n for r in reactions for n in r.ways.values()) == derivation.network.ways.sum()


def test_a_large_network_is_lumped_by_size_and_says_so():
    derivation = derive(T5)
    groups, reactions = grouped(derivation.structures, channels(derivation), lump=True)
    assert [group.n_species for group in groups] == [1, 2, 3, 2, 1]
    assert sum(n for r in reactions for n in r.ways.values()) == len(derivation.events)
    texts = [words.text for words in derivation.drawing(max_species=8).words]
    assert "9 species and 25 channels, lumped by size into 5; of each size one species is shown" in texts
    assert "3 species" in texts
    assert derivation.drawing(max_reactions=10).words != derivation.drawing().words


def test_rows_that_are_too_wide_go_on_below():
    drawing = derive(T5).drawing(most_wide=12)
    left, _, right, _ = drawing.bounds
    assert right - left < 15
    texts = [words.text for words in drawing.words]
    assert "…" in texts
    assert texts.count("trimer.c") > 1  # where its line goes on


def test_what_an_exploration_left_out_is_told():
    book = replace(LINE4, semantics=Semantics(gate="any"))
    for derivation in (derive(book, max_cubes=5, partial=True), derive(book, max_cubes=5, max_species=4, partial=True)):
        texts = [words.text for words in derivation.drawing().words]
        assert "incomplete: the exploration reached its limits or was interrupted" in texts


def test_counterexamples_are_drawn_step_by_step():
    report = check(RuleBook.load("line4_as_printed"))
    drawing = report.drawing()
    texts = [words.text for words in drawing.words]
    assert "3.  dimer.a + trimer.a → pentamer.a" in texts
    assert sum(text.startswith(("error:", "warning:")) for text in texts) == len(report.findings)
    for finding in report.findings:
        assert len(finding.changes) == len(finding.steps)
        assert all(sum(map(len, before)) == sum(map(len, after)) for before, after in finding.changes)
        if finding.changes and finding.structure is not None:
            assert finding.structure in finding.changes[-1].after
    ax = Figure().add_subplot()
    assert report.plot(ax) is ax


def test_parts_are_drawn_as_they_lie_in_the_whole():
    dimer = next(s for s in derive(T5).structures.values() if len(s) == 2 and set(s.letters) == {"b"})
    trimer = next(s for s in derive(T5).structures.values() if len(s) == 3 and set(s.letters) == {"b", "e"})
    for change in (Change((dimer, trimer), (T5.target,)), Change((T5.target,), (trimer, dimer))):
        laid = laid_out(change, "two", lambda structure: structure)
        parts = laid.before if len(laid.before) == 2 else laid.after
        assert set(parts[0].positions) | set(parts[1].positions) == set(T5.target.positions)
        assert change_drawing(*laid, "two").words


def test_a_report_without_findings_and_a_finding_without_structures():
    assert check(T5).drawing().words[0].text.startswith("book 't5': 9 structures")
    report = check(replace(T5, semantics=Semantics(bonds="hold")))
    assert any("unreachable rule" in words.text for words in report.drawing().words)


def test_text_is_wrapped_between_words():
    lines = wrapped("one two three four", 0.4, width_of("one two", 0.4))
    assert lines == ["one two", "three", "four"]


@pytest.mark.parametrize("what", ["structure", "book", "network", "species", "growth"])
def test_draw_command(tmp_path, what):
    outs = [tmp_path / "one.svg", tmp_path / "two.svg"]
    for out in outs:
        arguments = ["draw", "t5", "--what", what, "--out", str(out), "--json"]
        result = CliRunner().invoke(main, ["rules", *arguments], catch_exceptions=False)
        told = json.loads(result.stdout)
        assert told["what"] == what
        assert told["out"] == str(out)
        assert told["inches"][0] > 0
        ET.parse(out)
    assert outs[0].read_bytes() == outs[1].read_bytes()


def test_growth_of_a_seeded_book(tmp_path):
    arguments = ["draw", "pyramid45", "--what", "growth", "--seed", "1", "--frames", "4", "--json"]
    result = CliRunner().invoke(main, ["rules", *arguments, "--out", str(tmp_path / "g.png")], catch_exceptions=False)
    told = json.loads(result.stdout)
    assert told["frames"] == [1, 16, 30, 45]
    assert told["seed"] == 1


def test_draw_command_takes_targets(tmp_path):
    target = tmp_path / "mine.toml"
    target.write_text('layers = ["""\n##\n#.\n"""]\n')
    for name, cubes in ((str(target), 3), ("corner", 4)):
        arguments = ["draw", name, "--out", str(tmp_path / "t.svg"), "--json"]
        assert (
            json.loads(CliRunner().invoke(main, ["rules", *arguments], catch_exceptions=False).stdout)["cubes"] == cubes
        )


def test_check_command_draws(tmp_path):
    out = tmp_path / "report.svg"
    result = CliRunner().invoke(main, ["rules", "check", "line4", "--plot", str(out), "--json"], catch_exceptions=False)
    assert json.loads(result.stdout)["plot"] == str(out)
    ET.parse(out)


def test_wrong_input(tmp_path):
    out = str(tmp_path / "x.svg")
    for arguments, message in (
        (["draw", "none", "--out", out], "unknown rule book 'none'"),
        (["draw", "t5_as_printed", "--what", "growth", "--out", out], "never make its target"),
        (["draw", "none.toml", "--out", out], "does not exist"),
    ):
        done = CliRunner().invoke(main, ["rules", *arguments])
        assert (done.exit_code, message in done.stderr) == (2, True)
    refused = CliRunner().invoke(main, ["rules", "draw", "t5", "--out", "x.txt"])
    assert refused.exit_code == 2
    assert "must end in .png, .pdf, .svg" in refused.stderr
    with pytest.raises(ValueError, match="both must be at least 1"):
        derive(LINE4).drawing(max_species=0)


def test_results_plot_themselves_onto_given_axes():
    for result in (T5, derive(T5), check(RuleBook.load("t5_as_printed")).findings[0]):
        ax = Figure().add_subplot()
        assert result.plot(ax) is ax
        assert len(ax.collections) == 1
