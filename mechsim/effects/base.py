"""Base classes of effects: the settings that a scene lists, and their hooks in a running world."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar, Literal

import numpy as np

from kinetics.support.settings import Settings
from mechsim.effects.view import ViewOfScene, ViewOfWorld

EventKind = Literal["join", "break"]


class Stopped(Exception):  # noqa: N818 - a named outcome, not a fault of the program
    """The run was ended because its state can no longer be trusted; the text is the named reason."""


class Action:
    """An effect at work in one world; override only the hooks it needs. Hooks not overridden are never called."""

    def before_step(self) -> None:
        """Act on velocities before the engine moves the bodies."""

    def after_step(self) -> None:
        """Look at what the step did: contacts, new poses."""


class FlowSource(Action):
    """An effect that makes the fluid flow. Its `before_step` writes `flow`, which no other effect touches.

    flow (C, P, 3) : velocity that it adds at every drag point of every cube, world frame, length / tu; zeros before
        the first step. The world sums the flows of all sources into its field: sources superpose
    """

    flow: np.ndarray


class Effect(Settings, tag_field="effect"):
    """One physical influence, as a scene describes it. If a scene does not list it, its physics is absent.

    A new effect is one file, named as the effect is, with a subclass whose `tag` is that name, and one line in
    `mechsim/effects/__init__.py`, its import. tests/contracts/test_effects.py then tests what every effect must do, at
    the settings of `example`.
    """

    provides: ClassVar[str | None] = None  # what several effects are ways of, of which a scene takes one; None: itself
    needs: ClassVar[tuple[str, ...]] = ()  # what it cannot act without: names of effects, or of what they provide
    opens: ClassVar[tuple[EventKind, ...]] = ()  # kinds of event that it makes happen
    example: ClassVar[dict[str, Any]] = {}  # settings without a default, as a scene may give them

    @property
    def effect(self) -> str:
        """Its name."""
        return self.name()

    @classmethod
    def name(cls) -> str:
        """Its name, as a scene lists it."""
        return str(cls.__struct_config__.tag)

    @property
    def held_for(self) -> float | None:
        """Time for which a velocity of the fluid that it has drawn stays, tu; None: it holds nothing."""
        return None

    def check(self, scene: ViewOfScene) -> None:
        """Raise a ValueError if the effect does not fit the rest of the scene."""
        for need in self.needs:
            if scene.provider(need) is None:
                raise ValueError(f"effect {self.effect!r} needs effect {need!r}, which the scene does not list")

    @abstractmethod
    def attach(self, world: ViewOfWorld) -> Action:
        """Build what the effect needs in this world."""
