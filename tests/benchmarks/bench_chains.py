"""Questions to explicit chains of 3,000 to 100,000 states: CPU time and error, beside Storm where it is installed.

    python -m tests.benchmarks.bench_chains

Storm (extra `oracle`) answers the same questions about the same explicit files in the same process: by the solvers that
it takes by itself, at its precision of 1e-6, and for equations by its Jacobi iteration asked for 1e-12 as well, in at
most 20,000 rounds. (Those that prove a precision took up to a thousand times as long.) Its precision of values at a
time cannot be set from Python. Processor time is the median of repeats in turn, after one that is not counted, which
compiles or loads the kernels; reading the files is apart. Errors are relative to a reference that shares no code with
either (`chain_references`), where there is one, else to ours; beside ours stands the error that it comes with, proven
unless marked "~". P is the probability of the target by a time, U that of reaching it before "bad", T the mean time
until it, and S the share of "bad" after infinite time.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import click
import numpy as np

from kinetics import Chain, Rates
from kinetics.assembly import RuleBook, derive
from kinetics.markov import read_explicit, write_explicit
from tests.benchmarks.chain_references import reference

REPEATS = 3
ENOUGH = 5.0  # seconds, after which nothing is repeated
SIZES = (3_000, 10_000, 30_000, 100_000)


class Work(NamedTuple):
    """A chain with the labels "target" and "bad", and the times that are asked for."""

    name: str
    chain: Chain
    times: tuple[float, ...]


class Answer(NamedTuple):
    """A value, the relative error that came with it, processor time; or why there is none."""

    value: float
    told: str
    seconds: float
    refusal: str = ""


def line(states: int) -> Work:
    """The paper's line of four, from as many cubes as make about so many states."""
    cubes = {3_000: 70, 10_000: 108, 30_000: 157, 100_000: 236}[states]
    network = Rates.load("table3").apply(derive(RuleBook.load("line4")).network)
    chain = Chain.of(network, [cubes, 0, 0, 0], {"target": "quadmer >= 5", "bad": "trimer >= 9"})
    return Work("line of four", chain, (20.0, 200.0))


def births_and_deaths(states: int) -> Work:
    """A walk up and down between two walls, with two places where it rather stays."""
    n = np.arange(states)
    ups = 1.0 + 30.0 * np.sin(12.0 * n / states) / states
    rows, columns = np.append(n[:-1], n[1:]), np.append(n[1:], n[:-1])
    labels = {"target": n == 160, "bad": n == 20}
    chain = Chain(_sparse(rows, columns, np.append(ups[:-1], np.ones(states - 1)), states), 100, labels)
    return Work("births and deaths", chain, (200.0, 2000.0))


def random_chain(states: int) -> Work:
    """Five ways out of each state, to states by chance, at rates over two decades."""
    rng = np.random.default_rng(1)
    rows = np.repeat(np.arange(states), 5)
    columns = (rows + rng.integers(1, states, rows.size)) % states
    rates = 10.0 ** rng.uniform(-1.0, 1.0, rows.size)
    labels = {"target": np.arange(states) % 100 == 7, "bad": np.arange(states) % 100 == 8}
    return Work("random, five ways out", Chain(_sparse(rows, columns, rates, states), 0, labels), (1.0, 10.0))


