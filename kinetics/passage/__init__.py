"""First passage, committors, stationary distributions and rare events."""

from kinetics.passage.committor import Splitting, splitting
from kinetics.passage.first_passage import Passage, first_passage
from kinetics.passage.rare_events import RareEvent, rare_event
from kinetics.passage.stationary import Stationary, stationary

__all__ = ["Passage", "RareEvent", "Splitting", "Stationary", "first_passage", "rare_event", "splitting", "stationary"]
