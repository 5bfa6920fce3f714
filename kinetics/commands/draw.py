"""`wellmixed rules draw`: pictures of structures, rule books, networks and growth sequences."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from kinetics.assembly import RuleBook, derive
from kinetics.assembly.drawing.pictures import below_left, face_key, species_sheet, strip, structure_drawing
from kinetics.assembly.rules.rule_book import BOOKS
from kinetics.support.cli.completion import shipped
from kinetics.support.cli.declared import count_option, default_option
from kinetics.support.cli.options import echo_json, json_option, picture_of, seed_option
from kinetics.support.cli.progress import progress_line
from kinetics.support.config import find

if TYPE_CHECKING:
    from kinetics.assembly import Derivation, RuleBook, Structure
    from kinetics.assembly.drawing.drawing import Drawing

Drawn = tuple["Drawing", dict[str, Any]]  # and facts about it
FRAMES = 8
PLACEHOLDER = "#"  # of cubes that have no letter yet


@click.command()
@click.argument("book", metavar="BOOK|TARGET", shell_complete=shipped("book", "target"))
@default_option(
    "--what",
    type=click.Choice(["structure", "book", "network", "species", "growth"]),
    default="structure",
    help="What to draw: the finished structure; the rules as a state diagram; the derived reaction network as a graph; "
    "all species of that network; or a growth sequence from the first cube to the last.",
)
@click.option(
    "--out", "out", metavar="FILE", required=True, callback=picture_of, help="The PNG, PDF or SVG file to write."
)
@count_option("--frames", least=2, default=FRAMES, help="Number of pictures in a growth sequence.")
@count_option(
    "--max-cubes", help="Size of the largest structure explored, cubes.  [default: 12, or the target's size if larger]"
)
@count_option("--max-species", default=2000, help="Largest number of species explored.")
@seed_option
@json_option
def draw(
    book: str,
    what: str,
    out: str,
    frames: int,
    max_cubes: int | None,
    max_species: int,
    seed: int,
    as_json: bool,
) -> None:
    """Draw a rule book (shipped, or a .toml file), or the structure of a compiler target.

    The growth sequence of a book with a seed cube is a random one that its rules allow, cube by cube; of any other book
    it is the shortest sequence of joins to the finished structure. Networks of more than 24 species are lumped by size.
    """

    def network() -> Derivation:
        return _derived(RuleBook.load(book), max_cubes, max_species)

    makers: dict[str, Callable[[], Drawn]] = {
        "structure": lambda: _structure(book),
        "book": lambda: _book(RuleBook.load(book)),
        "network": lambda: _network(network()),
        "species": lambda: _species(network()),
        "growth": lambda: _growth(RuleBook.load(book), frames, seed, max_cubes, max_species),
    }
    drawing, facts = makers[what]()
    drawing.save(out)
    if as_json:
        echo_json({"book": book, "what": what, "out": out, "inches": drawing.size, **facts})
    else:
        listed = ", ".join(f"{name} {value}" for name, value in facts.items())
        click.echo(f"{out}: {what} of {book} ({listed})")


def _structure(name: str) -> Drawn:

    structure, scheme = _finished(name)
    labels = ["" if letter == PLACEHOLDER else letter for letter in structure.letters]
    drawing = structure_drawing(structure, scheme, labels=labels)
    below_left(drawing, face_key(scheme))
    return drawing, {"cubes": len(structure)}


def _finished(name: str) -> tuple[Structure, str]:
    """The finished structure of a book, or a compiler's target, with the face scheme of its cubes."""
    from kinetics.assembly.compiler.target import TARGETS, Target, describes_target

    if Path(name).suffix == ".toml" or len(Path(name).parts) > 1:
        is_target = describes_target(find(name, BOOKS, "rule book or target"))
    else:
        is_target = (TARGETS / f"{name}.toml").exists() and not (BOOKS / f"{name}.toml").exists()
    if is_target:
        target = Target.load(name)
        scheme = "two" if target.senses is None else target.senses.faces
        return target.structure(scheme), scheme
    book = RuleBook.load(name)
    if book.target is None:
        raise ValueError(f"book {name!r} names no target to draw; give it a [target], or draw --what species")
    return book.target, book.scheme


def _book(book: RuleBook) -> Drawn:
    return book.drawing(), {"letters": len(book.letters), "rules": len(book.all_rules)}


def _network(derivation: Derivation) -> Drawn:
    return derivation.drawing(), _size(derivation)


def _species(derivation: Derivation) -> Drawn:

    sheet = species_sheet(derivation.structures, derivation.book.scheme, derivation.is_closed)
    return sheet, _size(derivation)


def _growth(book: RuleBook, frames: int, seed: int, max_cubes: int | None, max_species: int) -> Drawn:
    """A growth, thinned to so many frames of which the first and the last are kept."""
    from kinetics.assembly.deriving.history import chain, random_growth

    facts: dict[str, Any] = {}
    if book.seed_letter is not None:
        grown, facts = random_growth(book, seed, max_cubes), {"seed": seed}
    else:
        grown = chain(_derived(book, max_cubes, max_species))
    steps = sorted({round(n * (len(grown) - 1) / (frames - 1)) for n in range(frames)})
    shown = [grown[step] for step in steps]
    captions = [f"{len(structure)} cube{'s' * (len(structure) > 1)}" for structure in shown]
    drawing = strip(shown, captions, book.scheme)
    below_left(drawing, face_key(book.scheme))
    return drawing, {"frames": [len(structure) for structure in shown], **facts}


def _size(derivation: Derivation) -> dict[str, Any]:
    return {
        "species": len(derivation.structures),
        "channels": len(derivation.events),
        "closed": derivation.is_closed,
    }


def _derived(book: RuleBook, max_cubes: int | None, max_species: int) -> Derivation:
    """The network as far as the caps; the drawing says where that is not all."""
    with progress_line() as progress:
        return derive(
            *(book, max_cubes, max_species),
            partial=True,
            progress=lambda explored, found: progress(f"{explored} of {found} structures explored"),
        )
