"""Evidence that the results are right: verification, hard cases, and accuracy against cost."""

from kinetics.trust.solver_agreement import SolverAgreement, compare_solvers
from kinetics.trust.verification import Verification, verify

__all__ = ["SolverAgreement", "Verification", "compare_solvers", "verify"]
