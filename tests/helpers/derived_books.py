"""Networks of shipped books, each derived once for all tests of a process: the pyramid's takes seconds."""

from functools import cache

from kinetics.assembly import RuleBook, derive


@cache
def derived(name):
    """The network of a shipped book."""
    return derive(RuleBook.load(name))
