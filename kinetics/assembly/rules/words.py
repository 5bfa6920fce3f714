"""Rules in a few words, as the key of a state diagram shows them."""

from __future__ import annotations

from collections.abc import Sequence

from kinetics.assembly.rules.conditions import Combination, Dissociation, Rule, Semantics


def rule_words(rule: Rule) -> str:
    """What a rule asks and does, in short: `a.f1 + a/b.f1, alone → b`."""
    letter = _either(rule.letter)
    asks = []
    if isinstance(rule, Combination):
        asks.append(f"{letter}{_face(rule.face)} + {_either(rule.partner)}{_face(rule.partner_face)}")
        asks += [f"{name} {_either(value)}" for name, value in (("roll", rule.roll),) if value]
        asks += [f"{_either(rule.across)} across"] if rule.across is not None else []
        asks += [f"touching {' '.join(rule.touched)}"] if rule.touched is not None else []
    elif isinstance(rule, Dissociation):
        asks.append(f"{letter} − {_either(rule.lost)}")
    else:
        asks.append(letter)
    if rule.neighbours is not None:
        asks.append(f"beside {' '.join(rule.neighbours)}" if rule.neighbours else "alone")
    if rule.has is not None:
        asks.append(f"beside at least {' '.join(rule.has)}")
    return f"{', '.join(asks)} → {rule.becomes}"


def _either(admitted: Sequence[str] | None) -> str:
    return "any" if admitted is None else "/".join(one or "none" for one in admitted)


def _face(admitted: Sequence[str] | None) -> str:
    return "" if admitted is None else f".{'/'.join(admitted)}"


def semantics_words(semantics: Semantics) -> list[str]:
    """What a book settles other than usual, a line each."""
    notes = ["gate: one rule for a bond is enough"] if semantics.gate == "any" else []
    notes += ["bonds hold for ever"] if semantics.bonds == "hold" else []
    return notes + [f"{end.letter} beside {end.neighbour} accepts no more" for end in semantics.finished]
