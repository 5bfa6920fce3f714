"""Effects declare which kinds of event they make happen, and nothing else knows them by name."""

from typing import ClassVar

import numpy as np
import pytest
from msgspec.structs import replace  # not checked: no scene may list what is not registered

from kinetics.assembly import RuleBook, derive
from mechsim.effects import EFFECTS
from mechsim.effects.base import Action, Effect, EventKind
from mechsim.runs.record import RunSpec, kinds, open_channels


class Glue(Effect, tag="glue"):
    """An effect that nobody has heard of."""

    opens: ClassVar[tuple[EventKind, ...]] = ("join",)

    def attach(self, world):
        return Action()


class Sunlight(Glue, tag="sunlight"):
    opens: ClassVar[tuple[EventKind, ...]] = ("break",)


def with_effects(scene, *effects):
    return replace(scene, effects=(*scene.effects, *effects))


def test_each_kind_of_event_is_some_effects_doing():
    assert {kind for effect in EFFECTS for kind in effect.opens} == {"join", "break"}


def test_open_channels_are_those_of_the_listed_effects(line4, derivation):
    joins = np.array([kind == "join" for kind in kinds(derivation)])
    np.testing.assert_array_equal(joins, derivation.network.stoichiometry.sum(axis=1) < 0)
    bare = line4.without("bonding", "breaking")
    for scene, expected in (
        (line4, joins | ~joins),
        (bare, joins & ~joins),
        (line4.without("bonding"), ~joins),
        (with_effects(bare, Glue()), joins),
        (with_effects(bare, Sunlight()), ~joins),
        (with_effects(bare, Glue(), Sunlight()), joins | ~joins),
    ):
        np.testing.assert_array_equal(open_channels(scene, derivation), expected)


def test_bonds_that_hold_refuse_whatever_breaks_them(line4):
    holding = line4.without("breaking").replace(rules="pyramid45")
    RunSpec(holding, {"monomer": 9, "seed": 1}, 1.0, seed=1, run=0)
    with pytest.raises(ValueError, match="lists the effect 'sunlight', but bonds of book pyramid45 hold"):
        RunSpec(with_effects(holding, Sunlight()), {"monomer": 9, "seed": 1}, 1.0, seed=1, run=0)


def test_breaking_without_bonds_is_refused(line4):
    """Where neither the start holds bonds nor an effect makes them."""
    only_breaks = line4.without("bonding")
    RunSpec(only_breaks, {"monomer": 8, "dimer": 1}, 1.0, seed=1, run=0)
    RunSpec(with_effects(only_breaks, Glue()), {"monomer": 8}, 1.0, seed=1, run=0)
    with pytest.raises(ValueError, match="lists the effect 'breaking', but there are no bonds to break"):
        RunSpec(only_breaks, {"monomer": 8}, 1.0, seed=1, run=0)


def test_channels_are_joins_or_breaks_in_every_book():
    for name in ("line4", "t5"):
        found = derive(RuleBook.load(name))
        changes = found.network.stoichiometry.sum(axis=1)
        assert [kind == "join" for kind in kinds(found)] == (changes < 0).tolist()
