"""Stationary distributions and passages computed outside: by mpmath to a hundred digits, by Storm in rational numbers.

States, combinations and matrices are made anew from the reactions alone; Storm makes even those itself.
"""

from fractions import Fraction

import mpmath
import numpy as np
import pytest
from exact_distributions import (
    DIGITS,
    DIMERS,
    ENZYME,
    REDUCIBLE,
    SYSTEMS,
    TRIMERS,
    blurred,
    explored,
    matrix,
    relative_errors,
    transient_distribution,
)

from kinetics import Dense, committor, first_passage, stationary

each_system = pytest.mark.parametrize("system", SYSTEMS, ids=[one.name for one in SYSTEMS])


def passage_moments(system):
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


def stationary_distribution(system):
    """The stationary distribution: at a time so late that a hundred digits show no rest of what came before."""
    return transient_distribution(system, 2.0**70)


@each_system
def test_dense_has_all_digits_of_every_probability(system):
    law = Dense().solve(system.net, system.start, [system.time])
    exact = transient_distribution(system, system.time)
    assert relative_errors([law.probability(state)[0] for state in exact], exact.values()).max() < 1e-13


@each_system
def test_stationary_distribution_within_its_own_bound(system):
    rest = stationary(system.net, system.start)
    exact = stationary_distribution(system)
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
    chance, mean, square = passage_moments(system)
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
    ends = committor(system.net, system.start, targets)
    assert relative_errors(ends.probabilities, [chance])[0] <= max(ends.error, 2.0**-52)


@pytest.mark.parametrize("system", [DIMERS, TRIMERS, REDUCIBLE, ENZYME], ids=lambda one: one.name)
def test_passage_cdf(system):
    """With the target made a trap, the transient distribution outside is the distribution function."""
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
