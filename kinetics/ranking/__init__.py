"""Ranking of correct rule books of one target by yield and first-assembly time."""

from kinetics.ranking.ranking import Ranking, rank

__all__ = ["Ranking", "rank"]
