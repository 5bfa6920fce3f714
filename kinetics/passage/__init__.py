"""First passage, until, committors, stationary distributions and rare events, of networks and of any chain."""

from kinetics.passage.committor import Committor, committor
from kinetics.passage.first_passage import Passage, first_passage
from kinetics.passage.rare_events import RareEvent, rare_event
from kinetics.passage.stationary import Stationary, stationary

__all__ = ["Committor", "Passage", "RareEvent", "Stationary", "committor", "first_passage", "rare_event", "stationary"]
