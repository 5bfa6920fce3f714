"""Rate constants with their intervals, by channel and by rate class."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.rates.class_keys import are_by_class as are_by_class
from kinetics.rates.class_keys import are_fitted as are_fitted
from kinetics.rates.class_keys import class_keys as class_keys  # at once: a module and a function have one name
from kinetics.rates.class_keys import more_general as more_general
from kinetics.support.lazy_names import lazy_names

if TYPE_CHECKING:
    from kinetics.rates.break_terms import BreakTerms as BreakTerms
    from kinetics.rates.break_terms import ShapePosterior as ShapePosterior
    from kinetics.rates.by_class import BookRates as BookRates
    from kinetics.rates.by_class import ClassRates as ClassRates
    from kinetics.rates.class_entries import ClassRate as ClassRate
    from kinetics.rates.class_entries import general_entries as general_entries
    from kinetics.rates.class_entries import measured_class as measured_class
    from kinetics.rates.class_entries import with_prior as with_prior
    from kinetics.rates.crowding_terms import CrowdingTerms as CrowdingTerms
    from kinetics.rates.fitted import FittedParameters as FittedParameters
    from kinetics.rates.fitted import PosteriorDraws as PosteriorDraws
    from kinetics.rates.posterior import RatesPosterior as RatesPosterior
    from kinetics.rates.rates import ChannelRate as ChannelRate
    from kinetics.rates.rates import Convention as Convention
    from kinetics.rates.rates import Rates as Rates
    from kinetics.rates.rates import about_priors as about_priors

__getattr__, __dir__ = lazy_names(__name__)
