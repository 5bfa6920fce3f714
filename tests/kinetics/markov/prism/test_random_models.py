"""Random models of several modules, against an interpreter of their parts that knows nothing of the language.

A model is made as plain data, written as text for the reader, and followed state by state with dictionaries.
"""

import itertools
import random

import numpy as np
import pytest

from kinetics.markov import read_prism

COMPARED = {"<": lambda a, b: a < b, ">=": lambda a, b: a >= b, "=": lambda a, b: a == b, "!=": lambda a, b: a != b}


def random_model(seed):
    """Variables (module, name, top), and commands (module, action, guards, updates) as plain data."""
    rng = random.Random(seed)
    variables = [
        (m, f"v{m}_{k}", rng.randint(1, 3)) for m in range(rng.randint(1, 3)) for k in range(rng.randint(1, 2))
    ]
    tops = {name: top for _, name, top in variables}
    commands = []
    for module in sorted({module for module, _, _ in variables}):
        own = [name for m, name, _ in variables if m == module]
        for _ in range(rng.randint(2, 4)):
            guards = [
                (name, rng.choice(list(COMPARED)), rng.randint(0, tops[name]))
                for name in rng.sample(sorted(tops), rng.randint(0, 1))
            ]
            updates = []
            for _ in range(rng.randint(1, 2)):
                changed = rng.sample(own, rng.randint(0, len(own)))
                values = {name: (rng.choice([name, *sorted(tops)]), rng.randint(1, 3)) for name in changed}
                updates.append((rng.choice([0.5, 1.25, 3.0]), rng.choice([None, *sorted(tops)]), values))
            commands.append((module, rng.choice(["", "", "a", "b"]), guards, updates))
    return variables, commands


def text_of(variables, commands):
    """The model as text. A new value is (source + shift) mod (top + 1), a rate is a number, or number * (1 + name)."""
    tops = {name: top for _, name, top in variables}
    lines = ["ctmc"]
    for module in sorted({module for module, _, _ in variables}):
        lines.append(f"module m{module}")
        lines += [f"  {name} : [0..{top}];" for m, name, top in variables if m == module]
        for m, action, guards, updates in commands:
            if m == module:
                guard = " & ".join(f"{name} {sign} {number}" for name, sign, number in guards) or "true"
                branches = []
                for rate, factor, values in updates:
                    changes = " & ".join(
                        f"({name}' = mod({source} + {shift}, {tops[name] + 1}))"
                        for name, (source, shift) in values.items()
                    )
                    branches.append(f"{rate}{f' * (1 + {factor})' if factor else ''} : {changes or 'true'}")
                lines.append(f"  [{action}] {guard} -> {' + '.join(branches)};")
        lines.append("endmodule")
    return "\n".join(lines)


def followed(variables, commands):
    """Rates between states, as tuples of values, of all states that are reached."""
    names = [name for _, name, _ in variables]
    tops = {name: top for _, name, top in variables}
    start = tuple(0 for _ in names)
    found, waiting = {start: {}}, [start]
    while waiting:
        state = waiting.pop()
        here = dict(zip(names, state, strict=True))
        enabled = [c for c in commands if all(COMPARED[sign](here[name], number) for name, sign, number in c[2])]
        ways = [(command,) for command in enabled if not command[1]]
        for action in ("a", "b"):
            modules = sorted({c[0] for c in commands if c[1] == action})
            parts = [[c for c in enabled if c[0] == module and c[1] == action] for module in modules]
            if modules:
                ways += list(itertools.product(*parts))
        for way in ways:
            for branches in itertools.product(*(command[3] for command in way)):
                rate, end = 1.0, dict(here)
                for number, factor, values in branches:
                    rate *= number * (1 + here[factor] if factor else 1)
                    for name, (source, shift) in values.items():
                        end[name] = (here[source] + shift) % (tops[name] + 1)
                target = tuple(end[name] for name in names)
                if target not in found:
                    found[target] = {}
                    waiting.append(target)
                if target != state:
                    found[state][target] = found[state].get(target, 0.0) + rate
    return found


@pytest.mark.parametrize("seed", range(40))
def test_the_reader_and_the_interpreter_agree(seed, tmp_path):
    variables, commands = random_model(seed)
    file = tmp_path / "random.sm"
    file.write_text(text_of(variables, commands), encoding="utf-8")
    chain, expected = read_prism(file), followed(variables, commands)
    states = [tuple(row) for row in np.asarray(chain.counts).tolist()]
    assert set(states) == set(expected)
    assert len(states) == len(expected)
    entries = chain.transitions.generator().tocoo()
    rates = {}
    for i, j, rate in zip(entries.row.tolist(), entries.col.tolist(), entries.data.tolist(), strict=True):
        if i != j:
            rates.setdefault(states[i], {})[states[j]] = rate
    for state, ends in expected.items():
        assert rates.get(state, {}) == pytest.approx(ends, rel=1e-14)


def test_the_models_are_not_all_alike():
    """The control: many have shared actions that happen, and more than a few states."""
    models = [random_model(seed) for seed in range(40)]
    sizes = [len(followed(*model)) for model in models]
    assert sum(size > 5 for size in sizes) > 20
    shared = [{c[0] for c in commands if c[1] == "a"} for _, commands in models]
    assert sum(len(modules) > 1 for modules in shared) > 5
