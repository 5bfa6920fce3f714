"""The exit codes of commands, and which of them, with what message, an error gives.

Codes for results, 1, 4 and 5, are chosen by each command.

To see where an error came from, a user gives `--debug` before the command.
"""

from __future__ import annotations

import errno
from pathlib import Path

import click

from kinetics.support import interrupts
from kinetics.support.packages import EXTRAS, how_to_install

CHECKED = 1  # a check found errors, or a question has no answer at some points: a result
MISTAKE = 2  # of the user: options, files, their contents, a package that is missing
OUTSIDE = 3  # a full disk, too little memory, a scheduler that is gone: the same command may go well another time
INCOMPLETE = 4  # runs were truncated, stopped by the guard, given up or are missing: a result, of fewer runs or times
DIFFERENT = 4  # a replay came out otherwise than the run: a result
BROKEN = 5  # held-out runs broke a rule that a plan had stated before: a result
FAULT = 70  # ours (EX_SOFTWARE of sysexits.h)
INTERRUPTED = interrupts.INTERRUPTED  # 130: by Ctrl-C or SIGTERM
BROKEN_PIPE = 141  # whoever read standard output has seen enough, as `| head`; 128 + SIGPIPE, as shells count

# Of the paths that a user gives; any other number is the system's.
WRONG_PATH = {
    *(errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.EEXIST, errno.ENOTEMPTY, errno.EACCES, errno.EPERM),
    *(errno.ELOOP, errno.ENAMETOOLONG, errno.EROFS, errno.EINVAL),
}
KEPT = "wellmixed.kept"
INSTEAD = "wellmixed.instead"  # of a package, what a command has that goes without it


def judged(error: Exception) -> tuple[int, str]:
    """Exit code and message of an error that ends a command."""
    said = str(error)
    if isinstance(error, ValueError):
        return MISTAKE, said
    if isinstance(error, ModuleNotFoundError) and error.name in EXTRAS:
        context = click.get_current_context(silent=True)
        return MISTAKE, how_to_install(error.name, context.meta.get(f"{INSTEAD}.{error.name}") if context else None)
    if isinstance(error, OSError):
        is_mistake = isinstance(error, PermissionError) or error.errno in WRONG_PATH
        if error.strerror:
            said = f"{error.strerror}: {error.filename}" if error.filename else error.strerror
        return MISTAKE if is_mistake else OUTSIDE, said
    if isinstance(error, MemoryError):
        return OUTSIDE, f"not enough memory{said and f' ({said})'}; ask for less, or free some"
    if isinstance(error, RecursionError):
        return MISTAKE, "the input is nested too deeply (a formula of hundreds of terms?); split it up"
    if isinstance(error, OverflowError):
        return MISTAKE, f"a number is too large to compute with ({said}); use less extreme settings"
    import traceback

    place = traceback.extract_tb(error.__traceback__)[-1]
    return FAULT, (
        f"{type(error).__name__}: {said} ({Path(place.filename).name}:{place.lineno}). This is a fault of wellmixed, "
        "not of the input; please report it, with what --debug shows"
    )


def keep(what: str) -> None:
    """Say what is kept where Ctrl-C or SIGTERM ends the command that runs."""
    click.get_current_context().meta[KEPT] = what


def interrupted(ctx: click.Context) -> str:
    """What to say after Ctrl-C or SIGTERM."""
    nothing = "nothing of it is kept, and the same command starts over; files already written are complete"
    return f"Interrupted: {ctx.meta.get(KEPT, nothing)}."


def keep_runs(folder: str | Path) -> None:
    """`keep` of a command that makes runs."""
    keep(f"finished runs are kept in {folder}; the same command makes only the missing ones")
