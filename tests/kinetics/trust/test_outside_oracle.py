"""Laws computed outside: by mpmath to a hundred digits, and by the model checker Storm in rational numbers.

The states, combinations and matrices are made here anew, from the reactions alone; Storm makes even those itself.
"""

from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from math import comb

import mpmath
import numpy as np
import pytest
from known_systems import network

from kinetics import Dense, FiniteStateProjection, Network, Transient, first_passage, splitting, stationary

DIGITS = 100


@dataclass(frozen=True)
class System:
    """A network with its start, a time, and a species whose first `copies` are waited for."""

    name: str
    net: Network
    start: tuple[int, ...]
    time: float
    waited: str
    copies: int = 1


def system(name, start, time, waited, copies, species, **reactions):
    """Rates are powers of two or sums of few, so that they are the same numbers everywhere."""
    sides = {channel: (before, after) for channel, (before, after, _) in reactions.items()}
    rates = [rate for _, _, rate in reactions.values()]
    return System(name, network(species, sides, rates), start, time, waited, copies)


STIFF = system(
    "stiff", (2, 0, 0), 0.5, "C", 2, "ABC",
    ab=((1, 0, 0), (0, 1, 0), 2.0**30), ba=((0, 1, 0), (1, 0, 0), 2.0**29), leak=((0, 1, 0), (0, 0, 1), 2.0**-10),
)  # fmt: skip
DECOMPOSABLE = system(
    "nearly decomposable", (1, 0, 0, 0), 8.0, "D", 1, "ABCD",
    ab=((1, 0, 0, 0), (0, 1, 0, 0), 1.0), ba=((0, 1, 0, 0), (1, 0, 0, 0), 2.0),
    ac=((1, 0, 0, 0), (0, 0, 1, 0), 2.0**-50), ca=((0, 0, 1, 0), (1, 0, 0, 0), 3 * 2.0**-50),
    cd=((0, 0, 1, 0), (0, 0, 0, 1), 5.0), dc=((0, 0, 0, 1), (0, 0, 1, 0), 7.0),
)  # fmt: skip
REDUCIBLE = system(
    "reducible", (2, 0, 0, 0), 3.0, "D", 1, "ABCD",
    pair=((1, 0, 0, 0), (0, 1, 0, 0), 1.0), trap=((1, 0, 0, 0), (0, 0, 0, 1), 3.0),
    bc=((0, 1, 0, 0), (0, 0, 1, 0), 2.0), cb=((0, 0, 1, 0), (0, 1, 0, 0), 8.0),
)  # fmt: skip
DIMERS = system(
    "dimers", (9, 0), 2.0, "B", 4, "AB", join=((2, 0), (0, 1), 0.125), part=((0, 1), (2, 0), 0.5)
)  # fmt: skip
TRIMERS = system(
    "trimers", (6, 0, 0), 1.0, "B", 2, "ABC",
    join=((3, 0, 0), (0, 1, 0), 0.0625), part=((0, 1, 0), (3, 0, 0), 0.25),
    turn=((1, 0, 0), (0, 0, 1), 1.0), back=((0, 0, 1), (1, 0, 0), 2.0),
)  # fmt: skip
ENZYME = system(
    "enzyme", (2, 4, 0, 0), 4.0, "P", 4, "ESCP",
    bind=((1, 1, 0, 0), (0, 0, 1, 0), 0.5), free=((0, 0, 1, 0), (1, 1, 0, 0), 1.0),
    make=((0, 0, 1, 0), (1, 0, 0, 1), 0.25),
)  # fmt: skip
SYSTEMS = (STIFF, DECOMPOSABLE, REDUCIBLE, DIMERS, TRIMERS, ENZYME)
each_system = pytest.mark.parametrize("system", SYSTEMS, ids=[one.name for one in SYSTEMS])


def explored(system):
    """Reachable states in order of discovery, and {(from, to): rate} in exact fractions."""
    net, states, rates = system.net, {system.start: 0}, {}
    queue = [system.start]
    for state in queue:
        for needed, change, rate in zip(net.reactants, net.stoichiometry, net.rate_constants, strict=True):
            ways = np.prod([comb(have, need) for have, need in zip(state, needed.tolist(), strict=True)], dtype=object)
            if not ways:
                continue
            after = tuple(int(x) for x in np.array(state) + change)
            if after not in states:
                states[after] = len(states)
                queue.append(after)
            step = (states[state], states[after])
            rates[step] = rates.get(step, 0) + Fraction(float(rate)) * int(ways)
    return list(states), rates


def matrix(n, rates):
    """The generator in mpmath's numbers; rows sum to zero."""
    generator = mpmath.matrix(n)
    for (i, j), rate in rates.items():
        exact = mpmath.mpf(rate.numerator) / rate.denominator
        generator[i, j] += exact
        generator[i, i] -= exact
    return generator


