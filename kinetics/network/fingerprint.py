"""The fingerprint of a network: a SHA-256 that ties rates to the network for which they were measured."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from kinetics.network.sparse_tables import SparseTable

if TYPE_CHECKING:
    from kinetics.network.laws.events import Event
    from kinetics.network.laws.expression import Expression

MAX_DENSE = 10**6  # entries of a table that is read in full; of a larger one, those other than 0


def fingerprint(
    species: Sequence[str],
    channels: Sequence[str],
    tables: Iterable[SparseTable],
    laws: Mapping[str, Expression],
    events: Sequence[Event],
    at_zero: str,
) -> str:
    """SHA-256 of a network without its rates; laws, events and `at_zero` count only if there are any."""
    is_small = len(channels) * len(species) <= MAX_DENSE
    entries = [table.dense().tolist() if is_small else [table.keys.tolist(), table.copies.tolist()] for table in tables]
    content: list[Any] = [species, channels, *entries]
    if laws or events:
        texts = [[name, law.text, sorted(law.parameters.items())] for name, law in laws.items()]
        content += [texts, [repr(event) for event in events], at_zero]
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()
