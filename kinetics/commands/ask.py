"""`wellmixed ask`: exact answers about a Markov chain, each with its bounds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from kinetics.commands.models import applied, described, instead_of_many_states
from kinetics.markov import Sensitivity, prism_text, write_explicit
from kinetics.markov.questions import parse
from kinetics.markov.settling import answering_chains
from kinetics.support.answer import TruthValue
from kinetics.support.cli.declared import count_option
from kinetics.support.cli.options import (
    HeadedCommand,
    ModelOptions,
    budget_option,
    echo_json,
    in_a_folder,
    json_option,
    model_options,
    truncate_option,
)
from kinetics.support.cli.progress import progress_line
from kinetics.support.output import write_whole

if TYPE_CHECKING:
    from collections.abc import Iterable

    from kinetics.markov import Chain
    from kinetics.markov.derivatives import Derivatives
    from kinetics.network import Model
    from kinetics.support.answer import Answer

MODELS = (".sm", ".prism")  # that are written
PRISM = (*MODELS, ".pm")
INSTEAD = (
    "Truncate the chain by --truncate, which gives bounds; --stop it where what you ask is decided; start from "
    "smaller counts, raise --max-states if the chain is finite, or sample by `wellmixed scan`"
)


@click.command(cls=HeadedCommand)
@model_options
@click.argument("questions", metavar="QUESTION...", nargs=-1)
@click.option(
    "--stop",
    metavar="CONDITION",
    help="Explore no further from states of a network in which this holds.",
)
@truncate_option
@count_option("--max-states", default=1_000_000, help="Refuse a model that reaches more states than this.")
@click.option(
    "--out",
    "out_file",
    metavar="FILE",
    callback=in_a_folder,
    help="Write the chain to PRISM's explicit files (.tra and its companions), or the network to a PRISM model "
    "(.sm, .prism).",
)
@click.option(
    "--sensitivity",
    "with_sensitivity",
    is_flag=True,
    help="Report derivative and elasticity of each answer by each rate constant of a network.",
)
@budget_option
@json_option
def ask(
    asked: ModelOptions,
    questions: tuple[str, ...],
    stop: str | None,
    truncate: str | int | None,
    max_states: int,
    out_file: str | None,
    with_sensitivity: bool,
    budget: float,
    as_json: bool,
) -> None:
    """Answer questions about a Markov chain: probabilities, rewards and the steady state, with bounds.

    NETWORK is a rule book, which needs --rates and --cubes, a network file that contains both, a .tra file as PRISM and
    Storm write it, or a model (ctmc) in PRISM's language (.sm, .prism, .pm), of which --set sets undefined constants. A
    QUESTION is one of theirs, such as 'P=? [ F<=100 quadmer >= 1 ]', 'P=? [ a > 0 U b = 3 ]', 'S=? [ monomer < 5 ]' or
    'R{"quadmer"}=? [ I=100 ]'; F, U and G take time bounds <=t, >=t and [a,b], R takes I=t, C<=t, C, F and S.
    'P>=0.9 [ F<=100 quadmer >= 1 ]' is true, false, or not decided within the bound, and may stand in a condition.
    There are X, F || F, R[var], quantile(...) and filter(...), too; E[A] @ 5, var[A] @ 5, sd[A] @ 5 and q0.9[A] @ 5 are
    mean, variance, standard deviation and a quantile at a time. Species count as variables and as rewards. Times are in
    tu.

    For F, G and U, states are explored only until the answer is settled. If that still leaves infinitely many,
    --truncate truncates the chain; the bounds hold for any behaviour outside.
    """
    if not questions and out_file is None:
        raise ValueError(
            "nothing to do; ask a question, as in 'P=? [ F<=100 quadmer >= 1 ]', or write the chain by --out"
        )
    queries = [parse(question) for question in questions]  # before any state is explored
    if Path(asked.source).suffix.lower() in (".tra", *PRISM):
        model = None
        chain = _from_files(asked, stop, truncate, max_states)
        chains: Iterable[tuple[Chain, list[int]]] = [(chain, list(range(len(queries))))]
    else:
        model = applied(*described(asked))
        # What is written is the whole chain, which then answers all questions.
        chains = answering_chains([] if out_file else queries, model, stop, truncate, max_states)
    found: dict[int, tuple[Answer, Derivatives | None]] = {}
    states = rates = 0
    with instead_of_many_states(INSTEAD), progress_line(budget=budget) as progress:
        progress("listing states")
        for chain, places in chains:
            if out_file:
                _write(out_file, chain, model)
            sensitivity = Sensitivity(chain) if with_sensitivity else None
            for place in range(len(queries)) if out_file else places:
                progress(f"answering {questions[place]} by {len(chain)} states")
                query = queries[place]
                found[place] = query.value(chain), None if sensitivity is None else query.derivatives(sensitivity)
            states, rates = max(states, len(chain)), max(rates, chain.transitions.rates.size)
    answers = [(text, *found[place]) for place, text in enumerate(questions)]
    if as_json:
        listed = [
            {"question": text, **answer.to_dict(), **_truth(answer), "sensitivity": slope and slope.to_dict()}
            for text, answer, slope in answers
        ]
        echo_json({"model": asked.source, "states": states, "rates": rates, "answers": listed})
        return
    for text, answer, slope in answers:
        click.echo(f"{text}  {answer}")
        if slope is not None:
            click.echo(f"{slope}\n")
    if out_file:
        click.echo(f"wrote {out_file}: {states} states, {rates} rates")


def _truth(answer: Answer) -> dict[str, bool | None]:
    """Whether an answer that is true or false is true; null if it is not decided within the bound."""
    return {"holds": answer.holds} if isinstance(answer, TruthValue) else {}


def _from_files(asked: ModelOptions, stop: str | None, truncate: str | int | None, max_states: int) -> Chain:
    """The chain of explicit files, or of a model in PRISM's language."""
    from kinetics.markov import read_explicit, read_prism

    path, is_explicit = asked.source, Path(asked.source).suffix.lower() == ".tra"
    given: dict[str, Any] = {
        "--rates": asked.rates_name,
        "--cubes": asked.cubes,
        "--initial": asked.initial,
        "--stop": stop,
        "--copies-per-unit": asked.copies_per_unit,
        "--truncate": truncate,
        "--set": (asked.chosen or None) if is_explicit else None,
        "--tank": asked.edges,
    }
    for option, value in given.items():
        if value is not None:
            raise ValueError(f"{path} is {'a whole chain' if is_explicit else 'a whole model'}; leave out {option}")
    return read_explicit(path) if is_explicit else read_prism(path, asked.chosen, max_states)


def _write(path: str, chain: Chain, model: Model | None) -> None:
    """A chain as explicit files, a network also as a model."""
    suffix = Path(path).suffix.lower()
    if suffix == ".tra":
        write_explicit(chain, path)
    elif suffix not in MODELS:
        raise ValueError(f"--out {path}: expected a name that ends in .tra, {', '.join(MODELS)}")
    elif np.any(chain.truncated):
        raise ValueError(f"--out {path}: a model has no edge; leave out --truncate")
    elif model is None:
        raise ValueError(f"--out {path}: a chain without a network has no model; write it to a .tra file")
    else:
        most = np.asarray(chain.counts)[:, : len(model.network.species)].max(axis=0)
        text = prism_text(model, most)
        write_whole(path, text)