@cache
def transient_law(system, time):
    """Probabilities by mpmath's matrix exponential, 100 digits: {state: mpf}."""
    with mpmath.workdps(DIGITS):
        states, rates = explored(system)
        law = mpmath.expm(matrix(len(states), rates) * mpmath.mpf(time))[0, :]
        return {state: law[i] for i, state in enumerate(states)}


def passage_law(system):
    """Chance of ever reaching the target, and the first two moments of the time, inf where it may be missed."""
    with mpmath.workdps(DIGITS):
        states, rates = explored(system)
        index = system.net.species.index(system.waited)
        hit = {i for i, state in enumerate(states) if state[index] >= system.copies}
        reaches = set(hit)
        while True:
            more = {i for (i, j) in rates if j in reaches} - reaches
            if not more:
                break
            reaches |= more
        way = sorted(reaches - hit)
        place = {state: k for k, state in enumerate(way)}
        left, into = mpmath.matrix(len(way)), mpmath.matrix(len(way), 1)
        met = {0}
        queue = [0]
        for i in queue:
            new = [] if i in hit else [j for (k, j) in rates if k == i and j not in met]
            met.update(new)
            queue += new
        for (i, j), rate in rates.items():
            if i not in place:
                continue
            exact = mpmath.mpf(rate.numerator) / rate.denominator
            left[place[i], place[i]] += exact
            if j in hit:
                into[place[i]] += exact
            elif j in place:
                left[place[i], place[j]] -= exact
        chance = mpmath.lu_solve(left, into)[0]
        if met - reaches:
            return chance, mpmath.inf, mpmath.inf
        mean = mpmath.lu_solve(left, mpmath.ones(len(way), 1))
        return chance, mean[0], mpmath.lu_solve(left, 2 * mean)[0]


def stationary_law(system):
    """The last law: at a time so late that a hundred digits show no rest of what came before."""
    return transient_law(system, 2.0**70)


def blurred(net, by):
    """The same network with rates wrong by up to a few times `by`."""
    return net.with_rates(net.rate_constants * (1 + by * np.arange(len(net.channels))))


def summed_error(law, t, exact):
    """Sum over all states of the two laws; a state that only one has counts in full."""
    found = dict(zip(map(tuple, law.space.states.tolist()), law.probabilities[t].tolist(), strict=True))
    with mpmath.workdps(DIGITS):
        return float(sum(abs(mpmath.mpf(found.get(state, 0.0)) - p) for state, p in exact.items())) + sum(
            p for state, p in found.items() if state not in exact
        )


def relative_errors(found, exact):
    """Relative error of each; 0 where both are 0."""
    with mpmath.workdps(DIGITS):
        pairs = ((mpmath.mpf(float(a)), mpmath.mpf(b)) for a, b in zip(found, exact, strict=True))
        return np.array([float(abs(a - b) / b) if b else float(abs(a)) for a, b in pairs])


# Not the projection on the stiff one: it would take 10**9 steps.
SOLVED = [
    pytest.param(one, method, id=f"{one.name}-{method.name}")
    for one in SYSTEMS
    for method in (Transient(), Dense(), FiniteStateProjection(1e-12))
    if one is not STIFF or method.name != "fsp"
]


@pytest.mark.parametrize(("system", "method"), SOLVED)
def test_transient_law_within_its_own_bound(system, method):
    times = [0.0, system.time / 2, system.time]
    law = method.solve(system.net, system.start, times)
    exact = [transient_law(system, time) for time in times]
    for t in range(len(times)):
        assert summed_error(law, t, exact[t]) <= law.error
    assert law.error < 1e-10
    # The control: rates wrong by parts in 10**9.
    wrong = method.solve(blurred(system.net, 1e-9), system.start, times)
    assert summed_error(wrong, 2, exact[2]) > wrong.error


@each_system
def test_dense_has_all_digits_of_every_probability(system):
    law = Dense().solve(system.net, system.start, [system.time])
    exact = transient_law(system, system.time)
    assert relative_errors([law.probability(state)[0] for state in exact], exact.values()).max() < 1e-13


@each_system
def test_stationary_law_within_its_own_bound(system):
    rest = stationary(system.net, system.start)
    exact = stationary_law(system)
    gone = mpmath.mpf(10) ** -60  # of states that are left for good, what is there still at 2**70 tu
    found = {state: rest.probability(state) for state in exact}
    kept = [state for state, p in exact.items() if p > gone]
    assert all(found[state] == 0.0 for state in exact if state not in kept)
    assert len(kept) == sum(members.size for members in rest.classes)
    errors = relative_errors([found[state] for state in kept], [exact[state] for state in kept])
    assert errors.max() <= rest.error < 1e-12
    if len(kept) > 1:  # the control: a rate wrong by a part in 10**10
        other = stationary(blurred(system.net, 1e-10), system.start)
        wrong = relative_errors([other.probability(state) for state in kept], [exact[state] for state in kept])
        assert wrong.max() > other.error


