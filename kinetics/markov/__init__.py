"""Markov chains in continuous time, from anywhere, and questions to them: each answer with its bounds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.support.lazy_names import lazy_names

if TYPE_CHECKING:
    from kinetics.markov.chain import Chain
    from kinetics.markov.chain_distribution import ChainDistribution
    from kinetics.markov.checks import Reward
    from kinetics.markov.explicit_files import read_explicit, write_explicit
    from kinetics.markov.network_questions import committor, first_passage, stationary
    from kinetics.markov.paths import ChainPath, chain_path, chain_path_to
    from kinetics.markov.prism_model import prism_text
    from kinetics.markov.questions import ask
    from kinetics.markov.sensitivity import Sensitivity, sensitivity_to

_HOMES = {
    "kinetics.markov.chain": ("Chain",),
    "kinetics.markov.chain_distribution": ("ChainDistribution",),
    "kinetics.markov.checks": ("Reward",),
    "kinetics.markov.explicit_files": ("read_explicit", "write_explicit"),
    "kinetics.markov.network_questions": ("committor", "first_passage", "stationary"),
    "kinetics.markov.paths": ("ChainPath", "chain_path", "chain_path_to"),
    "kinetics.markov.prism_model": ("prism_text",),
    "kinetics.markov.questions": ("ask",),
    "kinetics.markov.sensitivity": ("Sensitivity", "sensitivity_to"),
}

__all__ = [
    "Chain",
    "ChainDistribution",
    "ChainPath",
    "Reward",
    "Sensitivity",
    "ask",
    "chain_path",
    "chain_path_to",
    "committor",
    "first_passage",
    "prism_text",
    "read_explicit",
    "sensitivity_to",
    "stationary",
    "write_explicit",
]

__getattr__, __dir__ = lazy_names(__name__, __all__, _HOMES)
