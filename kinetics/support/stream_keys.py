"""Words and seeds that key random streams by text."""

from __future__ import annotations

import hashlib


def words_of(text: str) -> tuple[int, ...]:
    """The SHA-256 of a text as eight 32-bit words, for the `spawn_key` of a numpy SeedSequence.

    A SeedSequence mixes all words of its key into 128 bits: two keys give the same stream only where these agree, by
    chance one pair in 3e38.
    """
    digest = hashlib.sha256(text.encode()).digest()
    return tuple(int.from_bytes(digest[k : k + 4], "little") for k in range(0, len(digest), 4))


def seed_of(text: str) -> int:
    """A seed of 63 bits, from the same SHA-256: two texts share theirs by chance once in 9e18 pairs."""
    low, high, *_ = words_of(text)
    return (high << 32 | low) & (2**63 - 1)
