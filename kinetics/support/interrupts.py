"""Long calls during which Ctrl-C is heard.

Python handles a signal between two of its own instructions, so a compiled call must end for it. Work that can be cut
is done in `short_slices`, each some tenths of a second; a call of a library that cannot is `heard` from another thread.
"""

from __future__ import annotations

import atexit
import contextlib
import contextvars
import os
import sys
import threading
from collections.abc import Callable, Iterator
from typing import ParamSpec, TypeVar

AT_ONCE = 2**27  # elementary steps of a kernel in one call, some tenths of a second
INTERRUPTED = 130
LONG = 2e9  # multiplications of a library's call, from which on it is heard from another thread

Given = ParamSpec("Given")
Result = TypeVar("Result")


def short_slices(count: int, work: float) -> Iterator[slice]:
    """The numbers 0 to before `count` in pieces; work : steps that each takes.

    >>> from kinetics.support.interrupts import short_slices
    >>> [(piece.start, piece.stop) for piece in short_slices(5, work=2.0**26)]
    [(0, 2), (2, 4), (4, 5)]
    """
    length = max(1, int(AT_ONCE / max(work, 1.0)))
    return (slice(begin, min(begin + length, count)) for begin in range(0, count, length))


def was_interrupted(error: BaseException | None) -> bool:
    """Whether Ctrl-C is at the bottom of an error, which a library has made of it: Numba, as it compiles or
    returns arrays."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


LEFT: list[threading.Event] = []  # of the ends of calls that nobody waits for any more


@atexit.register
def _end_at_once() -> None:
    """Let no library that still computes see its memory go, for which it would crash the process at its very end."""
    if not all(end.is_set() for end in LEFT):
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(AttributeError, OSError, ValueError):  # absent, full or closed
                stream.flush()
        os._exit(INTERRUPTED)


def heard(function: Callable[Given, Result], *arguments: Given.args, **named: Given.kwargs) -> Result:
    """The result of a function whose work is one long call that releases the interpreter; KeyboardInterrupt at once.

    The call itself cannot be ended: it goes on in the background, and ends with the process, whose exit code is then
    that of an interrupt.
    """
    if threading.current_thread() is not threading.main_thread():
        return function(*arguments, **named)
    results: list[Result] = []
    errors: list[BaseException] = []
    context = contextvars.copy_context()  # numpy's handling of floating-point errors is part of it

    def work() -> None:
        try:
            results.append(context.run(function, *arguments, **named))
        except BaseException as error:  # noqa: BLE001  # raised below, by the thread that waits
            errors.append(error)
        finally:
            end.set()

    end = threading.Event()
    threading.Thread(target=work, daemon=True).start()
    try:
        while not end.wait(0.2):  # without a time, some systems hear no signal meanwhile
            pass
    except BaseException:
        LEFT.append(end)
        raise
    if errors:
        raise errors[0]
    return results[0]
