"""Every kind of question on random chains: its bounds hold the answers of dense matrices in forty digits."""

import mpmath
import numpy as np
import pytest
import question_oracle as oracle
from random_chains import random_rates

from kinetics import Chain
from kinetics.markov import ask
from kinetics.markov.questions import Question, parse

EVERY = 200  # chains by default, shared by the seeds of one run
WIDE = 1e-9  # of a bound, relative to the answer, or to 1e-3 if that is smaller


class Case:
    """A random chain of 3 or 4 states, of which some are never left, with labels, rewards and times."""

    def __init__(self, seed):
        rng = np.random.default_rng([seed, 7])
        n = self.n = 4 if seed % 4 == 0 else 3
        self.rates = random_rates(rng.integers(2**31), n, decades=1.0)
        self.rates[rng.random(n) < 0.3] = 0.0
        self.a, self.b, self.ways = rng.random(n) < 0.4, rng.random(n) < 0.4, rng.random(n) < 0.7
        self.a[rng.integers(n)] = self.b[rng.integers(n)] = True
        self.rewards = np.round(rng.exponential(2.0, n), 3) * (rng.random(n) < 0.8)
        self.s, self.t = np.round(np.sort(rng.uniform(0.05, 2.0, 2)), 3)
        self.row, self.limit = int(rng.integers(n)), round(float(rng.uniform(0.05, 0.95)), 2)
        self.chain = Chain(
            self.rates, self.row, {"a": self.a, "b": self.b, "w": self.ways}, {"r": self.rewards}, ("x",),
            np.arange(n)[:, None],
        )  # fmt: skip

    def truths(self):
        """Texts of questions, and their answers from every state; None where there is none."""
        rates, n, s, t = self.rates, self.n, float(self.s), float(self.t)
        a, b, ways, every = self.a, self.b, self.ways, [True] * self.n
        r = [float(each) for each in self.rewards]
        yield "P=? [ F a ]", oracle.until(rates, a, every)
        yield "P=? [ w U a ]", oracle.until(rates, a, ways)
        yield f"P=? [ w U<={t} a ]", oracle.until(rates, a, ways, 0, t)
        yield f"P=? [ w U[{s},{t}] a ]", oracle.until(rates, a, ways, s, t)
        yield f"P=? [ w U>={s} a ]", oracle.until(rates, a, ways, s)
        yield f"P=? [ G<={t} a ]", [1 - p for p in oracle.until(rates, ~a, every, 0, t)]
        yield f"P=? [ G>={s} a ]", [1 - p for p in oracle.until(rates, ~a, every, s)]
        yield "P=? [ X a ]", [self.next(i) for i in range(n)]
        yield "S=? [ a ]", oracle.steady(rates, a.astype(float))
        yield 'R{"r"}=? [ S ]', oracle.steady(rates, r)
        yield f'R{{"r"}}=? [ I={t} ]', oracle.moved(rates, r, oracle.exact(t))
        yield f'R{{"r"}}=? [ C<={t} ]', oracle.total(rates, r, t)
        yield 'R{"r"}=? [ F a ]', oracle.ended(rates, a, [0.0] * n, r)
        leads = oracle.closure(rates)
        spent = [not any(r[j] for j in oracle.places(leads[i])) for i in range(n)]
        yield 'R{"r"}=? [ C ]', oracle.ended(rates, spent, [0.0] * n, r)
        yield 'R[var]{"r"}=? [ F a ]', oracle.variance_until(rates, a, r)
        mean = oracle.moved(rates, r, oracle.exact(t))
        squares = oracle.moved(rates, [oracle.exact(each) ** 2 for each in r], oracle.exact(t))
        yield f'R[var]{{"r"}}=? [ I={t} ]', [q - m**2 for q, m in zip(squares, mean, strict=True)]
        yield "P=? [ F a || F b ]", oracle.conditional(rates, a, b, None, None)
        yield f"P=? [ F<={s} a || F<={t} b ]", oracle.conditional(rates, a, b, s, t)
        yield f"P=? [ F a || F<={t} b ]", oracle.conditional(rates, a, b, None, t)
        inner = np.array([p > self.limit for p in oracle.until(rates, a, every, 0, s)])
        yield f"P=? [ F<={t} b & P>{self.limit} [ F<={s} a ] ]", oracle.until(rates, b & inner, every, 0, t)
        sooner = [m is not None and m < 2.9173 for m in oracle.ended(rates, a, [0.0] * n, r)]
        yield (
            f'P=? [ G<={t} w | R{{"r"}}<2.9173 [ F a ] ]',
            [1 - p for p in oracle.until(rates, ~(ways | np.array(sooner)), every, 0, t)],
        )

    def next(self, i):
        q = [oracle.exact(each) for each in self.rates[i]]
        return sum(p for p, here in zip(q, self.a, strict=True) if here) / sum(q) if sum(q) else oracle.exact(self.a[i])


