"""The values in a text of reactions: parameters, counts at time 0, rate constants and laws."""

from __future__ import annotations

import re
from collections.abc import Mapping

from kinetics.network.laws.expression import Expression
from kinetics.network.laws.reading import NUMBER
from kinetics.network.parameters import Parameters, number_of
from kinetics.network.source_spans import SourceSpan
from kinetics.network.text_formulas import TextFormulas

COUNT = re.compile("[0-9]{1,19}")


def read_parameters(formulas: TextFormulas, chosen: Mapping[str, float]) -> Parameters:
    """The parameters and counts that a text gives, which its other formulas may read from then on.

    chosen : values that go before those of the text
    ValueError, with line and column, for one that is no number, or a count below 0
    """
    for name in chosen:
        if name in formulas.species:
            raise ValueError(f"{name!r} is a species; its count at time 0 is written as a line, '{name} = 100'")
    values = {name: number_of(f"parameter {name!r}", value, {}) for name, value in chosen.items()}
    given: dict[str, float | Expression] = {n: v for n, v in chosen.items() if n not in formulas.written}
    formulas.values.update({name: values[name] for name in given})
    for name, span in formulas.written.items():
        if name not in formulas.species:
            formula = _parameter(formulas, name, span)
            value = formulas.number(span, f"parameter {name!r}", values.get(name, formula))
            formulas.values[name] = value
            is_formula = isinstance(formula, Expression) and formula.parameters and name not in values
            given[name] = formula if is_formula else value
    initial: dict[str, int | Expression] = {}
    for name, span in formulas.written.items():
        if name in formulas.species:
            is_plain = COUNT.fullmatch(span.text)
            initial[name] = int(span.text) if is_plain else formulas.counted(span, only_parameters=True)
            if formulas.number(span, f"the count of {name!r}", initial[name]) < 0:
                raise span.wrong(f"{span.text} copies of {name!r}; expected at least 0")
    return Parameters(given, {}, initial)


def _parameter(formulas: TextFormulas, name: str, span: SourceSpan) -> float | Expression:
    """A parameter's formula, or its number in the unit that stands behind it."""
    quantity = formulas.quantity(span)
    if quantity is not None:
        formulas.factors[name] = span.located(lambda: formulas.measures.factor(quantity))
        formulas.kinds[name] = quantity.unit.kind
        return quantity.value
    formula, kind = formulas.measured(span, only_parameters=True)
    if kind is not None:
        formulas.kinds[name] = kind
    return formula


def read_rate(
    formulas: TextFormulas, span: SourceSpan, reactants: Mapping[str, int], combinations: str
) -> float | Expression:
    """The rate constant of mass action, or the law, which reads counts or the time, of a reaction.

    ValueError, with line and column, for a constant below 0 or one whose unit does not fit the reactants
    """
    if re.fullmatch(NUMBER, span.text):
        return formulas.number(span, "the rate", float(span.text))
    rate, kind = formulas.measured(span)
    if is_law(rate):
        return rate
    if kind is not None:
        rate = formulas.per_combination(span, rate, kind, reactants, combinations)
    value = formulas.number(span, "the rate", rate)
    if value < 0:
        raise span.wrong(f"the rate is {value:g}; expected at least 0")
    return rate if kind is None or rate.parameters else value


def is_law(rate: float | Expression) -> bool:
    """Whether a rate is a whole propensity: all names in it that are no parameters are species."""
    return isinstance(rate, Expression) and (rate.reads_time or bool(rate.species))
