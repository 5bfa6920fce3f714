"""Ranking of correct rule books of one target by yield and first-assembly time."""

from kinetics.predicting.ranking.ranking import Ranking, rank

__all__ = ["Ranking", "rank"]
