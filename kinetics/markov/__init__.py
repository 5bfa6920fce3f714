"""Markov chains in continuous time, from anywhere, and questions to them: each answer with its bounds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.support.lazy_names import lazy_names

if TYPE_CHECKING:
    from kinetics.markov.chain import Chain as Chain
    from kinetics.markov.chain_distribution import ChainDistribution as ChainDistribution
    from kinetics.markov.checks import Reward as Reward
    from kinetics.markov.explicit_files import read_explicit as read_explicit
    from kinetics.markov.explicit_files import write_explicit as write_explicit
    from kinetics.markov.matrix_free_questions import reached_by as reached_by
    from kinetics.markov.network_questions import committor as committor
    from kinetics.markov.network_questions import first_passage as first_passage
    from kinetics.markov.network_questions import stationary as stationary
    from kinetics.markov.paths import ChainPath as ChainPath
    from kinetics.markov.paths import chain_path as chain_path
    from kinetics.markov.paths import chain_path_to as chain_path_to
    from kinetics.markov.prism.reading import read_prism as read_prism
    from kinetics.markov.prism.writing import prism_text as prism_text
    from kinetics.markov.questions import ask as ask
    from kinetics.markov.sensitivity import Sensitivity as Sensitivity
    from kinetics.markov.sensitivity import sensitivity_to as sensitivity_to

__getattr__, __dir__ = lazy_names(__name__)
