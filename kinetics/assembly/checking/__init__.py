"""Verification of rule books: traps, starvation, off-target structures, growth infinite."""
