"""Chains as the explicit files of PRISM, in and out: `.tra`, and beside it `.sta`, `.lab`, `.srew` and `.trew`.

https://www.prismmodelchecker.org/manual/Appendices/ExplicitModelFiles. Of several rewards each has files of its own,
`model1.srew`, `model2.srew`, ..., and their first line gives the name. A `.tra` file may also begin as Storm's do,
with the word `ctmc` in the place of the sizes. A jump from a state to itself changes nothing but a reward, which
becomes a reward a time unit of that state.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.chain import Chain
from kinetics.markov.checks import Reward
from kinetics.markov.prism.writing import prism_names
from kinetics.markov.transient.search import MAX_STATES
from kinetics.markov.transient.transitions import totals
from kinetics.network.predicates import DEADLOCK, INIT
from kinetics.support.arrays import Floats
from kinetics.support.limits import check_names, text_in
from kinetics.support.memory import check_memory
from kinetics.support.output import scratch_folder, write_together
from kinetics.support.packages import sparse

REWARD_NAME = re.compile(r'#\s*Reward structure\s+"([^"]+)"')
Parsed = TypeVar("Parsed")


def read_explicit(path: str | Path) -> Chain:
    """The chain in a `.tra` file and those beside it; its labels include "init", where it starts, and "deadlock".

    A variable that is true or false in all states is also a label of its name, so that conditions may take it alone.

    ValueError: a file is missing or damaged, with its line; the label "init" is not that of one state

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from kinetics.markov import read_explicit
    >>> with TemporaryDirectory() as folder:
    ...     _ = Path(folder, "pump.tra").write_text('''2 2
    ... 0 1 0.1
    ... 1 0 2''')
    ...     pump = read_explicit(f"{folder}/pump.tra")
    >>> round(pump.steady_state([False, True]).value, 6)
    0.047619
    """
    file = Path(path)
    if not file.exists():
        raise ValueError(f"{file} does not exist; expected a .tra file")
    n, rows, columns, rates = _entries(file)
    if n > rows.size + 1 + MAX_STATES:
        raise ValueError(f"{file}: {n} states, but {rows.size} transitions, which lead to no more than so many of them")
    check_memory(f"{n} states", 8.0 * 20 * n, "give a smaller chain")
    bad = ~((rates >= 0) & np.isfinite(rates))
    if bad.any():
        raise ValueError(f"{file}: a rate is {rates[bad][0]:g}; expected a finite number of at least 0")
    variables, counts, booleans = _variables(file.with_suffix(".sta"), n)
    labels = _labels(file.with_suffix(".lab"), n)
    twice = next((name for name in booleans if name in labels), None)
    if twice is not None:
        raise ValueError(f"{file.with_suffix('.lab')}: the label {twice!r} is also a variable; rename one")
    labels |= booleans
    starts = np.flatnonzero(labels[INIT]) if INIT in labels else np.zeros(1, dtype=np.int64)
    if starts.size != 1:
        raise ValueError(f"{file.with_suffix('.lab')}: {starts.size} states have the label {INIT!r}; expected one")
    moves = rows != columns
    generator = _sparse(rows[moves], columns[moves], rates[moves], n)
    stays = totals(rows[~moves], rates[~moves], n)
    chain = Chain(generator, int(starts[0]), labels, dict(_rewards(file, n, stays)), variables, counts)
    missing = {name: mask for name, mask in chain.built_in.items() if name not in (*labels, *variables)}
    return replace(chain, labels={**labels, **missing}) if missing else chain


def write_explicit(chain: Chain, path: str | Path) -> None:
    """Write a chain to a `.tra` file, and beside it its labels, variables and rewards.

    Names become identifiers, as PRISM wants them. Before the files take their names they are read back and compared
    with the chain, at the cost of `read_explicit`.
    ValueError: it starts in several states, or is a part of a larger chain, which these files cannot hold; the files
    would say something else

    >>> from tempfile import TemporaryDirectory
    >>> from kinetics import Chain
    >>> from kinetics.markov import read_explicit, write_explicit
    >>> pump = Chain([[0.0, 0.1], [2.0, 0.0]], initial=0, labels={"down": [False, True]})
    >>> with TemporaryDirectory() as folder:
    ...     write_explicit(pump, f"{folder}/pump.tra")
    ...     same = read_explicit(f"{folder}/pump.tra")
    >>> same.transitions.generator().toarray().tolist(), same.labels["down"].tolist()
    ([[-0.1, 0.1], [2.0, -2.0]], [False, True])
    """
    if np.any(chain.truncated):
        raise ValueError("the chain is truncated, which a .tra file cannot express; enumerate all of its states")
    file = Path(path)
    if file.suffix != ".tra":
        raise ValueError(f"{file} must end in .tra")
    start = np.asarray(chain.initial)
    if np.count_nonzero(start) != 1:
        raise ValueError(
            f"the chain starts in {np.count_nonzero(start)} states, and a .tra file starts in one; add a first state "
            f"that leads to them"
        )
    entries = chain.transitions.generator().tocoo()
    order = np.lexsort((entries.col, entries.row))
    off = order[(entries.row != entries.col)[order]]
    lines = zip(entries.row[off].tolist(), entries.col[off].tolist(), entries.data[off].tolist(), strict=True)
    contents = {file: _text([f"{len(chain)} {off.size}", *(f"{i} {j} {rate!r}" for i, j, rate in lines)])}
    own = {name: mask for name, mask in chain.labels.items() if name not in (INIT, DEADLOCK, *chain.variables)}
    variables = prism_names(chain.variables).values()
    spelled = prism_names([*own], variables)
    if chain.counts is not None:
        is_truth = [name in chain.labels for name in chain.variables]
        words = (_words(row, is_truth) for row in np.asarray(chain.counts).tolist())
        rows = ("(" + ",".join(row) + ")" for row in words)
        contents[file.with_suffix(".sta")] = _text(
            [f"({','.join(variables)})", *(f"{i}:{row}" for i, row in enumerate(rows))]
        )
    labels = {**chain.built_in, **{spelled[name]: mask for name, mask in own.items()}}
    holds = np.array([np.asarray(mask) for mask in labels.values()]).T
    marked = ((i, np.flatnonzero(row)) for i, row in enumerate(holds))
    heading = " ".join(f'{k}="{name}"' for k, name in enumerate(labels))
    marks = (f"{i}: " + " ".join(map(str, k)) for i, k in marked if k.size)
    contents[file.with_suffix(".lab")] = _text([heading, *marks])
    contents |= dict(_reward_files(file, chain))
    _check_written(chain, file, contents)
    write_together(contents)


def _check_written(chain: Chain, file: Path, contents: Mapping[Path, str]) -> None:
    """A ValueError if these files, read back, are another chain; names may be spelled otherwise."""
    with scratch_folder({path.name: text for path, text in contents.items()}) as folder:
        try:
            again = read_explicit(folder / file.name)
        except ValueError as error:
            told = str(error).replace(f"{folder}/", "")
            raise ValueError(f"{file} is not written, because it cannot be read back: {told}") from None
    own = [mask for name, mask in chain.labels.items() if name not in (*chain.built_in, *chain.variables)]
    own += [chain.labels[name] for name in chain.variables if name in chain.labels]
    masks = [*chain.built_in.values(), *own]
    wrong = {
        "rates": _differ(chain.transitions.generator(), again.transitions.generator()),
        "start": not np.array_equal(chain.initial, again.initial),
        "variables": not np.array_equal(_counts(chain), _counts(again)),
        "labels": len(masks) != len(again.labels) or not all(map(np.array_equal, masks, again.labels.values())),
        "rewards": len(chain.rewards) != len(again.rewards),
    }
    rewards: Any = zip(chain.rewards.items(), again.rewards.values(), strict=False)
    for (name, reward), other in rewards:
        is_other = not np.array_equal(reward.rates, other.rates) or _differ(reward.impulses, other.impulses)
        wrong[f"reward {name!r}"] = is_other
    if any(wrong.values()):
        what = next(what for what, is_other in wrong.items() if is_other)
        raise ValueError(f"{file} is not written, because it would describe another chain: its {what} would differ")


def _counts(chain: Chain) -> NDArray[Any]:
    return np.empty((len(chain), 0)) if chain.counts is None else np.asarray(chain.counts)


def _differ(one: Any, other: Any) -> bool:
    """True if two sparse tables differ off the diagonal; None is a table without entries."""
    if one is None and other is None:
        return False
    apart = (one if other is None else -other if one is None else one - other).tocoo()
    return bool(np.any(apart.data[apart.row != apart.col]))


def _reward_files(file: Path, chain: Chain) -> Iterator[tuple[Path, str]]:
    """Paths and contents."""
    spelled = prism_names(list(chain.rewards))
    for k, (name, reward) in enumerate(chain.rewards.items(), start=1):
        each: Any = reward
        stem = file.with_name(file.stem + (str(k) if len(chain.rewards) > 1 else ""))
        heading = f'# Reward structure "{spelled[name]}"'
        places = np.flatnonzero(each.rates)
        values = zip(places.tolist(), np.asarray(each.rates)[places].tolist(), strict=True)
        state_lines = [f"{i} {value!r}" for i, value in values]
        yield Path(f"{stem}.srew"), _text([heading, "# State rewards", f"{len(chain)} {places.size}", *state_lines])
        if each.impulses is not None:
            jumps = each.impulses.tocoo()
            rows = zip(jumps.row.tolist(), jumps.col.tolist(), jumps.data.tolist(), strict=True)
            lines = [f"{i} {j} {value!r}" for i, j, value in rows]
            heads = [heading, "# Transition rewards", f"{len(chain)} {len(lines)}"]
            yield Path(f"{stem}.trew"), _text([*heads, *lines])


def _words(row: list[int], is_truth: list[bool]) -> list[str]:
    """The values of variables in a state; of boolean ones as true and false."""
    return [str(bool(value)).lower() if truth else str(value) for value, truth in zip(row, is_truth, strict=True)]


def _text(lines: list[str]) -> str:
    return "\n".join(lines) + "\n"


def _sparse(rows: NDArray[Any], columns: NDArray[Any], values: Floats, n: int) -> Any:

    return sparse.csr_array((values, (rows, columns)), shape=(n, n))


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Numbers and texts of the lines that hold anything."""
    for number, line in enumerate(text_in(path).splitlines(), start=1):
        if line.strip():
            yield number, line.strip()


