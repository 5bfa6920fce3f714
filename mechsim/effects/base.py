"""What an effect is: settings a scene lists, and the hooks they become in a running world."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar, Literal

from kinetics.support.config import Settings

if TYPE_CHECKING:
    from mechsim.scene import Scene
    from mechsim.world.world import World


EventKind = Literal["join", "break"]


class Stopped(Exception):  # noqa: N818 - a named outcome, not a fault of the program
    """The run was ended because its state can no longer be trusted; the text is the named reason."""


class Action:
    """An effect at work in one world; override only the hooks it needs. Hooks not overridden are never called."""

    def before_step(self) -> None:
        """Act on velocities before the engine moves the bodies."""

    def after_step(self) -> None:
        """Look at what the step did: contacts, new poses."""


class Effect(Settings):
    """One physical influence, as a scene describes it. Without it in the scene its physics is absent.

    A new effect is one file with a subclass whose `effect` field is its name, and one line in `effects.EFFECTS`.
    """

    effect: str
    provides: ClassVar[str | None] = None  # what several effects are ways of, of which a scene takes one; None: itself
    needs: ClassVar[tuple[str, ...]] = ()  # what it cannot act without: names of effects, or of what they provide
    opens: ClassVar[tuple[EventKind, ...]] = ()  # kinds of event that it makes happen

    def check(self, scene: Scene) -> None:
        """ValueError where the effect does not go with the rest of the scene."""
        for need in self.needs:
            if scene.provider(need) is None:
                raise ValueError(f"effect {self.effect!r} needs effect {need!r}, which the scene does not list")

    @abstractmethod
    def attach(self, world: World) -> Action:
        """Build what the effect needs in this world."""
