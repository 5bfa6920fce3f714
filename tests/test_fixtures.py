"""A fixture means the same to every test, whichever test asked for it first."""

import ast
from collections import defaultdict
from pathlib import Path

HERE = Path(__file__).parent


def fixtures(source):
    """(name, whether it outlives a test, what it asks for) of each fixture in a file's text."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef):
            for decorator in map(ast.unparse, node.decorator_list):
                if decorator.startswith("pytest.fixture"):
                    yield node.name, "scope=" in decorator, [argument.arg for argument in node.args.args]


def stale(sources):
    """Fixtures that outlive a test though a file or folder below gives what they ask for another meaning.

    pytest keeps the first value for all: such a fixture would be made of whatever the first test of a process means.
    """
    found, made_in = [], defaultdict(set)
    for path, source in sources.items():
        for name, lasts, asked in fixtures(source):
            made_in[name].add(path)
            found += [(path, name, argument) for argument in asked if lasts]
    return [
        f"{path}: {name} asks for {argument}, which {other} makes anew"
        for path, name, argument in found
        for other in sorted(made_in[argument] - {path})
        if path.name == "conftest.py" and path.parent in other.parents
    ]


def test_no_fixture_outlives_a_test_that_gives_its_parts_another_meaning():
    sources = {path: path.read_text(encoding="utf-8") for path in HERE.rglob("*.py")}
    assert not stale(sources)


def test_such_a_fixture_would_be_seen():
    above = '@pytest.fixture(scope="session")\ndef tank(engine): ...\n'
    below = "@pytest.fixture\ndef engine(): ...\n"
    assert stale({Path("tests/conftest.py"): above, Path("tests/world/test_it.py"): below})
    assert not stale(
        {Path("tests/conftest.py"): above.replace('(scope="session")', ""), Path("tests/world/t.py"): below}
    )
