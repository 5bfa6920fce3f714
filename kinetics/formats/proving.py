"""Proof of a file before it takes its name: it is read back, and compared with the model that was to be written."""

from __future__ import annotations

import re
import warnings
from itertools import zip_longest
from pathlib import Path

import numpy as np

from kinetics.formats.base import Format
from kinetics.formats.proofevents import event_numbers
from kinetics.network import Model, Network
from kinetics.support.arrays import Floats, Ints
from kinetics.support.output import scratch_folder

MOST_STATES = 8
MOST_ENTRIES = 10**7  # states times species and channels
RTOL = 1e-12  # of propensities: libsbml writes 15 digits of a number
SEED = 1


def check_written(kind: Format, model: Model, text: str, path: Path) -> None:
    """A ValueError that names what differs where the text, read back, is another model than this one.

    Counts at time 0, what each channel changes, and at some states propensities, observables and events, by their
    order: names may be spelled otherwise. Cost: that of reading the file, for SBML a second of processor time for 1,000
    channels, and of the propensities of all channels at 8 states at most, fewer beyond a million species and channels.
    """
    name = f"model{kind.suffixes[0]}"
    try:
        with scratch_folder({name: text}) as folder, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what there is to say of the network was said when it was made
            again = kind.model(folder / name)
    except ValueError as error:
        told = re.sub(rf"\S*{re.escape(name)}", path.name, str(error))
        raise _unlike(path, f"it cannot be read back: {told}") from None
    _compare(model, again, path)


def _compare(model: Model, again: Model, path: Path) -> None:
    was, now = model.network, again.network
    for what, given, got in (
        ("species", was.species, now.species),
        ("channels", was.channels, now.channels),
        ("observables", tuple(model.observables), tuple(again.observables)),
        ("events", tuple(each.name for each in was.events), tuple(each.name for each in now.events)),
    ):
        if len(given) != len(got):
            fault = f"it has {len(got)} {what} and not {len(given)}"
            raise _unlike(path, f"{fault}; {_first_other(given, got)!r} is the first that differs")
    differs = np.flatnonzero(model.initial != again.initial)
    if differs.size:
        s = int(differs[0])
        raise _unlike(path, f"species {was.species[s]!r} starts from {again.initial[s]} and not {model.initial[s]}")
    changes, others = was.sparse_stoichiometry, now.sparse_stoichiometry
    for r in range(len(was.channels)) if not _are_equal(changes, others) else ():
        if not all(np.array_equal(*pair) for pair in zip(changes.row(r), others.row(r), strict=True)):
            raise _unlike(path, f"channel {was.channels[r]!r} changes other counts")
    for state, time in _states(model):
        rates, expected = _propensities(now, state, time), _propensities(was, state, time)
        _check_close(path, "the propensity of channel", was.channels, rates, expected)
        (events, numbers), (other_events, found) = event_numbers(was, state, time), event_numbers(now, state, time)
        if len(events) != len(other_events):
            raise _unlike(path, f"event {_first_other(events, other_events)!r} or another sets other species")
        _check_close(path, "a number of event", events, found, numbers)
        _check_close(path, "observable", tuple(model.observables), _sums(again, state), _sums(model, state))


def _states(model: Model) -> list[tuple[Ints, float]]:
    """Counts and times at which models are compared: the initial state, states near it, and small counts."""
    rng = np.random.default_rng(SEED)
    n = len(model.initial)
    number = max(1, min(MOST_STATES, MOST_ENTRIES // (n + len(model.network.channels) + 1)))
    near = [np.minimum(model.initial, 2**40) + rng.integers(0, 3, n) for _ in range(MOST_STATES // 2)]
    few = [rng.integers(0, 10, n) for _ in range(MOST_STATES // 2 - 1)]
    kinds = [few[0], model.initial, *near, *few[1:]][:number]
    return [(state, 0.7 * place) for place, state in enumerate(kinds)]


def _propensities(network: Network, state: Ints, time: float) -> Floats | None:
    """Propensities (R,); None at a state for which a rate law has none."""
    try:
        with np.errstate(all="ignore"):
            return network.propensities(state, time)
    except ValueError:
        return None


def _sums(model: Model, state: Ints) -> Floats:
    place = {name: s for s, name in enumerate(model.network.species)}
    return np.array(
        [sum(w * float(state[place[each]]) for each, w in sums.items()) for sums in model.observables.values()]
    )


def _check_close(path: Path, what: str, names: tuple[str, ...], found: Floats | None, expected: Floats | None) -> None:
    if found is None or expected is None:
        if found is not expected:
            raise _unlike(path, f"{what} {names[0]!r} or another has a value in one of them alone")
        return
    off = np.flatnonzero(~np.isclose(found, expected, rtol=RTOL, atol=0.0, equal_nan=True))
    if off.size:
        i = int(off[0])
        raise _unlike(path, f"{what} {names[i]!r} is {found[i]:.15g} and not {expected[i]:.15g} at some counts")


def _are_equal(one: object, other: object) -> bool:
    parts = ("rows", "columns", "copies")
    return all(np.array_equal(getattr(one, part), getattr(other, part)) for part in parts)


def _first_other(given: tuple[str, ...], got: tuple[str, ...]) -> str:
    """The first name of the longer list that the shorter one does not have in its place."""
    longer, shorter = (given, got) if len(given) > len(got) else (got, given)
    return next(name for name, other in zip_longest(longer, shorter) if name != other)


def _unlike(path: Path, fault: str) -> ValueError:
    return ValueError(
        f"{path} is not written, because it would describe another network: {fault}; rename what is named here, or "
        f"write another format"
    )