def _parsed(path: Path, number: int, line: str, what: str, parse: Callable[[str], Parsed]) -> Parsed:
    try:
        return parse(line)
    except (ValueError, IndexError, OverflowError):
        raise ValueError(f"{path}, line {number}: {line[:80]!r}; expected {what}") from None


def _entries(path: Path) -> tuple[int, NDArray[np.int64], NDArray[np.int64], Floats]:
    """Number of states, and rows, columns and values (K,) of a file of transitions or of their rewards."""
    lines = [(number, line) for number, line in _lines(path) if not line.startswith("#")]
    if not lines:
        raise ValueError(f"{path} is empty")
    first, heading = lines[0]
    is_storms = heading.split()[0].lower() in ("ctmc", "@type:")
    if heading.split()[0].lower() in ("dtmc", "mdp", "ma"):
        raise ValueError(f"{path}, line {first}: {heading!r}; only Markov chains in continuous time are read")
    sizes = (0, 0) if is_storms else _parsed(path, first, heading, "numbers of states and transitions", _two)

    rows, columns, values = _table(path, lines[1:])
    n = sizes[0] if not is_storms else int(max(rows.max(initial=-1), columns.max(initial=-1))) + 1
    if not is_storms and rows.size != sizes[1]:
        raise ValueError(f"{path}: {rows.size} lines follow, where its first one says {sizes[1]}; is it cut short?")
    for ends in (rows, columns):
        if n < 1 or ends.min(initial=0) < 0 or ends.max(initial=0) >= n:
            raise ValueError(f"{path}: states go from 0 to {n - 1}; {ends.max(initial=0)} or one below 0 came")
    return n, rows, columns, values


