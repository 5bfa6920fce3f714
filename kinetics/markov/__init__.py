"""Markov chains in continuous time, from anywhere, and questions to them: each answer with its bounds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.support.lazy_names import lazy_names

if TYPE_CHECKING:
    from kinetics.markov.answers import ChainDistribution, ChainPath
    from kinetics.markov.chain import Chain
    from kinetics.markov.checks import Reward
    from kinetics.markov.explicit_files import read_explicit, write_explicit
    from kinetics.markov.prism_model import prism_text
    from kinetics.markov.queries import ask
    from kinetics.markov.sensitivity import Sensitivity, passage_sensitivity, sensitivity_to

_HOMES = {
    "kinetics.markov.answers": ("ChainDistribution", "ChainPath"),
    "kinetics.markov.chain": ("Chain",),
    "kinetics.markov.checks": ("Reward",),
    "kinetics.markov.explicit_files": ("read_explicit", "write_explicit"),
    "kinetics.markov.prism_model": ("prism_text",),
    "kinetics.markov.queries": ("ask",),
    "kinetics.markov.sensitivity": ("Sensitivity", "passage_sensitivity", "sensitivity_to"),
}

__all__ = [
    "Chain",
    "ChainDistribution",
    "ChainPath",
    "Reward",
    "Sensitivity",
    "ask",
    "passage_sensitivity",
    "prism_text",
    "read_explicit",
    "sensitivity_to",
    "write_explicit",
]

__getattr__, __dir__ = lazy_names(__name__, __all__, _HOMES)
