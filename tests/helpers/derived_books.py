"""Networks of shipped books, each derived once for all tests of a process: the pyramid's takes seconds."""

from functools import cache

from kinetics.assembly import RuleBook
from kinetics.assembly.deriving.derive import named
from kinetics.assembly.deriving.explore import explore


@cache
def explored(name):
    """All structures of a shipped book and the events between them."""
    found = explore(RuleBook.load(name))
    assert found.is_closed
    return found


@cache
def derived(name):
    """The network of a shipped book."""
    return named(explored(name))
