"""First passage, until, committors, stationary distributions and rare events, of networks and of any chain."""

from kinetics.markov.passage.committor import Committor, committor
from kinetics.markov.passage.first_passage import Passage, first_passage
from kinetics.markov.passage.rare_events import RareEvent, rare_event
from kinetics.markov.passage.stationary import Stationary, stationary

__all__ = ["Committor", "Passage", "RareEvent", "Stationary", "committor", "first_passage", "rare_event", "stationary"]