def misses(low, high, truth):
    """Whether bounds do not hold the truth; None is no finite answer, from every state inf."""
    if truth is None:
        return not np.isinf(low)
    return not mpmath.mpf(float(low)) - oracle.CLOSE <= truth <= mpmath.mpf(float(high)) + oracle.CLOSE


def check(seed):
    """How many answers were held against the oracle, and how many of them would be wrong by one part in a million."""
    case, seen, blunt = Case(seed), 0, 0
    with mpmath.workdps(oracle.DIGITS):
        for text, truths in case.truths():
            question, truth = parse(text), truths[case.row]
            if truth is None:
                with pytest.raises(ValueError, match=r"finite|probability 0"):
                    question.value(case.chain)
                continue
            answer = question.value(case.chain)
            assert answer.is_bound
            assert not misses(answer.low, answer.high, truth), (seed, text, answer, truth)
            assert answer.low <= answer.value <= answer.high, (seed, text)
            assert answer.high - answer.low <= WIDE * max(answer.value, 1e-3), (seed, text, answer)
            blunt += not misses(answer.low, answer.high, truth * (1 + mpmath.mpf(10) ** -6)) and truth > 1e-9
            seen += 1
            if type(question).by_state is Question.by_state:
                continue
            found = question.by_state(case.chain, np.ones(case.n, dtype=bool))
            for row, each in enumerate(truths):
                assert not misses(found.low[row], found.high[row], each), (seed, text, row, found, each)
            if seen % 16 == seed % 16:  # one of the questions of a chain
                check_filters(case, text, truths)
                check_verdict(case, text, truth)
    return seen, blunt


def check_filters(case, text, truths):
    known = [each if each is not None else mpmath.inf for each in truths]
    expected = {"min": min(known), "max": max(known), "sum": sum(known), "avg": sum(known) / len(known)}
    op = list(expected)[case.row % 4]
    found = ask(case.chain, f"filter({op}, {text})")
    assert not misses(found.low, found.high, None if mpmath.isinf(expected[op]) else expected[op]), (text, op, found)
    among = [each for each, here in zip(known, case.b, strict=True) if here]
    limit = case.limit
    asked = text.replace("=?", f">{limit}", 1)
    counted = ask(case.chain, f"filter(count, {asked}, b)")
    assert counted.low <= sum(each > limit for each in among) <= counted.high, (text, counted)
    for op, truth in (("forall", all(each > limit for each in among)), ("exists", any(each > limit for each in among))):
        assert ask(case.chain, f"filter({op}, {asked}, b)").holds in (truth, None)


def check_verdict(case, text, truth):
    for sign, holds in ((">=", truth >= case.limit), ("<", truth < case.limit)):
        found = ask(case.chain, text.replace("=?", f"{sign}{case.limit}", 1))
        assert found.holds is None or found.holds == holds, (text, found)


@pytest.mark.parametrize("part", range(8))
def test_no_bound_is_false(part):
    counts = np.sum([check(seed) for seed in range(part * EVERY // 8, (part + 1) * EVERY // 8)], axis=0)
    assert counts[0] > 400
    assert counts[1] == 0  # the control: truths that are wrong in the seventh digit lie outside


@pytest.mark.validate
@pytest.mark.parametrize("part", range(20))
def test_no_bound_is_false_on_many_chains(part):
    counts = np.sum([check(1000 + seed) for seed in range(part * 100, (part + 1) * 100)], axis=0)
    assert counts[0] > 1600
    assert counts[1] == 0


@pytest.mark.parametrize("seed", range(40))
def test_quantiles_lie_where_the_distribution_passes(seed):
    case = Case(seed)
    with mpmath.workdps(oracle.DIGITS):
        ever = oracle.until(case.rates, case.a, [True] * case.n)[case.row]
        found = ask(case.chain, f"quantile(min T, P>={case.limit} [ F<=T a ])")
        if ever < case.limit:
            assert found.value == np.inf
            return
        times = found.low, found.high, found.high * 1.001 + 1e-6
        ends = [oracle.until(case.rates, case.a, [True] * case.n, 0, time)[case.row] for time in times]
        assert ends[0] <= case.limit <= ends[1] or found.high == 0.0
        assert ends[2] > case.limit  # the control
