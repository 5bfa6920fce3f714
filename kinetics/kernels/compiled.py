"""The decorator of every kernel: Numba's compiler, with a cache that sees an edit of any kernel.

Numba's own `cache=True` watches the file of a function alone: where a function that it calls lies in another file and
is edited, the old machine code silently stays in use. Here compiled code lies in a folder named by a hash of all
kernel sources, so kernels may call each other across files and a shared step is written once. Kernels are imported
when they are needed; if sources were edited meanwhile, the process runs on and writes nothing to the cache.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import multiprocessing
import os
import shutil
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numba
from numba import njit
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.dispatcher import Dispatcher
from numba.core.types import unliteral

from kinetics.support.cli.progress import is_terminal
from kinetics.support.interrupts import heard

PREFIX = "kernels-"
# Folders of one room: going back to sources of a while ago, or another version of Numba, compiles nothing anew.
KEPT = 3


def compiled(
    function: Callable[..., Any] | None = None,
    *,
    nogil: bool = True,
    error_model: Literal["numpy", "python"] = "numpy",
    inline: Literal["never", "always"] = "never",
) -> Callable[..., Any]:
    """Compile a function at its first call, or take it from the cache.

    nogil : other threads run on meanwhile
    error_model : "numpy", where a division by zero gives inf or nan; "python", where it raises ZeroDivisionError
    inline : "always" for a step that kernels share, where a call with arrays would cost more than the step
    """
    if function is None:
        return functools.partial(compiled, nogil=nogil, error_model=error_model, inline=inline)
    options: Any = {"no_cfunc_wrapper": True}  # a wrapper for callers in C takes long, and there are none
    dispatcher: Any = njit(nogil=nogil, error_model=error_model, inline=inline, **options)(function)
    if not numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        dispatcher.get_call_template = functools.partial(template_of_plain_types, dispatcher.get_call_template)
        dispatcher._compile_for_args = functools.partial(beside_interrupts, dispatcher._compile_for_args)
        try:
            dispatcher._cache = KernelCache(function)  # as Numba's `enable_caching`, which knows its own cache only
        except RuntimeError as error:
            if "no locator available" not in str(error):
                raise
            say_that_nothing_is_kept()
    kernel: Callable[..., Any] = dispatcher
    return kernel


def load_cached(*modules: ModuleType) -> None:
    """Load what is cached of the kernels in some modules; compile nothing. Processes forked from this one have it."""
    for module in modules:
        kernels: list[Any] = [each for each in vars(module).values() if isinstance(each, Dispatcher)]
        for kernel in kernels:
            for types in kernel._cache.known(kernel.targetctx) if isinstance(kernel._cache, KernelCache) else ():
                kernel.compile(types)


def template_of_plain_types(template: Callable[..., Any], args: tuple[Any, ...], kws: dict[str, Any]) -> Any:
    """A kernel called by a kernel, with constants taken as any number of their type.

    Numba would compile the callee once more for each constant that it is called with, also for one with which a loop
    only begins; LLVM sees constants anyhow.
    """
    return template(tuple(map(unliteral, args)), {name: unliteral(kind) for name, kind in kws.items()})


def beside_interrupts(compile_for: Callable[..., Any], *args: Any, **kws: Any) -> Any:
    """Compile a kernel for the types of its arguments, in another thread than that which Ctrl-C interrupts.

    An interrupt within Numba or LLVM may be dropped, turned into another error, or crash the process.
    """
    return heard(compile_for, *args, **kws)


@functools.cache
def say_that_nothing_is_kept() -> None:
    """Once a command: a read-only installation without a home has no folder for compiled kernels."""
    if multiprocessing.parent_process() is not None:  # a worker's command has said so
        return
    warnings.warn(
        "there is no folder for compiled kernels, so each command compiles them anew, which takes seconds; set "
        "NUMBA_CACHE_DIR to a writable folder",
        RuntimeWarning,
        stacklevel=3,
    )


@functools.cache
def say_that_it_compiles() -> None:
    """Once a command, to a person at a terminal: it takes seconds, and only the first time."""
    if is_terminal(sys.stderr) and multiprocessing.parent_process() is None:
        print("compiling kernels, which are stored for the next time ...", file=sys.stderr, flush=True)  # noqa: T201


class KernelCache(FunctionCache):
    """Numba's cache of one function, in a folder for the sources of its room.

    Where that folder is, Numba decides: NUMBA_CACHE_DIR, else __pycache__ beside the kernels, else the user's cache.
    """

    def __init__(self, function: Callable[..., Any]):
        super().__init__(function)
        self._room = room_at(Path(function.__code__.co_filename).parent)
        self._room.look()
        sources = self._room.sources
        self._cache_path = str(Path(self._cache_path) / f"{PREFIX}{sources}")
        self._cache_file = IndexDataCacheFile(self._cache_path, self._impl.filename_base, sources)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Compiled code, or None; a folder that cannot be read is an empty one, and a damaged index is removed."""
        if self._room.is_mixed:
            return None  # a callee may be another than the code in the folder was compiled with
        found = None
        try:
            found = super().load_overload(sig, target_context)
        except OSError:
            pass
        except Exception:  # noqa: BLE001 - unpickling a cut or overwritten file may raise anything
            self._remove_index()
        if found is None:
            say_that_it_compiles()
        return found

    def known(self, target_context: Any) -> list[Any]:
        """The types of arguments for which there is compiled code for this machine."""
        try:
            index = {} if self._room.is_mixed else self._cache_file._load_index()
        except Exception:  # noqa: BLE001 - as above
            return []
        codegen = target_context.codegen()
        return [key[0] for key in index if key == self._index_key(key[0], codegen)]

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write compiled code; without it all runs as well, so a full disk or a folder just removed is no error."""
        if not self._room.is_as_hashed():
            return
        try:
            folder = Path(self._cache_path)
            if not folder.is_dir():
                folder.mkdir(parents=True, exist_ok=True)
                remove_old(folder)
            try:
                self._cache_file._load_index()
            except Exception:  # noqa: BLE001 - as above
                self._remove_index()
            super().save_overload(sig, data)
        except OSError:
            pass

    def _remove_index(self) -> None:
        """Without its index nothing of a function is cached; the next save writes index and code anew."""
        with contextlib.suppress(OSError):
            Path(self._cache_file._index_path).unlink()


class KernelRoom:
    """A folder of kernels: the hash of its sources when this process took its first kernel from it.

    is_mixed : sources have differed from that hash when a later kernel was decorated
    """

    def __init__(self, folder: Path):
        self.folder = folder
        self.is_mixed = False
        self._files = file_states(folder)
        self.sources = sources_hash(folder)

    def look(self) -> None:
        """Note whether the sources are still those hashed; they are read again only if a file looks changed."""
        try:
            files = file_states(self.folder)
            if files != self._files:
                self.is_mixed |= sources_hash(self.folder) != self.sources
                self._files = files
        except OSError:  # a file is being replaced
            self.is_mixed = True

    def is_as_hashed(self) -> bool:
        """Whether all kernels are of the sources hashed, and these are still there; reads all of them."""
        try:
            return not self.is_mixed and sources_hash(self.folder) == self.sources
        except OSError:
            return False


room_at = functools.cache(KernelRoom)


def file_states(folder: Path) -> set[tuple[str, int, int, int]]:
    """Name, times of the last changes, and size of each source: some of these change with every edit."""
    with os.scandir(folder) as entries:
        states = [(entry.name, entry.stat()) for entry in entries if entry.name.endswith(".py")]
    return {(name, state.st_mtime_ns, state.st_ctime_ns, state.st_size) for name, state in states}


def sources_hash(folder: Path) -> str:
    """A hash of all that kernels in a folder are compiled from: their sources, this file, and Numba's version."""
    seen = hashlib.sha256(numba.__version__.encode())
    for path in (Path(__file__), *sorted(folder.glob("*.py"))):
        text = path.read_bytes()
        seen.update(f"\n{path.name} {len(text)}\n".encode() + text)
    return seen.hexdigest()[:16]


def remove_old(folder: Path) -> None:
    """Remove all folders like this new one but the last `KEPT`.

    A process that runs on with older sources only compiles again what it finds removed.
    """
    made = {path: path.stat().st_mtime for path in folder.parent.glob(f"{PREFIX}*") if path != folder}
    for path in sorted(made, key=made.__getitem__)[: max(0, len(made) - KEPT + 1)]:
        shutil.rmtree(path, ignore_errors=True)
