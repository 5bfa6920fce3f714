"""Random inputs of every grammar that is read from outside are read or refused, whatever they ask for."""

from pathlib import Path

import pytest

from tests.helpers.fuzzing import campaign
from tests.helpers.limited import outcomes

for library in ("libsbml", "pyarrow"):
    pytest.importorskip(library)
SEED = 0
CORPUS = Path(__file__).parent / "corpus"  # inputs that once did harm
KINDS = (".law", ".condition", ".query", ".net", ".xml", ".tra", ".run", ".parquet")


def check(seed, first, last):
    counts, failures = campaign(seed, first, last)
    assert failures == []
    assert sum(counts.values()) == last - first
    for kind in KINDS:  # the power: a share of both, or the generator asks nothing
        total = counts[kind, "read"] + counts[kind, "refused"]
        assert min(counts[kind, "read"], counts[kind, "refused"]) > total / 16, (kind, counts)


def test_what_once_did_harm():
    found = outcomes(CORPUS)
    assert len(found) >= 6
    assert {outcome for outcome, *_ in found.values()} == {"read", "refused"}, found


def test_500_inputs():
    check(SEED, 0, 500)


def test_300_texts_of_reactions():
    """Texts of their own, beside the other grammars: each is read, or refused with its line."""
    counts, failures = campaign(SEED, 0, 300, "ReactionTexts")
    assert failures == []
    assert sum(counts.values()) == 300
    assert min(counts[".rxn", "read"], counts[".rxn", "refused"]) > 300 / 16, counts


@pytest.mark.validate
def test_100000_inputs():
    check(SEED + 1, 0, 100_000)


def test_the_campaign_sees_what_is_harmful():
    """The control: memory, time and an error that is no refusal, each told with its number."""
    counts, failures = campaign(SEED, 0, 10, "Harmful")
    assert [number for number, *_ in failures] == [3, 5, 7]
    assert [outcome for *_, outcome, _ in failures] == ["MemoryError", "exit -26", "RecursionError"]
    assert counts[".law", "read"] == 7