def _table(path: Path, lines: list[tuple[int, str]]) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats]:
    """Two states and a number a line: read at once, or where that fails one by one, to say which line is wrong."""
    kinds = [("row", np.int64), ("column", np.int64), ("value", np.float64)]
    with warnings.catch_warnings(), suppress(ValueError, DeprecationWarning):
        warnings.simplefilter("error", DeprecationWarning)  # of states that are no whole numbers
        texts = [line for _, line in lines]
        table = (
            np.loadtxt(texts, dtype=kinds, comments=None, usecols=(0, 1, 2), ndmin=1) if texts else np.empty(0, kinds)
        )
        return table["row"], table["column"], table["value"]

    def entry(line: str) -> tuple[int, int, float]:
        row, column, value = line.split()[:3]
        if max(abs(int(row)), abs(int(column))) >= 2**63:
            raise ValueError
        return int(row), int(column), float(value)

    found = [_parsed(path, number, line, "two states and a number", entry) for number, line in lines]
    rows, columns = (np.array([each[k] for each in found], dtype=np.int64) for k in (0, 1))
    return rows, columns, np.array([each[2] for each in found], dtype=np.float64)


def _two(line: str) -> tuple[int, int]:
    first, second = line.split()
    return int(first), int(second)


def _variables(path: Path, n: int) -> tuple[tuple[str, ...], NDArray[np.int64] | None, dict[str, NDArray[np.bool_]]]:
    """Names and values of the variables, where there is such a file; and as labels those that are true or false."""
    if not path.is_file():
        return (), None, {}
    (first, heading), *lines = list(_lines(path)) or [(1, "")]
    names = tuple(name.strip() for name in heading.strip("()").split(",") if name.strip())
    words = {"true": 1, "false": 0}
    numbers: set[int] = set()  # of the variables that are no truths

    def row(line: str) -> tuple[int, list[int]]:
        state, _, values = line.partition(":")
        written = values.strip().strip("()").split(",")
        numbers.update(place for place, word in enumerate(written) if word not in words)
        told = [words[word] if word in words else int(word) for word in written]
        if len(told) != len(names) or not 0 <= int(state) < n or any(abs(value) >= 2**63 for value in told):
            raise ValueError
        return int(state), told

    check_names(path, names)
    check_memory(f"{len(names)} variables of {n} states", 8.0 * n * len(names), "give fewer of them")
    counts = np.zeros((n, len(names)), dtype=np.int64)
    seen = np.zeros(n, dtype=bool)
    for number, line in lines:
        state, values = _parsed(path, number, line, f"a state below {n} and {len(names)} whole numbers", row)
        if seen[state]:
            raise ValueError(f"{path}, line {number}: state {state} comes a second time; expected each once")
        counts[state], seen[state] = values, True
    if not names or not seen.all():
        raise ValueError(f"{path}, line {first}: expected the names of variables, then their values in all {n} states")
    booleans = {name: counts[:, place] == 1 for place, name in enumerate(names) if place not in numbers}
    return names, counts, booleans


