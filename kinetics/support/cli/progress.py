"""Progress messages on standard error: the work done, the forecast, and a sign of life.

At a terminal it is one line, rewritten in place; elsewhere a line is printed every 30 s. Code far below a command names
what it does by `stage`, and what it will cost by `forecast`; both are silent if no command runs. Standard output
stays free of all of it.
"""

from __future__ import annotations

import contextlib
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

BUDGET = 120.0  # minutes of CPU time; as much as the limits of the solving methods
EVERY = 30.0  # s between lines if there is no terminal
REDRAWN = 0.1  # s between states of the line at a terminal, at least
TICK = 1.0  # s
LONG = 10.0  # s of work, which are worth a forecast
TRIED = 2.0  # s of counted work, after which its pace is believed

CLEAR = "\r\033[K"

_open: list[Progress] = []  # those of this process, the innermost last


def is_terminal(stream: Any) -> bool:
    """Whether a standard stream is there, open, and shown on a terminal; all that asks this asks it here."""
    try:
        return stream is not None and stream.isatty()
    except ValueError:  # closed
        return False


class Progress:
    """A line on the work under way; called with its text, and with the share of the work that is done if it is known.

    in_place : whether the line is rewritten, as at a terminal; else it is printed from time to time
    is_silent : whether nothing is said at all
    budget : CPU time, s, beyond which a forecast refuses the work; None: no limit
    """

    def __init__(self, in_place: bool, clock: Callable[[], float] = time.monotonic) -> None:
        self.in_place, self.clock = in_place, clock
        self.is_silent = False
        self.budget: float | None = None
        self.began = self.said = clock()
        self.drawn = self.began - TICK
        self.text = "at work"
        self.first: tuple[float, float] | None = None  # time and share when the present work was first counted
        self.ends = self.began  # as far as it is known
        self.is_forecast = False

    def __call__(self, text: str, share: float | None = None) -> None:
        """Print the work under way; the share done is between 0 and 1."""
        now = self.clock()
        self.text = text
        if share is not None:
            self._count(share, now)
        if now - self.drawn >= REDRAWN or share == 1.0:
            self._draw(text, now)

    def _count(self, share: float, now: float) -> None:
        """Take the pace so far for that of the rest; a share that falls is that of other work, which begins."""
        if self.first is None or share < self.first[1]:
            self.first, self.is_forecast = (now, share), False
        since, before = self.first
        if share > before:
            left = (now - since) * (1.0 - share) / (share - before)
            self.ends = now + left
            if not self.is_forecast and now - since > TRIED:
                self.is_forecast = True
                self._say_length(left, f" left after {self.text}")

    def forecast(self, seconds: float, what: str, at_once: int = 1) -> None:
        """Print a forecast of CPU time, s, on so many processors at once, if it is long.

        click.ClickException, with exit code 2: it is beyond the budget
        """
        if self.budget is not None and seconds > self.budget:
            raise _refusal(
                f"forecast: about {span(seconds)} of CPU time ({what}), beyond the budget of {self.budget / 60:g} min; "
                "ask for less, or allow more by --budget MINUTES"
            )
        self.ends, self.first, self.is_forecast = self.clock() + seconds / at_once, None, True
        self._say_length(seconds / at_once, f": {what}")

    def _say_length(self, seconds: float, of: str) -> None:
        if seconds > LONG and not self.is_silent:
            _write(f"{CLEAR if self.in_place else ''}forecast: about {span(seconds)}{of}\n")

    def tick(self) -> None:
        """Repeat the current message if none was printed for long."""
        now = self.clock()
        left = f", about {span(self.ends - now)} left" if self.ends > now else ""
        line = f"{self.text}, {span(now - self.began)} so far{left}"
        if now - self.drawn >= TICK:
            self._draw(line, now)
        if not self.in_place and not self.is_silent and now - self.said >= EVERY:
            self.said = now
            _write(f"{line}\n")

    def clear(self) -> None:
        """Remove the line from the terminal."""
        if self.in_place:
            _write(CLEAR)

    def _draw(self, line: str, now: float) -> None:
        if self.in_place:
            self.drawn = now
            _write(f"{CLEAR}{line[: shutil.get_terminal_size().columns - 1]}")


