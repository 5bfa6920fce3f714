"""Verification of samplers against exact solutions, and of solvers against each other."""

from kinetics.trust.verification.base import SamplerCheck, SamplerFinding
from kinetics.trust.verification.checks import SAMPLER_CHECKS
from kinetics.trust.verification.mutants import MUTANTS, Mutant, rate_mutant
from kinetics.trust.verification.reference import Reference
from kinetics.trust.verification.report import Verification
from kinetics.trust.verification.verifying import judge, verify, verify_against

__all__ = [
    "MUTANTS",
    "SAMPLER_CHECKS",
    "Mutant",
    "Reference",
    "SamplerCheck",
    "SamplerFinding",
    "Verification",
    "judge",
    "rate_mutant",
    "verify",
    "verify_against",
]
