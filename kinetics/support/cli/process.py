"""The process of a command: its standard streams, which may be full, closed, absent or without a reader, and SIGTERM.

A result that cannot be printed must not cost the files that a command also writes, nor pass for success: a write that
fails is noted, the command runs on, and `exit_code` says at its end what came of it. Python would raise at the write,
or flush once more when it has already chosen the exit code, and then end with 120.
"""

from __future__ import annotations

import errno
import io
import os
import select
import signal
import sys
import threading
from collections.abc import Sequence
from typing import Any, NoReturn

import click

from kinetics.support.cli.failures import BROKEN, BROKEN_PIPE, CHECKED, INCOMPLETE, INTERRUPTED, OUTSIDE


class StandardStream(io.FileIO):
    """A descriptor of this process that accepts every write; output after a failed write is dropped.

    lost : the error of the first write that failed, None if there was none
    """

    def __init__(self, descriptor: int) -> None:
        self.closed_before = fill_closed(descriptor, os.O_WRONLY)
        self.lost: OSError | None = None
        super().__init__(descriptor, "wb", closefd=False)

    def write(self, data: Any) -> int:
        """Write as much as possible, and report all of it as written."""
        if self.lost is None and self.closed_before:
            self.lost = OSError(errno.EBADF, "it is closed")
        while self.lost is None:
            try:
                written = super().write(data)
                if written is not None:
                    return written
                select.select([], [self], [])  # another program has made the pipe non-blocking
            except OSError as error:
                self.lost = error
        return memoryview(data).nbytes


def fill_closed(descriptor: int, mode: int) -> bool:
    """Put the null device where a standard stream is closed, and say whether it was.

    The next file to be opened would get its number, and with it all that C code prints.
    """
    try:
        os.fstat(descriptor)
    except OSError:
        null = os.open(os.devnull, mode)
        os.dup2(null, descriptor)
        if null != descriptor:
            os.close(null)
        os.set_inheritable(descriptor, True)
        return True
    return False


def own_streams() -> None:
    """Make standard output and error streams of ours, unless somebody (a test, a notebook) has replaced them."""
    fill_closed(0, os.O_RDONLY)
    if sys.stdout is sys.__stdout__:
        sys.stdout = _text(sys.stdout, 1)
    if sys.stderr is sys.__stderr__:
        sys.stderr = _text(sys.stderr, 2)


def _text(former: Any, descriptor: int) -> io.TextIOWrapper:
    """A text stream as Python's own is; letters that its encoding lacks are escaped."""
    encoding, errors, by_line = "utf-8", "backslashreplace", True
    if former is not None:
        encoding, by_line = former.encoding, former.line_buffering or former.write_through
        errors = former.errors if former.errors != "strict" else errors
    buffer = io.BufferedWriter(StandardStream(descriptor))
    return io.TextIOWrapper(buffer, encoding, errors, newline="\n", line_buffering=by_line)


def heed_interrupts() -> None:
    """Let SIGTERM interrupt as Ctrl-C does, by the same handlers; also where the shell has Ctrl-C ignored (`&`).

    Python drops what a `__del__` raises. An interrupt that comes there is sent again, and of an object that an
    interrupt left half made nothing is said.
    """
    if not _is_main_thread():
        return
    ignored = signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    asked: list[int] = []
    heard: list[int] = []

    def end(number: int, _: object) -> None:
        asked.append(number)
        signal.raise_signal(signal.SIGINT)

    def interrupt(number: int, _: object) -> None:
        if asked or not ignored:
            heard.append(number)
            raise KeyboardInterrupt

    if signal.getsignal(signal.SIGTERM) == signal.SIG_DFL:
        signal.signal(signal.SIGTERM, end)
    if ignored or signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, interrupt)
    before = sys.unraisablehook

    def dropped(lost: Any) -> None:
        if issubclass(lost.exc_type, KeyboardInterrupt) and _is_main_thread():
            threading.Timer(0.01, os.kill, (os.getpid(), signal.SIGINT)).start()  # here it would be dropped once more
        elif not heard:
            before(lost)

    sys.unraisablehook = dropped


def exit_code(code: int) -> int:
    """The exit code of a finished command, after its output is flushed; a lost result is a failure."""
    lost = _lost()
    if lost is None or code not in (0, CHECKED, INCOMPLETE, BROKEN):
        return code
    if lost.errno == errno.EPIPE:
        return BROKEN_PIPE
    click.echo(f"Error: could not write to standard output: {lost.strerror}", err=True)
    return OUTSIDE


def _lost() -> OSError | None:
    if sys.stdout is None:
        return None
    sys.stdout.flush()
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    return raw.lost if isinstance(raw, StandardStream) else None


def run(main: click.Command, args: Sequence[str] | None = None, **named: Any) -> NoReturn:
    """Run a command as all that this process does, and end it with the command's exit code."""
    own_streams()
    heed_interrupts()
    try:
        code = exit_code(_outcome(main, args, named))
        for number in (signal.SIGINT, signal.SIGTERM):  # from here on they end it at once, without a traceback
            if _is_main_thread() and callable(signal.getsignal(number)):
                signal.signal(number, signal.SIG_DFL)
    except KeyboardInterrupt:  # one more, as the first was being answered
        code = INTERRUPTED
    sys.exit(code)


def _outcome(main: click.Command, args: Sequence[str] | None, named: dict[str, Any]) -> int:
    """The exit code that a command asks for; click's errors are shown."""
    try:
        code = main.main(args, standalone_mode=False, **named)
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except click.Abort:
        return INTERRUPTED
    except SystemExit as end:
        code = end.code
    return code if isinstance(code, int) else 0


def _is_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()