@each_system
def test_passage_within_its_own_bound(system):
    found = first_passage(system.net, system.start, system.waited, system.copies)
    chance, mean, square = passage_law(system)
    assert relative_errors([found.probability], [chance])[0] <= max(found.error, 2.0**-52)
    if mpmath.isinf(mean):
        assert found.mean == np.inf
        assert not found.is_certain
    else:
        with mpmath.workdps(DIGITS):
            sd = mpmath.sqrt(square - mean**2)
        assert relative_errors([found.mean], [mean])[0] <= found.error < 1e-12
        assert relative_errors([found.sd], [sd])[0] <= 2 * found.error
        assert relative_errors([found.mean * (1 + 1e-11)], [mean])[0] > found.error  # the control
    index = system.net.species.index(system.waited)
    targets = {"there": lambda states: states[:, index] >= system.copies}
    ends = splitting(system.net, system.start, targets)
    assert relative_errors(ends.probabilities, [chance])[0] <= max(ends.error, 2.0**-52)


@pytest.mark.parametrize("system", [DIMERS, TRIMERS, REDUCIBLE, ENZYME], ids=lambda one: one.name)
def test_passage_cdf(system):
    """With the target made a trap, the transient law outside is the distribution function."""
    index = system.net.species.index(system.waited)
    with mpmath.workdps(DIGITS):
        states, rates = explored(system)
        hit = [i for i, state in enumerate(states) if state[index] >= system.copies]
        trapped = {step: rate for step, rate in rates.items() if step[0] not in hit}
        law = mpmath.expm(matrix(len(states), trapped) * mpmath.mpf(system.time))[0, :]
        exact = sum(law[i] for i in hit)
    found = first_passage(system.net, system.start, system.waited, system.copies)
    assert abs(found.cdf(system.time) - float(exact)) < 1e-13
    assert abs(found.survival(system.time) - float(1 - exact)) < 1e-13
    assert abs(found.cdf(system.time * (1 + 1e-6)) - float(exact)) > 1e-13  # the control


def storm_model(system, folder):
    """Storm's own exploration, in rational numbers, of the network written out as a program of its language."""
    stormpy = pytest.importorskip("stormpy", reason="Storm is an extra: pip install wellmixed[oracle]")
    net = system.net
    most = int(sum(system.start))
    names = [f"n_{name}" for name in net.species]  # P, S and C alone are words of its language
    lines = [f"  {name} : [0..{most}] init {n};" for name, n in zip(names, system.start, strict=True)]
    for needed, change, rate in zip(net.reactants, net.stoichiometry, net.rate_constants, strict=True):
        factors, guards, updates = [str(Fraction(float(rate)))], ["true"], []
        for name, n, gain in zip(names, needed.tolist(), change.tolist(), strict=True):
            if n:
                guards.append(f"{name} >= {n}")
                factors.append(("{0}", "{0} * ({0} - 1) / 2", "{0} * ({0} - 1) * ({0} - 2) / 6")[n - 1].format(name))
            if gain:
                updates.append(f"({name}' = {name} + {gain})")
        lines.append(f"  <> {' & '.join(guards)} -> {' * '.join(factors)} : {' & '.join(updates)};")
    label = f'label "there" = n_{system.waited} >= {system.copies};'
    (folder / "model.sm").write_text("\n".join(["ctmc", "module m", *lines, "endmodule", label]))
    program = stormpy.parse_prism_program(str(folder / "model.sm"))

    def ask(question):
        parsed = stormpy.parse_properties(question, program)
        model = stormpy.build_model[stormpy.Rational](program, parsed)
        return str(stormpy.model_checking(model, parsed[0]).get_value(model.initial_states[0]))

    return ask


@each_system
def test_against_storm_in_rational_numbers(system, tmp_path):
    ask = storm_model(system, tmp_path)
    rest = stationary(system.net, system.start)
    for name, mean in zip(system.net.species, rest.mean(), strict=True):
        shares = [Fraction(ask(f"S=? [n_{name} = {n}]")) for n in range(1, sum(system.start) + 1)]
        exact = sum(n * share for n, share in enumerate(shares, start=1))
        assert abs(Fraction(float(mean)) - exact) <= Fraction(rest.error + 1e-15) * exact
        if exact > 0:  # the control
            assert abs(Fraction(float(mean) * (1 + 1e-11)) - exact) > Fraction(rest.error) * exact
    found = first_passage(system.net, system.start, system.waited, system.copies)
    chance = Fraction(ask('P=? [F "there"]'))
    assert abs(Fraction(found.probability) - chance) <= Fraction(found.error + 2.0**-52) * chance
    mean = ask('T=? [F "there"]')
    assert found.is_certain is (mean != "inf")
    if found.is_certain:
        assert abs(Fraction(found.mean) - Fraction(mean)) <= Fraction(found.error) * Fraction(mean)
