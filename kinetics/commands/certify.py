"""`wellmixed rules certify`: whether what a certificate says of a compiled book is true."""

from __future__ import annotations

import json
from pathlib import Path

import click

from kinetics.assembly import RuleBook
from kinetics.support.cli.completion import shipped
from kinetics.support.cli.declared import count_option
from kinetics.support.cli.failures import CHECKED
from kinetics.support.cli.options import echo_json, json_option
from kinetics.support.limits import text_in


@click.command()
@click.argument("book", shell_complete=shipped("book"))
@click.argument("certificate", type=click.Path(exists=True, dir_okay=False))
@count_option("--steps", default=1_000_000, help="Most answers tried in each search for a book with fewer letters.")
@json_option
def certify(book: str, certificate: str, steps: int, as_json: bool) -> None:
    """Verify what CERTIFICATE, of `wellmixed rules compile --certificate`, claims of the rule book BOOK.

    By code that shares nothing with the compiler: the book is explored, books with fewer letters are searched for, and
    the situations that cubes with weaker senses cannot distinguish are compared. Exit code 1 if a claim is false or
    was not decided.
    """
    from kinetics.assembly.checking.certificate import certified

    try:
        said = json.loads(text_in(Path(certificate)))
    except json.JSONDecodeError as error:
        raise ValueError(f"{certificate}: no certificate: {error}") from None
    claims = certified(RuleBook.load(book), said, steps)
    if as_json:
        echo_json({"book": book, "claims": [claim._asdict() for claim in claims]})
    else:
        click.echo("\n".join(map(str, claims)))
    if not all(claim.holds for claim in claims):
        raise SystemExit(CHECKED)
