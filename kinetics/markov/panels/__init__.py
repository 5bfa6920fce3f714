"""The exact likelihood of data: counts seen at some times, or every event with its time."""

from __future__ import annotations

from kinetics.markov.panels.base import Likelihood, Scored
from kinetics.markov.panels.data import PanelData, PanelRun
from kinetics.markov.panels.event_data import EventData, EventLikelihood, log_probability
from kinetics.markov.panels.joint import JointLikelihood
from kinetics.markov.panels.likelihood import PanelLikelihood, log_likelihood

__all__ = [
    "EventData",
    "EventLikelihood",
    "JointLikelihood",
    "Likelihood",
    "PanelData",
    "PanelLikelihood",
    "PanelRun",
    "Scored",
    "log_likelihood",
    "log_probability",
]
