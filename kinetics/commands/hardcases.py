"""`wellmixed trust hardcases`: problems on which numerical methods are known to fail, and how ours do on them."""

from __future__ import annotations

import click

from kinetics.support.cli.options import echo_json, json_option
from kinetics.support.cli.progress import stage
from kinetics.trust.hardcases import CASES


@click.command()
@click.option("--only", metavar="TEXT", default="", help="Run only the cases whose name contains this text.")
@json_option
def hardcases(only: str, as_json: bool) -> None:
    """Test every numerical method on hard cases: each must agree with an independent answer or refuse with a reason.

    The cases fix their own seeds. Exit code 1 if a case fails.
    """
    chosen = [case for case in CASES if only in case.name]
    if not chosen:
        raise ValueError(f"no hard case has {only!r} in its name; there are {', '.join(case.name for case in CASES)}")
    attempts, failed = [], 0
    for case in chosen:
        if not as_json:
            click.echo(f"{case.name}: {case.question} ({case.answer})")
        stage(f"{case.name}, {chosen.index(case)} of {len(chosen)} cases done")
        for found in case.attempts():
            failed += not found.passed
            verdict = "ok" if found.passed else "WRONG"
            if not as_json:
                answer = (
                    f'refused: "{found.refusal}"' if found.refusal else f"{found.error:.1e} (up to {found.allowed:.0e})"
                )
                click.echo(f"  {verdict:5}  {found.seconds:7.3f} s  {found.method}: {answer}")
            attempts.append(
                {
                    "case": case.name,
                    "question": case.question,
                    "answer": case.answer,
                    "method": found.method,
                    "error": None if found.refusal else found.error,
                    "allowed": None if found.refusal else found.allowed,
                    "refusal": found.refusal or None,
                    "passed": found.passed,
                    "seconds": found.seconds,
                }
            )
    if as_json:
        echo_json({"attempts": attempts, "failed": failed})
    else:
        click.echo(f"{len(attempts)} attempts at {len(chosen)} cases; {failed} failed")
    if failed:
        raise SystemExit(1)
