"""One try of a campaign: work in a process of its own, and what is found afterwards."""

from __future__ import annotations

import json
import os
import signal
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
MISTAKE, OUTSIDE, FAULT = 2, 3, 70  # exit codes, as those of the command
AT_MOST = 60  # s, before work counts as stuck


@dataclass(frozen=True)
class Ending:
    """How work ended.

    code : exit code, or minus the signal; result : what it returned, if it did
    warned : warnings; said : the end of what it wrote to its outputs
    """

    code: int
    result: Any
    warned: tuple[str, ...]
    said: str

    def complaints(self) -> list[str]:
        """What no fault excuses: to get stuck, a fault of ours, damage, a traceback."""
        found = []
        if self.code == -signal.SIGALRM:
            found.append("it got stuck")
        elif self.code not in (0, OUTSIDE, -signal.SIGKILL):
            found.append(f"it ended with code {self.code}: {self.said.replace(f'{ROOT}/', '')[-300:]}")
        return found + [text for text in self.warned if "damaged" in text]


def in_child(work: Callable[[], Any], scratch: Path, at_most: int = AT_MOST) -> Ending:
    """Call `work` in a forked process, its outputs in a file; an OSError is exit code 3, as in the command."""
    pid = start(work, scratch, at_most)
    _, status = os.waitpid(pid, 0)
    return ended(status, scratch)


def start(work: Callable[[], Any], scratch: Path, at_most: int = AT_MOST) -> int:
    """The process that does the work; `ended` reads what came of it."""
    scratch.mkdir(exist_ok=True)
    report = scratch / "report.json"
    report.unlink(missing_ok=True)
    pid = os.fork()
    if pid:
        return pid
    code = FAULT
    try:
        signal.alarm(at_most)
        said = os.open(scratch / "said", os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        os.dup2(said, 1)
        os.dup2(said, 2)
        with warnings.catch_warnings(record=True) as noticed:
            warnings.simplefilter("always")
            result = work()
        report.write_text(json.dumps({"result": result, "warned": [str(one.message) for one in noticed]}))
        code = 0
    except OSError:
        code = OUTSIDE
        traceback.print_exc()
    except ValueError:
        code = MISTAKE
        traceback.print_exc()
    except SystemExit as stop:
        code = int(stop.code or 0)
    except BaseException:  # noqa: BLE001 - told by the exit code
        traceback.print_exc()
    finally:
        os._exit(code)


def ended(status: int, scratch: Path) -> Ending:
    """What came of a process that `start` has made."""
    report = scratch / "report.json"
    told = json.loads(report.read_text()) if report.exists() else {"result": None, "warned": []}
    said = (scratch / "said").read_text(errors="replace") if (scratch / "said").exists() else ""
    return Ending(os.waitstatus_to_exitcode(status), told["result"], tuple(told["warned"]), said)
