"""Rate constants with their intervals, by channel and by rate class."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.rates.class_keys import (  # at once: a module and a function have one name
    are_by_class,
    class_keys,
    more_general,
)
from kinetics.support.lazy_names import lazy_names

if TYPE_CHECKING:
    from kinetics.rates.break_terms import BreakTerms, ShapePosterior
    from kinetics.rates.by_class import BookRates, ClassRates
    from kinetics.rates.class_entries import ClassRate, general_entries, measured_class, with_prior
    from kinetics.rates.posterior import RatesPosterior
    from kinetics.rates.rates import ChannelRate, Convention, Rates, about_priors

_HOMES = {
    "kinetics.rates.break_terms": ("BreakTerms", "ShapePosterior"),
    "kinetics.rates.by_class": ("BookRates", "ClassRates"),
    "kinetics.rates.class_entries": ("ClassRate", "general_entries", "measured_class", "with_prior"),
    "kinetics.rates.posterior": ("RatesPosterior",),
    "kinetics.rates.rates": ("ChannelRate", "Convention", "Rates", "about_priors"),
}

__all__ = [
    "BookRates",
    "BreakTerms",
    "ChannelRate",
    "ClassRate",
    "ClassRates",
    "Convention",
    "Rates",
    "RatesPosterior",
    "ShapePosterior",
    "about_priors",
    "are_by_class",
    "class_keys",
    "general_entries",
    "measured_class",
    "more_general",
    "with_prior",
]

__getattr__, __dir__ = lazy_names(__name__, __all__, _HOMES)
