"""Engines of rigid bodies, of which a scene chooses one by name; the first is the default, and the reference."""

from mechsim.world.engines.base import Engine, EngineEntry, Touch

ENGINES: tuple[EngineEntry, ...] = (
    EngineEntry("pybullet", "mechsim.world.engines.pybullet_engine", "PyBulletEngine", ("pybullet",)),
    EngineEntry("own", "mechsim.world.engines.own_engine", "OwnEngine", ("numba",), version=2),
)


def engine_named(name: str) -> EngineEntry:
    """The entry of this name. ValueError: there is none.

    >>> from mechsim.world.engines import engine_named
    >>> engine_named("pybullet").packages
    ('pybullet',)
    """
    for entry in ENGINES:
        if entry.name == name:
            return entry
    raise ValueError(f"unknown engine {name!r}; expected one of {', '.join(entry.name for entry in ENGINES)}")


__all__ = ["ENGINES", "Engine", "EngineEntry", "Touch", "engine_named"]
