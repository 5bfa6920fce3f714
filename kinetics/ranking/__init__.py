"""Correct rule books of one target compared by yield and time to the first copy."""

from kinetics.ranking.ranking import Ranking, rank

__all__ = ["Ranking", "rank"]
