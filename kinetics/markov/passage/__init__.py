"""First passage, until, committors, stationary distributions and rare events, of networks and of any chain."""

from kinetics.markov.passage.committor import Committor
from kinetics.markov.passage.first_passage import Passage
from kinetics.markov.passage.rare_events import RareEvent, rare_event
from kinetics.markov.passage.stationary import Stationary

__all__ = ["Committor", "Passage", "RareEvent", "Stationary", "rare_event"]
