"""Modules that are copies of others with names replaced, and copies of such copies.

https://www.prismmodelchecker.org/manual/ThePRISMLanguage/ModuleRenaming
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from kinetics.markov.prism.syntax import ModuleText
from kinetics.markov.prism.tokens import Lexeme, ModelTextError
from kinetics.network.checks import nearest


class Copied(NamedTuple):
    """A module: the text that it is made of, and the names that are replaced in it, one step after another."""

    name: Lexeme
    text: ModuleText
    renamings: tuple[Mapping[str, str], ...] = ()

    def renamed(self, token: Lexeme) -> Lexeme:
        """What a name of the text is here."""
        name = token.text
        for renaming in self.renamings:
            name = renaming.get(name, name)
        return token if name == token.text else token._replace(text=name, line=self.name.line, column=self.name.column)


def copied_modules(modules: Sequence[ModuleText]) -> list[Copied]:
    """All modules, each with the text behind it.

    ModelTextError: a copy of no module, or of itself; a name that is replaced twice
    """
    by_name = {module.name.text: module for module in modules}

    def source(module: ModuleText) -> Copied:
        renamings: list[Mapping[str, str]] = []
        passed = [module.name.text]
        original = module
        while original.base is not None:
            renamings.insert(0, _renaming(original))
            base = original.base
            if base.text not in by_name:
                raise ModelTextError(f"there is no module {base.shown} to copy; {nearest(base.text, by_name)}", base)
            if base.text in passed:
                raise ModelTextError(f"a module is a copy of itself: {' = '.join([*passed, base.text])}", base)
            passed.append(base.text)
            original = by_name[base.text]
        return Copied(module.name, original, tuple(renamings))

    return [source(module) for module in modules]


def _renaming(module: ModuleText) -> dict[str, str]:
    found: dict[str, str] = {}
    for old, new in module.renaming:
        if old.text in found:
            raise ModelTextError(f"{old.shown} is replaced twice", old)
        found[old.text] = new.text
    return found
