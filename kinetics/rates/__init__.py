"""Rate constants with their intervals, by channel and by rate class."""

from kinetics.rates.by_class import ClassRates
from kinetics.rates.rates import ChannelRate, Convention, Rates

__all__ = ["ChannelRate", "ClassRates", "Convention", "Rates"]