def _refusal(said: str) -> Exception:
    """An error that ends the command; no ValueError, which callers would take for "not by this method"."""
    from click import ClickException

    class BeyondBudgetError(ClickException):
        exit_code = 2

    return BeyondBudgetError(said)


def _write(text: str) -> None:
    """Write to the current standard error, unless it is absent or closed."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        sys.stderr.write(text)
        sys.stderr.flush()


@contextmanager
def progress_line(shown: bool | None = None, budget: float | None = None) -> Iterator[Progress]:
    """A `Progress` of a command, or of a part of its work, which `stage` and `forecast` speak to meanwhile.

    shown : True: rewritten in place; False: silent; None: in place at a terminal, else a line from time to time
    budget : CPU time, minutes

    Within another, it goes on with its clock and, unless it has its own, with its budget.
    """
    line = Progress(is_terminal(sys.stderr) if shown is None else shown)
    line.budget = None if budget is None else 60.0 * budget
    outer = _open[-1] if _open else None
    if outer:
        line.clock, line.began, line.said, line.ends = outer.clock, outer.began, outer.said, outer.began
        line.budget = outer.budget if budget is None else line.budget
        line.text = outer.text
    line.is_silent = shown is False or (outer is not None and outer.is_silent)
    line.in_place &= not line.is_silent
    _open.append(line)
    try:
        yield line
    finally:
        _open.remove(line)
        line.clear()
        if outer:
            outer.said = line.said


@contextmanager
def sign_of_life(command: str, is_quiet: bool = False) -> Iterator[None]:
    """Around a whole command: a thread has the innermost line say from time to time that work goes on."""
    line = Progress(in_place=False)
    line.text, line.is_silent = f"{command} at work", is_quiet
    is_over = threading.Event()

    def watch() -> None:
        while not is_over.wait(TICK):
            with contextlib.suppress(IndexError):  # just closed
                _open[-1].tick()

    _open.append(line)
    thread = threading.Thread(target=watch, daemon=True)  # ends with the process, and is in no fork of it
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join(TICK)
        _open.remove(line)


def stage(text: str, share: float | None = None) -> None:
    """Say what is done now, on the line of the command that runs; see `Progress`."""
    if _open:
        _open[-1](text, share)


def forecast(seconds: float, what: str, at_once: int = 1) -> None:
    """Say what work will take, before it starts, where a command runs; see `Progress.forecast`."""
    if _open:
        _open[-1].forecast(seconds, what, at_once)


def allowed(otherwise: float) -> float:
    """CPU time, s, that the budget of the command at work allows; `otherwise` if none runs, or has none."""
    budget = _open[-1].budget if _open else None
    return otherwise if budget is None else budget


def limit_in_words(seconds: float) -> str:
    """A limit on CPU time by its name: the option of the command at work, or the argument of a call from Python."""
    has_option = bool(_open) and _open[-1].budget is not None
    return f"--budget {seconds / 60:g} (minutes)" if has_option else f"max_seconds = {seconds:g}"


SPANS = (("s", 1.0, 120.0), ("min", 60.0, 7200.0), ("h", 3600.0, 172_800.0), ("days", 86_400.0, 6e7))


def is_heard() -> bool:
    """Whether a command runs that prints the messages of `stage` and `forecast`."""
    return bool(_open)


def span(seconds: float) -> str:
    """A length of time for people, from seconds."""
    for unit, size, most in SPANS:
        if seconds < most:
            many = seconds / size
            return f"{many:.0f} {unit}" if many >= 10 else f"{many:.2g} {unit}"
    return f"{seconds / 3.15576e7:.2g} years"
