"""Books whose figures tests of rankings know."""

from dataclasses import replace
from typing import NamedTuple

from kinetics import Model
from kinetics.assembly import RuleBook, Structure, derive
from kinetics.rates import ClassRates, Rates

LINE4, PAIRS = RuleBook.load("line4"), RuleBook.load("line4_pairs")
T5, T5_BAR, T5_ALL = (RuleBook.load(name) for name in ("t5", "t5_bar", "t5_all"))


def without(book, name, *rules):
    """A book without these rules, under another name."""
    return replace(book, name=name, combine=tuple(rule for rule in book.combine if rule.rule not in rules))


NO_TRIMERS = without(LINE4, "line4_no12", "P3")
NO_PAIRS = without(LINE4, "line4_no22", "P2")
DIMER = replace(without(PAIRS, "dimer", "P2"), target=Structure(((0, 0, 0), (0, 0, 1)), (0, 0), ("b", "b")))
TABLE3 = ClassRates.of_rates(derive(LINE4), Rates.load("table3_geometric"))


class Asked(NamedTuple):
    """The first arguments of `yield_and_first_time`."""

    model: Model
    target: str
    possible: int
    horizon: float


def question(book, rates, cubes, horizon):
    """What is asked of so many free cubes."""
    derivation = derive(book)
    monomer, target = (
        derivation.network.species[derivation.species_of(each)] for each in (book.monomer(), book.target)
    )
    return Asked(Model.of(rates.apply(derivation), {monomer: cubes}), target, cubes // len(book.target), horizon)
