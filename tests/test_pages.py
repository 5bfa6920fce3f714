"""What the documentation asks a reader to type: commands are run and print what is shown, or at least exist."""

import pytest
from click.testing import CliRunner
from pages import PAGES, ROOT, blocks, lines, misspelt, run_page, typed

from tests.results.page_pictures import PICTURES, shown
from wellmixed import main

NAMES = [str(page.relative_to(ROOT)) for page in PAGES]
# Where a page has examples in Python, docs/conftest.py types its commands before them.
ALONE = [page for page in PAGES if typed(page) and (page.parent == ROOT or ">>> " not in page.read_text("utf-8"))]


@pytest.mark.parametrize("page", ALONE, ids=lambda page: page.stem)
def test_commands_print_what_the_page_shows(page, tmp_path):
    assert run_page(page, tmp_path) == []


def test_a_wrong_line_of_output_is_seen(tmp_path):
    """The control."""
    page = tmp_path / "page.md"
    page.write_text("```console\n$ wellmixed --version\nwellmixed, version 0.0\n```\n", encoding="utf-8")
    (wrong,) = run_page(page, tmp_path)
    assert "instead of" in wrong
    page.write_text("```console\n$ wellmixed rules derive nothing.net\n```\n", encoding="utf-8")
    (wrong,) = run_page(page, tmp_path)
    assert "ended with 2" in wrong


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_commands_that_are_not_run_are_spelt_right(page):
    assert {line: misspelt(line) for line in lines(page) if misspelt(line)} == {}


def test_every_picture_is_drawn_by_a_command_of_its_page():
    drawn = {name: " ".join(command for command, _ in typed(page)) for page in PAGES for name in shown(page)}
    assert drawn.keys() == {path.name for path in PICTURES.iterdir()}
    assert [name for name, commands in drawn.items() if name not in commands] == []


def test_pages_have_commands():
    assert sum(len(lines(page)) for page in PAGES) > 50
    assert sum(len(typed(page)) for page in PAGES) > 20


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("wellmixed forecast line4", "no command"),
        ("wellmixed predict line4 --cubs 60", "No such option"),
        ("wellmixed predict line4 --cubes many", "not a valid integer"),
        ("wellmixed passage line4", "is missing"),
        ("wellmixed predict line4 --method fast", "is not one of"),
        ("wellmixed predict", "is missing"),
        ("wellmixed predict line4 --times 10 50 100  # a remark", None),
        ("wellmixed rules check t5 --json | less", None),
    ],
)
def test_a_misspelt_command_is_seen(line, said):
    found = misspelt(line)
    assert found is None if said is None else said in found


@pytest.mark.parametrize(("shell", "said"), [("bash", "complete -o"), ("zsh", "#compdef"), ("fish", "complete --no")])
def test_shells_complete_as_the_page_says(shell, said):
    assert f"_WELLMIXED_COMPLETE={shell}_source wellmixed" in (ROOT / "docs" / "how_to.md").read_text("utf-8")
    done = CliRunner().invoke(main, [], prog_name="wellmixed", env={"_WELLMIXED_COMPLETE": f"{shell}_source"})
    assert said in done.output


def test_a_word_is_completed():
    asked = {"_WELLMIXED_COMPLETE": "bash_complete", "COMP_WORDS": "wellmixed pas", "COMP_CWORD": "1"}
    assert CliRunner().invoke(main, [], prog_name="wellmixed", env=asked).output == "plain,passage\n"


def test_no_block_is_left_open():
    assert [page.name for page in PAGES if page.read_text("utf-8").count("```") != 2 * len(blocks(page))] == []
