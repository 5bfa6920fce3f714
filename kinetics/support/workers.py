"""Worker processes: they end with the process that started them, and none is started while a script is being loaded."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading

GUARD = 'in a script, start workers under `if __name__ == "__main__":`, because workers load the script as well'


def end_with_parent() -> None:
    """End this worker once the process that started it is gone, however that was killed."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def leave_signals_to_parent() -> None:
    """Ignore Ctrl-C and SIGTERM in this worker: if all processes of a command get one, the parent ends its workers.

    Otherwise it might first take a worker that has died of the signal for one that failed.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)


def end_while_loading() -> None:
    """End a worker that comes to the call which started it, as it loads a script without a guard.

    Silently, since its starter says what is wrong. Without this it would wait for runs that its starter has claimed.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        os._exit(1)
