"""Derivation: from a rule book to all structures, all reactions, and the reaction network."""
