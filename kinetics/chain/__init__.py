"""Markov chains in continuous time, from anywhere, and questions to them: each answer with its limits."""

from kinetics.chain.answers import ChainAnswer, ChainDistribution, ChainPath
from kinetics.chain.chain import Chain
from kinetics.chain.checks import Reward
from kinetics.chain.explicit_files import read_explicit, write_explicit
from kinetics.chain.prism_model import prism_text
from kinetics.chain.queries import ask
from kinetics.chain.sensitivity import Sensitivity, passage_sensitivity, sensitivity_to

__all__ = [
    "Chain",
    "ChainAnswer",
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
