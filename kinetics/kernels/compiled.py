"""The decorator of every kernel: Numba's compiler, with a cache that sees an edit of any kernel.

Numba's own `cache=True` watches the file of a function alone: where a function that it calls lies in another file and
is edited, the old machine code silently stays in use. Here compiled code lies in a folder named by a hash of all
kernel sources, so kernels may call each other across files and a shared step is written once.
"""

from __future__ import annotations

import functools
import hashlib
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import numba
from numba import njit
from numba.core.caching import FunctionCache, IndexDataCacheFile

PREFIX = "kernels-"
KEPT = (
    3  # folders of one room: going back to sources of a while ago, or another version of Numba, compiles nothing anew
)


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
    dispatcher: Any = njit(nogil=nogil, error_model=error_model, inline=inline)(function)
    if not numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        dispatcher._cache = KernelCache(function)  # as Numba's `enable_caching`, which knows its own cache only
    return dispatcher


class KernelCache(FunctionCache):
    """Numba's cache of one function, in a folder for the sources of its room.

    Where that folder is, Numba decides: NUMBA_CACHE_DIR, else __pycache__ beside the kernels, else the user's cache.
    """

    def __init__(self, function: Callable[..., Any]):
        super().__init__(function)
        sources = sources_hash(Path(function.__code__.co_filename).parent)
        self._cache_path = str(Path(self._cache_path) / f"{PREFIX}{sources}")
        self._cache_file = IndexDataCacheFile(self._cache_path, self._impl.filename_base, sources)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Compiled code, or None; a folder that cannot be read is an empty one."""
        try:
            return super().load_overload(sig, target_context)
        except OSError:
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write compiled code; without it all runs as well, so a full disk or a folder just removed is no error."""
        try:
            folder = Path(self._cache_path)
            if not folder.is_dir():
                folder.mkdir(parents=True, exist_ok=True)
                remove_old(folder)
            super().save_overload(sig, data)
        except OSError:
            pass


@functools.cache
def sources_hash(folder: Path) -> str:
    """Of all that decides what the kernels in a folder compile to: their sources, this file, and Numba's version."""
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
