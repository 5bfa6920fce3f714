"""Panel data: counts seen at some times, with nothing known of what happened in between; their exact likelihood."""

from __future__ import annotations

from kinetics.markov.panels.data import PanelData, PanelRun
from kinetics.markov.panels.likelihood import PanelLikelihood, log_likelihood

__all__ = ["PanelData", "PanelLikelihood", "PanelRun", "log_likelihood"]
