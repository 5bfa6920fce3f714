"""The embedded control system of Muppala, Ciardo & Trivedi (1994): 3,478 states, rates from 3e-8 to 3e-2 per second.

Stochastic reward nets for reliability prediction, Communications in Reliability, Maintainability and Serviceability
1(2); its form here is that of the PRISM benchmark suite (Kwiatkowska, Norman & Parker 2012), whose numbers of states
and transitions it has.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from kinetics.markov.transient.certificate import Entries

DAY = 24.0 * 60 * 60
PROCESSOR, SENSOR, ACTUATOR = 1 / (365 * DAY), 1 / (30 * DAY), 1 / (60 * DAY)  # failures, 1/s
TIMEOUT, FAULT, REBOOT = 1 / 60, 1 / DAY, 1 / 30
SKIPPED = 2  # cycles that the main processor may skip


class State(NamedTuple):
    """What works, cycles skipped, and the requests on the bus. Processors: 2 works, 1 transient fault, 0 failed."""

    sensors: int = 3
    reader: int = 2
    actuators: int = 2
    writer: int = 2
    main: int = 1
    skipped: int = 0
    is_done: bool = True
    has_input: bool = True
    has_output: bool = False


def moves(x: State) -> Iterator[tuple[float, State]]:
    """Rate and end of each transition."""
    reads, writes, runs = x.reader == 2 and x.sensors >= 2, x.writer == 2 and x.actuators >= 1, x.main == 1
    if x.sensors > 1:
        yield x.sensors * SENSOR, x._replace(sensors=x.sensors - 1)
    if x.actuators > 0:
        yield x.actuators * ACTUATOR, x._replace(actuators=x.actuators - 1)
    if runs:
        yield PROCESSOR, x._replace(main=0)
    if x.sensors >= 2:
        if x.reader > 0:
            yield PROCESSOR, x._replace(reader=0)
        if x.reader == 2:
            yield FAULT, x._replace(reader=1)
        if x.reader == 1:
            is_done, has_output = x.is_done or (runs and not x.has_output), not writes and (x.has_output or runs)
            yield REBOOT, x._replace(reader=2, is_done=is_done, has_input=True, has_output=has_output)
    if x.actuators >= 1:
        if x.writer > 0:
            yield PROCESSOR, x._replace(writer=0)
        if x.writer == 2:
            yield FAULT, x._replace(writer=1)
        if x.writer == 1:
            is_done, has_input = x.is_done or (x.has_input and runs), reads or (x.has_input and not runs)
            yield REBOOT, x._replace(writer=2, is_done=is_done, has_input=has_input, has_output=False)
    yield (
        TIMEOUT,
        x._replace(
            skipped=0 if x.is_done else min(x.skipped + 1, SKIPPED + 1),
            is_done=x.has_input and not x.has_output and runs,
            has_input=reads or (x.has_input and (x.has_output or not runs)),
            has_output=not writes and (x.has_output or (x.has_input and runs)),
        ),
    )


def embedded_system() -> tuple[np.ndarray, Entries, int]:
    """States (N, 9), the start first; rates between different ones; and how many transitions come back at once."""
    found, index, rows, columns, rates, loops = [State()], {State(): 0}, [], [], [], 0
    for x in found:
        for rate, end in moves(x):
            if end not in index:
                index[end] = len(found)
                found.append(end)
            if end == x:
                loops += 1
                continue
            rows.append(index[x])
            columns.append(index[end])
            rates.append(rate)
    return np.array(found, dtype=int), Entries(np.array(rows), np.array(columns), np.array(rates)), loops