def groups(states: int) -> Work:
    """Ten groups of states with ways by chance inside, left from one state in ten at rates of 1e-6: stiff."""
    rng, size = np.random.default_rng(2), states // 10
    rows = np.repeat(np.arange(states), 5)
    columns = rows // size * size + (rows % size + rng.integers(1, size, rows.size)) % size
    rates = 10.0 ** rng.uniform(-1.0, 1.0, rows.size)
    slow = np.arange(0, states, 10)
    onward = (slow + rng.choice([-size, size], slow.size)) % states
    chain = _sparse(
        np.append(rows, slow), np.append(columns, onward), np.append(rates, np.full(slow.size, 1e-6)), states
    )
    places = np.arange(states)
    labels = {"target": (places // size == 5) & (places % 10 == 7), "bad": (places // size == 8) & (places % 10 == 8)}
    return Work("ten groups, left at 1e-6", Chain(chain, 0, labels), (100.0,))


def _sparse(rows: Any, columns: Any, rates: Any, n: int) -> Any:
    from scipy.sparse import csr_array

    return csr_array((rates, (rows, columns)), shape=(n, n))


def ours(chain: Chain, question: str, time_asked: float) -> Answer:
    """By the chain as it was read."""
    began = time.process_time()
    try:
        if question == "T":
            passage = chain.passage("target")
            return _answered(passage.mean, passage.error, passage.is_bound, began)
        if question == "S":
            found = chain.steady_state("bad")
        elif question == "U":
            found = chain.until("target", "not bad")
        else:
            found = chain.until("target", by=time_asked)
    except ValueError as refused:
        return Answer(np.nan, "", time.process_time() - began, str(refused))
    return _answered(found.value, (found.high - found.low) / 2 / found.value, found.is_bound, began)


def _answered(value: float, error: float, is_bound: bool, began: float) -> Answer:
    return Answer(value, f"{'' if is_bound else '~'}{error:.0e}", time.process_time() - began)


NOTATION = {"P": 'P=? [ F<={0:g} "target" ]', "U": 'P=? [ !"bad" U "target" ]', "T": 'T=? [ F "target" ]'}
NOTATION["S"] = 'S=? [ "bad" ]'


def storm(path: Path) -> tuple[Callable[[str, float, str], Answer], float]:
    """Answers of Storm about a chain in its explicit files, by the name of its settings; and the time to read them."""
    import stormpy

    began = time.process_time()
    model = stormpy.build_model_from_explicit(path, path.with_suffix(".lab"))
    reading = time.process_time() - began

    def fine() -> Any:
        made = stormpy.Environment()
        made.solver().set_linear_equation_solver_type(stormpy.environments.EquationSolverType.NATIVE)
        made.solver().native().precision = stormpy.Rational("1/1000000000000")
        made.solver().native().maximal_number_of_iterations = 20_000
        return made

    settings = {"storm": stormpy.Environment, "to 1e-12": fine}

    def ask(question: str, time_asked: float, kind: str) -> Answer:
        (asked,) = stormpy.parse_properties(NOTATION[question].format(time_asked))
        environment, began = settings[kind](), time.process_time()
        try:
            result = stormpy.model_checking(model, asked, only_initial_states=True, environment=environment)
            value = float(result.get_value(model.initial_states[0]))
        except RuntimeError as refused:
            return Answer(np.nan, "", time.process_time() - began, str(refused))
        return Answer(value, "", time.process_time() - began)

    return ask, reading


def write_for_storm(chain: Chain, path: Path) -> None:
    """Explicit files in Storm's own form, which gives no sizes and declares its labels."""
    entries = chain.transitions.generator().tocoo()
    order = np.lexsort((entries.col, entries.row))
    off = order[(entries.row != entries.col)[order]]
    lines = zip(entries.row[off].tolist(), entries.col[off].tolist(), entries.data[off].tolist(), strict=True)
    path.write_text("ctmc\n" + "".join(f"{i} {j} {rate!r}\n" for i, j, rate in lines))
    labels: dict[str, Any] = {"init": np.asarray(chain.initial) > 0, **chain.labels}
    held = ((i, [name for name in labels if labels[name][i]]) for i in range(len(chain)))
    marks = "".join(f"{i} {' '.join(names)}\n" for i, names in held if names)
    path.with_suffix(".lab").write_text(f"#DECLARATION\n{' '.join(labels)}\n#END\n{marks}")


def race(work: Work) -> None:
    """Print the rows of a chain."""
    with tempfile.TemporaryDirectory() as folder:
        files = {name: Path(folder) / f"{name}.tra" for name in ("ours", "storm")}
        write_explicit(work.chain, files["ours"])
        began = time.process_time()
        chain = read_explicit(files["ours"])
        reading = f"reading: ours {time.process_time() - began:.3f} s"
        ask, kinds = None, ()
        if find_spec("stormpy"):
            write_for_storm(work.chain, files["storm"])
            ask, seconds = storm(files["storm"])
            reading, kinds = f"{reading}, storm {seconds:.3f} s", ("storm", "to 1e-12")
    click.echo(f"\n{work.name}: {len(chain)} states, {chain.transitions.rates.size} rates; {reading}")
    for question, when in [*(("P", each) for each in work.times), *((each, np.nan) for each in "UTS")]:
        chosen = kinds[:1] if question == "P" else kinds
        calls: dict[str, Callable[[], Answer]] = {"ours": lambda q=question, t=when: ours(chain, q, t)}
        calls |= {kind: lambda q=question, t=when, k=kind: ask(q, t, k) for kind in chosen}
        answers = [{name: call() for name, call in calls.items()}]
        for _ in range(REPEATS):
            slow = {name for name in calls if answers[-1][name].seconds > ENOUGH}
            answers.append({name: answers[-1][name] if name in slow else call() for name, call in calls.items()})
        _print_row(f"{question} {when:g}" if question == "P" else question, work.chain, question, when, answers)


def _print_row(title: str, chain: Chain, question: str, when: float, answers: list[dict[str, Answer]]) -> None:
    told = answers[-1]
    seconds = {name: median(each[name].seconds for each in answers[1:]) for name in told}
    exact = reference(chain, question, when)
    against = told["ours"].value if exact is None else exact
    cells = []
    for name, answer in told.items():
        if answer.refusal:
            cells.append(f"{name} refused after {seconds[name]:.2f} s")
            continue
        error = "reference" if exact is None and name == "ours" else f"{abs(answer.value / against - 1.0):.0e}"
        bound = f" (told {answer.told})" if answer.told else f" = {seconds[name] / seconds['ours']:.2f} x ours"
        cells.append(f"{name} {1e3 * seconds[name]:.1f} ms, off by {error}{bound}")
    click.echo(f"  {title:7} {against:<12.6g} " + "; ".join(cells))


def main() -> None:
    """Print the tables."""
    if not find_spec("stormpy"):
        click.echo("Storm is not installed (pip install 'wellmixed[oracle]'); ours alone")
    for states in SIZES:
        for make in (line, births_and_deaths, random_chain, groups):
            race(make(states))


if __name__ == "__main__":
    main()
