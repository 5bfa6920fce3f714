"""Why the numbers can be believed: verification, hard cases, accuracy against cost."""

from kinetics.trust.verification import Verification, verify

__all__ = ["Verification", "verify"]
