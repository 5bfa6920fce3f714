"""What every check of a sampler must do, so that a new one is tested by its line in `SAMPLER_CHECKS`."""

from dataclasses import replace

import pytest
from verified_networks import dimers, enzyme

from kinetics import Direct
from kinetics.trust.verification import MUTANTS, SAMPLER_CHECKS, Reference, SamplerFinding, rate_mutant
from kinetics.trust.verification.sampler_runs import SamplerRuns

LEVEL = 1e-9  # of a finding


@pytest.fixture(params=SAMPLER_CHECKS, ids=lambda check: check.name)
def check(request):
    return request.param()


@pytest.fixture(scope="module")
def sample():
    reference = Reference.of(enzyme(), [3, 12, 0, 0], [1.0, 6.0])
    return [SamplerRuns.of(reference, Direct(), 2000, seed) for seed in (1, 11)]


def test_is_named_and_says_what_it_sees(check):
    assert [kind.name for kind in SAMPLER_CHECKS].count(check.name) == 1
    assert len(check.sees.split()) > 5
    assert len(type(check).__doc__) > 60


def test_right_runs_pass(check, sample):
    for runs in sample:
        for finding in check.findings(runs):
            assert isinstance(finding, SamplerFinding)
            assert LEVEL < finding.p_value <= 1.0, finding


def test_what_is_looked_at_does_not_depend_on_the_runs(check, sample):
    one, other = ([finding.what for finding in check.findings(runs)] for runs in sample)
    assert one
    assert one == other
    assert len(set(one)) == len(one)


def test_some_mutant_is_seen(check, sample):
    right = sample[0]
    mutants = (*MUTANTS, rate_mutant(right.reference.network, Direct(), 1, "make", 0.5))
    seen = [
        mutant.name
        for mutant in mutants
        if any(finding.p_value <= LEVEL for finding in check.findings(mutant.applied(right)))
    ]
    assert seen


def test_counts_alone_one_time_and_a_short_run_are_no_trouble(check):
    reference = Reference.of(dimers(), [3, 0], [0.5])
    right = SamplerRuns.of(reference, Direct(), 100, 3)
    for runs in (right, replace(right, paths=(), next_paths=())):
        assert all(LEVEL < finding.p_value <= 1.0 for finding in check.findings(runs))
