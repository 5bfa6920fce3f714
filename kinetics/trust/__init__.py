"""Evidence that the results are right: verification, hard cases, and accuracy against cost."""

from kinetics.trust.verification import Verification, verify

__all__ = ["Verification", "verify"]
