"""Long work is cut into pieces that give the same bits; what cannot be cut is heard from another thread."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from kinetics import Chain, Model, Network, Sensitivity, first_passage, predict
from kinetics.markov import ask
from kinetics.markov.transient import Dense
from kinetics.support import interrupts
from kinetics.support.interrupts import heard, short_slices

LOOP = "A <-> B, 1.3, 1\nB <-> C, 1, 0.7\nC -> D, 0.2\nA = 8"
RING = "A <-> B, 1.3, 1\nB <-> C, 1, 0.7\nC <-> A, 0.2, 0.3\nA + C -> 2 B, 0.1\nA = 20"


def numbers():
    """Of every kernel that is cut, and of every call that is heard."""
    net, ring = Network.from_text(LOOP), Network.from_text(RING)
    chain, whole = Chain.of(net, net.initial), Chain.of(ring, ring.initial)
    found = [predict(Model(net, net.initial), None, [1.0, 5.0], "transient").mean]
    found += [ask(chain, question).value for question in ("P=? [ F<=4 D >= 3 ]", "E[B] @ 3", "P=? [ F D >= 3 ]")]
    found += [ask(whole, "S=? [ C = 4 ]").value, ask(whole, 'R{"time"}=? [ F A = 0 ]').value]
    found += [Sensitivity(chain).until("D >= 3", by=4.0).elasticity]
    found += [Dense().solve(net, net.initial, [2.0]).probabilities]
    passage = first_passage(net, net.initial, "D", 3)
    found += [passage.mean, passage.sd, float(passage.cdf(2.0)), float(passage.quantile(0.3))]
    return [np.array(each) for each in found]


def test_pieces_and_threads_give_the_same_bits(monkeypatch):
    whole = numbers()
    monkeypatch.setattr(interrupts, "AT_ONCE", 100)
    monkeypatch.setattr("kinetics.markov.transient.dense.LONG", 1.0)
    monkeypatch.setattr("kinetics.markov.transient.search.CHUNK", 50)
    for one, other in zip(whole, numbers(), strict=True):
        np.testing.assert_array_equal(one, other)


def test_pieces_are_all_there_is():
    assert [*short_slices(0, 1.0)] == []
    parts = [*short_slices(7, interrupts.AT_ONCE / 3)]
    assert [(part.start, part.stop) for part in parts] == [(0, 3), (3, 6), (6, 7)]
    assert len([*short_slices(5, 1e30)]) == 5


def test_what_is_heard_gives_its_result_or_its_error_under_the_same_settings():
    with np.errstate(divide="raise"), pytest.raises(FloatingPointError):
        heard(lambda: np.ones(1) / np.zeros(1))
    assert heard(lambda a, b: (a, b), 1, b=2) == (1, 2)
    seen = []
    worker = threading.Thread(target=lambda: seen.append(heard(threading.current_thread)))
    worker.start()
    worker.join()
    assert seen == [worker]  # in a thread of the caller's nothing need be heard


SCRIPT = """
import time
from kinetics.support.interrupts import heard
print("begun", flush=True)
try:
    heard(time.sleep, 60)  # goes on after a signal, which libc's own does not
except KeyboardInterrupt:
    print("heard", flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_an_interrupt_is_heard_during_a_call_that_goes_on():
    process = subprocess.Popen(
        [sys.executable, "-c", SCRIPT], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "begun\n"
    time.sleep(0.1)
    began = os.times().elapsed
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=50)
    assert (out, err, process.returncode) == ("heard\n", "", 130)
    assert os.times().elapsed - began < 50  # it would sleep for a minute


HALF_MADE = """
import os, signal, sys
from kinetics.support.cli.process import heed_interrupts

class Half:
    def __init__(self, number):
        if number:
            os.kill(os.getpid(), number)
        self.whole = True
    def __del__(self):
        self.missing

heed_interrupts()
try:
    Half(getattr(signal, sys.argv[1], 0))
except KeyboardInterrupt:
    print("interrupted")
"""


@pytest.mark.parametrize(
    ("number", "said", "told"), [("SIGINT", "interrupted\n", 0), ("SIGTERM", "interrupted\n", 0), ("none", "", 1)]
)
def test_nothing_is_said_of_what_an_interrupt_left_half_made(number, said, told):
    """Control: without an interrupt, what a `__del__` raises is told."""
    done = subprocess.run([sys.executable, "-c", HALF_MADE, number], capture_output=True, text=True, check=True)
    assert done.stdout == said
    assert done.stderr.count("AttributeError") == told