def _labels(path: Path, n: int) -> dict[str, NDArray[np.bool_]]:
    if not path.is_file():
        return {}
    (_, heading), *lines = list(_lines(path)) or [(1, "")]
    names = {int(k): name for k, name in re.findall(r'(\d+)="([^"]*)"', heading)}
    check_names(path, names.values())
    check_memory(f"{len(names)} labels of {n} states", 1.0 * n * len(names), "give fewer of them")
    masks = {name: np.zeros(n, dtype=bool) for name in names.values()}

    def row(line: str) -> tuple[int, list[str]]:
        state, _, marks = line.partition(":")
        held = [names.get(int(k), "") for k in marks.split()]
        if not 0 <= int(state) < n or "" in held:
            raise ValueError
        return int(state), held

    for number, line in lines:
        state, held = _parsed(path, number, line, f"a state below {n} and numbers of labels of the first line", row)
        for name in held:
            masks[name][state] = True
    return masks


def _rewards(file: Path, n: int, stays: Floats) -> Iterator[tuple[str, Reward]]:
    """Names and rewards beside a `.tra` file. stays : (N,) rates at which states lead to themselves, 1/tu."""
    stems = [file.with_suffix("")]
    if not any(Path(f"{stems[0]}{suffix}").is_file() for suffix in (".srew", ".trew")):
        stems = []
        while any(Path(f"{file.with_suffix('')}{len(stems) + 1}{suffix}").is_file() for suffix in (".srew", ".trew")):
            stems.append(Path(f"{file.with_suffix('')}{len(stems) + 1}"))
    for k, stem in enumerate(stems, start=1):
        by_state, by_jump = Path(f"{stem}.srew"), Path(f"{stem}.trew")
        name, rates, impulses = f"r{k}", np.zeros(n), None
        if by_state.is_file():
            name = _name(by_state) or name
            rates = _state_rewards(by_state, n)
        if by_jump.is_file():
            name = _name(by_jump) or name
            size, rows, columns, values = _entries(by_jump)
            if size != n:
                raise ValueError(f"{by_jump} is of {size} states; expected {n}")
            own = rows == columns
            np.add.at(rates, rows[own], values[own] * stays[rows[own]])
            impulses = _sparse(rows[~own], columns[~own], values[~own], n)
        yield name, Reward(rates, impulses)


def _name(path: Path) -> str | None:
    found = REWARD_NAME.search(text_in(path)[:1000])
    check_names(path, [found[1]] if found else [])
    return found[1] if found else None


def _state_rewards(path: Path, n: int) -> Floats:
    lines = [(number, line) for number, line in _lines(path) if not line.startswith("#")]
    if not lines:
        raise ValueError(f"{path} is empty")
    size, count = _parsed(path, *lines[0], "numbers of states and rewards", _two)
    if size != n or count != len(lines) - 1:
        raise ValueError(f"{path}: {size} states and {count} rewards; expected {n}, and {len(lines) - 1} lines follow")

    def row(line: str) -> tuple[int, float]:
        state, value = line.split()
        if not 0 <= int(state) < n:
            raise ValueError
        return int(state), float(value)

    rates, seen = np.zeros(n), np.zeros(n, dtype=bool)
    for number, line in lines[1:]:
        state, value = _parsed(path, number, line, f"a state below {n} and a number", row)
        if seen[state]:
            raise ValueError(f"{path}, line {number}: state {state} comes a second time; expected each once")
        seen[state] = True
        rates[state] = value
    return rates
